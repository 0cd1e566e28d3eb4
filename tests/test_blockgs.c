/* BlockGS: product and sweeps against PETSc's own in double precision, on any number of ranks; updates of single rows. */
/* ranks: 1 2 3 */
#include "core.h"
#include "blockgs.h"

#define NROW 60 /* block rows of all ranks */

static const PetscInt reach[] = {-7, -1, 0, 1, 7};

/* Block row r: noise, with a strong diagonal */
static void set_row(Mat A, PetscInt nk, PetscInt r, PetscInt seed)
{
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(reach); k++) {
    const PetscInt col = r + reach[k];
    PetscReal      block[16];

    if (col < 0 || col >= NROW) continue;
    for (PetscInt e = 0; e < nk * nk; e++) block[e] = noise(((seed * NROW + r) * NROW + col) * 16 + e) + (col == r && e % (nk + 1) == 0 ? 6 : 0);
    OK(MatSetValuesBlocked(A, 1, &r, 1, &col, block, INSERT_VALUES));
  }
}

static void create(PetscInt nk, Mat *A)
{
  PetscInt first, last;

  OK(MatCreateBAIJ(PETSC_COMM_WORLD, nk, PETSC_DECIDE, PETSC_DECIDE, NROW * nk, NROW * nk, 5, NULL, 5, NULL, A));
  OK(MatGetOwnershipRange(*A, &first, &last));
  for (PetscInt r = first / nk; r < last / nk; r++) set_row(*A, nk, r, 1);
  OK(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
}

static void fill(Vec v, PetscInt seed)
{
  PetscInt   first, last;
  PetscReal *a;

  OK(VecGetOwnershipRange(v, &first, &last));
  OK(VecGetArray(v, &a));
  for (PetscInt i = first; i < last; i++) a[i - first] = noise(seed * 10007 + i);
  OK(VecRestoreArray(v, &a));
}

static PetscReal difference(Vec x, Vec y)
{
  PetscReal d, size;

  OK(VecNorm(y, NORM_2, &size));
  OK(VecAXPY(x, -1, y));
  OK(VecNorm(x, NORM_2, &d));
  return d / size;
}

/* Product and one sweep of each kind, from zero and from a start value: within the round-off of floats, and not without it */
static void compare(Mat A, Mat shell)
{
  const int flags[] = {SOR_LOCAL_FORWARD_SWEEP | SOR_ZERO_INITIAL_GUESS,
                       SOR_LOCAL_BACKWARD_SWEEP | SOR_ZERO_INITIAL_GUESS,
                       SOR_LOCAL_SYMMETRIC_SWEEP | SOR_ZERO_INITIAL_GUESS,
                       SOR_LOCAL_FORWARD_SWEEP,
                       SOR_LOCAL_BACKWARD_SWEEP,
                       SOR_LOCAL_SYMMETRIC_SWEEP};
  PetscReal d;
  Vec       b, x, y;

  OK(MatCreateVecs(A, &x, &b));
  OK(VecDuplicate(x, &y));
  fill(b, 1);
  OK(MatMult(shell, b, x));
  OK(MatMult(A, b, y));
  d = difference(x, y);
  assert_true(d > 0);
  BELOW(d, 1e-6);
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(flags); k++) {
    fill(x, 2);
    fill(y, 2);
    OK(MatSOR(shell, b, 1, (MatSORType)flags[k], 0, 1, 1, x));
    OK(MatSOR(A, b, 1, (MatSORType)flags[k], 0, 1, 1, y));
    BELOW(difference(x, y), 1e-6);
  }
  OK(VecDestroy(&b));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
}

