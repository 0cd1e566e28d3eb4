/* Options: conversion, ranges, messages, unused options, defaults, listing. */
/* ranks: 1 2 */
#include "compat.h"
#include "base/opt.h"
#include "raised.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

static void give(const char name[], const char value[])
{
  assert_int_equal(PetscOptionsSetValue(NULL, name, value), 0);
}

static int start(void **state)
{
  (void)state;
  return (int)PetscOptionsClear(NULL);
}

static int stop(void **state)
{
  (void)state;
  return (int)OptFinalize();
}

static PetscErrorCode read_viscosity(PetscReal *v)
{
  return OptReal("-flow_viscosity", "dynamic viscosity of the fluid", "Pa s", OPT_POSITIVE, PETSC_MAX_REAL, v);
}

static void reads_values(void **state)
{
  const char *const kinds[] = {"nodal", "penalty", "snap", NULL};
  PetscReal         v = 0.1, x[2] = {0, 0};
  PetscInt          n = 3, c[2] = {1, 1}, kind = 0, room = 4;
  PetscBool         b       = PETSC_FALSE, found;
  char              dir[32] = "out", *name[4];

  (void)state;
  assert_int_equal(read_viscosity(&v), 0);
  assert_true(v == 0.1);            /* absent: the default stays */
  give("-Flow_Viscosity", "1e-20"); /* upper case is the same name; tiny is positive */
  assert_int_equal(read_viscosity(&v), 0);
  assert_true(v == 1e-20);
  give("-sim_steps", "7");
  assert_int_equal(OptInt("-sim_steps", "number of steps", "", 0, PETSC_MAX_INT, &n), 0);
  assert_int_equal(n, 7);
  give("-scene_dry_run", NULL);
  assert_int_equal(OptBool("-scene_dry_run", "stop before step 1", &b), 0);
  assert_true(b);
  give("-scene_dry_run", "Off");
  assert_int_equal(OptBool("-scene_dry_run", "stop before step 1", &b), 0);
  assert_false(b);
  give("-couple_boundary", "Snap");
  assert_int_equal(OptChoice("-couple_boundary", "treatment of the surface", kinds, &kind), 0);
  assert_int_equal(kind, 2);
  give("-output_dir", "out/my run");
  assert_int_equal(OptString("-output_dir", "folder", dir, sizeof(dir)), 0);
  assert_string_equal(dir, "out/my run");
  give("-flow_gravity", "0, -981");
  assert_int_equal(OptRealArray("-flow_gravity", "gravity", "m/s^2", PETSC_MIN_REAL, PETSC_MAX_REAL, 2, x, &found), 0);
  assert_true(found && x[0] == 0 && x[1] == -981);
  assert_int_equal(OptIntArray("-mesh_cells", "cells", "", 1, PETSC_MAX_INT, 2, c, &found), 0);
  assert_true(!found && c[0] == 1);
  give("-mesh_cells", "8,24");
  assert_int_equal(OptIntArray("-mesh_cells", "cells", "", 1, PETSC_MAX_INT, 2, c, NULL), 0);
  assert_true(c[0] == 8 && c[1] == 24);
  give("-particle_groups", "disc, bed");
  assert_int_equal(OptStringArray("-particle_groups", "groups", &room, name), 0);
  assert_int_equal(room, 2);
  assert_string_equal(name[1], "bed");
  assert_int_equal(PetscFree(name[0]) || PetscFree(name[1]), 0);
  assert_int_equal(OptHas("-sim_steps", "number of steps", &found), 0);
  assert_true(found);
  assert_int_equal(OptCheckUnused(), 0);
}

