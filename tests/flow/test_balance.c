/* What drives the fluid and what it amounts to: forces and pressures from outside, the power of a step, the pressure
   in a cell, the estimate of an error, eddies and gradients at the nodes, each where the right number is known. */
/* ranks: 2 */
#include "fluidcase.h"
#include "impl.h"
#include "material/project.h"

#define BOX "-mesh_cells 3,4 -mesh_upper 1.5,1 "

/* ---- forces ---- */

/* That of a step is that of its point theta, by the ends of the step */
static void test_forces_in_time(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case                  c;
    const FlowParameters *par;
    PetscReal             x[2] = {0.7, 0.3}, force[3], drive[3] = {0, 5, 0};

    open_case(&c, k ? BOX "-flow_time cn -flow_gravity 0,-t^2 -flow_force t*x,y"
                    : BOX "-flow_time be -flow_gravity 0,-t^2 -flow_force t*x,y");
    OK(FlowBeginStep(c.flow, 3, 2));
    OK(FlowGetParameters(c.flow, &par));
    NEAR(par->gravity[0], 0, 0);
    NEAR(par->gravity[1], k ? -0.5 * (9 + 1) : -9, 1e-14);
    OK(FlowSetMeanPressureGradient(c.flow, drive));
    OK(FlowForceAt(c.flow, x, force));
    NEAR(force[0], (k ? 2 : 3) * 0.7, 1e-14);
    NEAR(force[1], 0.3 + 5, 1e-14);
    close_case(&c);
  }
}

/* What convection took of the momentum comes back along periodic axes: in whole, whatever the next step is long, also
   where that is taken again */
static void test_kept(void **state)
{
  const PetscReal       flux[3] = {3, 1, 0}, x[2] = {0.7, 0.3};
  PetscReal             force[3];
  Case                  c;
  const FlowParameters *par;

  (void)state;
  open_case(&c, BOX "-mesh_periodic x -flow_convection_form conservative -flow_force y,0");
  OK(FlowBeginStep(c.flow, 2, 2));
  FlowKeepMomentum(c.flow, flux, 1.5);
  OK(FlowGetParameters(c.flow, &par));
  for (PetscReal dt = 1; dt > 0.2; dt /= 2) {
    OK(FlowBeginStep(c.flow, 2 + dt, dt));
    NEAR(par->force[0], 4 / dt, 1e-14);
    NEAR(par->force[1], 0, 0);
    OK(FlowForceAt(c.flow, x, force));
    NEAR(force[0], 0.3 + 4 / dt, 1e-14);
  }
  close_case(&c);
}

static PetscErrorCode source(void *ctx, PetscReal t, const PetscReal x[], PetscReal v[])
{
  (void)ctx;
  v[0] = t * x[0] * x[0];
  v[1] = x[0] * x[1] + t;
  return PETSC_SUCCESS;
}

/* int (t x^2, x y + t) over 1.5 x 1 */
static void test_source(void **state)
{
  Case            c;
  FlowDiagnostics d;
  PetscReal      *r, sum[2] = {0, 0};

  (void)state;
  open_case(&c, BOX "-flow_time be");
  OK(FlowSetSource(c.flow, source, NULL));
  OK(FlowBeginStep(c.flow, 2, 1));
  OK(FlowAssemble(c.flow));
  OK(FlowDiagnose(c.flow, c.flow->u, NULL, &d));
  OK(PetscCalloc1(c.l->nnode_all * 2, &r));
  OK(FlowRhs(c.flow, r));
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) sum[i % 2] += r[i];
  for (PetscInt a = 0; a < 2; a++) {
    NEAR(d.driven[a], a ? 0.5 * 1.125 + 2 * 1.5 : 2 * 1.125, 1e-13);
    NEAR(total(sum[a]), d.driven[a], 1e-13);
  }
  OK(PetscFree(r));
  close_case(&c);
}

