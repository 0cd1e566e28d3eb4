/* BlockGS: product and sweeps against PETSc's own in double precision, on any number of ranks; updates of single rows;
   rows that are equal. */
/* ranks: 1 2 3 */
#include "core.h"
#include "pressure/blockgs.h"
#include "pressure/rowpool.h"

#define NROW 60 /* block rows of all ranks */

static const PetscInt reach[] = {-7, -1, 0, 1, 7};

/* Block row r: noise, with a strong diagonal */
static void set_row(Mat A, PetscInt nk, PetscInt r, PetscInt seed)
{
  for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(reach); k++) {
    const PetscInt col = r + reach[k];
    PetscReal      block[16];

    if (col < 0 || col >= NROW) continue;
    for (PetscInt e = 0; e < nk * nk; e++)
      block[e] = noise(((seed * NROW + r) * NROW + col) * 16 + e) + (col == r && e % (nk + 1) == 0 ? 6 : 0);
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

/* What the shell borrows, of A on this rank: other ranks' columns are numbered behind the own ones */
typedef struct {
  PetscInt     start[NROW + 1], column[NROW * 5], ghost[NROW];
  BlockPattern pattern;
} Pattern;

static void list_columns(Mat A, PetscInt nk, Pattern *p)
{
  PetscInt first, last, n = 0;

  OK(MatGetOwnershipRange(A, &first, &last));
  first /= nk;
  last /= nk;
  *p = (Pattern){.pattern = {.nk = nk, .n = last - first, .start = p->start, .column = p->column, .ghost = p->ghost}};
  for (PetscInt r = first; r < last; r++) {
    for (PetscInt other = 0; other < 2; other++) {
      for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(reach); k++) {
        const PetscInt col = r + reach[k], own = col >= first && col < last;
        PetscInt       g = 0;

        if (col < 0 || col >= NROW || own == other) continue;
        while (!own && g < p->pattern.nghost && p->ghost[g] != col) g++;
        if (!own && g == p->pattern.nghost) p->ghost[p->pattern.nghost++] = col;
        p->column[n++] = own ? col - first : last - first + g;
      }
    }
    p->start[r - first + 1] = n;
  }
}

/* Row i of the shell as it stands in A */
static void copy_row(Mat A, const Pattern *p, PetscInt i, PetscBool many, Mat shell)
{
  const PetscInt nk = p->pattern.nk, n = p->pattern.n;
  PetscInt       first, row[4], col[4];
  PetscReal      value[5 * 16], block[16];

  OK(MatGetOwnershipRange(A, &first, NULL));
  for (PetscInt q = p->start[i]; q < p->start[i + 1]; q++) {
    const PetscInt c = p->column[q];

    for (PetscInt k = 0; k < nk; k++) {
      row[k] = first + i * nk + k;
      col[k] = (c < n ? first / nk + c : p->ghost[c - n]) * nk + k;
    }
    OK(MatGetValues(A, nk, row, nk, col, block));
    for (PetscInt e = 0; e < nk * nk; e++) value[(q - p->start[i]) * nk * nk + e] = block[e % nk * nk + e / nk];
  }
  OK(BlockGSSetRow(shell, i, value, many));
}

static void copy_all(Mat A, const Pattern *p, Mat shell)
{
  OK(BlockGSClear(shell));
  for (PetscInt i = 0; i < p->pattern.n; i++) copy_row(A, p, i, PETSC_TRUE, shell);
}

static PetscReal difference(Vec x, Vec y)
{
  PetscReal d, size;

  OK(VecNorm(y, NORM_2, &size));
  OK(VecAXPY(x, -1, y));
  OK(VecNorm(x, NORM_2, &d));
  return d / size;
}

