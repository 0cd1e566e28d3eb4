/* Flow: the kernels for devices (device.h), as they run on the processor, give the numbers of the batch kernels on the
   arrays of real meshes: boxes, cells that are no boxes, cells in which nodes hang, periodic ones, all forms. */
#include "core.h"
#include "flow/flow.h"
#include "devicecells.h"

#define CLOSE 1e-12 /* of the largest */

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
  DeviceQueue      queue;
  DeviceCells      cells;
  DeviceForm       form;
  double          *coefficient;
} Case;

static const char *const SCENES[] = {
  "-mesh_cells 4,3,3 -mesh_upper 1.5,1,1",
  "-mesh_cells 5,4,3 -mesh_upper 1.5,1,1 -mesh_periodic x,z -flow_convection_form skew",
  "-mesh_cells 4,3,3 -mesh_upper 1.5,1,1 -flow_convection 0",
  "-mesh_cells 3,3,3 -mesh_upper 1.5,1,1 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4",
  "-mesh_cells 4,4,4 -mesh_upper 1.5,1,1 -mesh_levels 2 -mesh_refine a -mesh_box_a_corners 0.4,0.4,0.4,0.6,0.6,0.6 -flow_convection_form skew",
  "-mesh_cells 4,3,3 -mesh_upper 1.5,1,1 -flow_rheology smagorinsky",
  "-mesh_cells 4,3,3 -mesh_upper 1.5,1,1 -flow_rheology smagorinsky -flow_convection_form skew",
};
#define NSCENES (PetscInt)(sizeof(SCENES) / sizeof(SCENES[0]))

static const char *const SKEWED[] = {"", "-flow_convection_form skew", "-flow_convection 0",
                                     "-flow_rheology smagorinsky"};
#define NSKEWED (PetscInt)(sizeof(SKEWED) / sizeof(SKEWED[0]))

/* The second step of a flow that is noise */
static void open_case(Case *c, PetscBool skewed, const char options[])
{
  const PetscInt n[3] = {3, 3, 4};
  PetscReal     *u, *p;
  char           all[512];

  OK(PetscSNPrintf(all, sizeof(all), "-flow_density 3 -flow_viscosity 0.7 -flow_velocity_operator matrix_free %s %s",
                   options, skewed ? "" : "-mesh_dimension 3"));
  give(all);
  if (skewed) create_skewed_mesh(3, n, &c->mesh);
  else OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(PetscCalloc2(c->l->nnode_all * 3, &u, c->l->ncell * 4, &p));
  fill_noise(c->l, 5, u);
  OK(FlowBeginStep(c->flow, 0.1, 0.1));
  OK(FlowAcceptStep(c->flow, u, p));
  OK(FlowBeginStep(c->flow, 0.25, 0.15));
  OK(FlowAssemble(c->flow));
  OK(PetscFree2(u, p));
  c->queue = (DeviceQueue){.run = DeviceGetKernels("cpu")};
  OK(FlowCreateDeviceCells(c->flow, &c->queue, c->l->ncell, NULL, &c->cells));
}

