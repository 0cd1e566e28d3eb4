/* Manufactured solutions: a divergence-free field that is no solution by itself, with the body force and boundary
   values that make it one. Rates of convergence are declared here and asserted: velocity 3 and pressure 2 in space, for
   steady and unsteady problems on boxes and on curved cells; 2 in time for cn, bdf2 and fstheta. Besides, flow between
   turning cylinders (Couette), whose exact solution needs no force. */
/* ranks: 1 2 */
#include "core.h"
#include "fem/element.h"
#include "defaults.h"
#include "steady.h"

#define RATE_VELOCITY 3
#define RATE_PRESSURE 2
#define RATE_TIME     2

static const PetscReal RHO = 1.3, MU = 0.05, K = 2.1, M = 1.4;

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  Steady           steady;
  const MeshLocal *l;
} Case;

typedef void (*Exact)(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p);

/* Amplitude of the velocity and its derivative */
static PetscReal amplitude(PetscReal t, PetscReal *rate)
{
  *rate = 0.6 * PetscCosReal(2 * t);
  return 1 + 0.3 * PetscSinReal(2 * t);
}

static void manufactured(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p)
{
  PetscReal       rate;
  const PetscReal g = amplitude(t, &rate), a = K * x[0] + 0.3, b = M * x[1] + 0.1;

  u[0] = g * PetscSinReal(a) * PetscCosReal(b);
  u[1] = -g * K / M * PetscCosReal(a) * PetscSinReal(b);
  *p   = PetscCosReal(3 * x[0] + t) * PetscSinReal(2 * x[1]);
}

static PetscErrorCode manufactured_velocity(void *ctx, PetscReal t, const PetscReal x[], PetscReal v[])
{
  PetscReal p;

  (void)ctx;
  manufactured(t, x, v, &p);
  return PETSC_SUCCESS;
}

/* rho (u_t + u.grad u) - mu lap u + grad p; ctx: is the problem steady? */
static PetscErrorCode manufactured_force(void *ctx, PetscReal t, const PetscReal x[], PetscReal f[])
{
  PetscReal       rate, u[2], p;
  const PetscReal g = amplitude(t, &rate), a = K * x[0] + 0.3, b = M * x[1] + 0.1;
  const PetscReal grad[2][2] = {{g * K * PetscCosReal(a) * PetscCosReal(b), -g * M * PetscSinReal(a) * PetscSinReal(b)},
                                {g * K * K / M * PetscSinReal(a) * PetscSinReal(b),
                                 -g * K * PetscCosReal(a) * PetscCosReal(b)}};
  const PetscReal grad_p[2]  = {-3 * PetscSinReal(3 * x[0] + t) * PetscSinReal(2 * x[1]),
                                2 * PetscCosReal(3 * x[0] + t) * PetscCosReal(2 * x[1])};

  manufactured(t, x, u, &p);
  for (PetscInt d = 0; d < 2; d++) {
    const PetscReal change = *(PetscBool *)ctx ? 0 : rate / g * u[d];

    f[d] = RHO * (change + u[0] * grad[d][0] + u[1] * grad[d][1]) + MU * (K * K + M * M) * u[d] + grad_p[d];
  }
  return PETSC_SUCCESS;
}

static PetscBool IS_STEADY = PETSC_TRUE, IS_UNSTEADY = PETSC_FALSE;