/* The pressure outside pushes on the fluid with its integral over the opening, at the point theta of the step */
static void test_opening(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case            c;
    FlowDiagnostics d;
    PetscReal      *r, sum[2] = {0, 0}, moment = 0;

    open_case(&c,
              k ? BOX
                "-flow_time cn -flow_bc_left_type pressure -flow_bc_left_pressure t*(2+y) -flow_bc_right_type outflow"
                : BOX
                "-flow_time be -flow_bc_left_type pressure -flow_bc_left_pressure t*(2+y) -flow_bc_right_type outflow");
    assert_true(FlowHasTraction(c.flow));
    OK(FlowBeginStep(c.flow, 3, 2));
    OK(FlowAssemble(c.flow));
    OK(PetscCalloc1(c.l->nnode_all * 2, &r));
    OK(FlowRhs(c.flow, r));
    OK(PetscArrayzero(r, c.l->nnode_all * 2));
    OK(FlowAddTraction(c.flow, r));
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) {
      sum[i % 2] += r[i];
      if (!(i % 2)) moment += r[i] * c.l->x[i + 1];
    }
    NEAR(total(sum[0]), (k ? 2 : 3) * 2.5, 1e-13);
    NEAR(total(sum[1]), 0, 1e-13);
    NEAR(total(moment), (k ? 2 : 3) * (1 + 1. / 3), 1e-13); /* int y (2 + y) */
    OK(FlowDiagnose(c.flow, c.flow->u, NULL, &d));
    NEAR(d.traction[0], (k ? 2 : 3) * 2.5, 1e-13);
    OK(PetscFree(r));
    close_case(&c);
  }
}

/* ---- starts ---- */

static void check_start(const char options[], void (*want)(const PetscReal x[], PetscReal v[]))
{
  Case c;

  open_case(&c, options);
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    PetscReal v[3] = {0, 0, 0};

    (*want)(c.l->x + i * c.dim, v);
    for (PetscInt a = 0; a < c.dim; a++) {
      NEAR(c.flow->u[i * c.dim + a], v[a], 1e-14);
      NEAR(c.flow->u_old[i * c.dim + a], v[a], 1e-14);
    }
  }
  close_case(&c);
}

static void uniform(const PetscReal x[], PetscReal v[])
{
  (void)x;
  v[0] = 0.3;
  v[1] = -0.2;
}

/* from -1 at the lower wall to 2 at the upper one */
static void couette(const PetscReal x[], PetscReal v[])
{
  v[0] = -1 + 3 * x[1];
}

static void parabola(const PetscReal x[], PetscReal v[])
{
  v[0] = 4 * 0.7 * x[1] * (1 - x[1]);
}

/* half of force/viscosity times y (1 - y) */
static void driven(const PetscReal x[], PetscReal v[])
{
  v[0] = 0.5 * 0.8 / 0.1 * x[1] * (1 - x[1]);
}

static void square_duct(const PetscReal x[], PetscReal v[])
{
  v[0] = 16 * 0.7 * x[1] * (1 - x[1]) * x[2] * (1 - x[2]);
}

static void formula(const PetscReal x[], PetscReal v[])
{
  v[0] = PetscSinReal(x[1]);
  v[1] = x[0] * x[0];
}

static void test_starts(void **state)
{
  (void)state;
  check_start(BOX "-mesh_periodic x,y -flow_velocity 0.3,-0.2", uniform);
  check_start(BOX
              "-mesh_periodic x -flow_initial shear -flow_bc_bottom_type moving_wall -flow_bc_bottom_velocity -1,0 -flow_bc_top_type moving_wall "
              "-flow_bc_top_velocity 2,0",
              couette);
  check_start(BOX "-mesh_periodic x -flow_initial poiseuille -flow_velocity 0.7,0", parabola);
  check_start(BOX "-mesh_periodic x -flow_initial poiseuille -flow_force 0.8,0 -flow_viscosity 0.1", driven);
  check_start("-mesh_cells 3,2,2 -mesh_periodic x -flow_initial poiseuille -flow_velocity 0.7,0,0", square_duct);
}

