/* Flow on a device: with -device emulate the fields of a step stay with the kernels, and right-hand side, start values,
   diagnostics and residuals of single cells are those of the flow on the host, for all schemes and kinds of cells. */
#include "core.h"
#include "flow/device.h"
#include "flow/flow.h"

#define CLOSE 1e-12 /* of the largest */

typedef struct {
  Mesh             mesh;
  const MeshLocal *l;
  Flow             host, there;
  PetscInt         nu, np;
  PetscReal       *u, *p; /* the solution of a step */
} Case;

#define BOX     "-mesh_dimension 3 -mesh_cells 4,3,3 -mesh_upper 1.5,1,1 "
#define REFINED "-mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4 "

static const char *const SCENES[] = {
  BOX "-flow_force 1,0.5,-2",
  BOX "-flow_time cn -flow_convection_form skew -flow_force x*y,t,0",
  BOX "-flow_time be -mesh_periodic x,z",
  BOX "-flow_time fstheta " REFINED,
  BOX "-flow_convection 0 " REFINED,
  BOX
  "-flow_bc_left_type pressure -flow_bc_left_pressure 1+y*t -flow_bc_right_type outflow -flow_bc_top_type slip -flow_time cn",
  "-flow_convection_form skew",
  "-flow_time cn",
};
#define NBOXES 6

static void open_case(Case *c, const char options[], PetscBool skewed)
{
  const PetscInt n[3] = {3, 3, 4};
  char           all[512];

  OK(PetscSNPrintf(all, sizeof(all), "-flow_density 3 -flow_viscosity 0.7 %s", options));
  give(all);
  if (skewed) create_skewed_mesh(3, n, &c->mesh);
  else OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->host));
  OK(PetscOptionsSetValue(NULL, "-device", "emulate"));
  OK(FlowCreate(c->mesh, &c->there));
  c->nu = c->l->nnode * 3;
  c->np = c->l->ncell * 4;
  OK(PetscCalloc2(c->nu, &c->u, c->np, &c->p));
}

static void close_case(Case *c)
{
  OK(PetscFree2(c->u, c->p));
  OK(FlowDestroy(&c->there));
  OK(FlowDestroy(&c->host));
  OK(MeshDestroy(&c->mesh));
}

static void check_close(PetscInt n, const PetscReal a[], const PetscReal b[])
{
  BELOW(max_difference(n, a, b), CLOSE * PetscMax(1e-30, max_abs(n, b)));
}

/* Right-hand side and start values of the step */
static void check_start(Case *c)
{
  PetscReal     *rhs, *u, *p, *dp;
  FlowDeviceStep s;

  OK(PetscCalloc4(c->nu, &rhs, c->nu, &u, c->np, &p, c->np, &dp));
  OK(FlowRhs(c->host, rhs));
  OK(FlowExtrapolate(c->host, u, p, dp));
  OK(FlowRhs(c->there, NULL));
  OK(FlowExtrapolate(c->there, NULL, NULL, NULL));
  OK(FlowGetStepOnDevice(c->there, &s));
  check_close(c->nu, s.rhs, rhs);
  check_close(c->nu, s.u, u);
  check_close(c->np, s.p, p);
  check_close(c->np, s.dp, dp);
  OK(PetscFree4(rhs, u, p, dp));
}

/* Some solution */
static void set_solution(Case *c, PetscInt seed)
{
  FlowDeviceStep s;

  fill_noise(c->l, seed, c->u);
  fill_noise_pressure(c->l, seed + 1, c->p);
  OK(FlowGetStepOnDevice(c->there, &s));
  OK(PetscArraycpy(s.u, c->u, c->nu));
  OK(PetscArraycpy(s.p, c->p, c->np));
}

static void check_diagnostics(Case *c)
{
  FlowDiagnostics a, b;
  PetscReal       size;

  OK(FlowDiagnose(c->host, c->u, c->p, &a));
  OK(FlowDiagnose(c->there, NULL, NULL, &b));
  NEAR(b.cfl, a.cfl, CLOSE * a.cfl);
  NEAR(b.divergence, a.divergence, CLOSE * a.divergence);
  NEAR(b.kinetic_energy, a.kinetic_energy, CLOSE * a.kinetic_energy);
  NEAR(b.speed_max, a.speed_max, CLOSE * a.speed_max);
  NEAR(b.cell_reynolds, a.cell_reynolds, CLOSE * a.cell_reynolds);
  NEAR(b.volume, a.volume, CLOSE * a.volume);
  size = 100 * max_abs(3, a.change) + max_abs(3, a.flux) +
         a.kinetic_energy; /* sums of noise, of which little is left */
  for (PetscInt i = 0; i < 3; i++) {
    NEAR(b.change[i], a.change[i], CLOSE * size);
    NEAR(b.flux[i], a.flux[i], CLOSE * size);
    NEAR(b.driven[i], a.driven[i], CLOSE * (1 + max_abs(3, a.driven)));
    NEAR(b.traction[i], a.traction[i], CLOSE * (1 + max_abs(3, a.traction)));
    NEAR(b.velocity[i], a.velocity[i], CLOSE * a.kinetic_energy);
  }
}

