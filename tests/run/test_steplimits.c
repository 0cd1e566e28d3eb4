/* The table of what limits a step: who is asked in which order, whose word a length is, what is counted, and that a
   room which knows nothing of the table can have a row in it. */
/* ranks: 2 */
#include "core.h"
#include "raised.h"
#include "steplimits.h"

/* A client: wants the step to be shorter (or longer) than a bound, and counts how often it was asked */
typedef struct {
  PetscReal bound;
  PetscInt  asked;
  PetscBool floor;
} Client;

static PetscErrorCode apply(void *ctx, PetscReal *dt)
{
  Client *c = ctx;

  PetscFunctionBeginUser;
  c->asked++;
  *dt = c->floor ? PetscMax(*dt, c->bound) : PetscMin(*dt, c->bound);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscInt add(Limits l, LimitStage stage, const char name[], Client *client)
{
  PetscInt row;

  OK(LimitsAdd(l,
               &(Limit){.stage = stage,
                        .name  = name,
                        .what  = name,
                        .unit  = "",
                        .then  = "",
                        .value = client->bound,
                        .apply = apply,
                        .ctx   = client},
               &row));
  return row;
}

/* By stages, not by the order in which rows came: the floor lifts what the bounds leave, growth is asked after it */
static void test_stages(void **state)
{
  Client growth = {.bound = 3}, floor = {.bound = 0.5, .floor = PETSC_TRUE}, wave = {.bound = 2}, wish = {.bound = 5};
  Limits l;
  PetscReal dt;
  PetscInt  row, cause, row_growth, row_floor, row_wave, row_wish;

  (void)state;
  OK(LimitsCreate(&l));
  row_growth = add(l, LIMIT_CHANGE, "growth", &growth);
  row_floor  = add(l, LIMIT_FLOOR, "min", &floor);
  row_wave   = add(l, LIMIT_BOUND, "capillary_wave", &wave);
  row_wish   = add(l, LIMIT_WANTED, "error", &wish);
  OK(LimitsAsk(l, &dt));
  NEAR(dt, 2, 1e-15);
  OK(LimitsGetDeciding(l, &row, &cause));
  assert_int_equal(row, row_wave);
  assert_int_equal(cause, row_wave);
  wave.bound = 0.1; /* below the floor, which then has the last word, but is not the cause */
  OK(LimitsAsk(l, &dt));
  NEAR(dt, 0.5, 1e-15);
  OK(LimitsGetDeciding(l, &row, &cause));
  assert_int_equal(row, row_floor);
  assert_int_equal(cause, row_wave);
  wave.bound = 9; /* nobody but growth */
  OK(LimitsAsk(l, &dt));
  NEAR(dt, 3, 1e-15);
  OK(LimitsGetDeciding(l, &row, &cause));
  assert_int_equal(row, row_growth);
  assert_int_equal(cause, row_wish);
  assert_string_equal(LimitsName(l, row), "growth");
  assert_int_equal(wave.asked, 3); /* once a step */
  assert_int_equal(growth.asked + floor.asked + wish.asked, 9);
  begin_error();
  expect_error(LimitsAdd(l, &(Limit){.stage = LIMIT_CHECK, .name = "min"}, NULL), PETSC_ERR_PLIB, "'min'", "already",
               NULL);
  OK(LimitsDestroy(&l));
}

/* Steps, refusals and excesses stand with their rows; the shortest step with the row that made it */
static void test_counts(void **state)
{
  Client    wave = {.bound = 2}, wish = {.bound = 5};
  Limits    l;
  PetscReal dt;
  PetscInt  row_wave, row_check, steps, refused, exceeded;

  (void)state;
  OK(LimitsCreate(&l));
  add(l, LIMIT_WANTED, "error", &wish);
  row_wave = add(l, LIMIT_BOUND, "wave", &wave);
  OK(
    LimitsAdd(l, &(Limit){.stage = LIMIT_CHECK, .name = "check", .what = "check", .unit = "", .then = ""}, &row_check));
  for (PetscInt i = 0; i < 5; i++) {
    wave.bound = i < 3 ? 1 : 10; /* three steps by the wave, two by the wish, the last one to meet a time */
    OK(LimitsAsk(l, &dt));
    if (i == 1) OK(LimitsRefuse(l, row_wave));
    if (i == 4) OK(LimitsSetDeciding(l, LIMITS_TIME));
    if (i > 2) OK(LimitsExceed(l, row_check));
    OK(LimitsAccept(l, i == 4 ? 0.25 : dt));
  }
  OK(LimitsCount(l, "wave", &steps, &refused, &exceeded));
  assert_int_equal(100 * steps + 10 * refused + exceeded, 310);
  OK(LimitsCount(l, "error", &steps, &refused, &exceeded));
  assert_int_equal(100 * steps + 10 * refused + exceeded, 100);
  OK(LimitsCount(l, "time", &steps, NULL, NULL));
  assert_int_equal(steps, 1);
  OK(LimitsCount(l, "check", &steps, NULL, &exceeded));
  assert_int_equal(10 * steps + exceeded, 2);
  OK(LimitsCount(l, "elastic_wave", &steps, NULL, NULL));
  assert_int_equal(steps, -1);
  OK(LimitsExceed(NULL, 3)); /* nobody counts */
  OK(LimitsDestroy(&l));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_stages), cmocka_unit_test(test_counts)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("steplimits", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