/* The values of the formula; what makes the room run free of divergence is its own affair */
static void test_start_by_formula(void **state)
{
  Case        c;
  FlowInitial how;

  (void)state;
  open_case(&c, BOX "-mesh_periodic x,y -flow_velocity sin(y),x^2");
  OK(FlowGetInitial(c.flow, &how, NULL));
  assert_int_equal(how, FLOW_START_EXPRESSION);
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    PetscReal v[2];

    formula(c.l->x + 2 * i, v);
    NEAR(c.flow->u[2 * i], v[0], 1e-14);
    NEAR(c.flow->u[2 * i + 1], v[1], 1e-14);
  }
  close_case(&c);
}

/* ---- power ---- */

static void plane(const PetscReal x[], PetscReal v[])
{
  v[0] = x[0] * x[0];
  v[1] = x[0] * x[1];
}

/* From rest in one step of be, tested with itself: rho/dt int u^2, mu int |grad u|^2, both by hand; and what the
   terms of a cell add */
static void test_power(void **state)
{
  Case       c;
  PetscReal *u, *term;
  PetscInt   cell = 0;
  FlowPower  p;

  (void)state;
  open_case(&c, BOX "-flow_time be -flow_density 3 -flow_viscosity 0.7 -flow_convection false");
  OK(PetscMalloc2(c.l->nnode_all * 2, &u, 81, &term));
  fill_field(c.l, plane, u);
  OK(FlowBeginStep(c.flow, 0.2, 0.2));
  OK(FlowAssemble(c.flow));
  OK(FlowGetPower(c.flow, u, u, &p));
  NEAR(p.inertia, 15 * (PetscPowReal(1.5, 5) / 5 + 1.125 / 3), 1e-12);
  NEAR(p.viscous, 0.7 * (5 * 1.125 + 0.5), 1e-12);
  NEAR(p.terms, 0, 0);
  for (PetscInt e = 0; e < 81; e++) term[e] = e % 10 ? 0 : 1; /* of every rank's first cell, the sum of squares */
  OK(FlowAddCellTerms(c.flow, &c, 1, &cell, term));
  OK(FlowGetPower(c.flow, u, u, &p));
  {
    PetscReal sum = 0;

    for (PetscInt j = 0; j < 9; j++)
      for (PetscInt a = 0; a < 2; a++) sum += PetscSqr(u[2 * c.l->cell_node[j] + a]);
    NEAR(p.terms, total(sum), 1e-12);
  }
  OK(PetscFree2(u, term));
  close_case(&c);
}

/* A velocity that vanishes on all walls: convection in skew form has no power, whatever w is */
static void bubble(const PetscReal x[], PetscReal v[])
{
  const PetscReal b = x[0] * (1.5 - x[0]) * x[1] * (1 - x[1]);

  v[0] = b * (1 + x[1]);
  v[1] = b * (2 - 3 * x[0]);
}

static void test_power_of_convection(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case       c;
    PetscReal *u;
    FlowPower  p[2];

    open_case(&c, k ? BOX "-flow_time be -flow_convection_form skew" : BOX "-flow_time be");
    OK(PetscMalloc1(c.l->nnode_all * 2, &u));
    fill_field(c.l, bubble, u);
    fill_field(c.l, bubble, c.flow->u);
    OK(FlowBeginStep(c.flow, 0.2, 0.2));
    OK(FlowAssemble(c.flow));
    for (PetscInt w = 0; w < 2; w++) {
      for (PetscInt i = 0; i < c.l->nnode_all * 2; i++)
        c.flow->w[i] = w ? 100 * noise(2 * c.l->node_global[i / 2] + i % 2) : 0;
      OK(FlowGetPower(c.flow, u, u, &p[w]));
    }
    if (k) NEAR(p[1].inertia, p[0].inertia, 1e-12);
    else assert_true(PetscAbsReal(p[1].inertia - p[0].inertia) > 1e-3);
    OK(PetscFree(u));
    close_case(&c);
  }
}

