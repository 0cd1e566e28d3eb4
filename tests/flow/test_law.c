/* Laws of generalised Newtonian fluids at a point: each against its formula and its limits, slopes against
   differences, the stages in which it becomes rigid. */
#include "core.h"
#include "laws.h"
#include "raised.h"
#include "material/rheology.h"

#define MU 0.3 /* -flow_viscosity */

static Rheology create(const char options[])
{
  Rheology r;
  Polymer  polymer;
  Eddy     eddy;

  give(options);
  OK(RheologyCreate(MU, &r, &polymer, &eddy));
  assert_non_null(r);
  assert_null(polymer.name);
  assert_null(eddy.name);
  return r;
}

static PetscReal viscosity(Rheology r, PetscReal g)
{
  PetscReal mu;

  RheologyEvaluate(r, g, &mu, NULL);
  return mu;
}

/* At every rate from 1e-3 to 1e4 that is not cut off: mu = f(g), to a relative tolerance */
static void compare(Rheology r, PetscReal (*f)(PetscReal g), PetscReal tolerance)
{
  for (PetscReal g = 1e-3; g < 2e4; g *= 3) NEAR(viscosity(r, g) / f(g), 1, tolerance);
}

static PetscReal thinning(PetscReal g)
{
  return MU * PetscPowReal(2 * g, -0.4);
}

static PetscReal thickening(PetscReal g)
{
  return MU * PetscPowReal(2 * g, 0.3);
}

static void test_power_law(void **state)
{
  Rheology r = create(
    "-flow_rheology power_law -flow_rheology_index 0.6 -flow_rheology_time 2 -flow_rheology_viscosity_bounds 1e-6,1e6");

  (void)state;
  compare(r, thinning, 1e-6);
  NEAR(viscosity(r, 1e30), 1e-6 * MU, 1e-18);
  OK(RheologyDestroy(&r));
  r = create(
    "-flow_rheology power_law -flow_rheology_index 0.6 -flow_rheology_time 2 -flow_rheology_viscosity_bounds 1e-3,1e3");
  NEAR(viscosity(r, 0), 1e3 * MU, 1e-3 * MU);
  OK(RheologyDestroy(&r));
  r = create(
    "-flow_rheology power_law -flow_rheology_index 1.3 -flow_rheology_time 2 -flow_rheology_viscosity_bounds 1e-3,1e3");
  compare(r, thickening, 1e-6);
  NEAR(viscosity(r, 0), 1e-3 * MU, 1e-7 * MU);
  NEAR(viscosity(r, 1e30), 1e3 * MU, 1e-12);
  OK(RheologyDestroy(&r));
}

static PetscReal carreau(PetscReal g)
{
  return 0.02 + (MU - 0.02) * PetscPowReal(1 + PetscSqr(0.5 * g), -0.3);
}

static PetscReal yasuda(PetscReal g)
{
  return (MU)*PetscPowReal(1 + PetscPowReal(3 * g, 0.8), -0.5 / 0.8);
}

/* Without an exponent a Carreau's own law, where it is 2 */
static void test_carreau(void **state)
{
  Rheology r = create(
    "-flow_rheology carreau -flow_rheology_index 0.4 -flow_rheology_time 0.5 -flow_rheology_viscosity_infinity 0.02");

  (void)state;
  compare(r, carreau, 1e-13);
  NEAR(viscosity(r, 0), MU, 1e-13);
  NEAR(viscosity(r, 1e30), 0.02, 1e-13);
  OK(RheologyDestroy(&r));
  r = create("-flow_rheology carreau -flow_rheology_index 0.5 -flow_rheology_time 3 -flow_rheology_yasuda 0.8");
  compare(r, yasuda, 1e-13);
  OK(RheologyDestroy(&r));
}

static PetscReal cross_law(PetscReal g)
{
  return 0.05 + (MU - 0.05) / (1 + PetscPowReal(4 * g, 0.7));
}

static void test_cross(void **state)
{
  Rheology r = create(
    "-flow_rheology cross -flow_rheology_index 0.3 -flow_rheology_time 4 -flow_rheology_viscosity_infinity 0.05");

  (void)state;
  compare(r, cross_law, 1e-13);
  NEAR(viscosity(r, 0.25), 0.5 * (MU + 0.05), 1e-14); /* half of the way at L g = 1 */
  NEAR(viscosity(r, 0), MU, 1e-8);                    /* (L g)^0.7 falls slowly */
  NEAR(viscosity(r, 1e30), 0.05, 1e-12);
  OK(RheologyDestroy(&r));
}

/* What yields has the stress t_0 + K g^n; what does not, the viscosity that makes it rigid */
static void test_yield(void **state)
{
  Rheology r = create("-flow_rheology bingham -flow_rheology_yield 0.7 -flow_rheology_max_viscosity_ratio 500");

  (void)state;
  assert_true(RheologyHasYield(r));
  for (PetscReal g = 1; g < 1e6; g *= 10) NEAR(g * viscosity(r, g), 0.7 + MU * g, 1e-13 * (1 + g));
  NEAR(viscosity(r, 0), 501 * MU, 1e-6 * MU);
  NEAR(viscosity(r, 1e-7), 501 * MU, 0.01 * MU);
  OK(RheologyDestroy(&r));
  r = create(
    "-flow_rheology herschel_bulkley -flow_rheology_yield 0.7 -flow_rheology_papanastasiou 400 -flow_rheology_index 0.6 -flow_rheology_time 2 "
    "-flow_rheology_viscosity_bounds 1e-6,1e6");
  for (PetscReal g = 1; g < 1e4; g *= 10) NEAR(g * viscosity(r, g), 0.7 + g * thinning(g), 1e-6 * (1 + g));
  NEAR(viscosity(r, 1e-3), 0.7 * -expm1(-0.4) / 1e-3 + thinning(1e-3), 1e-4); /* the yield stress in part */
  OK(RheologyDestroy(&r));
  assert_false(RheologyHasYield(NULL));
}