/* Residuals of every other cell, at every third slot; velocities and pressures of lists */
static void check_list(Case *c)
{
  const PetscInt n = c->l->ncell / 2;
  PetscInt      *cell, *point, *node, npoint = 0;
  PetscReal     *u, *p, *r, one[81], most = 0;
  FlowDeviceList list;

  OK(PetscMalloc3(n, &cell, n * 9, &point, 2, &node));
  OK(PetscCalloc3(c->nu, &u, c->np, &p, n * 27, &r));
  node[0] = 1;
  node[1] = c->l->nnode - 1;
  for (PetscInt i = 0; i < n; i++) {
    cell[i] = 2 * i + 1;
    for (PetscInt j = 0; j < 27; j += 3) point[npoint++] = i * 27 + j;
  }
  OK(FlowListCreate(c->there, 2, node, n, cell, npoint, point, &list));
  OK(FlowListTake(c->there, list, u, p, r));
  for (PetscInt i = 0; i < 3; i++) assert_true(u[i] == 0 && u[3 + i] == c->u[3 + i] && u[c->nu - 1] == c->u[c->nu - 1]);
  for (PetscInt i = 0; i < 4; i++) assert_true(p[i] == 0 && p[4 + i] == c->p[4 + i]);
  for (PetscInt k = 0; k < npoint; k++) {
    if (k % 9 == 0) OK(FlowCellResiduals(c->host, 1, &cell[k / 9], c->u, c->p, one));
    most = PetscMax(most, max_abs(81, one));
    for (PetscInt a = 0; a < 3; a++) NEAR(r[3 * k + a], one[point[k] % 27 * 3 + a], CLOSE * most);
  }
  OK(FlowListDestroy(c->there, &list));
  OK(PetscFree3(u, p, r));
  OK(PetscFree3(cell, point, node));
}

/* After the step: the gradient there, and the fields, which come when they are asked for */
static void check_fields(Case *c)
{
  PetscReal *a[2], *b[2], *pa, *pb, na, nb;

  OK(FlowGetGradientNorm(c->there, NULL, &nb));
  OK(FlowGetFields(c->host, &a[0], &a[1], &pa));
  OK(FlowGetFields(c->there, &b[0], &b[1], &pb));
  OK(FlowGetGradientNorm(c->host, a[0], &na));
  NEAR(nb, na, CLOSE * na);
  for (PetscInt i = 0; i < 2; i++) check_close(c->nu, b[i], a[i]);
  check_close(c->np, pb, pa);
}

static void check_step(Case *c, PetscInt step, PetscReal time, PetscReal dt)
{
  const PetscReal frame[3] = {0.1, -0.2, 0.3};

  for (PetscInt i = 0; i < 2; i++) {
    Flow f = i ? c->there : c->host;

    OK(FlowBeginStep(f, time, dt));
    if (step == 2) OK(FlowSetFrame(f, frame));
    OK(FlowAssemble(f));
  }
  assert_true(FlowStaysOnDevice(c->there) && !FlowStaysOnDevice(c->host));
  check_start(c);
  set_solution(c, 10 + step);
  check_diagnostics(c);
  check_list(c);
  for (PetscInt i = 0; i < 2; i++) OK(FlowAcceptStep(i ? c->there : c->host, c->u, c->p));
  if (step != 1) check_fields(c); /* once without: fields stay */
}

static void test_scenes(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < (PetscInt)PETSC_STATIC_ARRAY_LENGTH(SCENES); i++) {
    Case c;

    open_case(&c, SCENES[i], (PetscBool)(i >= NBOXES));
    for (PetscInt k = 0; k < 4; k++) check_step(&c, k, 0.1 * (k + 1), k < 3 ? 0.1 : 0.05);
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_scenes)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("devicefields", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
