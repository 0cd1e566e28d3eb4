/* Scalars: quadratic fields are exact, balances close whatever a cell is made of, a flux through sides of cells is that
   through a boundary, bodies of one value keep heat. */
/* ranks: 1 2 3 */
#include "core.h"
#include "fem/side.h"
#include "scalar/scalar.h"

#define CONDUCTIVITY "-scalars s -scalar_s_conductivity 0.7 -scalar_s_capacity 1.3 "

typedef struct {
  Mesh             mesh;
  const MeshLocal *l;
  Scalars          s;
} Case;

static void open_case(Case *c, PetscInt dim, const char options[])
{
  give(options);
  OK(PetscOptionsInsertString(NULL, dim == 2 ? "-mesh_dimension 2 -mesh_cells 5,4 -mesh_upper 1.5,1"
                                             : "-mesh_dimension 3 -mesh_cells 3,2,3 -mesh_upper 1.5,1,1"));
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(ScalarsCreate(c->mesh, &c->s));
}

static void close_case(Case *c)
{
  OK(ScalarsDestroy(&c->s));
  OK(MeshDestroy(&c->mesh));
}

static void begin(Case *c, PetscReal dt)
{
  /* BDF2, after a first step of that length; or a steady state */
  const ScalarStep step = {.time          = 2 * dt,
                           .dt            = dt,
                           .ct            = dt > 0 ? 1.5 / dt : 0,
                           .d0            = dt > 0 ? 2 / dt : 0,
                           .d1            = dt > 0 ? -0.5 / dt : 0,
                           .theta         = 1,
                           .extrapolation = dt > 0 ? 1 : 0};

  OK(ScalarsBeginStep(c->s, &step));
}

static PetscReal *solve(Case *c, const PetscReal w[])
{
  KSPConvergedReason reason;
  PetscReal         *T;

  OK(ScalarsSolve(c->s, 0, w, &reason));
  assert_true(reason > 0);
  OK(ScalarsGetSolution(c->s, 0, &T));
  return T;
}

/* No sources or sinks: w = (1 + y, x, 0) */
static void stream(const PetscReal x[], PetscReal w[])
{
  w[0] = 1 + x[1];
  w[1] = x[0];
}

static void test_quadratic(void **state)
{
  /* T = x^2 + xy - 2y^2: 1.3 w.grad T + 1.4 = source */
  static const char        SOURCE[] = "-scalar_s_source 1.3*((1+y)*(2*x+y)+x*(x-4*y))+1.4 ";
  static const char *const SIDES[]  = {"left", "right", "bottom", "top", "front", "back"};

  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    char       options[1024] = CONDUCTIVITY;
    PetscReal *w, *T, worst = 0;
    Case       c;

    strcat(options, SOURCE);
    for (PetscInt b = 0; b < 4; b++) {
      strcat(options, "-scalar_s_bc_");
      strcat(options, SIDES[b]);
      strcat(options, "_value x^2+x*y-2*y^2 ");
    }
    open_case(&c, dim, options);
    OK(PetscCalloc1(c.l->nnode_all * dim, &w));
    fill_field(c.l, stream, w);
    begin(&c, 0);
    T = solve(&c, w);
    for (PetscInt i = 0; i < c.l->nnode; i++) {
      const PetscReal x = c.l->x[i * dim], y = c.l->x[i * dim + 1];

      worst = PetscMax(worst, PetscAbsReal(T[i] - (x * x + x * y - 2 * y * y)));
    }
    BELOW(largest(worst), 1e-8);
    OK(PetscFree(w));
    close_case(&c);
  }
}