static void test_against_petsc(void **state)
{
  (void)state;
  for (PetscInt nk = 3; nk <= 4; nk++) {
    Mat      A, shell;
    PetscInt first, last, n = 0, rows[NROW];

    create(nk, &A);
    OK(BlockGSCreate(A, &shell));
    OK(BlockGSUpdate(shell, 0, NULL));
    compare(A, shell);
    OK(MatGetOwnershipRange(A, &first, &last));
    for (PetscInt r = first / nk; r < last / nk; r += 3) {
      set_row(A, nk, r, 2);
      rows[n++] = r - first / nk;
    }
    OK(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    OK(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    OK(BlockGSUpdate(shell, n, rows));
    compare(A, shell);
    OK(MatDestroy(&shell));
    OK(MatDestroy(&A));
  }
}

/* W by its rule: block column k has blocks in rows that noise chooses, so a column is on several ranks */
static PetscReal low_rank(PetscInt nk, PetscInt nr, PetscInt r, PetscInt k, PetscInt e)
{
  return noise(977 * r + k) > 0.3 ? noise(((r * 7 + k) * nk * nr + e) * 31) : 0;
}

/* A + W W^T, assembled */
static void fill_low_rank(PetscInt nk, PetscInt ncolumn, PetscInt nr, Mat A, Mat *whole)
{
  PetscInt first, last;

  OK(MatCreateBAIJ(PETSC_COMM_WORLD, nk, PETSC_DECIDE, PETSC_DECIDE, NROW * nk, NROW * nk, NROW, NULL, NROW, NULL, whole));
  OK(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt r = first / nk; r < last / nk; r++) set_row(*whole, nk, r, 1);
  OK(MatAssemblyBegin(*whole, MAT_FLUSH_ASSEMBLY));
  OK(MatAssemblyEnd(*whole, MAT_FLUSH_ASSEMBLY));
  for (PetscInt r = first / nk; r < last / nk; r++) {
    for (PetscInt col = 0; col < NROW; col++) {
      PetscReal block[16] = {0};

      for (PetscInt e = 0; e < nk * nk; e++)
        for (PetscInt k = 0; k < ncolumn; k++)
          for (PetscInt m = 0; m < nr; m++) block[e] += low_rank(nk, nr, r, k, e / nk * nr + m) * low_rank(nk, nr, col, k, e % nk * nr + m);
      OK(MatSetValuesBlocked(*whole, 1, &r, 1, &col, block, ADD_VALUES));
    }
  }
  OK(MatAssemblyBegin(*whole, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(*whole, MAT_FINAL_ASSEMBLY));
}

/* A part of low rank acts as if it were filled in, and is gone when taken back */
static void test_low_rank(void **state)
{
  const PetscInt ncolumn = 4;

  (void)state;
  for (PetscInt nk = 3; nk <= 4; nk++) {
    const PetscInt nr = nk == 3 ? 3 : 6;
    PetscInt       first, last, n = 0, row[NROW * 4], column[NROW * 4];
    PetscReal     *w;
    Mat            A, whole, shell;

    create(nk, &A);
    fill_low_rank(nk, ncolumn, nr, A, &whole);
    OK(BlockGSCreate(A, &shell));
    OK(BlockGSUpdate(shell, 0, NULL));
    OK(MatGetOwnershipRange(A, &first, &last));
    OK(PetscMalloc1(NROW * ncolumn * nk * nr, &w));
    for (PetscInt r = first / nk; r < last / nk; r++) {
      for (PetscInt k = 0; k < ncolumn; k++) {
        if (low_rank(nk, nr, r, k, 0) == 0) continue;
        for (PetscInt e = 0; e < nk * nr; e++) w[n * nk * nr + e] = low_rank(nk, nr, r, k, e);
        row[n]      = r - first / nk;
        column[n++] = k;
      }
    }
    OK(BlockGSSetLowRank(shell, ncolumn, n, row, column, w));
    compare(whole, shell);
    OK(BlockGSSetLowRank(shell, 0, 0, NULL, NULL, NULL));
    compare(A, shell);
    OK(PetscFree(w));
    OK(MatDestroy(&shell));
    OK(MatDestroy(&whole));
    OK(MatDestroy(&A));
  }
}

static void test_mistakes(void **state)
{
  (void)state;
  Mat A, shell;

  OK(MatCreateBAIJ(PETSC_COMM_WORLD, 2, PETSC_DECIDE, PETSC_DECIDE, 8, 8, 1, NULL, 1, NULL, &A));
  OK(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  OK(PetscPushErrorHandler(PetscIgnoreErrorHandler, NULL));
  assert_int_equal(BlockGSCreate(A, &shell), PETSC_ERR_ARG_WRONG);
  OK(PetscPopErrorHandler());
  OK(MatDestroy(&A));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_against_petsc), cmocka_unit_test(test_low_rank), cmocka_unit_test(test_mistakes)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("blockgs", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
