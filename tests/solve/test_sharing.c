/* Sums over the ranks that know a body against sums over all ranks: bodies on one rank, on some, on all. */
/* ranks: 1 2 3 11 */
#include "core.h"
#include "rigid/sharedreduction.h"

#define NBODY 60

/* Does rank r know body k? Every seventh is known to all, and so that none is unknown the first rank of a body too */
static int knows(int r, int size, int k)
{
  return k % 7 == 0 || r == k % size || (r == (k / 2) % size && k % 3 == 0) || (k % 11 == 5 && r < 8);
}

static double part(int r, int k, int m)
{
  return 1.0 / (1 + r) + k / 3.0 - m * 0.1 * r;
}

static void test_sums(void **state)
{
  PetscMPIInt     rank, size;
  PetscInt        n = 0, body[NBODY], shared, sent, expected = 0;
  PetscSFNode     remote[NBODY];
  PetscSF         sf;
  SharedReduction s;

  (void)state;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  for (int k = 0; k < NBODY; k++) {
    int others = 0;

    for (int r = 0; r < size; r++) others += r != rank && knows(r, size, k);
    if (!knows(rank, size, k)) continue;
    if (others < REDUCTION_MANY) expected += others;
    remote[n] = (PetscSFNode){.rank = (k + 1) % size, .index = k / size};
    body[n++] = k;
  }
  OK(PetscSFCreate(PETSC_COMM_WORLD, &sf));
  OK(PetscSFSetGraph(sf, NBODY / size + 1, n, NULL, PETSC_COPY_VALUES, remote, PETSC_COPY_VALUES));
  OK(SharedReductionCreate(sf, n, 6, &s));
  OK(PetscSFDestroy(&sf));
  OK(SharedReductionGetSizes(s, &shared, &sent));
  assert_int_equal(sent, expected);
  for (PetscInt unit = 1; unit <= 6; unit += 5) {
    PetscReal value[NBODY * 6], bits[NBODY * 6], most[NBODY * 6];

    for (PetscInt e = 0; e < NBODY * unit; e++) bits[e] = PETSC_MIN_REAL; /* the same on all ranks */
    for (PetscInt e = 0; e < n * unit; e++) value[e] = part(rank, (int)body[e / unit], (int)(e % unit));
    OK(SharedReductionSum(s, unit, value));
    for (PetscInt e = 0; e < n * unit; e++) {
      PetscReal sum = 0;

      for (int r = 0; r < size; r++)
        if (knows(r, size, (int)body[e / unit])) sum += part(r, (int)body[e / unit], (int)(e % unit));
      assert_true(PetscAbsReal(value[e] - sum) < 1e-12);
      bits[body[e / unit] * unit + e % unit] = value[e];
    }
    MPI_Allreduce(bits, most, (int)(NBODY * unit), MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD);
    for (PetscInt e = 0; e < n * unit; e++) assert_true(value[e] == most[body[e / unit] * unit + e % unit]);
  }
  OK(SharedReductionDestroy(&s));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_sums)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("sharing", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