/* ---- pressure ---- */

static void spreading(const PetscReal x[], PetscReal v[])
{
  v[0] = 0.5 * x[0] * x[0] + 2 * x[0];
  v[1] = 1.5 * x[1] * x[1] - x[1];
}

/* div u = x + 3 y + 1 as a pressure: what the mass matrix makes of its integrals is the line itself, in the cell and
   beyond */
static void test_pressure(void **state)
{
  Case       c;
  PetscReal *u, *r, *p, *out, value, far[2] = {9, -7};

  (void)state;
  open_case(&c, BOX);
  OK(PetscMalloc4(c.l->nnode_all * 2, &u, c.l->ncell * 3, &r, c.l->ncell * 3, &p, c.l->ncell * 3, &out));
  fill_field(c.l, spreading, u);
  OK(FlowDivergence(c.flow, u, r));
  OK(PetscArrayzero(p, c.l->ncell * 3));
  OK(FlowPressureMassSolve(c.flow, 1, r, p));
  OK(FlowGetPressureGradient(c.flow, p, out));
  for (PetscInt i = 0; i < c.l->ncell; i++) {
    const PetscReal *x = c.l->x + 2 * c.l->cell_node[9 * i + 4];

    NEAR(out[3 * i], x[0] + 3 * x[1] + 1, 1e-12);
    NEAR(out[3 * i + 1], 1, 1e-11);
    NEAR(out[3 * i + 2], 3, 1e-11);
    OK(FlowCellPressure(c.flow, i, p, far, &value));
    NEAR(value, 9 - 21 + 1, 1e-10);
  }
  OK(PetscFree4(u, r, p, out));
  close_case(&c);
}

/* ---- estimate ---- */

/* Of Poiseuille's flow, which the elements hold, there is no error; with another pressure there is one that can be
   counted: a force g that is missing, h g/sqrt(mu) over the root of the dissipation */
static void test_estimate(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 2; k++) {
    Case            c;
    PetscBool      *fluid;
    PetscReal      *eta, relative;
    const PetscReal mu = 0.1, h = PetscSqrtReal(0.125), wrong = k ? 0.3 : 0;

    open_case(&c, BOX
              "-flow_viscosity 0.1 -flow_bc_left_type inflow -flow_bc_left_velocity 1,0 -flow_bc_right_type outflow");
    OK(PetscMalloc2(c.l->ncell, &fluid, c.l->ncell, &eta));
    OK(FlowBeginSteady(c.flow, 0));
    for (PetscInt i = 0; i < c.l->nnode_all; i++) {
      c.flow->u[2 * i]     = 4 * c.l->x[2 * i + 1] * (1 - c.l->x[2 * i + 1]);
      c.flow->u[2 * i + 1] = 0;
    }
    for (PetscInt i = 0; i < c.l->ncell; i++) {
      fluid[i]             = PETSC_TRUE;
      c.flow->p[3 * i]     = (-8 * mu + wrong) * c.l->x[2 * c.l->cell_node[9 * i + 4]];
      c.flow->p[3 * i + 1] = (-8 * mu + wrong) * c.flow->cells.size[i];
      c.flow->p[3 * i + 2] = 0;
    }
    OK(FlowEstimate(c.flow, fluid, eta, &relative));
    for (PetscInt i = 0; i < c.l->ncell; i++) NEAR(eta[i], wrong * h * h / PetscSqrtReal(mu), k ? 1e-10 : 1e-7);
    /* dissipation mu int 16 (1 - 2 y)^2 = mu 1.5 16/3; 12 cells */
    NEAR(relative, wrong * h * h / PetscSqrtReal(mu) * PetscSqrtReal(12) / PetscSqrtReal(mu * 8), k ? 1e-10 : 1e-7);
    OK(PetscFree2(fluid, eta));
    close_case(&c);
  }
}

/* ---- gradients and eddies ---- */