static void refuses_bad_reals(void **state)
{
  PetscReal v = 0.1;
  struct {
    const char *value, *text;
  } bad[] = {
    {"-1", "Option -flow_viscosity = -1 is outside its range (> 0) Pa s: dynamic viscosity of the fluid"},
    {"0", "= 0 is outside its range (> 0)"},
    {"nan", "= nan is not a finite number"},
    {"inf", "= inf is not a finite number"},
    {"1e999", "= 1e999 is not a finite number"},
    {"thick", "= thick is not a number; wanted: dynamic viscosity of the fluid [Pa s] (> 0)"},
    {"0.1x", "= 0.1x is not a number"},
    {"1,2", "= 1,2 is not a number"},
    {"default", "= default is not a number"},
    {NULL, "has no value; wanted: dynamic viscosity of the fluid [Pa s] (> 0)"},
  };

  (void)state;
  for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
    give("-flow_viscosity", bad[i].value);
    begin_error();
    expect_error(read_viscosity(&v), PETSC_ERR_USER_INPUT, "-flow_viscosity", bad[i].text, NULL);
    assert_true(v == 0.1);
  }
}

static void names_both_bounds(void **state)
{
  PetscReal v = 1;
  PetscInt  n = 3;

  (void)state;
  give("-x", "3");
  begin_error();
  expect_error(OptReal("-x", "share", "", 0, 1, &v), PETSC_ERR_USER_INPUT, "-x = 3 is outside its range (0 to 1): share", NULL);
  begin_error();
  expect_error(OptReal("-x", "share", "m", OPT_POSITIVE, 2, &v), PETSC_ERR_USER_INPUT, "(> 0 and <= 2) m: share", NULL);
  begin_error();
  expect_error(OptReal("-x", "share", "m", PETSC_MIN_REAL, 2, &v), PETSC_ERR_USER_INPUT, "(<= 2) m", NULL);
  give("-n", "0");
  begin_error();
  expect_error(OptInt("-n", "steps", "", 1, PETSC_MAX_INT, &n), PETSC_ERR_USER_INPUT, "-n = 0 is outside its range (>= 1): steps", NULL);
}

static void refuses_bad_integers(void **state)
{
  PetscInt n = 3;

  (void)state;
  give("-n", "1e3");
  begin_error();
  expect_error(OptInt("-n", "steps", "", 1, PETSC_MAX_INT, &n), PETSC_ERR_USER_INPUT, "-n = 1e3 is not a whole number", "steps (>= 1)", NULL);
  give("-n", "99999999999999999999"); /* PETSc itself would wrap it */
  begin_error();
  expect_error(OptInt("-n", "steps", "", 1, PETSC_MAX_INT, &n), PETSC_ERR_USER_INPUT, "-n = 99999999999999999999 does not fit", NULL);
  assert_int_equal(n, 3);
}

static void refuses_bad_words(void **state)
{
  const char *const kinds[] = {"nodal", "penalty", "snap", NULL};
  PetscInt          kind    = 1;
  PetscBool         b       = PETSC_TRUE;
  char              dir[8]  = "out";

  (void)state;
  give("-couple_boundary", "cut");
  begin_error();
  expect_error(OptChoice("-couple_boundary", "treatment", kinds, &kind), PETSC_ERR_USER_INPUT, "-couple_boundary = cut",
               "(known: nodal, penalty, snap)", NULL);
  assert_int_equal(kind, 1);
  give("-b", "maybe");
  begin_error();
  expect_error(OptBool("-b", "switch", &b), PETSC_ERR_USER_INPUT, "-b = maybe", "true", "switch", NULL);
  give("-output_dir", "far/too/long");
  begin_error();
  expect_error(OptString("-output_dir", "folder", dir, sizeof(dir)), PETSC_ERR_USER_INPUT, "-output_dir has 12 characters, at most 7", NULL);
  assert_string_equal(dir, "out");
}

