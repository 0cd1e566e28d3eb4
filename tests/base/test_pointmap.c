/* PointMap: partners of points that are distributed and ordered in another way. */
/* ranks: 1 2 3 */
#include "core.h"
#include "base/pointmap.h"

#define TOLERANCE 1e-9

/* Point number i of a lattice of side n [0,1)^dim with jitter far below the spacing; the same number on every rank */
static void place(PetscInt dim, PetscInt n, PetscInt i, PetscReal x[])
{
  for (PetscInt d = 0; d < dim; d++, i /= n) x[d] = (i % n + 0.2 * noise(7 * i + d)) / n;
}

/* Roots in blocks, leaves dealt out round robin backwards and off by up to `shift` */
static void check(PetscInt dim, PetscInt n, PetscReal shift)
{
  PetscInt    total = 1, nroot, start = 0, nleaf = 0, missing;
  PetscMPIInt rank, size;
  PetscReal  *xr, *xl, *number, *got, where[3];
  PetscInt   *wanted;
  PetscSF     sf;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  for (PetscInt d = 0; d < dim; d++) total *= n;
  nroot = total / size + (rank < total % size);
  OK(MPI_Exscan(&nroot, &start, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  OK(PetscMalloc1(nroot * dim, &xr));
  OK(PetscMalloc1(nroot, &number));
  OK(PetscMalloc1(total * dim, &xl));
  OK(PetscMalloc1(total, &got));
  OK(PetscMalloc1(total, &wanted));
  for (PetscInt i = 0; i < nroot; i++) {
    place(dim, n, start + i, xr + i * dim);
    number[i] = (PetscReal)(start + i);
  }
  for (PetscInt i = total - 1; i >= 0; i--) {
    if (i % size != rank) continue;
    place(dim, n, i, xl + nleaf * dim);
    for (PetscInt d = 0; d < dim; d++) xl[nleaf * dim + d] += shift * noise(i + d);
    wanted[nleaf++] = i;
  }
  OK(PointMapCreate(PETSC_COMM_WORLD, dim, TOLERANCE, nroot, xr, nleaf, xl, &sf, &missing, where));
  assert_int_equal(missing, 0);
  OK(PetscSFBcastBegin(sf, MPIU_REAL, number, got, MPI_REPLACE));
  OK(PetscSFBcastEnd(sf, MPIU_REAL, number, got, MPI_REPLACE));
  for (PetscInt i = 0; i < nleaf; i++) assert_int_equal((PetscInt)got[i], wanted[i]);
  OK(PetscSFDestroy(&sf));
  OK(PetscFree(xr));
  OK(PetscFree(number));
  OK(PetscFree(xl));
  OK(PetscFree(got));
  OK(PetscFree(wanted));
}

static void test_exact(void **state)
{
  (void)state;
  check(1, 100, 0);
  check(2, 31, 0);
  check(3, 9, 0);
}

/* Round-off apart: also where a partner lies across a border of the rounded coordinates */
static void test_apart(void **state)
{
  (void)state;
  check(2, 31, 0.9 * TOLERANCE);
  check(3, 9, 0.9 * TOLERANCE);
}

/* Points exactly on the borders of the rounding (multiples of its width), partners on either side */
static void test_borders(void **state)
{
  (void)state;
  const PetscReal width = 4096 * TOLERANCE, x[6] = {-3 * width, 0, 0, 5 * width, 7 * width, -2 * width};
  PetscReal       y[6], where[3], value[3] = {1, 2, 3}, got[3] = {0, 0, 0};
  PetscMPIInt     rank;
  PetscInt        n, missing;
  PetscSF         sf;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  n = rank ? 0 : 3;
  for (PetscInt sign = -1; sign <= 1; sign += 2) {
    for (PetscInt i = 0; i < 6; i++) y[i] = x[i] + 0.5 * sign * TOLERANCE;
    OK(PointMapCreate(PETSC_COMM_WORLD, 2, TOLERANCE, n, x, n, y, &sf, &missing, where));
    assert_int_equal(missing, 0);
    OK(PetscSFBcastBegin(sf, MPIU_REAL, value, got, MPI_REPLACE));
    OK(PetscSFBcastEnd(sf, MPIU_REAL, value, got, MPI_REPLACE));
    for (PetscInt i = 0; i < n; i++) NEAR(got[i], i + 1, 0);
    OK(PetscSFDestroy(&sf));
  }
}

static void test_missing(void **state)
{
  (void)state;
  const PetscReal x[4] = {0, 0, 1, 1};
  PetscReal       y[6] = {1, 1, 0.5, 0.25, 0, 2 * TOLERANCE}, where[3] = {0, 0, 0};
  PetscMPIInt     rank, size;
  PetscInt        missing;
  PetscSF         sf;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  OK(
    PointMapCreate(PETSC_COMM_WORLD, 2, TOLERANCE, rank ? 0 : 2, x, rank == size - 1 ? 3 : 0, y, &sf, &missing, where));
  assert_int_equal(missing, 2);
  assert_null(sf);
  NEAR(where[0], 0.5, 0);
  NEAR(where[1], 0.25, 0);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_exact), cmocka_unit_test(test_apart),
                                     cmocka_unit_test(test_borders), cmocka_unit_test(test_missing)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("pointmap", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