/* Of a linear velocity P(grad u) is its gradient at every node, in cells that are no parallelograms, too */
static void test_projected_gradient(void **state)
{
  const PetscInt  n[3]    = {3, 2, 2};
  const PetscReal L[3][3] = {{0.3, -1, 2}, {0.7, 0.4, -0.2}, {1.1, -0.6, -0.7}};

  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    Case       c;
    Projection p;
    PetscReal *u, *grad;

    give("");
    create_skewed_mesh(dim, n, &c.mesh);
    OK(MeshGetLocal(c.mesh, &c.l));
    OK(FlowCreate(c.mesh, &c.flow));
    OK(PetscMalloc2(c.l->nnode_all * dim, &u, c.l->nnode_all * dim * dim, &grad));
    for (PetscInt i = 0; i < c.l->nnode_all * dim; i++) {
      u[i] = 0.1;
      for (PetscInt b = 0; b < dim; b++) u[i] += L[i % dim][b] * c.l->x[i / dim * dim + b];
    }
    OK(ProjectionCreate(c.flow, &p));
    OK(ProjectionUpdate(&p));
    OK(ProjectionGradient(&p, u, grad));
    for (PetscInt i = 0; i < c.l->nnode_all * dim * dim; i++) NEAR(grad[i], L[i / dim % dim][i % dim], 1e-12);
    for (PetscInt i = 0; i < c.l->nnode_all; i++) assert_false(ProjectionIsSurface(&p, i));
    OK(ProjectionDestroy(&p));
    OK(PetscFree2(u, grad));
    close_case(&c);
  }
}

/* In a uniform shear: Smagorinsky's (C W)^2 |rate| at every node, with W half of the root of the cell's area; none with
   wale; with van Driest's factor nearly all in the middle, next to nothing at walls */
static void test_eddies(void **state)
{
  static const char *const law[] = {"smagorinsky -flow_les_damping none -flow_les_constant 0.2", "wale",
                                    "smagorinsky -flow_les_constant 0.2"};
  const PetscReal          full  = PetscSqr(0.2 * 0.5) * 0.125 * 3;

  (void)state;
  for (PetscInt k = 0; k < 3; k++) {
    char       options[256];
    Case       c;
    PetscReal *nu;

    snprintf(options, sizeof(options), BOX "-mesh_periodic x -flow_density 2 -flow_viscosity 1e-3 -flow_rheology %s",
             law[k]);
    open_case(&c, options);
    for (PetscInt i = 0; i < c.l->nnode_all; i++) c.flow->u[2 * i] = c.flow->u_old[2 * i] = 3 * c.l->x[2 * i + 1];
    OK(FlowBeginStep(c.flow, 0.1, 0.1));
    OK(FlowAssemble(c.flow));
    OK(PetscMalloc1(c.l->nnode_all, &nu));
    OK(FlowGetEddies(c.flow, nu));
    for (PetscInt i = 0; i < c.l->nnode; i++) {
      if (k < 2) NEAR(nu[i], k ? 0 : full, 1e-14);
      else if (c.l->x[2 * i + 1] == 0.5) NEAR(nu[i], full, 0.1 * full);
      else NEAR(nu[i], 0, (c.l->x[2 * i + 1] == 0 || c.l->x[2 * i + 1] == 1 ? 0.2 : 1) * full);
    }
    OK(PetscFree(nu));
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_forces_in_time),
                                     cmocka_unit_test(test_kept),
                                     cmocka_unit_test(test_source),
                                     cmocka_unit_test(test_opening),
                                     cmocka_unit_test(test_starts),
                                     cmocka_unit_test(test_start_by_formula),
                                     cmocka_unit_test(test_power),
                                     cmocka_unit_test(test_power_of_convection),
                                     cmocka_unit_test(test_pressure),
                                     cmocka_unit_test(test_estimate),
                                     cmocka_unit_test(test_projected_gradient),
                                     cmocka_unit_test(test_eddies)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("balance", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
