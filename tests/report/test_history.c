/* History: extrema, periods and values of a sampled signal, better than its step; gaps, ends and mistakes. */
/* ranks: 1 */
#include "core.h"
#include "history.h"
#include <math.h>

#define DT 0.02

/* Two columns with known extrema, unevenly sampled: 0.3 + sin 2 pi t + 0.2 t, and one with numbers that are missing */
static History sample_signal(void)
{
  History   h;
  PetscReal t = 0;

  OK(HistoryCreate(2, &h));
  for (PetscInt i = 0; i < 200; i++) {
    const PetscReal v[2] = {0.3 + PetscSinReal(2 * PETSC_PI * t) + 0.2 * t, i % 3 ? (PetscReal)INFINITY : -t};

    OK(HistoryAdd(h, t, v));
    t += DT * (1 + 0.3 * noise(i));
  }
  return h;
}

static void test_extremum(void **state)
{
  (void)state;
  /* where the derivative 2 pi cos 2 pi t + 0.2 vanishes */
  const PetscReal shift = PetscAcosReal(-0.1 / PETSC_PI) / (2 * PETSC_PI);
  History         h     = sample_signal();
  PetscReal       time, value;
  PetscBool       found;

  OK(HistoryGetExtremum(h, 0, 1, 1.9, 3, &time, &value, &found));
  assert_true(found);
  NEAR(time, 2 + shift, 0.02 * DT);
  NEAR(value, 0.3 + PetscSinReal(2 * PETSC_PI * shift) + 0.2 * time, 1e-5); /* the best sample may be 0.002 off */
  OK(HistoryGetExtremum(h, 0, -1, 0, 3, &time, &value, &found));
  NEAR(time, 1 - shift, 0.02 * DT);
  /* on the rising flank the extreme sample is at the end, and is the answer */
  OK(HistoryGetExtremum(h, 0, -1, 0, 0.2, &time, &value, &found));
  NEAR(time, 0, 0);
  NEAR(value, 0.3, 0);
  OK(HistoryGetExtremum(h, 0, -1, 0.1, 0.2, &time, &value, &found)); /* so it is when the range begins inside */
  NEAR(value, 0.3 + PetscSinReal(2 * PETSC_PI * time) + 0.2 * time, 1e-14);
  assert_true(time >= 0.1);
  OK(HistoryGetExtremum(h, 1, 1, 1, 3, &time, &value, &found));
  assert_true(found && value == -time && time >= 1);
  OK(HistoryGetExtremum(h, 0, 1, 100, 200, &time, &value, &found));
  assert_false(found);
  OK(HistoryDestroy(&h));
}

static void test_period(void **state)
{
  (void)state;
  History   h;
  PetscReal period;
  PetscInt  n;

  OK(HistoryCreate(1, &h));
  OK(HistoryGetPeriod(h, 0, 0, &period, &n));
  assert_int_equal(n, 0);
  for (PetscInt i = 0; i < 300; i++) {
    const PetscReal t = DT * i,
                    v = 5 + PetscSinReal(2 * PETSC_PI * t / 0.77) + 0.2 * PetscSinReal(4 * PETSC_PI * t / 0.77);

    OK(HistoryAdd(h, t, &v));
  }
  OK(HistoryGetPeriod(h, 0, 1, &period, &n));
  assert_int_equal(n, 5); /* crossings at 1.54, 2.31, ... 5.39 */
  NEAR(period, 0.77, 1e-4);
  OK(HistoryGetPeriod(h, 0, 5.9, &period, &n)); /* less than a period is left */
  assert_int_equal(n, 0);
  NEAR(period, 0, 0);
  OK(HistoryDestroy(&h));
}

static void test_value(void **state)
{
  (void)state;
  History   h = sample_signal();
  PetscReal value;
  PetscBool found;

  for (PetscInt i = 0; i < 7; i++) {
    const PetscReal t = i == 0 ? 0 : 0.5 * i + 0.013;

    OK(HistoryGetValue(h, 0, t, &value, &found));
    assert_true(found);
    NEAR(value, 0.3 + PetscSinReal(2 * PETSC_PI * t) + 0.2 * t, 5e-5);
  }
  OK(HistoryGetValue(h, 0, -0.001, &value, &found));
  assert_false(found);
  OK(HistoryGetValue(h, 0, 5, &value, &found));
  assert_false(found);
  OK(HistoryDestroy(&h));
}

static PetscErrorCode ignore_error(MPI_Comm comm, int line, const char *fun, const char *file, PetscErrorCode n,
                                   PetscErrorType p, const char *mess, void *ctx)
{
  (void)comm, (void)line, (void)fun, (void)file, (void)p, (void)mess, (void)ctx;
  return n;
}

static void test_order_of_times(void **state)
{
  (void)state;
  History         h    = sample_signal();
  const PetscReal v[2] = {0, 0};

  OK(PetscPushErrorHandler(ignore_error, NULL));
  assert_int_equal(HistoryAdd(h, 1, v), PETSC_ERR_ARG_OUTOFRANGE);
  OK(PetscPopErrorHandler());
  OK(HistoryDestroy(&h));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_extremum), cmocka_unit_test(test_period),
                                     cmocka_unit_test(test_value), cmocka_unit_test(test_order_of_times)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("history", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
