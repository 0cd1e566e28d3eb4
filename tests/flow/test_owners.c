/* Flow: what several owners add to the equations is the sum of what they have, in matrices, products, diagonals, rows
   near marked nodes and right-hand sides. */
/* ranks: 1 2 */
#include "fluidcase.h"
#include "impl.h"
#include "gathered.h"

/* Terms in every local cell: factor times noise of the cell and entry */
static PetscInt make_terms(const MeshLocal *l, PetscReal factor, PetscInt **cells, PetscReal **terms)
{
  const PetscInt nn = l->nb * l->nb;

  OK(PetscMalloc2(l->ncell_all, cells, l->ncell_all * nn, terms));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    (*cells)[c] = c;
    for (PetscInt e = 0; e < nn; e++) (*terms)[c * nn + e] = factor * noise(l->cell_global[c] * nn + e);
  }
  return l->ncell_all;
}

/* Sum over own nodes of noise . S noise, by product or matrix, and of the diagonal; and compare_rows near all nodes */
static void measure(Case *c, PetscReal value[2])
{
  const PetscInt n = c->l->nnode * c->dim;
  PetscReal     *x, *y, *d;
  PetscBool     *all;

  OK(FlowAssemble(c->flow));
  OK(PetscMalloc4(c->l->nnode_all * c->dim, &x, c->l->nnode_all * c->dim, &y, c->l->nnode_all, &d, c->l->nnode_all,
                  &all));
  fill_noise(c->l, 3, x);
  multiply(c, x, y);
  OK(FlowGetDiagonal(c->flow, d));
  value[0] = dot(n, x, y);
  value[1] = 0;
  for (PetscInt i = 0; i < c->l->nnode; i++) value[1] += d[i] * noise(c->l->node_global[i]);
  value[1] = total(value[1]);
  for (PetscInt i = 0; i < c->l->nnode_all; i++) all[i] = PETSC_TRUE;
  (void)compare_rows(c->flow, c->l, all);
  OK(PetscFree4(x, y, d, all));
}

static void check_terms(const char options[])
{
  Case       c;
  PetscInt  *cells[3], n = 0;
  PetscReal *terms[3], bare[2], whole[2], parts[2], one[2];
  const int  owner[2] = {0, 0};

  open_case(&c, options);
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  for (PetscInt k = 0; k < 3; k++) n = make_terms(c.l, k == 0 ? 0.7 : k == 1 ? 0.3 : 1, &cells[k], &terms[k]);
  measure(&c, bare);
  OK(FlowAddCellTerms(c.flow, &owner[0], n, cells[2], terms[2]));
  measure(&c, whole);
  OK(FlowAddCellTerms(c.flow, &owner[0], n, cells[0], terms[0])); /* replaces */
  OK(FlowAddCellTerms(c.flow, &owner[1], n, cells[1], terms[1]));
  measure(&c, parts);
  OK(FlowAddCellTerms(c.flow, &owner[0], 0, NULL, NULL)); /* the first goes, the second stays */
  measure(&c, one);
  for (PetscInt k = 0; k < 2; k++) {
    assert_true(PetscAbsReal(whole[k] - bare[k]) > 1e-3);
    NEAR(parts[k], whole[k], 1e-11);
    NEAR(one[k] - bare[k], 0.3 * (whole[k] - bare[k]), 1e-11);
  }
  OK(FlowAddCellTerms(c.flow, &owner[1], 0, NULL, NULL));
  measure(&c, one);
  for (PetscInt k = 0; k < 2; k++) NEAR(one[k], bare[k], 0);
  for (PetscInt k = 0; k < 3; k++) OK(PetscFree2(cells[k], terms[k]));
  close_case(&c);
}

static void test_terms(void **state)
{
  (void)state;
  check_terms("-mesh_cells 4,3");
  check_terms("-mesh_cells 4,3 -flow_velocity_operator matrix_free");
  check_terms("-mesh_dimension 3 -mesh_cells 3,2,2");
}

static void test_forces(void **state)
{
  Case       c;
  const int  owner[2] = {0, 0};
  PetscReal *f[2], *before, *after;

  (void)state;
  open_case(&c, "-mesh_cells 4,3");
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  OK(PetscCalloc4(c.l->nnode_all * 2, &f[0], c.l->nnode_all * 2, &f[1], c.l->nnode_all * 2, &before, c.l->nnode_all * 2,
                  &after));
  for (PetscInt k = 0; k < 2; k++)
    for (PetscInt i = 0; i < c.l->nnode * 2; i++)
      f[k][i] = noise(1000 * k + 2 * c.l->node_global[i / 2] + i % 2); /* own nodes push */
  OK(FlowRhs(c.flow, before));
  for (PetscInt k = 0; k < 2; k++) OK(FlowAddForce(c.flow, &owner[k], f[k]));
  OK(FlowRhs(c.flow, after));
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) NEAR(after[i], before[i] + f[0][i] + f[1][i], 1e-14);
  for (PetscInt k = 0; k < 2; k++) OK(FlowAddForce(c.flow, &owner[k], NULL));
  /* right-hand sides that belong to operators, one without */
  for (PetscInt k = 0; k < 2; k++) OK(FlowAddOperator(c.flow, &owner[k], &(FlowOperator){.force = f[k]}));
  OK(FlowAddOperator(c.flow, f, &(FlowOperator){.lumped = NULL}));
  OK(FlowRhs(c.flow, after));
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) NEAR(after[i], before[i] + f[0][i] + f[1][i], 1e-14);
  OK(FlowAddOperator(c.flow, &owner[0], &(FlowOperator){.force = f[1]}));
  OK(FlowRhs(c.flow, after));
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) NEAR(after[i], before[i] + 2 * f[1][i], 1e-14);
  for (PetscInt k = 0; k < 2; k++) OK(FlowAddOperator(c.flow, &owner[k], NULL));
  OK(FlowAddOperator(c.flow, f, NULL));
  assert_false(FlowHasOperators(c.flow));
  OK(FlowRhs(c.flow, after));
  for (PetscInt i = 0; i < c.l->nnode * 2; i++) NEAR(after[i], before[i], 0);
  OK(PetscFree4(f[0], f[1], before, after));
  close_case(&c);
}

/* What owners have in the lumped mass adds up, of terms and of operators, on ranks without terms too */
static void test_lumped(void **state)
{
  static const char owner[2];
  const PetscReal  *sum;
  PetscReal        *lumped;
  Case              c;

  (void)state;
  open_case(&c, "-mesh_cells 4,3");
  OK(FlowGetOperatorDiagonal(c.flow, &sum));
  assert_null(sum);
  OK(PetscMalloc1(c.l->nnode_all, &lumped));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) lumped[i] = 1 + (PetscReal)i;
  OK(FlowAddCellTerms(c.flow, &owner[0], 0, NULL, NULL));
  OK(FlowCountCellTerms(c.flow, &owner[0], lumped));
  OK(FlowAddOperator(c.flow, &owner[1], &(FlowOperator){.lumped = lumped}));
  OK(FlowGetOperatorDiagonal(c.flow, &sum));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) NEAR(sum[i], 2 * lumped[i], 0);
  OK(FlowAddOperator(c.flow, &owner[1], NULL));
  OK(FlowAddCellTerms(c.flow, &owner[0], 0, NULL, NULL));
  OK(FlowGetOperatorDiagonal(c.flow, &sum));
  assert_null(sum);
  OK(PetscFree(lumped));
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_terms), cmocka_unit_test(test_forces),
                                     cmocka_unit_test(test_lumped)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("owners", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
