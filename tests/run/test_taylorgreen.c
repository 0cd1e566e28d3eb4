/* Flows with exact solutions: the decaying Taylor-Green vortex carried by a uniform stream through a doubly periodic
   box (Taylor & Green 1937), the decaying ABC flow in 3D (a Beltrami field), and plane Poiseuille flow. Rates of
   convergence are declared here and asserted: velocity 3 and pressure 2 in space, 1 (be) and 2 (cn, bdf2, fstheta) in
   time. */
/* ranks: 1 2 */
#include "core.h"
#include "couple/couple.h"

#define RATE_VELOCITY 3
#define RATE_PRESSURE 2

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  const MeshLocal *l;
  PetscReal        time;
} Case;

static const PetscReal RHO = 1.3, MU = 0.026, STREAM[2] = {1, 0.5};

/* Exact velocity and pressure at time t */
typedef void (*Exact)(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p);

static void taylor_green(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p)
{
  const PetscReal k = 2 * PETSC_PI, f = PetscExpReal(-2 * MU / RHO * k * k * t), a = k * (x[0] - STREAM[0] * t),
                  b = k * (x[1] - STREAM[1] * t);

  u[0] = STREAM[0] + f * PetscSinReal(a) * PetscCosReal(b);
  u[1] = STREAM[1] - f * PetscCosReal(a) * PetscSinReal(b);
  *p   = 0.25 * RHO * f * f * (PetscCosReal(2 * a) + PetscCosReal(2 * b));
}

static void abc_flow(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p)
{
  const PetscReal k = 2 * PETSC_PI, f = PetscExpReal(-MU / RHO * k * k * t), A = 1, B = 0.8, C = 0.6;

  u[0] = f * (A * PetscSinReal(k * x[2]) + C * PetscCosReal(k * x[1]));
  u[1] = f * (B * PetscSinReal(k * x[0]) + A * PetscCosReal(k * x[2]));
  u[2] = f * (C * PetscSinReal(k * x[1]) + B * PetscCosReal(k * x[0]));
  *p   = -0.5 * RHO * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
}

static void open_case(Case *c, const char options[])
{
  give("-flow_density 1.3 -flow_viscosity 0.026 -flow_ksp_rtol 1e-9 -flow_ksp_max_it 200");
  OK(PetscOptionsInsertString(NULL, options));
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  OK(CoupleCreate(c->flow, c->bodies, &c->couple));
  c->time = 0;
}