/* The balance of a step from noise, in a flow that is noise, with a value, a flux and an exchange at boundaries */
static void measure(PetscInt dim, const char more[], ScalarBalance *b)
{
  char options[512] = CONDUCTIVITY "-scalar_s_bc_left_value 1 -scalar_s_bc_right_flux 0.5 -scalar_s_bc_top_transfer 2 ";
  PetscReal *w, *T, *T_old, boundary[6];
  Case       c;

  strcat(options, more);
  open_case(&c, dim, options);
  OK(PetscCalloc1(c.l->nnode_all * dim, &w));
  fill_noise(c.l, 3, w);
  OK(ScalarsGetFields(c.s, 0, &T, &T_old));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    T[i]     = noise(c.l->node_global[i]);
    T_old[i] = noise(7 + c.l->node_global[i]);
  }
  begin(&c, 0.05);
  (void)solve(&c, w);
  OK(ScalarsMeasure(c.s, 0, b, boundary, NULL));
  OK(PetscFree(w));
  close_case(&c);
}

static void test_balance(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    ScalarBalance by_nodes, by_points, with;

    measure(dim, "", &by_nodes);
    measure(dim, "-scalar_s_decay 1e-300", &by_points); /* the same, by points of the quadrature */
    measure(dim, "-scalar_s_decay 2 -scalar_s_source x+y", &with);
    BELOW(by_nodes.residual / by_nodes.size, 1e-12);
    BELOW(by_points.residual / by_points.size, 1e-12);
    BELOW(with.residual / with.size, 1e-12);
    NEAR(by_nodes.change, by_points.change, 1e-10 * by_nodes.size);
    NEAR(by_nodes.convected, by_points.convected, 1e-10 * by_nodes.size);
    NEAR(by_nodes.content, by_points.content, 1e-10);
    NEAR(by_nodes.mean, by_nodes.content / (1.3 * 1.5), 1e-12);
    assert_true(by_nodes.convected != 0 && with.source != 0);
  }
}

/* Largest error of a linear field where two cells of three are n x n samples of the fluid */
static PetscReal measure_samples(PetscInt n)
{
  PetscReal     one[64], none[64], *T, worst = 0;
  PetscInt     *sample;
  ScalarSamples samples[2];
  ScalarCells   cells = {.samples = samples};
  Case          c;

  open_case(&c, 2, CONDUCTIVITY "-scalar_s_bc_left_value 0 -scalar_s_bc_right_value 3");
  for (PetscInt q = 0; q < 64; q++) {
    one[q]  = 0.7;
    none[q] = 0;
  }
  OK(PetscMalloc1(c.l->ncell_all, &sample));
  for (PetscInt e = 0; e < c.l->ncell_all; e++) sample[e] = c.l->cell_global[e] % 3 - 1;
  for (PetscInt k = 0; k < 2; k++)
    samples[k] = (ScalarSamples){.n            = n,
                                 .capacity     = one,
                                 .conductivity = one,
                                 .reaction     = none,
                                 .source       = none,
                                 .lump         = -1};
  cells.sample = sample;
  OK(ScalarsSetCells(c.s, 0, &cells));
  begin(&c, 0);
  T = solve(&c, NULL);
  for (PetscInt i = 0; i < c.l->nnode; i++) worst = PetscMax(worst, PetscAbsReal(T[i] - 2 * c.l->x[2 * i]));
  OK(PetscFree(sample));
  close_case(&c);
  return largest(worst);
}

/* Samples are sums over midpoints, of second order */
static void test_samples(void **state)
{
  PetscReal coarse, fine;

  (void)state;
  coarse = measure_samples(4);
  fine   = measure_samples(8);
  BELOW(fine, 1e-3);
  expect_rate("a linear field through cells of samples", coarse, fine, 2);
}

