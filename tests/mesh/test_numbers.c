/* Numbers above 2^31, without a mesh that has them: exact where PetscInt has 64 bits, otherwise refused. */
/* ranks: 1 2 3 */
#include "core.h"
#include "numbers.h"

static char message[1024];

static PetscErrorCode keep_message(MPI_Comm comm, int line, const char *func, const char *file, PetscErrorCode code,
                                   PetscErrorType type, const char *text, void *ctx)
{
  (void)comm, (void)line, (void)func, (void)file, (void)ctx;
  if (type == PETSC_ERROR_INITIAL) (void)snprintf(message, sizeof(message), "%s", text);
  return code;
}

/* Every rank has `own` of what has `each` unknowns; fits: whatever PETSc was built with */
static void spread(PetscInt own, PetscInt each, PetscBool fits)
{
  PetscInt       start = -1, total = -1;
  PetscErrorCode error;
  PetscMPIInt    rank, size;

  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  message[0] = 0;
  OK(PetscPushErrorHandler(keep_message, NULL));
  error = NumbersSpread(PETSC_COMM_WORLD, "nodes", own, each, &start, &total);
  OK(PetscPopErrorHandler());
  if (fits || sizeof(PetscInt) == 8) {
    assert_int_equal(error, 0);
    assert_true((long long)start == (long long)rank * own && (long long)total == (long long)size * own);
  } else {
    assert_int_equal(error, PETSC_ERR_USER_INPUT);
    assert_non_null(strstr(message, "nodes have"));
    assert_non_null(strstr(message, "32-bit numbers"));
  }
}

static void test_spread(void **state)
{
  (void)state;
  PetscMPIInt size;

  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  spread(0, 3, PETSC_TRUE);
  spread(PETSC_MAX_INT / 3 / size, 3, PETSC_TRUE);
  spread(2000000000, 1, (PetscBool)(size == 1)); /* sums of 4e9 and 6e9 are below and above 0 in 32 bits */
  spread(2000000000, 2, PETSC_FALSE);
  spread(1500000000, 3, PETSC_FALSE);
}

/* 76 million cells in space, 195 million in the plane, are what 32 bits hold */
static void test_boxes(void **state)
{
  const PetscInt fits[2] = {195000000, 76000000}, more[2] = {196000000, 77000000};

  (void)state;
  for (PetscInt i = 0; i < 2; i++) {
    OK(NumbersCheck(PETSC_COMM_WORLD, 2 + i, (PetscReal)fits[i]));
    message[0] = 0;
    OK(PetscPushErrorHandler(keep_message, NULL));
    (void)NumbersCheck(PETSC_COMM_WORLD, 2 + i, (PetscReal)more[i]);
    OK(PetscPopErrorHandler());
    assert_int_equal(message[0] != 0, sizeof(PetscInt) == 4);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_spread), cmocka_unit_test(test_boxes)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("numbers", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
