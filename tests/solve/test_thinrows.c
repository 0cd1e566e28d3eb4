/* ThinRows: groups of rows with a few large entries: what stays, what its sums are, which groups go, on any number of
   ranks. */
/* ranks: 1 3 */
#include "core.h"
#include "pressure/thinrows.h"

#define NR      3
#define GROUPS  6  /* of all ranks; group g has COLUMNS columns from g on */
#define WIDTH   20 /* columns of the matrix */
#define COLUMNS 12

/* Every third column counts, with either sign; the others are a tenth of that, and their sum is not zero; group g is
   2^g as large as the first */
static PetscReal entry(PetscInt g, PetscInt s, PetscInt i)
{
  return 1e-3 * (1 << g) * (i % 3 ? 0.1 : 1) * (1 + 0.1 * s + 0.01 * i) * ((i + s) % 2 && i % 3 == 0 ? -1 : 1);
}

static Mat matrix(PetscInt *first, PetscInt *last)
{
  PetscMPIInt rank, size;
  PetscInt    groups, begin;
  Mat         W;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  groups = GROUPS / size;
  OK(MatCreateAIJ(PETSC_COMM_WORLD, groups * NR, PETSC_DECIDE, PETSC_DETERMINE, WIDTH, COLUMNS, NULL, COLUMNS, NULL,
                  &W));
  OK(MatGetOwnershipRange(W, &begin, NULL));
  *first = begin / NR;
  *last  = *first + groups;
  for (PetscInt g = *first; g < *last; g++)
    for (PetscInt s = 0; s < NR; s++)
      for (PetscInt i = 0; i < COLUMNS; i++) OK(MatSetValue(W, g * NR + s, g + i, entry(g, s, i), INSERT_VALUES));
  OK(MatAssemblyBegin(W, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(W, MAT_FINAL_ASSEMBLY));
  return W;
}

static Mat thinned(Mat W, ThinRule rule, PetscReal weight)
{
  Vec v;
  Mat thin;

  rule.nr = NR;
  OK(MatCreateVecs(W, &v, NULL));
  OK(VecSet(v, weight));
  OK(ThinRows(W, &rule, v, &thin));
  OK(VecDestroy(&v));
  return thin;
}

/* Of every row: its entries, and their sum */
static void look(Mat A, PetscInt row, PetscInt *n, PetscReal *sum)
{
  PetscInt           many;
  const PetscScalar *value;

  OK(MatGetRow(A, row, &many, NULL, &value));
  *n   = many;
  *sum = 0;
  for (PetscInt i = 0; i < many; i++) *sum += value[i];
  OK(MatRestoreRow(A, row, &many, NULL, &value));
}

static void test_what_stays(void **state)
{
  PetscInt  first, last, n;
  PetscReal before, after;
  Mat       W = matrix(&first, &last), thin = thinned(W, (ThinRule){.tol = 0.5, .max = COLUMNS}, 1);

  (void)state;
  for (PetscInt row = first * NR; row < last * NR; row++) {
    look(W, row, &n, &before);
    look(thin, row, &n, &after);
    assert_int_equal(n, COLUMNS / 3);
    assert_true(PetscAbsReal(after - before) < 1e-12 * (1 << row / NR));
  }
  OK(MatDestroy(&thin));
  for (int large = 0; large < 2; large++) { /* nothing is small: the same matrix */
    thin = thinned(W, (ThinRule){.tol = large ? 0.5 : 0, .max = COLUMNS}, large ? 1e9 : 1);
    OK(MatAXPY(thin, -1, W, DIFFERENT_NONZERO_PATTERN));
    OK(MatNorm(thin, NORM_FROBENIUS, &after));
    assert_true(after == 0);
    OK(MatDestroy(&thin));
  }
  OK(MatDestroy(&W));
}

/* By the number of columns all at once, by the weight those below a size */
static void test_which_groups_go(void **state)
{
  PetscInt  first, last, n;
  PetscReal sum, square = 0;
  ThinRule  rule = {.tol = 0.5, .max = COLUMNS, .power = 1};
  Mat       W    = matrix(&first, &last), thin;

  (void)state;
  assert_null(thinned(W, (ThinRule){.tol = 0.5, .max = COLUMNS / 3 - 1}, 1));
  /* the largest row of the first group */
  for (PetscInt i = 0; i < COLUMNS; i++) square += PetscSqr(entry(0, NR - 1, i));
  rule.weak = 4 * square * (1 << 4) * COLUMNS / 3 * 1.01; /* group 2 is just below */
  thin      = thinned(W, rule, 4);
  for (PetscInt row = first * NR; row < last * NR; row++) {
    look(thin, row, &n, &sum);
    assert_int_equal(n, row / NR > 2 ? COLUMNS / 3 : 0);
  }
  OK(MatDestroy(&thin));
  rule.few = COLUMNS / 3; /* few columns stay whatever their weight */
  thin     = thinned(W, rule, 4);
  for (PetscInt row = first * NR; row < last * NR; row++) {
    look(thin, row, &n, &sum);
    assert_int_equal(n, COLUMNS / 3);
  }
  OK(MatDestroy(&thin));
  OK(MatDestroy(&W));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_what_stays), cmocka_unit_test(test_which_groups_go)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("thinrows", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
