/* Steady problems: Newton's matrix against differences, Poiseuille flow, the ways to converge agree, failure. */
/* ranks: 1 2 */
#include "base/interrupt.h"
#include "core.h"
#include "defaults.h"
#include "base/interrupt.h"
#include "steady.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  Steady           steady;
  const MeshLocal *l;
  PetscInt         its, linear;
} Case;

static void open_case(Case *c, const char options[])
{
  char refusal[64];

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(DefaultsApply(c->mesh, NULL, NULL, NULL, PETSC_TRUE, refusal, sizeof(refusal)));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  OK(CoupleCreate(c->flow, c->bodies, &c->couple));
  OK(SteadyCreate(c->flow, c->couple, "1e-10", &c->steady));
  OK(SteadySetUp(c->steady));
}

static void close_case(Case *c)
{
  OK(SteadyDestroy(&c->steady));
  OK(CoupleDestroy(&c->couple));
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

#define CAVITY "-flow_viscosity 0.002 -mesh_cells 12,12 -flow_bc_top_type moving_wall -flow_bc_top_velocity 1,0 "

/* The residual is quadratic in u, so that central differences of it are exact. */
static void check_newton_matrix(PetscInt dim, const char options[])
{
  const PetscInt n[3] = {3, 2, 2};
  Mesh           mesh;
  Flow           flow;
  PetscReal     *u, *v, *w, *p, *matrix;

  const MeshLocal *l;

  give(options);
  create_skewed_mesh(dim, n, &mesh);
  OK(MeshGetLocal(mesh, &l));
  OK(FlowCreate(mesh, &flow));
  OK(FlowBeginSteady(flow, 0));
  const PetscInt rows = l->nb * dim;

  OK(PetscMalloc5(l->nnode_all * dim, &u, l->nnode_all * dim, &v, l->nnode_all * dim, &w, l->ncell_all * (dim + 1), &p,
                  rows * rows, &matrix));
  fill_noise(l, 1, u);
  fill_noise(l, 2, v);
  OK(PetscArrayzero(p, l->ncell_all * (dim + 1)));
  for (PetscInt c = 0; c < l->ncell; c++) {
    PetscReal change[81] = {0}, linear[81], r[81], size = 0, error = 0;

    for (PetscInt sign = -1; sign <= 1; sign += 2) {
      for (PetscInt i = 0; i < l->nnode_all * dim; i++) w[i] = u[i] + sign * v[i];
      OK(FlowSetConvection(flow, w));
      OK(FlowCellResidual(flow, c, w, p, r));
      for (PetscInt i = 0; i < rows; i++) change[i] += 0.5 * sign * r[i];
    }
    OK(FlowSetConvection(flow, u));
    OK(FlowCellResidual(flow, c, v, p, linear)); /* S v */
    OK(FlowCellNewton(flow, c, u, matrix));
    for (PetscInt i = 0; i < rows; i++) {
      PetscReal product = linear[i];

      for (PetscInt j = 0; j < rows; j++)
        product += matrix[i * rows + j] * v[l->cell_node[c * l->nb + j / dim] * dim + j % dim];
      error = PetscMax(error, PetscAbsReal(product - change[i]));
      size  = PetscMax(size, PetscAbsReal(change[i]));
    }
    assert_true(size > 0);
    BELOW(error / size, 1e-13);
  }
  OK(PetscFree5(u, v, w, p, matrix));
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

static void test_newton_matrix(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    check_newton_matrix(dim, "-flow_density 1.3 -flow_viscosity 0.1");
    check_newton_matrix(dim, "-flow_density 1.3 -flow_viscosity 0.1 -flow_convection_form skew");
  }
}

/* Poiseuille flow lies in the space of the elements: the solution is exact at the nodes, pressure included. */
static void test_poiseuille(void **state)
{
  Case             c;
  const PetscReal *u, *p;
  PetscReal        error = 0, slope = 0;

  (void)state;
  open_case(&c,
            "-mesh_cells 6,4 -mesh_upper 3,1 -flow_density 1.5 -flow_viscosity 0.05 -flow_bc_left_type inflow -flow_bc_left_velocity 2,0 "
            "-flow_bc_left_profile parabolic -flow_bc_right_type outflow");
  OK(SteadySolve(c.steady, &c.its, &c.linear));
  assert_true(c.its <= 6);
  OK(CoupleGetSolution(c.couple, &u, &p));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    const PetscReal y = c.l->x[2 * i + 1];

    error = PetscMax(error, PetscMax(PetscAbsReal(u[2 * i] - 8 * y * (1 - y)), PetscAbsReal(u[2 * i + 1])));
  }
  BELOW(largest(error), 1e-9);
  error = 0;
  for (PetscInt k = 0; k < c.l->ncell; k++) {
    const PetscReal h = PetscSqrtReal(0.5 * 0.25), *x = c.l->x + 2 * c.l->cell_node[k * 9 + 4];

    slope = p[3 * k + 1] / h;
    /* dp/dx = -8 U mu/H^2 */
    error = PetscMax(error, PetscMax(PetscAbsReal(slope + 0.8), PetscAbsReal(p[3 * k] - 0.8 * (3 - x[0]))));
  }
  BELOW(largest(error), 1e-9);
  close_case(&c);
}