static void close_case(Case *c)
{
  OK(DeviceCellsDestroy(&c->queue, &c->cells));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static void set_coefficients(Case *c)
{
  const DeviceKernels *run = c->queue.run;
  const PetscReal     *nu;
  size_t               bytes;

  FlowGetDeviceForm(c->flow, &c->form, &nu);
  bytes = DeviceCoefficients(&c->cells, &c->form) * sizeof(double);
  OK((*run->allocate)(&c->queue, bytes, (void **)&c->coefficient));
  memset(c->coefficient, 0xff, bytes); /* nothing may be left as it was */
  OK((*run->set_coefficients)(&c->queue, &c->cells, &c->form, c->flow->w, nu, c->coefficient));
}

/* S x, of all nodes, and of what is not fixed */
static void check_product(Case *c)
{
  const DeviceKernels *run = c->queue.run;
  const PetscInt       n   = c->l->nnode * 3;
  PetscReal           *x, *y, *want;
  unsigned char       *fixed;

  OK(PetscCalloc4(n, &x, n, &y, n, &want, c->l->nnode, &fixed));
  fill_noise(c->l, 7, x);
  OK(FlowMultiply(c->flow, PETSC_FALSE, x, want));
  OK((*run->multiply)(&c->queue, &c->cells, &c->form, c->coefficient, 0, x, y));
  BELOW(max_difference(n, y, want), CLOSE * max_abs(n, want));
  for (PetscInt i = 0; i < c->l->nnode; i++) fixed[i] = (unsigned char)(4 * noise(11 * i) + 4);
  OK((*run->set_fixed)(&c->queue, &c->cells, fixed, (int *)c->cells.node));
  OK(PetscArrayzero(y, n));
  OK((*run->multiply)(&c->queue, &c->cells, &c->form, c->coefficient, 1, x, y));
  for (PetscInt i = 0; i < n; i++)
    if (fixed[i / 3] >> i % 3 & 1) x[i] = 0;
  OK(FlowMultiply(c->flow, PETSC_FALSE, x, want));
  for (PetscInt i = 0; i < n; i++)
    if (fixed[i / 3] >> i % 3 & 1) want[i] = 0;
  BELOW(max_difference(n, y, want), CLOSE * max_abs(n, want));
  OK((*run->set_fixed)(&c->queue, &c->cells, NULL, (int *)c->cells.node));
  OK(PetscFree4(x, y, want, fixed));
}

static void check_diagonal(Case *c)
{
  const PetscInt n = c->l->nnode;
  PetscReal     *d, *want;

  OK(PetscCalloc2(n, &d, n, &want));
  OK(FlowGetDiagonal(c->flow, want));
  OK((*c->queue.run->add_diagonal)(&c->queue, &c->cells, &c->form, c->coefficient, d));
  BELOW(max_difference(n, d, want), CLOSE * max_abs(n, want));
  OK(PetscFree2(d, want));
}

/* The right-hand side from the mass and S: a M (...) - (1 - theta)/theta (S u - rho c_t M u) */
static void check_rhs(Case *c)
{
  const DeviceKernels *run = c->queue.run;
  const Flow           f   = c->flow;
  const FlowStep      *s   = &f->step;
  const PetscInt       n   = c->l->nnode * 3;
  const PetscReal      old = (1 - s->theta) / s->theta, factor[] = {s->d0 / s->ct + old, s->d1 / s->ct},
                  constant[3] = {f->par.force[0] / c->form.a, f->par.force[1] / c->form.a, f->par.force[2] / c->form.a};
  const double *const v[]     = {f->u, f->u_old};
  PetscReal          *r, *su, *want;

  if (!FlowIsPlain(f)) return; /* a stress of its own on the right-hand side */
  OK(PetscCalloc3(n, &r, n, &su, n, &want));
  OK(FlowRhs(f, want));
  OK((*run->add_mass)(&c->queue, &c->cells, &c->form, c->coefficient, 1, 2, v, factor, constant, r));
  OK((*run->multiply)(&c->queue, &c->cells, &c->form, c->coefficient, 0, f->u, su));
  for (PetscInt i = 0; i < n; i++) r[i] -= old * su[i];
  BELOW(max_difference(n, r, want), CLOSE * max_abs(n, want));
  OK(PetscFree3(r, su, want));
}

/* B u and B^T p with weights */
static void check_divergence(Case *c)
{
  const DeviceKernels *run = c->queue.run;
  const PetscInt       n = c->l->nnode * 3, np = c->l->ncell * 4;
  DeviceDivergence     d;
  PetscReal           *u, *p, *out, *r, *want;

  OK(PetscCalloc5(n, &u, np, &p, np, &out, n, &r, PetscMax(n, np), &want));
  OK(FlowCreateDeviceDivergence(c->flow, &c->queue, &c->cells, NULL, &d));
  fill_noise(c->l, 3, u);
  fill_noise_pressure(c->l, 4, p);
  OK(FlowDivergence(c->flow, u, want));
  for (PetscInt i = 0; i < np; i++) want[i] = -0.5 * want[i] + 2 * p[i];
  OK((*run->divergence)(&c->queue, &c->cells, &d, -0.5, u, 2, p, out));
  BELOW(max_difference(np, out, want), CLOSE * max_abs(np, want));
  OK(FlowGradient(c->flow, 3, p, want));
  OK((*run->add_gradient)(&c->queue, &c->cells, &d, 0, 3, NULL, p, r));
  BELOW(max_difference(n, r, want), CLOSE * max_abs(n, want));
  OK((*run->add_gradient)(&c->queue, &c->cells, &d, 0, 3, u, p, r));
  for (PetscInt i = 0; i < n; i++) want[i] *= 1 + u[i];
  BELOW(max_difference(n, r, want), CLOSE * max_abs(n, want));
  OK(PetscArraycpy(want, p, np));
  if (!FlowVaries(c->flow)) { /* else the host has more */
    OK(FlowPressureMassSolve(c->flow, 0.3, out, want));
    OK((*run->add_pressure_mass)(&c->queue, &c->cells, &d, 0.3, out, p));
    BELOW(max_difference(np, p, want), CLOSE * max_abs(np, want));
  }
  OK(FlowDestroyDeviceDivergence(&c->queue, &d));
  OK(PetscFree5(u, p, out, r, want));
}

static void check_case(Case *c)
{
  set_coefficients(c);
  check_product(c);
  check_diagonal(c);
  check_rhs(c);
  check_divergence(c);
  OK((*c->queue.run->release)(&c->queue, c->coefficient));
}

static void test_scenes(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < NSCENES + NSKEWED; i++) {
    const PetscBool skewed = (PetscBool)(i >= NSCENES);
    Case            c;

    open_case(&c, skewed, skewed ? SKEWED[i - NSCENES] : SCENES[i]);
    assert_int_equal(c.cells.nbox == 0, skewed);
    assert_int_equal(c.cells.hang != NULL, c.l->hang != NULL);
    check_case(&c);
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_scenes)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("device", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