/* Of block row i of this rank, if it is there */
static PetscReal row_difference(Vec x, Vec y, PetscInt nk, PetscInt i)
{
  const PetscReal *xa, *ya;
  PetscReal        d = 0, size = 1;
  PetscInt         n;

  OK(VecGetLocalSize(x, &n));
  OK(VecGetArrayRead(x, &xa));
  OK(VecGetArrayRead(y, &ya));
  for (PetscInt k = i * nk; k < (i + 1) * nk && k < n; k++) {
    d    = PetscMax(d, PetscAbsReal(xa[k] - ya[k]));
    size = PetscMax(size, PetscAbsReal(ya[k]));
  }
  OK(VecRestoreArrayRead(x, &xa));
  OK(VecRestoreArrayRead(y, &ya));
  return d / size;
}

/* x += M^{-1} (b - A x), M^{-1} one sweep of PETSc's over the ranks' own parts of `sweep` */
static void refer(Mat A, Mat sweep, MatSORType direction, Vec b, Vec x)
{
  Vec r, dx;

  OK(VecDuplicate(b, &r));
  OK(VecDuplicate(x, &dx));
  OK(MatMult(A, x, r));
  OK(VecAYPX(r, -1, b));
  OK(MatSOR(sweep, r, 1, (MatSORType)(direction | SOR_ZERO_INITIAL_GUESS), 0, 1, 1, dx));
  OK(VecAXPY(x, 1, dx));
  OK(VecDestroy(&r));
  OK(VecDestroy(&dx));
}

/* The two halves of a cycle: sweep and residual; a correction, which other ranks' columns get as well, and the sweep
   back */
static void compare_halves(Mat A, Mat sweep, Mat shell, const Pattern *p)
{
  const PetscInt   nk = p->pattern.nk;
  PetscInt         first, last;
  const PetscReal *ba;
  PetscReal       *xa, *ra, *ya, *ghost;
  Vec              b, r, x, y;

  OK(MatCreateVecs(A, &x, &b));
  OK(VecDuplicate(x, &y));
  OK(VecDuplicate(x, &r));
  OK(MatGetOwnershipRange(A, &first, &last));
  fill_noise_vec(4, b);
  OK(VecGetArrayRead(b, &ba));
  OK(VecGetArray(x, &xa));
  OK(VecGetArray(r, &ra));
  OK(BlockGSSweepDown(shell, ba, xa, ra));
  OK(VecRestoreArray(r, &ra));
  OK(VecRestoreArray(x, &xa));
  OK(VecZeroEntries(y));
  refer(A, sweep, SOR_LOCAL_FORWARD_SWEEP, b, y);
  BELOW(difference(x, y), 1e-6);
  OK(MatMult(A, y, x));
  OK(VecAYPX(x, -1, b));
  BELOW(difference(r, x), 1e-5);
  OK(VecGetArray(x, &xa));
  OK(VecGetArray(r, &ra));
  OK(BlockGSSweepDown(shell, ba, xa, ra)); /* x again */
  OK(VecGetArray(y, &ya));
  for (PetscInt i = first; i < last; i++) xa[i - first] += noise(10007 + i);
  for (PetscInt i = first; i < last; i++) ya[i - first] += noise(10007 + i);
  OK(VecRestoreArray(y, &ya));
  OK(BlockGSGetGhosts(shell, &ghost));
  for (PetscInt e = 0; e < p->pattern.nghost * nk; e++) ghost[e] += noise(10007 + p->ghost[e / nk] * nk + e % nk);
  OK(BlockGSSweepUp(shell, ba, xa));
  OK(VecRestoreArray(r, &ra));
  OK(VecRestoreArray(x, &xa));
  OK(VecRestoreArrayRead(b, &ba));
  refer(A, sweep, SOR_LOCAL_BACKWARD_SWEEP, b, y);
  BELOW(difference(x, y), 1e-6);
  OK(VecDestroy(&b));
  OK(VecDestroy(&r));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
}

/* Product and one sweep of each kind, from zero and from a start value: within the round-off of floats, and not without
   it. `sweep`: A as its sweeps see it. */