static void close_case(Case *c)
{
  OK(CoupleDestroy(&c->couple));
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static void start(Case *c, Exact exact)
{
  PetscReal *u, p;

  OK(FlowGetFields(c->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c->l->nnode_all; i++) exact(0, c->l->x + i * c->l->dim, u + i * c->l->dim, &p);
}

/* Steps of `length` times the ratios in turn */
static void take_uneven_steps(Case *c, PetscInt n, PetscReal length, PetscInt nratio, const PetscReal ratio[])
{
  PetscInt         parts;
  const PetscReal *fraction;

  OK(FlowGetSubsteps(c->flow, &parts, &fraction));
  for (PetscInt i = 0; i < n * parts; i++) {
    PetscInt           its;
    KSPConvergedReason reason;
    const PetscReal    dt = fraction[i % parts] * length * ratio[i / parts % nratio];

    c->time += dt;
    OK(FlowBeginStep(c->flow, c->time, dt));
    OK(CoupleUpdateGeometry(c->couple));
    OK(CoupleSolve(c->couple, &its, &reason));
    assert_true(reason > 0);
    OK(CoupleForce(c->couple));
    OK(CoupleAdvance(c->couple));
  }
}

static void take_steps(Case *c, PetscInt n, PetscReal dt)
{
  const PetscReal one = 1;

  take_uneven_steps(c, n, dt, 1, &one);
}

/* Root mean square errors over the box with a Gauss rule of 4 points an axis; the pressure without its mean. Cells are
   boxes. */
static void measure(const Case *c, Exact exact, PetscReal *error_u, PetscReal *error_p)
{
  const MeshLocal *l   = c->l;
  const PetscInt   dim = l->dim, nb = l->nb;
  PetscQuadrature  quad;
  const PetscReal *xi, *w;
  PetscReal       *u, *p, *pg, sum[3] = {0, 0, 0}, volume = 0;
  PetscInt         nq;

  OK(PetscDTGaussTensorQuadrature(dim, 1, 4, -1, 1, &quad));
  OK(PetscQuadratureGetData(quad, NULL, NULL, &nq, &xi, &w));
  OK(FlowGetFields(c->flow, &u, NULL, &p));
  OK(PetscMalloc1(l->ncell * (dim + 1), &pg));
  OK(FlowGetPressureGradient(c->flow, p, pg));
  for (PetscInt cell = 0; cell < l->ncell; cell++) {
    PetscReal xc[MESH_MAX_NB * 3];

    OK(MeshCellCoordinates(c->mesh, cell, xc));
    for (PetscInt q = 0; q < nq; q++) {
      PetscReal x[3], basis[3][3], want[3], want_p, got[3] = {0, 0, 0}, got_p = pg[cell * (dim + 1)], weight = w[q];

      for (PetscInt d = 0; d < dim; d++) {
        const PetscReal s = xi[q * dim + d], half = 0.5 * (xc[(nb - 1) * dim + d] - xc[d]);

        basis[d][0] = 0.5 * s * (s - 1);
        basis[d][1] = 1 - s * s;
        basis[d][2] = 0.5 * s * (s + 1);
        x[d]        = xc[(nb / 2) * dim + d] + s * half;
        weight *= half;
        got_p += pg[cell * (dim + 1) + 1 + d] * s * half;
      }
      for (PetscInt j = 0; j < nb; j++) {
        const PetscReal phi = basis[0][j % 3] * basis[1][j / 3 % 3] * (dim == 3 ? basis[2][j / 9] : 1);

        for (PetscInt d = 0; d < dim; d++) got[d] += phi * u[l->cell_node[cell * nb + j] * dim + d];
      }
      exact(c->time, x, want, &want_p);
      for (PetscInt d = 0; d < dim; d++) sum[0] += weight * PetscSqr(got[d] - want[d]);
      sum[1] += weight * (got_p - want_p);
      sum[2] += weight * PetscSqr(got_p - want_p);
      volume += weight;
    }
  }
  volume   = total(volume);
  *error_u = PetscSqrtReal(total(sum[0]) / volume);
  *error_p = PetscSqrtReal(PetscMax(0, total(sum[2]) / volume - PetscSqr(total(sum[1]) / volume)));
  OK(PetscFree(pg));
  OK(PetscQuadratureDestroy(&quad));
}

/* ---- a scene of expressions ---- */

/* The vortex between walls that move with it, its strength held by a body force */
static void forced_vortex(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p)
{
  const PetscReal f = 1 + 0.3 * PetscSinReal(5 * t), a = PETSC_PI * x[0] + 0.3, b = PETSC_PI * x[1] + 0.1;

  u[0] = f * PetscSinReal(a) * PetscCosReal(b);
  u[1] = -f * PetscCosReal(a) * PetscSinReal(b);
  *p   = 0.25 * RHO * f * f * (PetscCosReal(2 * a) + PetscCosReal(2 * b));
}

#define VORTEX "sin(pi*x+.3)*cos(pi*y+.1)@,-cos(pi*x+.3)*sin(pi*y+.1)@"

/* The formula with `factor` in place of @ */
static void give_vortex(const char name[], const char factor[])
{
  char text[512];
  int  n = 0;

  for (const char *c = VORTEX; *c; c++)
    n += *c == '@' ? snprintf(text + n, sizeof(text) - n, "%s", factor)
                   : snprintf(text + n, sizeof(text) - n, "%c", *c);
  OK(PetscOptionsSetValue(NULL, name, text));
}

static void run_vortex(PetscInt cells, const char scheme[], PetscInt n, PetscReal end, PetscReal *error_u,
                       PetscReal *error_p)
{
  const char *const side[4] = {"left", "right", "bottom", "top"};
  char              option[OPT_NAME];
  Case              c;

  PetscCallAbort(PETSC_COMM_SELF, PetscOptionsClear(NULL));
  for (PetscInt i = 0; i < 4; i++) {
    OK(PetscOptionsSetValue(NULL, OptJoin("-flow_bc_", side[i], "_type", option), "moving_wall"));
    give_vortex(OptJoin("-flow_bc_", side[i], "_velocity", option), "*(1+.3*sin(5*t))");
  }
  give_vortex("-flow_velocity", "");
  /* rho (f' + 2 nu k^2 f) */
  give_vortex("-flow_force", "*1.3*(1.5*cos(5*t)+2*0.02*pi^2*(1+.3*sin(5*t)))");
  snprintf(option, sizeof(option),
           "-flow_density 1.3 -flow_viscosity 0.026 -flow_ksp_rtol 1e-9 -mesh_cells %d,%d -flow_time %s", (int)cells,
           (int)cells, scheme);
  OK(PetscOptionsInsertString(NULL, option));
  OK(MeshCreate(PETSC_COMM_WORLD, &c.mesh));
  OK(MeshGetLocal(c.mesh, &c.l));
  OK(FlowCreate(c.mesh, &c.flow));
  OK(BodiesCreate(c.l->dim, c.l->lower, c.l->upper, &c.bodies));
  OK(CoupleCreate(c.flow, c.bodies, &c.couple));
  c.time = 0;
  take_steps(&c, n, end / n);
  measure(&c, forced_vortex, error_u, error_p);
  close_case(&c);
}

static void test_expressions(void **state)
{
  PetscReal eu[3], ep[3], p;

  (void)state;
  for (PetscInt i = 0; i < 3; i++) run_vortex(4 << i, "cn", 8, 0.008, &eu[i], &ep[i]);
  for (PetscInt i = 0; i < 2; i++) expect_rate("velocity in space, expressions", eu[i], eu[i + 1], RATE_VELOCITY);
  for (PetscInt s = 0; s < 2; s++) {
    const char *const scheme = s ? "cn" : "bdf2";

    for (PetscInt i = 0; i < 3; i++) run_vortex(16, scheme, (s ? 8 : 16) << i, 0.8, &eu[i], &p);
    for (PetscInt i = 0; i < 2; i++) expect_rate(scheme, eu[i], eu[i + 1], 2);
  }
}

/* ---- space ---- */

static void test_space(void **state)
{
  (void)state;
  PetscReal eu[3], ep[3];

  for (PetscInt i = 0; i < 3; i++) {
    char options[96];
    Case c;

    snprintf(options, sizeof(options), "-mesh_cells %d,%d -mesh_periodic x,y -flow_time bdf2", 6 << i, 6 << i);
    open_case(&c, options);
    start(&c, taylor_green);
    take_steps(&c, 20, 0.001);
    measure(&c, taylor_green, &eu[i], &ep[i]);
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) {
    expect_rate("velocity in space", eu[i], eu[i + 1], RATE_VELOCITY);
    expect_rate("pressure in space", ep[i], ep[i + 1], RATE_PRESSURE);
  }
  BELOW(eu[2], 3e-4);
}

static void test_space_3d(void **state)
{
  (void)state;
  PetscReal eu[2], ep[2];

  for (PetscInt i = 0; i < 2; i++) {
    char options[128];
    Case c;

    snprintf(options, sizeof(options),
             "-mesh_dimension 3 -mesh_cells %d,%d,%d -mesh_periodic x,y,z -flow_time bdf2 -flow_ksp_rtol 1e-6", 8 << i,
             8 << i, 8 << i);
    open_case(&c, options);
    start(&c, abc_flow);
    take_steps(&c, 2, 0.002);
    measure(&c, abc_flow, &eu[i], &ep[i]);
    close_case(&c);
  }
  expect_rate("velocity in space, 3D", eu[0], eu[1], RATE_VELOCITY);
}

/* ---- time ---- */

/* Differences between runs with dt, dt/2, dt/4 on one mesh: what space contributes cancels. uneven: steps follow each
   other in ratios between 0.4 and 2. */
static void check_time(const char scheme[], PetscBool uneven, PetscReal rate)
{
  const PetscReal even[1] = {1}, ratio[4] = {0.6, 1.2, 0.8, 1.4};
  PetscReal      *end[3], diff[2];
  PetscInt        n = 0;

  for (PetscInt i = 0; i < 3; i++) {
    char       options[96];
    Case       c;
    PetscReal *u;

    snprintf(options, sizeof(options), "-mesh_cells 8,8 -mesh_periodic x,y -flow_time %s", scheme);
    open_case(&c, options);
    start(&c, taylor_green);
    take_uneven_steps(&c, 16 << i, 0.2 / (16 << i), uneven ? 4 : 1, uneven ? ratio : even);
    n = c.l->nnode * 2;
    OK(PetscMalloc1(n, &end[i]));
    OK(FlowGetFields(c.flow, &u, NULL, NULL));
    OK(PetscArraycpy(end[i], u, n));
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) {
    diff[i] = 0;
    for (PetscInt j = 0; j < n; j++) diff[i] += PetscSqr(end[i][j] - end[i + 1][j]);
    diff[i] = PetscSqrtReal(total(diff[i]));
  }
  expect_rate(scheme, diff[0], diff[1], rate);
  assert_true(PetscLog2Real(diff[0] / diff[1]) < rate + 0.35);
  for (PetscInt i = 0; i < 3; i++) OK(PetscFree(end[i]));
}

static void test_time(void **state)
{
  (void)state;
  check_time("be", PETSC_FALSE, 1);
  check_time("cn", PETSC_FALSE, 2);
  check_time("bdf2", PETSC_FALSE, 2);
  check_time("fstheta", PETSC_FALSE, 2);
  check_time("cn", PETSC_TRUE, 2);
  check_time("bdf2", PETSC_TRUE, 2);
}

/* ---- Poiseuille ---- */

static void poiseuille(PetscReal t, const PetscReal x[], PetscReal u[], PetscReal *p)
{
  (void)t;
  u[0] = 4 * x[1] * (1 - x[1]);
  u[1] = 0;
  *p   = -8 * MU * (x[0] - 2);
}

/* The parabola is in the velocity space and the pressure is linear: the steady state is reached to round-off, from rest
   in one long step and by keeping it */
static void check_poiseuille(const char options[], PetscBool periodic)
{
  Case      c;
  PetscReal eu, ep;

  open_case(&c, options);
  take_steps(&c, 1, 1e12); /* at rest the convecting velocity is zero: a Stokes problem, with the same solution */
  measure(&c, poiseuille, &eu, &ep);
  BELOW(eu, 1e-9);
  if (!periodic) BELOW(ep, 1e-8);
  close_case(&c);

  open_case(&c, options);
  start(&c, poiseuille);
  take_steps(&c, 5, 0.1); /* with convection */
  measure(&c, poiseuille, &eu, &ep);
  BELOW(eu, 1e-9);
  if (!periodic) BELOW(ep, 1e-8);
  close_case(&c);
}

static void test_poiseuille(void **state)
{
  (void)state;
  check_poiseuille("-mesh_cells 6,4 -mesh_upper 2,1 -flow_ksp_rtol 1e-12 -flow_bc_left_type inflow -flow_bc_left_velocity 1,0 -flow_bc_left_profile parabolic -flow_bc_right_type outflow",
                   PETSC_FALSE);
  check_poiseuille("-mesh_cells 6,4 -mesh_upper 2,1 -flow_ksp_rtol 1e-12 -mesh_periodic x -flow_force 0.208,0",
                   PETSC_TRUE);
}

/* The outer iteration does not care how long the step is: the pressure solve is sound with an undetermined constant,
   whatever round-off makes of the singular coarse matrix */
static void test_long_steps(void **state)
{
  (void)state;
  for (PetscReal dt = 0.1; dt < 1e13; dt *= 10) {
    Case               c;
    PetscInt           its;
    KSPConvergedReason reason;

    open_case(&c, "-mesh_cells 6,4 -mesh_upper 2,1 -flow_ksp_rtol 1e-12 -mesh_periodic x -flow_force 0.208,0");
    OK(FlowBeginStep(c.flow, dt, dt));
    OK(CoupleUpdateGeometry(c.couple));
    OK(CoupleSolve(c.couple, &its, &reason));
    assert_true(reason > 0);
    assert_in_range(its, 1, 25);
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_space),      cmocka_unit_test(test_space_3d),
                                     cmocka_unit_test(test_time),       cmocka_unit_test(test_expressions),
                                     cmocka_unit_test(test_poiseuille), cmocka_unit_test(test_long_steps)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("taylorgreen", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
