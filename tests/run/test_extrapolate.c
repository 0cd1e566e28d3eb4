/* Errors from values on coarser meshes: exact for one power of the cell, bounds where meshes do not agree. Rows of real
   scenes, whose true errors are known, are in runs/studies/accuracy. */
#include "core.h"
#include "extrapolate.h"

static const ErrorOrder SMOOTH = {2.5, 3.5, 3.5}, CORNERED = {1.1, 3.5, 2};
static const PetscReal  RATIO[2] = {1.5, 2};

/* Value error * ratio^order */
static PetscReal estimate_power(PetscReal error, PetscReal order, const ErrorOrder *bounds, ErrorTrend *trend)
{
  const PetscReal difference[2] = {error * (PetscPowReal(1.5, order) - 1), error * (PetscPowReal(2, order) - 1)};

  return ExtrapolateError(2, difference, RATIO, bounds, trend);
}

static void test_orders(void **state)
{
  ErrorTrend trend;

  (void)state;
  for (PetscReal order = 1.2; order < 3.5; order += 0.4) {
    NEAR(estimate_power(-3e-3, order, &CORNERED, &trend), 3e-3, 1e-9);
    assert_int_equal(trend, TREND_CONVERGES);
    if (order >= SMOOTH.low) NEAR(estimate_power(3e-3, order, &SMOOTH, &trend), 3e-3, 1e-9);
  }
  /* slower than any order of smooth bodies: the least one, on the low side but seen; faster: what the coarsest tells */
  NEAR(estimate_power(1e-3, 1.5, &SMOOTH, &trend), 1e-3 * (PetscPowReal(1.5, 1.5) - 1) / (PetscPowReal(1.5, 2.5) - 1),
       1e-9);
  NEAR(estimate_power(1e-3, 6, &SMOOTH, &trend), 1e-3 * 63 / (PetscPowReal(2, 3.5) - 1), 1e-9);
}

static void test_bounds(void **state)
{
  const PetscReal turn[2] = {-1e-3, 2e-3}, back[2] = {3e-3, 1e-3};
  ErrorTrend      trend;

  (void)state;
  NEAR(ExtrapolateError(2, turn, RATIO, &SMOOTH, &trend), 3e-3 / (PetscPowReal(2, 2.5) - 1), 1e-12);
  assert_int_equal(trend, TREND_TURNS);
  NEAR(ExtrapolateError(2, back, RATIO, &SMOOTH, &trend), 3e-3 / (PetscPowReal(1.5, 2.5) - 1), 1e-12);
  assert_int_equal(trend, TREND_STALLS);
  NEAR(ExtrapolateError(1, turn, RATIO, &CORNERED, &trend), 1e-3 / (PetscPowReal(1.5, 1.1) - 1), 1e-12);
  assert_int_equal(trend, TREND_STALLS);
}

int main(void)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_orders), cmocka_unit_test(test_bounds)};

  return cmocka_run_group_tests(tests, NULL, NULL);
}