static void open_case(Case *c, const char options[], PetscBool *steady)
{
  char refusal[1024];

  give("-flow_density 1.3 -flow_viscosity 0.05");
  OK(PetscOptionsInsertString(NULL, options));
  c->steady = NULL;
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  if (*steady) OK(DefaultsApply(c->mesh, NULL, NULL, NULL, PETSC_TRUE, refusal, sizeof(refusal)));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(FlowSetSource(c->flow, manufactured_force, steady));
  OK(ConditionsSetField(FlowConditions(c->flow), manufactured_velocity, NULL));
  OK(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  OK(CoupleCreate(c->flow, c->bodies, &c->couple));
  if (*steady) OK(SteadyCreate(c->flow, c->couple, "1e-10", &c->steady));
}

static void close_case(Case *c)
{
  OK(SteadyDestroy(&c->steady));
  OK(CoupleDestroy(&c->couple));
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static void solve_steady(Case *c)
{
  PetscInt its, linear;

  OK(SteadySetUp(c->steady));
  OK(SteadySolve(c->steady, &its, &linear));
}

static void take_steps(Case *c, PetscInt n, PetscReal dt)
{
  PetscInt         parts;
  const PetscReal *fraction;
  PetscReal       *u, p, time = 0;

  OK(FlowGetFields(c->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c->l->nnode_all; i++) manufactured(0, c->l->x + 2 * i, u + 2 * i, &p);
  OK(FlowGetSubsteps(c->flow, &parts, &fraction));
  for (PetscInt i = 0; i < n * parts; i++) {
    PetscInt           its;
    KSPConvergedReason reason;

    time += fraction[i % parts] * dt;
    OK(FlowBeginStep(c->flow, time, fraction[i % parts] * dt));
    OK(CoupleUpdateGeometry(c->couple));
    OK(CoupleSolve(c->couple, &its, &reason));
    if (reason < 0) print_error("step %d: %s after %d iterations\n", (int)i, KSPConvergedReasons[reason], (int)its);
    assert_true(reason > 0);
    OK(CoupleForce(c->couple));
    OK(CoupleAdvance(c->couple));
  }
}

/* Root mean square errors of the last solution at time t; the pressure without its mean */
static void measure(const Case *c, Exact exact, PetscReal t, PetscReal *error_u, PetscReal *error_p)
{
  const MeshLocal *l = c->l;
  const PetscReal *u, *p;
  PetscReal       *pg, sum[3] = {0, 0, 0}, volume = 0;
  ElementTables    table = {0};

  OK(ElementCreate(2, &table));
  OK(CoupleGetSolution(c->couple, &u, &p));
  OK(PetscMalloc1(l->ncell * 3, &pg));
  OK(FlowGetPressureGradient(c->flow, p, pg));
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscReal     xc[MESH_MAX_NB * 3], uc[MESH_MAX_NB * 2];
    ElementMetric m = {0};

    for (PetscInt i = 0; i < 2 * l->nb; i++) uc[i] = u[2 * l->cell_node[cell * l->nb + i / 2] + i % 2];
    MeshCellGather(l, cell, 2, uc);
    OK(MeshCellCoordinates(c->mesh, cell, xc));
    ElementSetMetric(&table, xc, &m);
    for (PetscInt q = 0; q < table.nq; q++) {
      PetscReal x[2] = {0, 0}, got[2] = {0, 0}, want[2], want_p, got_p = pg[3 * cell];

      for (PetscInt j = 0; j < l->nb; j++) {
        for (PetscInt d = 0; d < 2; d++) {
          x[d] += table.phi[q * table.nbp + j] * xc[2 * j + d];
          got[d] += table.phi[q * table.nbp + j] * uc[2 * j + d];
        }
      }
      for (PetscInt d = 0; d < 2; d++) got_p += pg[3 * cell + 1 + d] * (x[d] - xc[2 * 4 + d]);
      exact(t, x, want, &want_p);
      sum[0] += m.weight[q] * (PetscSqr(got[0] - want[0]) + PetscSqr(got[1] - want[1]));
      sum[1] += m.weight[q] * (got_p - want_p);
      sum[2] += m.weight[q] * PetscSqr(got_p - want_p);
      volume += m.weight[q];
    }
  }
  volume   = total(volume);
  *error_u = PetscSqrtReal(total(sum[0]) / volume);
  *error_p = PetscSqrtReal(PetscMax(0, total(sum[2]) / volume - PetscSqr(total(sum[1]) / volume)));
  OK(PetscFree(pg));
  OK(ElementDestroy(&table));
}

/* ---- space ---- */

static void check_steady_rates(PetscBool refined, const char mesh[])
{
  PetscReal eu[3], ep[3];

  for (PetscInt i = 0; i < 3; i++) {
    char options[192];
    Case c;

    snprintf(options, sizeof(options), refined ? "%s -mesh_cells %d,%d" : "%s -dm_refine %d", mesh,
             (int)(refined ? 4 << i : i), 4 << (int)i);
    open_case(&c, options, &IS_STEADY);
    solve_steady(&c);
    measure(&c, manufactured, 0, &eu[i], &ep[i]);
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) {
    expect_rate("velocity, steady", eu[i], eu[i + 1], RATE_VELOCITY);
    expect_rate("pressure, steady", ep[i], ep[i + 1], RATE_PRESSURE);
  }
}

/* The same jump of levels on each of the three meshes, inside and at a wall */
static void test_refined(void **state)
{
  (void)state;
  check_steady_rates(PETSC_TRUE, "-mesh_levels 1 -mesh_refine patch -mesh_box_patch_corners 0,0.26,0.49,0.74");
}

static void test_steady(void **state)
{
  (void)state;
  check_steady_rates(PETSC_FALSE, "-mesh_cells 4,4");
  check_steady_rates(PETSC_FALSE, "-mesh_kind disc -mesh_resolution 2 -mesh_radius 0.6 -mesh_centre 0.5,0.5");
}

/* bdf2 with steps so short that space dominates */
static void test_unsteady(void **state)
{
  PetscReal eu[3], ep[3];

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    char options[128];
    Case c;

    snprintf(options, sizeof(options), "-mesh_cells 4,4 -dm_refine %d -flow_ksp_rtol 1e-9", (int)i);
    open_case(&c, options, &IS_UNSTEADY);
    take_steps(&c, 20, 0.001);
    measure(&c, manufactured, 0.02, &eu[i], &ep[i]);
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) {
    expect_rate("velocity, unsteady", eu[i], eu[i + 1], RATE_VELOCITY);
    expect_rate("pressure, unsteady", ep[i], ep[i + 1], RATE_PRESSURE);
  }
}

/* ---- time ---- */

/* Differences between runs with dt, dt/2, dt/4 on one mesh: what space contributes cancels. Force and boundary values
   change in time. */
static void check_time(const char scheme[])
{
  PetscReal *end[3], diff[2];
  PetscInt   n = 0;

  for (PetscInt i = 0; i < 3; i++) {
    char             options[96];
    Case             c;
    const PetscReal *u, *p;
    PetscReal        eu, ep;

    snprintf(options, sizeof(options), "-mesh_cells 8,8 -flow_ksp_rtol 1e-9 -flow_time %s", scheme);
    open_case(&c, options, &IS_UNSTEADY);
    take_steps(&c, 16 << i, 1.0 / (16 << i));
    measure(&c, manufactured, 1, &eu, &ep);
    BELOW(eu, 0.02);
    n = c.l->nnode * 2;
    OK(PetscMalloc1(n, &end[i]));
    OK(CoupleGetSolution(c.couple, &u, &p));
    OK(PetscArraycpy(end[i], u, n));
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) {
    diff[i] = 0;
    for (PetscInt j = 0; j < n; j++) diff[i] += PetscSqr(end[i][j] - end[i + 1][j]);
    diff[i] = PetscSqrtReal(total(diff[i]));
  }
  expect_rate(scheme, diff[0], diff[1], RATE_TIME);
  for (PetscInt i = 0; i < 3; i++) OK(PetscFree(end[i]));
}

static void test_time(void **state)
{
  (void)state;
  check_time("cn");
  check_time("bdf2");
  check_time("fstheta");
}

/* ---- Couette flow between cylinders ---- */

#define R1     0.5
#define R2     1.0
#define OMEGA1 2.0
#define OMEGA2 (-0.4)

/* u_phi = a r + b/r, dp/dr = rho u_phi^2/r */
static void couette(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p)
{
  const PetscReal a = (OMEGA2 * R2 * R2 - OMEGA1 * R1 * R1) / (R2 * R2 - R1 * R1),
                  b = (OMEGA1 - OMEGA2) * R1 * R1 * R2 * R2 / (R2 * R2 - R1 * R1);
  const PetscReal r = PetscSqrtReal(x[0] * x[0] + x[1] * x[1]), w = a + b / (r * r);

  (void)t;
  u[0] = -w * x[1];
  u[1] = w * x[0];
  *p   = RHO * (0.5 * a * a * r * r + 2 * a * b * PetscLogReal(r) - 0.5 * b * b / (r * r));
}

static void test_couette(void **state)
{
  PetscReal eu[3], ep[3];

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    char options[320];
    Case c;

    snprintf(options, sizeof(options),
             "-mesh_kind annulus -mesh_centre 0,0 -mesh_radii 0.5,1 -mesh_resolution 4 -flow_bc_inner_type rotating_wall -flow_bc_inner_omega 2 "
             "-flow_bc_outer_type rotating_wall -flow_bc_outer_omega -0.4 -dm_refine %d",
             (int)i + 1);
    open_case(&c, options, &IS_STEADY);
    OK(FlowSetSource(c.flow, NULL, NULL));
    OK(ConditionsSetField(FlowConditions(c.flow), NULL, NULL));
    solve_steady(&c);
    measure(&c, couette, 0, &eu[i], &ep[i]);
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) {
    expect_rate("velocity, Couette", eu[i], eu[i + 1], RATE_VELOCITY);
    expect_rate("pressure, Couette", ep[i], ep[i + 1], RATE_PRESSURE);
  }
  BELOW(eu[2], 1e-3);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_steady), cmocka_unit_test(test_refined),
                                     cmocka_unit_test(test_unsteady), cmocka_unit_test(test_time),
                                     cmocka_unit_test(test_couette)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("manufactured", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