static void refuses_bad_arrays(void **state)
{
  PetscReal x[2] = {5, 5};
  PetscInt  c[2] = {1, 1}, room = 1;
  char     *name[2];

  (void)state;
  give("-flow_gravity", "1,2,3");
  begin_error();
  expect_error(OptRealArray("-flow_gravity", "gravity", "m/s^2", PETSC_MIN_REAL, PETSC_MAX_REAL, 2, x, NULL), PETSC_ERR_USER_INPUT,
               "-flow_gravity = 1,2,3 has 3 values, 2 are wanted", "gravity [m/s^2]", NULL);
  give("-mesh_cells", "8,-2");
  begin_error();
  expect_error(OptIntArray("-mesh_cells", "cells", "", 1, PETSC_MAX_INT, 2, c, NULL), PETSC_ERR_USER_INPUT,
               "-mesh_cells (value 2 of 2) = -2 is outside its range (>= 1)", NULL);
  give("-mesh_cells", "8,");
  begin_error();
  expect_error(OptIntArray("-mesh_cells", "cells", "", 1, PETSC_MAX_INT, 2, c, NULL), PETSC_ERR_USER_INPUT, "-mesh_cells (value 2 of 2)",
               "not a whole number", NULL);
  give("-particle_groups", "a,b");
  begin_error();
  expect_error(OptStringArray("-particle_groups", "groups", &room, name), PETSC_ERR_USER_INPUT, "-particle_groups has 2 values, at most 1", NULL);
  room = 2;
  give("-particle_groups", "a,");
  begin_error();
  expect_error(OptStringArray("-particle_groups", "groups", &room, name), PETSC_ERR_USER_INPUT, "-particle_groups = a, has an empty entry", NULL);
}

static void names_the_nearest(void **state)
{
  PetscReal v = 0.1, rho = 1;

  (void)state;
  give("-flow_viscosty", "0.2");
  assert_int_equal(read_viscosity(&v), 0);
  assert_int_equal(OptReal("-flow_density", "density", "kg/m^3", OPT_POSITIVE, PETSC_MAX_REAL, &rho), 0);
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "Unknown or unused option -flow_viscosty = 0.2", "did you mean -flow_viscosity?", NULL);
  give("-flow_dnesity", "0.2"); /* a swap is one edit */
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "(2)", "-flow_viscosty", "did you mean -flow_viscosity?", "-flow_dnesity",
               "did you mean -flow_density?", NULL);
}

static void names_solver_options(void **state)
{
  (void)state;
  give("-flow_fieldsplit_pressure_ksp_rtoll", "1e-3");
  give("-ksp_gmres_restrat", "30");
  assert_int_equal(OptDefault("-flow_fieldsplit_pressure_ksp_type", "cg"), 0);
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "did you mean -flow_fieldsplit_pressure_ksp_rtol?", "did you mean -ksp_gmres_restart?", NULL);
  start(NULL);
  give("-ksp_rtol", "1e-3"); /* spelt right, but no solver read it */
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "-ksp_rtol = 1e-3", "nothing in this run reads", NULL);
}

static void exempts_late_options(void **state)
{
  (void)state;
  give("-log_view", ":x.csv:ascii_csv");
  give("-options_left", NULL);
  give("-malloc_dump", NULL);
  give("-info", NULL);
  give("-objects_dump", NULL);
  assert_int_equal(OptCheckUnused(), 0);
  give("-logg_view", NULL);
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "-logg_view", "did you mean -log_view?", NULL);
}

static void shortens_long_lists(void **state)
{
  char name[64];

  (void)state;
  for (int i = 0; i < 60; i++) {
    snprintf(name, sizeof(name), "-surely_not_an_option_of_anything_%d", i);
    give(name, "1");
  }
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "(60)", "more", NULL);
  assert_true(strlen(raised) < 2000);
}

static void default_yields_to_user(void **state)
{
  char      value[32] = "";
  PetscBool found;

  (void)state;
  give("-flow_ksp_rtol", "1e-3");
  assert_int_equal(OptDefault("-flow_ksp_rtol", "1e-6"), 0);
  begin_error(); /* the look at the database must not count as reading it */
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "-flow_ksp_rtol", "nothing in this run reads", NULL);
  assert_int_equal(PetscOptionsGetString(NULL, NULL, "-flow_ksp_rtol", value, sizeof(value), &found), 0);
  assert_string_equal(value, "1e-3");
  assert_int_equal(OptDefault("-flow_ksp_type", "gmres"), 0);
  assert_int_equal(OptDefault("-flow_ksp_type", "fgmres"), 0);
  assert_int_equal(OptCheckUnused(), 0); /* a default of ours that nobody reads is no mistake */
  assert_int_equal(PetscOptionsGetString(NULL, NULL, "-flow_ksp_type", value, sizeof(value), &found), 0);
  assert_string_equal(value, "fgmres");
}

