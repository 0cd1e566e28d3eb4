/* Exact sums: no rounding, no order, any number of ranks. */
/* ranks: 1 2 3 */
#include "base/exact.h"
#include "core.h"
#include <math.h>

static void nothing_is_lost(void **state)
{
  const PetscReal term[] = {1e300, 1, -1e-300, -1e300, 4.9e-324, 1e-300, -3, 0, 1e17, -1e17};
  Exact           e      = {{0}, 0, 0};
  PetscReal       sum;

  (void)state;
  for (PetscInt i = 0; i < 10; i++) ExactAdd(&e, term[i]);
  OK(ExactGetSum(PETSC_COMM_SELF, &e, &sum));
  assert_true(sum == -2);
  e = (Exact){{0}, 0, 0};
  ExactAdd(&e, (PetscReal)INFINITY);
  OK(ExactGetSum(PETSC_COMM_SELF, &e, &sum));
  assert_true(PetscIsInfOrNanReal(sum));
}

/* 1000 numbers of many sizes, in two orders, spread over the ranks */
static void order_and_ranks_do_not_show(void **state)
{
  PetscMPIInt rank, size;
  PetscReal   all, mine;
  Exact       one = {{0}, 0, 0}, spread = {{0}, 0, 0};

  (void)state;
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  for (PetscInt i = 0; i < 1000; i++) {
    const PetscInt  j = 999 - i;
    const PetscReal a = PetscSinReal(i) * PetscPowReal(10, i % 40 - 20),
                    b = PetscSinReal(j) * PetscPowReal(10, j % 40 - 20);

    ExactAdd(&one, a);
    if (j % size == rank) ExactAdd(&spread, b);
  }
  OK(ExactGetSum(PETSC_COMM_SELF, &one, &all));
  OK(ExactGetSum(PETSC_COMM_WORLD, &spread, &mine));
  assert_true(all == mine && all != 0);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(nothing_is_lost), cmocka_unit_test(order_and_ranks_do_not_show)};

  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("exact", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