static void compare(Mat A, Mat sweep, Mat shell, const Pattern *p)
{
  const MatSORType directions[] = {SOR_LOCAL_FORWARD_SWEEP, SOR_LOCAL_BACKWARD_SWEEP, SOR_LOCAL_SYMMETRIC_SWEEP};
  PetscReal        d;
  Vec              b, x, y;

  OK(MatCreateVecs(A, &x, &b));
  OK(VecDuplicate(x, &y));
  fill_noise_vec(1, b);
  OK(MatMult(shell, b, x));
  OK(MatMult(A, b, y));
  d = difference(x, y);
  assert_true(d > 0);
  BELOW(d, 1e-6);
  for (PetscInt zero = 0; zero < 2; zero++) {
    for (size_t k = 0; k < PETSC_STATIC_ARRAY_LENGTH(directions); k++) {
      if (directions[k] == SOR_LOCAL_SYMMETRIC_SWEEP && sweep != A) continue; /* the way back sees A */
      fill_noise_vec(2, x);
      OK(VecCopy(x, y));
      if (zero) OK(VecZeroEntries(y));
      OK(MatSOR(shell, b, 1, (MatSORType)(directions[k] | (zero ? SOR_ZERO_INITIAL_GUESS : 0)), 0, 1, 1, x));
      refer(A, sweep, directions[k], b, y);
      BELOW(difference(x, y), 1e-6);
    }
  }
  OK(VecDestroy(&b));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
  compare_halves(A, sweep, shell, p);
}

