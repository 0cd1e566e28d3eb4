/* Expressions: numbers stay numbers, values, what is kept, integrals, messages with the place of the fault. */
/* ranks: 1 2 */
#include "base/expr.h"
#include "core.h"
#include "raised.h"

static const OptSpec SPECS[] = {
  {"-test_field", OPT_REALS, "m/s", OPT_ANY, "0", .help = "a field", .variables = "x, y, z, t"},
  {"-test_mixture", OPT_REALS, "Pa s", OPT_ANY, "0", .help = "of scalars", .variables = "x, y, z, t, scalars"},
  {"-test_course", OPT_REALS, "m/s", OPT_ANY, "0", .help = "a course", .variables = "t"},
};
OPT_TABLE("test: of expressions", SPECS)

static PetscErrorCode get(const char name[], const char text[], PetscInt dim, PetscInt n, PetscReal value[], Expr *e)
{
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsClear(NULL));
  PetscCall(PetscOptionsSetValue(NULL, name, text));
  PetscCall(ExprRead(name, dim, n, value, e, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void fields_have_names_of_their_own(void **state)
{
  PetscReal v[1];
  Expr      e;

  (void)state;
  OK(ExprNameFields(2, (const char *const[]){"heat", "t"}));
  OK(get("-test_mixture", "1 + heat", 2, 1, v, &e));
  assert_true(ExprUsesField(e, 0) && !ExprUsesField(e, 1) && ExprUsesFields(e) && !ExprUsesFields(NULL));
  OK(ExprDestroy(&e));
  OK(get("-test_course", "2*t", 2, 1, v, &e));
  OK(ExprDestroy(&e));
  begin_error();
  expect_error(get("-test_mixture", "1 + heat*t", 2, 1, v, &e), PETSC_ERR_USER_INPUT,
               "Option -test_mixture = 1 + heat*t is wrong at character 1: 't' is a scalar, too", NULL);
  OK(ExprNameFields(0, NULL));
}

static void numbers_stay_numbers(void **state)
{
  const char *const text[] = {"1, -2.5e3", "1 -2.5e3", "2-1, -2500", "cos(0), -2.5*10^3",
                              "(1>0 ? 1 : 2), -min(2500, 3000)"};
  PetscReal         v[2]   = {7, 8};
  PetscBool         found;
  Expr              e;

  (void)state;
  for (size_t i = 0; i < sizeof(text) / sizeof(text[0]); i++) {
    v[0] = v[1] = 0;
    OK(get("-test_field", text[i], 2, 2, v, &e));
    assert_null(e);
    NEAR(v[0], 1, 1e-15);
    NEAR(v[1], -2500, 1e-12);
  }
  OK(PetscOptionsClear(NULL));
  OK(ExprRead("-test_field", 2, 2, (PetscReal[]){0, 0}, &e, &found));
  assert_true(!e && !found);
}

static void values_at_points(void **state)
{
  const PetscReal  x[] = {0.5, 2, 3, -1, 0.25, 4};
  PetscReal        v[6];
  const PetscReal *kept, *again;
  Expr             e;

  (void)state;
  OK(get("-test_field", "-x^2 + atan2(y, z), 5, y * t", 3, 3, v, &e));
  assert_string_equal(ExprText(e), "(-x^2+atan2(y,z)),5,y*t");
  assert_true(ExprUsesTime(e) && ExprUsesPosition(e) && ExprValueUsesTime(e, 2) && !ExprValueUsesTime(e, 0));
  OK(ExprEvaluate(e, 3, 2, x, v));
  for (PetscInt p = 0; p < 2; p++) {
    const PetscReal *a = x + 3 * p;

    NEAR(v[3 * p], -a[0] * a[0] + atan2(a[1], a[2]), 1e-15);
    NEAR(v[3 * p + 1], 5, 0);
    NEAR(v[3 * p + 2], 3 * a[1], 1e-15);
  }
  OK(ExprKeep(e, 3, 2, x, &kept));
  for (PetscInt i = 0; i < 6; i++) NEAR(kept[i], v[i], 0);
  OK(ExprKeep(e, 4, 2, x, &again));
  NEAR(again[2], 8, 1e-15);
  OK(ExprDestroy(&e));
  OK(get("-test_field", "x, y", 2, 2, v, &e)); /* as the text in the database is read again */
  OK(ExprKeep(e, 0, 2, x, &kept));
  ((PetscReal *)(size_t)kept)[0] = 17;
  OK(ExprKeep(e, 1, 2, x, &again)); /* neither t nor other points: nothing is evaluated */
  NEAR(again[0], 17, 0);
  OK(ExprKeep(e, 1, 2, x + 1, &again));
  NEAR(again[0], 2, 0);
  OK(ExprDestroy(&e));
}

static void integrals(void **state)
{
  PetscReal v[2], once[2];
  Expr      e;

  (void)state;
  OK(get("-test_course", "cos(50*t)*exp(-t), abs(sin(t))", 2, 2, v, &e));
  for (PetscReal t = 0; t < 12; t += 2.9) {
    const PetscInt  turns  = (PetscInt)(t / PETSC_PI);
    const PetscReal damped = (1 + PetscExpReal(-t) * (50 * PetscSinReal(50 * t) - PetscCosReal(50 * t))) / 2501;

    OK(ExprIntegrate(e, t, v));
    NEAR(v[0], damped, 1e-13);
    NEAR(v[1], 2 * turns + 1 - PetscCosReal(t - turns * PETSC_PI), 1e-7);
  }
  OK(ExprIntegrate(e, 5, once));
  for (PetscReal t = 1; t < 4; t++) OK(ExprIntegrate(e, t, v));
  OK(ExprIntegrate(e, 5, v));
  assert_true(v[0] == once[0] && v[1] == once[1]);
  OK(ExprDestroy(&e));
}

static void faults_have_a_place(void **state)
{
  const struct {
    const char *option, *text, *message;
    PetscInt    dim;
  } bad[] = {
    {"-test_field", "0, sin(q*x)", "Option -test_field = 0, sin(q*x) is wrong at character 8: Unexpected token 'q", 2},
    {"-test_field", "x, z", "= x, z is wrong at character 4: ", 2},
    {"-test_field", "x, 2*(1+y", "is wrong at character 6: this bracket is not closed (known: ", 2},
    {"-test_field", "x, ", "is wrong at character 3: an expression is missing", 2},
    {"-test_field", "x=3, y", "is wrong at character 2: '=' sets something", 2},
    {"-test_field", "fast, y", "is wrong at character 1: ", 2},
    {"-test_field", "x, \"y\"", "is wrong at character ", 2},
    {"-test_field", "x, y, 1", "has 3 values, 2 are wanted", 2},
    {"-test_field", "max(x, y)", "has 1 value, 2 are wanted", 2},
    {"-test_field", "1, 2, 3", "has 3 values, 2 are wanted", 2},
    {"-test_course", "t, x", "is wrong at character 4: Unexpected token 'x' (known: numbers, t, pi,", 2},
    {"-test_field", "1/0, 1", "value 1 is inf", 2},
  };

  (void)state;
  for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
    PetscReal v[3] = {0, 0, 0};
    Expr      e;

    begin_error();
    expect_error(get(bad[i].option, bad[i].text, bad[i].dim, 2, v, &e), PETSC_ERR_USER_INPUT, bad[i].message,
                 bad[i].option, NULL);
  }
}

static void not_finite(void **state)
{
  const PetscReal x[] = {1, 1, -1, 1};
  PetscReal       v[4];
  Expr            e;

  (void)state;
  OK(get("-test_field", "y, sqrt(x)", 2, 2, v, &e));
  begin_error();
  expect_error(ExprEvaluate(e, 0, 2, x, v), PETSC_ERR_USER_INPUT, "Option -test_field = y,sqrt(x): value 2 is",
               "at x = -1, y = 1, t = 0", NULL);
  OK(ExprDestroy(&e));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(numbers_stay_numbers),
                                     cmocka_unit_test(values_at_points),
                                     cmocka_unit_test(integrals),
                                     cmocka_unit_test(faults_have_a_place),
                                     cmocka_unit_test(fields_have_names_of_their_own),
                                     cmocka_unit_test(not_finite)};

  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("expr", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