/* u of the cavity by another way, against `want` if that holds numbers already */
static void check_way(const char options[], PetscReal want[], PetscInt most)
{
  Case             c;
  const PetscReal *u, *p;
  char             all[1024];
  PetscInt         n;

  snprintf(all, sizeof(all), "%s%s", CAVITY, options);
  open_case(&c, all);
  OK(SteadySolve(c.steady, &c.its, &c.linear));
  if (c.its > most) print_error("%s: %d iterations\n", options, (int)c.its);
  assert_true(c.its <= most);
  OK(CoupleGetSolution(c.couple, &u, &p));
  n = c.l->nnode * 2;
  if (want[0] == PETSC_MAX_REAL) OK(PetscArraycpy(want, u, n));
  BELOW(max_difference(n, u, want), 1e-7);
  assert_true(max_abs(n, u) > 0.9);
  close_case(&c);
}

static void test_ways_agree(void **state)
{
  PetscReal *want;

  (void)state;
  OK(PetscMalloc1(2 * 625, &want));
  want[0] = PETSC_MAX_REAL;
  check_way("", want, 12);
  check_way("-flow_linearization picard -flow_snes_rtol 1e-9", want, 60);
  check_way("-flow_snes_max_it 1", want, 60); /* pseudo-time to the end */
  want[0] = PETSC_MAX_REAL;
  check_way("-flow_viscosity 0.02", want, 8);
  check_way("-flow_viscosity 0.02 -flow_solver accurate", want, 8); /* preconditioner of Picard's matrix */
  OK(PetscFree(want));
}

static PetscErrorCode keep_message(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode n,
                                   PetscErrorType p, const char *text, void *ctx)
{
  (void)comm;
  (void)line;
  (void)function;
  (void)file;
  if (p == PETSC_ERROR_INITIAL) snprintf((char *)ctx, 1024, "%s", text);
  return n;
}

static void test_failure_names_remedies(void **state)
{
  Case           c;
  char           message[1024] = "";
  PetscErrorCode error;

  (void)state;
  open_case(&c, CAVITY "-flow_snes_max_it 2 -flow_pseudo_steps 0");
  OK(PetscPushErrorHandler(keep_message, message));
  error = SteadySolve(c.steady, &c.its, &c.linear);
  OK(PetscPopErrorHandler());
  assert_int_not_equal(error, 0);
  assert_non_null(strstr(message, "DIVERGED_MAX_IT"));
  assert_non_null(strstr(message, "-flow_snes_max_it"));
  assert_non_null(strstr(message, "-flow_pseudo_steps"));
  close_case(&c);
}

/* A signal to any rank ends the solve on all of them, with what it has and without an error; asked again, it solves */
static void test_interrupt(void **state)
{
  (void)state;
  for (PetscInt direct = 0; direct < 2; direct++) {
    Case        c;
    PetscMPIInt rank;

    OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
    open_case(&c, direct ? CAVITY "-flow_viscosity 0.02 -flow_solver direct"
                         : CAVITY "-flow_viscosity 0.02 -flow_solver balanced");
    if (rank == 0) InterruptRaise(15);
    OK(SteadySolve(c.steady, &c.its, &c.linear));
    assert_true(InterruptHeard());
    assert_true(c.its <= 2); /* the first solve, and that of the flow without convection */
    InterruptRaise(0);
    assert_false(InterruptHeard());
    OK(SteadySolve(c.steady, &c.its, &c.linear));
    assert_true(c.its > 3);
    close_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_newton_matrix),          cmocka_unit_test(test_poiseuille), cmocka_unit_test(test_ways_agree),
    cmocka_unit_test(test_failure_names_remedies), cmocka_unit_test(test_interrupt),
  };
  int failed;

  OK(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  OK(OptFinalize());
  OK(PetscFinalize());
  return failed;
}