/* With the index 1 there is a Newtonian fluid in each, with a yield stress Bingham's */
static void test_index_of_one(void **state)
{
  Rheology r = create("-flow_rheology power_law -flow_rheology_index 1"), s;

  (void)state;
  for (PetscReal g = 1e-6; g < 1e7; g *= 10) NEAR(viscosity(r, g), MU, 1e-15);
  OK(RheologyDestroy(&r));
  r = create("-flow_rheology carreau -flow_rheology_index 1 -flow_rheology_viscosity_infinity 0.1");
  for (PetscReal g = 1e-6; g < 1e7; g *= 10) NEAR(viscosity(r, g), MU, 1e-15);
  OK(RheologyDestroy(&r));
  s = create("-flow_rheology bingham -flow_rheology_yield 0.2");
  r = create("-flow_rheology herschel_bulkley -flow_rheology_index 1 -flow_rheology_yield 0.2");
  for (PetscReal g = 1e-6; g < 1e7; g *= 10) NEAR(viscosity(r, g) / viscosity(s, g), 1, 1e-14);
  OK(RheologyDestroy(&r));
  OK(RheologyDestroy(&s));
}

/* slope = (dmu/dg)/g against central differences, over eleven decades but at the corners where a power is cut off */
static void test_slopes(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < NLAWS; i++) {
    Rheology r = create(LAWS[i]);

    for (PetscReal g = 1.7e-7; g < 1e4; g *= 10) {
      const PetscReal h = 1e-4 * g, change = (viscosity(r, g + h) - viscosity(r, g - h)) / (2 * h);
      PetscReal       mu, slope;

      RheologyEvaluate(r, g, &mu, &slope);
      NEAR(slope * g * g, change * g, 1e-7 * mu);
    }
    OK(RheologyDestroy(&r));
  }
}

/* More rate, more stress: else a flow would not be determined by what drives it */
static void test_stress_grows(void **state)
{
  (void)state;
  for (PetscInt i = 0; i < NLAWS; i++) {
    Rheology  r    = create(LAWS[i]);
    PetscReal last = 0;

    for (PetscReal g = 1e-9; g < 1e9; g *= 1.5) {
      const PetscReal stress = g * viscosity(r, g);

      if (stress <= last)
        fail_msg("%s: at the rate %g the stress is %g, %g at a lower one", LAWS[i], (double)g, (double)stress,
                 (double)last);
      last = stress;
    }
    OK(RheologyDestroy(&r));
  }
}

/* In stages: softer at rest, as it was where it yields; at last what the options say */
static void test_softening(void **state)
{
  static const char *const law[] =
    {"-flow_rheology bingham -flow_rheology_yield 0.7 -flow_rheology_max_viscosity_ratio 1000",
     "-flow_rheology power_law -flow_rheology_index 0.5"};
  PetscBool less;

  (void)state;
  for (PetscInt i = 0; i < 2; i++) {
    Rheology        r    = create(law[i]);
    const PetscReal rest = viscosity(r, 0), far = viscosity(r, 50);

    OK(RheologySetRegularisation(r, 10, &less));
    assert_true(less);
    NEAR(viscosity(r, 0), (i ? 10 : 11) * MU, 1e-5);
    NEAR(viscosity(r, 50), far, (i ? 1e-5 : 1e-14) * far);
    OK(RheologySetRegularisation(r, 1e5, &less));
    assert_false(less);
    NEAR(viscosity(r, 0), rest, 1e-12 * rest);
    OK(RheologyDestroy(&r));
  }
  OK(RheologySetRegularisation(NULL, 10, &less));
  assert_false(less);
}

static void refuse(const char options[], const char text[], const char more[])
{
  Rheology r;
  Polymer  polymer;
  Eddy     eddy;

  give(options);
  begin_error();
  expect_error(RheologyCreate(MU, &r, &polymer, &eddy), PETSC_ERR_USER_INPUT, text, more, NULL);
  OK(RheologyDestroy(&r));
}

static void test_refused_laws(void **state)
{
  (void)state;
  refuse("-flow_rheology carreau", "needs -flow_rheology_index", NULL);
  refuse("-flow_rheology bingham", "needs -flow_rheology_yield", NULL);
  refuse("-flow_rheology cross -flow_rheology_index 1", "-flow_rheology_index 1", "use -flow_rheology carreau");
  refuse("-flow_rheology carreau -flow_rheology_index 0.5 -flow_rheology_viscosity_infinity 0.3",
         "must be below -flow_viscosity 0.3", NULL);
  refuse("-flow_rheology power_law -flow_rheology_index 0.5 -flow_rheology_viscosity_bounds 2,3",
         "-flow_rheology_viscosity_bounds 2.,3.", NULL);
  refuse("-flow_rheology giesekus -flow_rheology_time 1 -flow_rheology_solvent 0.5", "needs -flow_rheology_mobility",
         NULL);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_power_law),    cmocka_unit_test(test_carreau),
                                     cmocka_unit_test(test_cross),        cmocka_unit_test(test_yield),
                                     cmocka_unit_test(test_index_of_one), cmocka_unit_test(test_slopes),
                                     cmocka_unit_test(test_stress_grows), cmocka_unit_test(test_softening),
                                     cmocka_unit_test(test_refused_laws)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("law", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