static void says_when_table_is_full(void **state)
{
  char name[32];

  (void)state;
  for (int i = 0; i < 505; i++) {
    snprintf(name, sizeof(name), "-particle_a_%d", i);
    give(name, "1");
  }
#if PETSC_VERSION_LT(3, 20, 0)
  begin_error();
  expect_error(OptDefault("-flow_ksp_type", "fgmres"), PETSC_ERR_USER_INPUT, "505", "512", "table file", NULL);
#else
  assert_int_equal(OptDefault("-flow_ksp_type", "fgmres"), 0);
#endif
}

static void writes_database(void **state)
{
  char        line[128];
  FILE       *file = tmpfile();
  int         n = 0, wanted = 0;
  PetscMPIInt rank;

  (void)state;
  assert_int_equal(MPI_Comm_rank(PETSC_COMM_WORLD, &rank), 0);
  give("-motion", "sin(t) -cos(t)"); /* blanks and dashes in a value */
  give("-flag", NULL);
  assert_int_equal(OptWrite(rank ? NULL : file), 0);
  rewind(file);
  while (fgets(line, sizeof(line), file)) {
    n++;
    wanted += !strcmp(line, "-motion sin(t) -cos(t)\n") + !strcmp(line, "-flag\n");
  }
  fclose(file);
  assert_int_equal(n, rank ? 0 : 2);
  assert_int_equal(wanted, rank ? 0 : 2);
}

static char printed[512]; /* what -help prints */

static PetscErrorCode record_help(MPI_Comm comm, const char format[], ...)
{
  va_list args;
  size_t  n = strlen(printed);

  (void)comm;
  va_start(args, format);
  vsnprintf(printed + n, sizeof(printed) - n, format, args);
  va_end(args);
  return PETSC_SUCCESS;
}

static void prints_help_once(void **state)
{
  PetscErrorCode (*keep)(MPI_Comm, const char[], ...) = PetscHelpPrintf;
  PetscReal v                                         = 0.1;
  PetscBool found;

  (void)state;
  give("-help", NULL);
  PetscHelpPrintf = record_help;
  assert_int_equal(OptReal("-flow_viscosity", "dynamic viscosity", "Pa s", OPT_POSITIVE, PETSC_MAX_REAL, &v), 0);
  assert_int_equal(OptReal("-flow_viscosity", "dynamic viscosity", "Pa s", OPT_POSITIVE, PETSC_MAX_REAL, &v), 0);
  assert_int_equal(OptHas("-sim_restart", "continue a run", &found), 0); /* no default to show */
  PetscHelpPrintf = keep;
  assert_string_equal(printed, "-flow_viscosity <0.1>: dynamic viscosity [Pa s] (> 0)\n-sim_restart: continue a run\n");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup_teardown(reads_values, start, stop),           cmocka_unit_test_setup_teardown(refuses_bad_reals, start, stop),
    cmocka_unit_test_setup_teardown(names_both_bounds, start, stop),      cmocka_unit_test_setup_teardown(refuses_bad_integers, start, stop),
    cmocka_unit_test_setup_teardown(refuses_bad_words, start, stop),      cmocka_unit_test_setup_teardown(refuses_bad_arrays, start, stop),
    cmocka_unit_test_setup_teardown(names_the_nearest, start, stop),      cmocka_unit_test_setup_teardown(names_solver_options, start, stop),
    cmocka_unit_test_setup_teardown(exempts_late_options, start, stop),   cmocka_unit_test_setup_teardown(shortens_long_lists, start, stop),
    cmocka_unit_test_setup_teardown(default_yields_to_user, start, stop), cmocka_unit_test_setup_teardown(says_when_table_is_full, start, stop),
    cmocka_unit_test_setup_teardown(writes_database, start, stop),        cmocka_unit_test_setup_teardown(prints_help_once, start, stop),
  };
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  PetscCall(PetscOptionsClear(NULL));
  PetscCall(PetscFinalize());
  return failed;
}