static void test_against_petsc(void **state)
{
  (void)state;
  for (PetscInt k = 0; k < 4; k++) {
    const PetscInt  nk    = 3 + k % 2;
    const PetscBool exact = (PetscBool)(k / 2);
    Mat             A, shell;
    Vec             b, x, y;
    Pattern         p;
    PetscInt        first, last;

    create(nk, &A);
    list_columns(A, nk, &p);
    OK(BlockGSCreate(PETSC_COMM_WORLD, &p.pattern, exact, &shell));
    copy_all(A, &p, shell);
    compare(A, A, shell, &p);
    OK(MatGetOwnershipRange(A, &first, &last));
    for (PetscInt r = first / nk; r < last / nk; r += 3) set_row(A, nk, r, 2);
    OK(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    OK(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    for (PetscInt i = 0; i < p.pattern.n; i += 3) copy_row(A, &p, i, PETSC_FALSE, shell);
    compare(A, A, shell, &p);
    OK(MatCreateVecs(A, &x, &b));
    OK(VecDuplicate(x, &y));
    fill_noise_vec(3, b);
    OK(BlockGSGetDiagonal(shell, x));
    OK(MatGetDiagonal(A, y));
    BELOW(difference(x, y), exact ? 1e-15 : 1e-6);
    OK(BlockGSMultiplySparse(shell, b, x));
    OK(MatMult(A, b, y));
    BELOW(difference(x, y), exact ? 1e-15 : 1e-6);
    if (exact) {
      const PetscInt fine = 1;

      OK(BlockGSSetFine(shell, p.pattern.n > 1, &fine));
      OK(BlockGSMultiplySparse(shell, b, x));
      assert_true(difference(x, y) > 1e-15);
      OK(BlockGSMultiplySparse(shell, b, x));
      BELOW(row_difference(x, y, nk, fine), 1e-15);
    }
    OK(VecDestroy(&b));
    OK(VecDestroy(&x));
    OK(VecDestroy(&y));
    OK(MatDestroy(&shell));
    OK(MatDestroy(&A));
  }
}

/* W by its rule: block column k has blocks in rows that noise chooses, so a column is on several ranks */
static PetscReal low_rank(PetscInt nk, PetscInt nr, PetscInt r, PetscInt k, PetscInt e)
{
  return noise(977 * r + k) > 0.3 ? noise(((r * 7 + k) * nk * nr + e) * 31) : 0;
}

/* Ranks that have a part of block column k */
static PetscReal sharers(PetscInt nk, PetscInt nr, PetscInt first, PetscInt last, PetscInt k)
{
  PetscReal has = 0;

  for (PetscInt r = first; r < last; r++) has = low_rank(nk, nr, r, k, 0) != 0 ? 1 : has;
  return total(has);
}

/* A + W W^T, assembled; or as the sweeps see it: the part of a column times its sharers, and `extra` on the diagonal */
static void fill_low_rank(PetscInt nk, PetscInt ncolumn, PetscInt nr, Mat A, PetscBool sweep, const PetscReal extra[],
                          Mat *whole)
{
  PetscInt  first, last;
  PetscReal factor[8];

  OK(MatCreateBAIJ(PETSC_COMM_WORLD, nk, PETSC_DECIDE, PETSC_DECIDE, NROW * nk, NROW * nk, NROW, NULL, NROW, NULL,
                   whole));
  OK(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt k = 0; k < ncolumn; k++) {
    factor[k] = sharers(nk, nr, first / nk, last / nk, k);
    if (!sweep) factor[k] = 1;
  }
  for (PetscInt r = first / nk; r < last / nk; r++) set_row(*whole, nk, r, 1);
  OK(MatAssemblyBegin(*whole, MAT_FLUSH_ASSEMBLY));
  OK(MatAssemblyEnd(*whole, MAT_FLUSH_ASSEMBLY));
  for (PetscInt r = first / nk; r < last / nk; r++) {
    for (PetscInt col = 0; col < NROW; col++) {
      PetscReal block[16] = {0};

      for (PetscInt e = 0; e < nk * nk; e++)
        for (PetscInt k = 0; k < ncolumn; k++)
          for (PetscInt m = 0; m < nr; m++)
            block[e] += factor[k] * low_rank(nk, nr, r, k, e / nk * nr + m) * low_rank(nk, nr, col, k, e % nk * nr + m);
      for (PetscInt e = 0; e < nk * nk && sweep && col == r; e++) block[e] += extra[(r - first / nk) * nk * nk + e];
      OK(MatSetValuesBlocked(*whole, 1, &r, 1, &col, block, ADD_VALUES));
    }
  }
  OK(MatAssemblyBegin(*whole, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(*whole, MAT_FINAL_ASSEMBLY));
}

/* All ranks have all columns, which the first one owns. */
static void share_columns(PetscInt ncolumn, PetscInt nr, SharedReduction *sharing)
{
  PetscMPIInt rank;
  PetscSFNode remote[8];
  PetscSF     sf;

  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  for (PetscInt k = 0; k < ncolumn; k++) remote[k] = (PetscSFNode){.rank = 0, .index = k};
  OK(PetscSFCreate(PETSC_COMM_WORLD, &sf));
  OK(PetscSFSetGraph(sf, rank ? 0 : ncolumn, ncolumn, NULL, PETSC_COPY_VALUES, remote, PETSC_COPY_VALUES));
  OK(SharedReductionCreate(sf, ncolumn, nr, sharing));
  OK(PetscSFDestroy(&sf));
}

/* A part of low rank acts as if it were filled in, and is gone when taken back; what is extra is in the sweeps only */
static void test_low_rank(void **state)
{
  const PetscInt ncolumn = 4;

  (void)state;
  for (PetscInt nk = 3; nk <= 4; nk++) {
    const PetscInt  nr = nk == 3 ? 3 : 6;
    PetscInt        first, last, n = 0, row[NROW * 4], column[NROW * 4];
    PetscReal      *w, extra[NROW * 16];
    Mat             A, whole, sweep, shell;
    SharedReduction sharing;
    Pattern         p;

    create(nk, &A);
    for (PetscInt e = 0; e < NROW * nk * nk; e++) extra[e] = e % (nk * nk) % (nk + 1) == 0 ? 1 + noise(e) : 0.1;
    fill_low_rank(nk, ncolumn, nr, A, PETSC_FALSE, NULL, &whole);
    fill_low_rank(nk, ncolumn, nr, A, PETSC_TRUE, extra, &sweep);
    list_columns(A, nk, &p);
    OK(BlockGSCreate(PETSC_COMM_WORLD, &p.pattern, PETSC_TRUE, &shell));
    OK(BlockGSSetExtra(shell, extra));
    copy_all(A, &p, shell);
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
    share_columns(ncolumn, nr, &sharing);
    OK(BlockGSSetLowRank(shell, sharing, ncolumn, n, row, column, w));
    compare(whole, sweep, shell, &p);
    OK(BlockGSSetExtra(shell, NULL));
    OK(BlockGSSetLowRank(shell, NULL, 0, 0, NULL, NULL, NULL));
    copy_all(A, &p, shell);
    compare(A, A, shell, &p);
    OK(PetscFree(w));
    OK(SharedReductionDestroy(&sharing));
    OK(MatDestroy(&shell));
    OK(MatDestroy(&whole));
    OK(MatDestroy(&sweep));
    OK(MatDestroy(&A));
  }
}

static void test_mistakes(void **state)
{
  (void)state;
  Mat shell;

  OK(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
  assert_int_equal(BlockGSCreate(PETSC_COMM_WORLD, &(BlockPattern){.nk = 2}, PETSC_TRUE, &shell), PETSC_ERR_ARG_WRONG);
  OK(PetscPopErrorHandler());
}

/* Rows that are equal stand once, whether exact or not; a row that changes leaves the others alone */
static void test_pool(void **state)
{
  (void)state;
  for (PetscInt exact = 0; exact < 2; exact++) {
    const PetscInt n = 1000;
    PetscInt       used;
    RowPool        p;
    PetscReal      value[6];

    OK(RowPoolCreate(n, 3, (PetscBool)exact, &p));
    for (PetscInt i = 0; i < n; i++) {
      for (PetscInt e = 0; e < 6; e++) value[e] = noise(i % 7 * 6 + e) * (1 + (i % 14 > 6 ? 1e-12 : 0));
      OK(RowPoolSet(&p, i, 1 + i % 7 % 2, value, PETSC_TRUE));
    }
    assert_int_equal(p.nkind, exact ? 14 : 7);
    assert_int_equal(p.used, exact ? 20 : 10);
    value[0] = 5;
    OK(RowPoolSet(&p, 9, 1, value, PETSC_FALSE));
    assert_true(p.at[9] != p.at[23] && p.at[23] == p.at[37]);
    NEAR(p.value[p.at[9] * 3], 5, 1e-6);
    NEAR(p.value[p.at[23] * 3], noise(2 * 6), 1e-6);
    assert_true(exact == (p.exact != NULL));
    value[0] = 6; /* alone of its kind: in the same place, which no other row may take for the old kind's */
    OK(RowPoolSet(&p, 30, 1, value, PETSC_TRUE));
    used     = p.used;
    value[0] = 7;
    OK(RowPoolSet(&p, 30, 1, value, PETSC_FALSE));
    assert_int_equal(p.used, used);
    for (PetscInt other = 6; other < 8; other++) {
      value[0] = other;
      OK(RowPoolSet(&p, 37, 1, value, PETSC_FALSE));
      assert_true(p.at[37] != p.at[30]);
      NEAR(p.value[p.at[37] * 3], other, 1e-6);
      NEAR(p.value[p.at[30] * 3], 7, 1e-6);
    }
    OK(RowPoolDestroy(&p));
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_against_petsc), cmocka_unit_test(test_low_rank),
                                     cmocka_unit_test(test_mistakes), cmocka_unit_test(test_pool)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("blockgs", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