static void step_with_sides(const char options[], PetscBool sides, PetscReal sum[2])
{
  ScalarBalance b;
  ScalarSide   *side;
  PetscInt      n = 0;
  PetscReal     boundary[6], *T;
  Case          c;

  open_case(&c, 2, options);
  OK(PetscMalloc1(c.l->ncell_all, &side));
  for (PetscInt e = 0; e < c.l->ncell_all && sides; e++)
    if (c.l->x[2 * c.l->cell_node[e * 9 + 5]] > 1.5 - 1e-9)
      side[n++] = (ScalarSide){.cell = e, .side = 1, .q = 4.5, .h = 3};
  OK(ScalarsSetSides(c.s, 0, n, side));
  begin(&c, 0.1);
  T = solve(&c, NULL);
  OK(ScalarsMeasure(c.s, 0, &b, boundary, NULL));
  BELOW(b.residual / b.size, 1e-12);
  sum[0] = dot(c.l->nnode, T, T);
  sum[1] = sides ? b.source : b.boundary;
  OK(PetscFree(side));
  close_case(&c);
}

static void test_sides(void **state)
{
  PetscReal at_boundary[2], at_sides[2];

  (void)state;
  step_with_sides(CONDUCTIVITY "-scalar_s_bc_right_transfer 3 -scalar_s_bc_right_ambient 1.5", PETSC_FALSE,
                  at_boundary);
  step_with_sides(CONDUCTIVITY, PETSC_TRUE, at_sides);
  NEAR(at_sides[0], at_boundary[0], 1e-9 * at_boundary[0]);
  NEAR(at_sides[1], at_boundary[1], 1e-9 * at_boundary[1]);
  assert_true(at_boundary[1] > 0);
}

static PetscErrorCode sum_over_ranks(void *ctx, PetscReal v[])
{
  PetscFunctionBeginUser;
  (void)ctx;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, v, 2, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Two bodies of one value in a box that lets nothing out: a step of implicit Euler keeps the heat */
static void test_lumps(void **state)
{
  const PetscReal capacity[2] = {2, 0.5}, source[2] = {0, 0.4};
  PetscReal       value[2][3] = {{1, 1, 1}, {-1, -1, -1}}, boundary[6], *T, worst = 0, before, dt = 0.2;
  PetscBool       is[2] = {PETSC_TRUE, PETSC_TRUE}, own[2];
  PetscInt       *of_node;
  ScalarLumps     lumps = {2, is, own, NULL, capacity, source, capacity, value[0], 3, sum_over_ranks, NULL};
  ScalarBalance   b;
  PetscMPIInt     rank;
  Case            c;

  (void)state;
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  own[0] = own[1] = (PetscBool)(rank == 0);
  open_case(&c, 2, CONDUCTIVITY "-scalar_s_initial 0.25");
  OK(PetscMalloc1(c.l->nnode_all, &of_node));
  for (PetscInt i = 0; i < c.l->nnode_all; i++)
    of_node[i] = c.l->x[2 * i] < 0.31 ? 0 : c.l->x[2 * i] > 1.19 && c.l->x[2 * i + 1] > 0.49 ? 1 : -1;
  lumps.of_node = of_node;
  OK(ScalarsSetLumps(c.s, 0, &lumps));
  OK(ScalarsBeginStep(c.s, &(ScalarStep){.time = dt, .dt = dt, .ct = 1 / dt, .d0 = 1 / dt, .theta = 1}));
  T = solve(&c, NULL);
  OK(ScalarsMeasure(c.s, 0, &b, boundary, NULL));
  before = 1.3 * 1.5 * 0.25 + 2 * 1 - 0.5;
  NEAR(b.content, before + 0.4 * dt, 1e-11);
  BELOW(b.residual / b.size, 1e-12);
  for (PetscInt i = 0; i < c.l->nnode; i++)
    if (of_node[i] >= 0) worst = PetscMax(worst, PetscAbsReal(T[i] - value[of_node[i]][2]));
  BELOW(largest(worst), 1e-14);
  assert_true(value[0][2] < 1 && value[1][2] > -1);
  OK(PetscFree(of_node));
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_quadratic), cmocka_unit_test(test_balance),
                                     cmocka_unit_test(test_samples), cmocka_unit_test(test_sides),
                                     cmocka_unit_test(test_lumps)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
