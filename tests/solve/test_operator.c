/* FlowSolver with an operator that an owner adds to the flow's (FlowAddOperator): E = k times the mass of the velocity
   along x, a drag along one axis, or with a map P along y. A uniform flow then decays by the closed form, one that is
   noise satisfies the whole system, with and without a matrix of the velocity. */
/* ranks: 1 2 */
#include "core.h"
#include "solve/system.h"
#include "fem/element.h"

#define DRAG 30
#define RHO  1.3
#define DT   0.05
#define BASE \
  "-mesh_periodic x,y -mesh_cells 6,5 -flow_density 1.3 -flow_viscosity 0.02 -flow_ksp_rtol 1e-11 -flow_ksp_max_it 200 "

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Constraint       constraint;
  const MeshLocal *l;
  Mat              E, P;
  PetscReal       *lumped;
} Case;

/* E by cells: rows and columns are node, then component */
static void create_drag(Case *c)
{
  const MeshLocal *l = c->l;
  ElementTables    t;
  const PetscReal *m;

  OK(ElementCreate(2, &t));
  OK(MatCreateAIJ(PETSC_COMM_WORLD, 2 * l->nnode, 2 * l->nnode, PETSC_DETERMINE, PETSC_DETERMINE, 25, NULL, 25, NULL,
                  &c->E));
  for (PetscInt e = 0; e < l->ncell; e++) {
    PetscReal     xc[18], ce[9 * ELEMENT_MAX_NBP];
    ElementMetric metric;

    OK(MeshCellCoordinates(c->mesh, e, xc));
    ElementSetMetric(&t, xc, &metric);
    ElementOperator(&t, &metric, DRAG, 0, NULL, 0, ce);
    for (PetscInt i = 0; i < 81; i++)
      OK(MatSetValue(c->E, 2 * l->node_global[l->cell_node[9 * e + i / 9]],
                     2 * l->node_global[l->cell_node[9 * e + i % 9]], ce[i / 9 * t.nbp + i % 9], ADD_VALUES));
  }
  OK(MatAssemblyBegin(c->E, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(c->E, MAT_FINAL_ASSEMBLY));
  OK(ElementDestroy(&t));
  OK(FlowGetLumpedMass(c->flow, &m));
  OK(PetscMalloc1(l->nnode_all, &c->lumped));
  for (PetscInt i = 0; i < l->nnode_all; i++) c->lumped[i] = DRAG * m[i] / 2; /* the mean of both components */
}

/* To what is along y, at x, so that P^T E P is the drag along y and P E P^T nothing */
static void create_map(Case *c)
{
  const PetscInt n = 2 * c->l->nnode;
  PetscInt       start;

  OK(MatCreateAIJ(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, 1, NULL, 0, NULL, &c->P));
  OK(MatGetOwnershipRange(c->P, &start, NULL));
  for (PetscInt i = start; i < start + n; i += 2) OK(MatSetValue(c->P, i, i + 1, 1, INSERT_VALUES));
  OK(MatAssemblyBegin(c->P, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(c->P, MAT_FINAL_ASSEMBLY));
}

static void open_case(Case *c, const char options[])
{
  const unsigned char *fixed;
  const PetscReal     *value;

  give(BASE);
  OK(PetscOptionsInsertString(NULL, options));
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(ConstraintCreate(c->mesh, 0, &c->constraint));
  OK(ConditionsGetValues(FlowConditions(c->flow), &fixed, &value));
  OK(ConstraintSetBoundary(c->constraint, fixed, value));
  create_drag(c);
  create_map(c);
}

static void close_case(Case *c)
{
  OK(PetscFree(c->lumped));
  OK(MatDestroy(&c->E));
  OK(MatDestroy(&c->P));
  OK(ConstraintDestroy(&c->constraint));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* Iterations, -1: it failed. u, p: solution of the first step from the velocity that is in the flow; rhs: its
   right-hand side */
static PetscInt solve(Case *c, PetscReal u[], PetscReal p[], PetscReal rhs[])
{
  FlowSolver         solver;
  KSPConvergedReason reason;
  PetscInt           its;
  PetscReal          none = 0;

  OK(FlowBeginStep(c->flow, DT, DT));
  OK(FlowAssemble(c->flow));
  OK(FlowRhs(c->flow, rhs));
  OK(FlowSolverCreate(c->flow, c->constraint, PETSC_TRUE, &solver));
  OK(FlowSolverSetUp(solver));
  OK(FlowSolverSolve(solver, rhs, &none, u, p, NULL, &none, &its, &reason));
  OK(FlowSolverDestroy(&solver));
  return reason > 0 ? its : -1;
}

/* Largest of S u + E u - B^T p - rhs at own nodes, over the largest of rhs */
static PetscReal find_residual(Case *c, PetscReal u[], const PetscReal p[], const PetscReal rhs[])
{
  const PetscInt n = 2 * c->l->nnode;
  PetscReal     *r, *y;
  Mat            S, A;
  Vec            in, out;
  PetscReal      top;

  OK(PetscMalloc2(2 * c->l->nnode_all, &r, 2 * c->l->nnode_all, &y));
  OK(FlowGradient(c->flow, -1, p, r));
  OK(FlowGetMatrix(c->flow, &S));
  OK(MatCreateMAIJ(S, 2, &A));
  OK(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, n, PETSC_DETERMINE, u, &in));
  OK(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, n, PETSC_DETERMINE, y, &out));
  OK(MatMult(A, in, out));
  OK(FlowMultiplyOperators(c->flow, in, out));
  for (PetscInt i = 0; i < n; i++) r[i] += y[i] - rhs[i];
  top = max_abs(n, r) / max_abs(n, rhs);
  OK(VecDestroy(&in));
  OK(VecDestroy(&out));
  OK(MatDestroy(&A));
  OK(PetscFree2(r, y));
  return top;
}

static void check_drag(const char options[], PetscBool lumped, PetscBool mapped, PetscBool compliant)
{
  const int       owner[2] = {0, 0};
  const PetscReal start[2] = {2, -1};
  const PetscInt  along    = mapped ? 1 : 0;
  Case            c;
  FlowOperator    drag;
  PetscReal      *u, *p, *rhs, *now;

  open_case(&c, options);
  drag = (FlowOperator){.E = c.E, .P = mapped ? c.P : NULL, .lumped = lumped ? c.lumped : NULL, .compliant = compliant};
  OK(PetscMalloc3(2 * c.l->nnode_all, &u, 3 * c.l->ncell, &p, 2 * c.l->nnode_all, &rhs));
  OK(FlowGetFields(c.flow, &now, NULL, NULL));
  OK(FlowAddOperator(c.flow, &owner[0], &drag));
  for (PetscInt two = 0; two < 2; two++) { /* once more, of a second owner */
    if (two) OK(FlowAddOperator(c.flow, &owner[1], &drag));
    for (PetscInt i = 0; i < 2 * c.l->nnode_all; i++) now[i] = start[i % 2];
    OK(PetscArrayzero(u, 2 * c.l->nnode_all));
    OK(PetscArrayzero(p, 3 * c.l->ncell));
    assert_true(solve(&c, u, p, rhs) > 0);
    for (PetscInt i = 0; i < 2 * c.l->nnode; i++)
      NEAR(u[i], start[i % 2] * (i % 2 == along ? (RHO / DT) / (RHO / DT + (1 + two) * DRAG) : 1), 1e-8);
    fill_noise(c.l, 7, now);
    OK(PetscArrayzero(u, 2 * c.l->nnode_all));
    OK(PetscArrayzero(p, 3 * c.l->ncell));
    assert_true(solve(&c, u, p, rhs) > 0);
    BELOW(find_residual(&c, u, p, rhs), 1e-7);
  }
  for (PetscInt k = 0; k < 2; k++) OK(FlowAddOperator(c.flow, &owner[k], NULL));
  assert_false(FlowHasOperators(c.flow));
  OK(PetscFree3(u, p, rhs));
  close_case(&c);
}

static void test_drag(void **state)
{
  (void)state;
  for (PetscInt mapped = 0; mapped < 2; mapped++) {
    check_drag("", PETSC_TRUE, (PetscBool)mapped, PETSC_FALSE);
    check_drag("-flow_velocity_operator matrix_free", PETSC_TRUE, (PetscBool)mapped, PETSC_FALSE);
    check_drag("", PETSC_FALSE, (PetscBool)mapped, PETSC_FALSE);
    check_drag("", PETSC_TRUE, (PetscBool)mapped, PETSC_TRUE);
    check_drag("-flow_solver direct", PETSC_TRUE, (PetscBool)mapped, PETSC_FALSE);
  }
}

/* Fluid that is all but fixed on one side of the box, E = k times the lumped mass there: as its nodes are one block of
   the preconditioner, a solve takes as few iterations as with none, whether its diagonal is given or not */
static void test_porous(void **state)
{
  const int owner = 0;
  PetscInt  its[3];

  (void)state;
  for (PetscInt i = 0; i < 3; i++) { /* none; with its diagonal; without */
    const PetscReal  k = i ? 1e5 : 0;
    Case             c;
    FlowOperator     porous;
    const PetscReal *m;
    PetscReal       *u, *p, *rhs, *now;
    PetscInt         start;

    open_case(&c, "-flow_ksp_rtol 1e-8");
    OK(PetscMalloc3(2 * c.l->nnode_all, &u, 3 * c.l->ncell, &p, 2 * c.l->nnode_all, &rhs));
    OK(FlowGetFields(c.flow, &now, NULL, NULL));
    OK(FlowGetLumpedMass(c.flow, &m));
    OK(MatZeroEntries(c.E));
    OK(MatSetOption(c.E, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
    OK(MatGetOwnershipRange(c.E, &start, NULL));
    for (PetscInt n = 0; n < c.l->nnode_all; n++) {
      c.lumped[n] = c.l->x[2 * n] < 0.5 ? k * m[n] : 0;
      for (PetscInt a = 0; n < c.l->nnode && a < 2; a++)
        OK(MatSetValue(c.E, start + 2 * n + a, start + 2 * n + a, c.lumped[n], INSERT_VALUES));
    }
    OK(MatAssemblyBegin(c.E, MAT_FINAL_ASSEMBLY));
    OK(MatAssemblyEnd(c.E, MAT_FINAL_ASSEMBLY));
    porous = (FlowOperator){.E = c.E, .lumped = i < 2 ? c.lumped : NULL};
    OK(FlowAddOperator(c.flow, &owner, &porous));
    fill_noise(c.l, 7, now);
    OK(PetscArrayzero(u, 2 * c.l->nnode_all));
    OK(PetscArrayzero(p, 3 * c.l->ncell));
    its[i] = solve(&c, u, p, rhs);
    BELOW(find_residual(&c, u, p, rhs), 1e-5);
    for (PetscInt n = 0; n < c.l->nnode && i > 0; n++)
      if (c.l->x[2 * n] < 0.5) BELOW(PetscAbsReal(u[2 * n]), 1e-2);
    OK(PetscFree3(u, p, rhs));
    close_case(&c);
  }
  assert_in_range(its[0], 1, 20);
  assert_in_range(its[1], 1, its[0] + 2);
  assert_in_range(its[2], 1, its[0] + 2);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_drag), cmocka_unit_test(test_porous)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("operator", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
