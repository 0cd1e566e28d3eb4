/* Options: conversion, ranges, messages, unused options, defaults, tables, printing. */
/* ranks: 1 2 */
#include "compat.h"
#include "base/opt.h"
#include "raised.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const OptSpec SPECS[] = {
  {"-x", OPT_REAL, "", 0, 1, "", .help = "share"},
  {"-y", OPT_REAL, "m", OPT_POSITIVE, 2, "", .help = "share"},
  {"-z", OPT_REAL, "m", -INFINITY, 2, "3", .help = "share", .when = "-b true", .old = "-zed", .expert = PETSC_TRUE},
  {"-n", OPT_INT, "", OPT_FROM(1), "", .help = "steps"},
  {"-b", OPT_BOOL, "", OPT_ANY, "", .help = "switch"},
  {"-kind", OPT_CHOICE, "", OPT_ANY, "", .help = "treatment of the surface", .choices = "nodal, penalty, aligned",
   .old = "-sort", .old_words = "snap aligned"},
  {"-point", OPT_REALS, "m/s^2", OPT_ANY, "", .help = "gravity"},
  {"-size", OPT_INTS, "", OPT_FROM(1), "", .help = "cells"},
  {"-of_<thing>_size", OPT_REAL, "m", OPT_ANY, "1", .help = "size of a thing", .when = "-things",
   .old = "-of_<thing>_radius", .also = "length, extent"},
  {"-turn", OPT_REAL, "rad", OPT_ANY, "", .help = "angle"},
  {"-turns", OPT_REALS, "rad, rad", OPT_ANY, "", .help = "angles"},
  {"-of_<thing>_mean_size", OPT_INT, "", OPT_ANY, "", .help = "of a thing", .when = "-b | true", .also = "extent",
   .find = "extent, bulk"},
};
OPT_TABLE("test: of options", SPECS)

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
  return OptReal("-flow_viscosity", v);
}

static void reads_values(void **state)
{
  const char *const kinds[] = {"nodal", "penalty", "aligned", NULL};
  PetscReal         v = 0.01, x[2] = {0, 0};
  PetscInt          n = 3, c[2] = {16, 16}, kind = 0, room = 4;
  PetscBool         b       = PETSC_FALSE, found;
  char              dir[32] = "out", *name[4];

  (void)state;
  assert_int_equal(read_viscosity(&v), 0);
  assert_true(v == 0.01);           /* absent: the default stays */
  give("-Flow_Viscosity", "1e-20"); /* upper case is the same name; tiny is positive */
  assert_int_equal(read_viscosity(&v), 0);
  assert_true(v == 1e-20);
  give("-sim_steps", "7");
  assert_int_equal(OptInt("-sim_steps", &n), 0);
  assert_int_equal(n, 7);
  give("-b", NULL);
  assert_int_equal(OptBool("-b", &b), 0);
  assert_true(b);
  give("-b", "Off");
  assert_int_equal(OptBool("-b", &b), 0);
  assert_false(b);
  give("-kind", "Aligned");
  assert_int_equal(OptChoice("-kind", kinds, &kind), 0);
  assert_int_equal(kind, 2);
  give("-output_dir", "out/my run");
  assert_int_equal(OptString("-output_dir", dir, sizeof(dir)), 0);
  assert_string_equal(dir, "out/my run");
  give("-flow_gravity", "0, -981");
  assert_int_equal(OptRealArray("-flow_gravity", 2, x, &found), 0);
  assert_true(found && x[0] == 0 && x[1] == -981);
  assert_int_equal(OptIntArray("-mesh_cells", 2, c, &found), 0);
  assert_true(!found && c[0] == 16);
  give("-mesh_cells", "8,24");
  assert_int_equal(OptIntArray("-mesh_cells", 2, c, NULL), 0);
  assert_true(c[0] == 8 && c[1] == 24);
  give("-particle_groups", "disc, bed");
  assert_int_equal(OptStringArray("-particle_groups", &room, name), 0);
  assert_int_equal(room, 2);
  assert_string_equal(name[1], "bed");
  assert_int_equal(PetscFree(name[0]) || PetscFree(name[1]), 0);
  assert_int_equal(OptHas("-sim_steps", &found), 0);
  assert_true(found);
  assert_int_equal(OptCheckUnused(), 0);
}

static void refuses_bad_reals(void **state)
{
  PetscReal v = 0.01;
  struct {
    const char *value, *text;
  } bad[] = {
    {"-1", "Option -flow_viscosity = -1 is outside its range (> 0) mass/(length time): dynamic viscosity of the fluid"},
    {"0", "= 0 is outside its range (> 0)"},
    {"nan", "= nan is not a finite number"},
    {"inf", "= inf is not a finite number"},
    {"1e999", "= 1e999 is not a finite number"},
    {"thick",
     "= thick is not a number; wanted: dynamic viscosity of the fluid; with -flow_rheology that of the law [mass/(length time)] (> 0)"},
    {"0.1x", "= 0.1x is not a number"},
    {"1,2", "= 1,2 is not a number"},
    {"default", "= default is not a number"},
    {NULL,
     "has no value; wanted: dynamic viscosity of the fluid; with -flow_rheology that of the law [mass/(length time)] (> 0)"},
  };

  (void)state;
  for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
    give("-flow_viscosity", bad[i].value);
    begin_error();
    expect_error(read_viscosity(&v), PETSC_ERR_USER_INPUT, "-flow_viscosity", bad[i].text, NULL);
    assert_true(v == 0.01);
  }
}

static void names_both_bounds(void **state)
{
  PetscReal v = 1;
  PetscInt  n = 3;

  (void)state;
  give("-x", "3");
  begin_error();
  expect_error(OptReal("-x", &v), PETSC_ERR_USER_INPUT, "-x = 3 is outside its range (0 to 1): share", NULL);
  begin_error();
  give("-y", "3");
  expect_error(OptReal("-y", &v), PETSC_ERR_USER_INPUT, "(> 0 and <= 2) m: share", NULL);
  begin_error();
  give("-z", "3");
  v = 3;
  expect_error(OptReal("-z", &v), PETSC_ERR_USER_INPUT, "(<= 2) m", NULL);
  give("-n", "0");
  begin_error();
  expect_error(OptInt("-n", &n), PETSC_ERR_USER_INPUT, "-n = 0 is outside its range (>= 1): steps", NULL);
}

static void refuses_bad_integers(void **state)
{
  PetscInt n = 3;

  (void)state;
  give("-n", "1e3");
  begin_error();
  expect_error(OptInt("-n", &n), PETSC_ERR_USER_INPUT, "-n = 1e3 is not a whole number", "steps (>= 1)", NULL);
  give("-n", "99999999999999999999"); /* PETSc itself would wrap it */
  begin_error();
  expect_error(OptInt("-n", &n), PETSC_ERR_USER_INPUT, "-n = 99999999999999999999 does not fit", NULL);
  assert_int_equal(n, 3);
}

static void refuses_bad_words(void **state)
{
  const char *const kinds[] = {"nodal", "penalty", "aligned", NULL};
  PetscInt          kind    = 1;
  PetscBool         b       = PETSC_TRUE;
  char              dir[8]  = "out";

  (void)state;
  give("-kind", "cut");
  begin_error();
  expect_error(OptChoice("-kind", kinds, &kind), PETSC_ERR_USER_INPUT, "-kind = cut",
               "(known: nodal, penalty, aligned)", NULL);
  assert_int_equal(kind, 1);
  give("-b", "maybe");
  begin_error();
  expect_error(OptBool("-b", &b), PETSC_ERR_USER_INPUT, "-b = maybe", "true", "switch", NULL);
  give("-output_dir", "far/too/long");
  begin_error();
  expect_error(OptString("-output_dir", dir, sizeof(dir)), PETSC_ERR_USER_INPUT,
               "-output_dir has 12 characters, at most 7", NULL);
  assert_string_equal(dir, "out");
}

static void refuses_bad_arrays(void **state)
{
  PetscReal x[2] = {5, 5};
  PetscInt  c[2] = {1, 1}, room = 1;
  char     *name[2];

  (void)state;
  give("-point", "1,2,3");
  begin_error();
  expect_error(OptRealArray("-point", 2, x, NULL), PETSC_ERR_USER_INPUT, "-point = 1,2,3 has 3 values, 2 are wanted",
               "gravity [m/s^2]", NULL);
  give("-size", "8,-2");
  begin_error();
  expect_error(OptIntArray("-size", 2, c, NULL), PETSC_ERR_USER_INPUT,
               "-size (value 2 of 2) = -2 is outside its range (>= 1)", NULL);
  give("-size", "8,");
  begin_error();
  expect_error(OptIntArray("-size", 2, c, NULL), PETSC_ERR_USER_INPUT, "-size (value 2 of 2)", "not a whole number",
               NULL);
  give("-particle_groups", "a,b");
  begin_error();
  expect_error(OptStringArray("-particle_groups", &room, name), PETSC_ERR_USER_INPUT,
               "-particle_groups has 2 values, at most 1", NULL);
  room = 2;
  give("-particle_groups", "a,");
  begin_error();
  expect_error(OptStringArray("-particle_groups", &room, name), PETSC_ERR_USER_INPUT,
               "-particle_groups = a, has an empty entry", NULL);
}

static void names_the_nearest(void **state)
{
  PetscReal v = 0.01, rho = 1;

  (void)state;
  give("-flow_viscosty", "0.2");
  assert_int_equal(read_viscosity(&v), 0);
  assert_int_equal(OptReal("-flow_density", &rho), 0);
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "Unknown or unused option -flow_viscosty = 0.2",
               "did you mean -flow_viscosity?", NULL);
  give("-flow_dnesity", "0.2"); /* a swap is one edit */
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "(2)", "-flow_viscosty", "did you mean -flow_viscosity?",
               "-flow_dnesity", "did you mean -flow_density?", NULL);
}

static void names_solver_options(void **state)
{
  (void)state;
  give("-flow_fieldsplit_pressure_ksp_rtoll", "1e-3");
  give("-ksp_gmres_restrat", "30");
  assert_int_equal(OptDefault("-flow_fieldsplit_pressure_ksp_type", "cg"), 0);
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "did you mean -flow_fieldsplit_pressure_ksp_rtol?",
               "need the prefix of a solver: -flow_fieldsplit_pressure_ksp_gmres_restrat", NULL);
  start(NULL);
  give("-ksp_rtol", "1e-3"); /* spelt right, but no solver read it */
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "-ksp_rtol = 1e-3",
               "need the prefix of a solver: -flow_fieldsplit_pressure_ksp_rtol", NULL);
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
  char *text;
  int   n = 0, wanted = 0;

  (void)state;
  give("-motion", "sin(t) -cos(t)"); /* blanks and dashes in a value */
  give("-flag", NULL);
  assert_int_equal(OptGetAll(&text), 0);
  for (char *line = strtok(text, "\n"); line; line = strtok(NULL, "\n")) {
    n++;
    wanted += !strcmp(line, "-motion sin(t) -cos(t)") + !strcmp(line, "-flag");
  }
  assert_int_equal(PetscFree(text), 0);
  assert_int_equal(n, 2);
  assert_int_equal(wanted, 2);
}

/* One reader and one row must agree: anything else is a mistake of the program. */
static void tells_mistakes_of_the_program(void **state)
{
  const char *const kinds[] = {"nodal", "aligned", NULL};
  PetscReal         v       = 0.1;
  PetscInt          n       = 0;
  PetscBool         on      = PETSC_TRUE;

  (void)state;
  begin_error();
  expect_error(OptReal("-undeclared", &v), PETSC_ERR_PLIB, "-undeclared", "no table declares it", NULL);
  begin_error();
  expect_error(OptInt("-flow_viscosity", &n), PETSC_ERR_PLIB, "-flow_viscosity", "another type", NULL);
  begin_error();
  expect_error(OptReal("-flow_viscosity", &v), PETSC_ERR_PLIB, "default 0.01", "its reader 0.1", NULL);
  begin_error();
  expect_error(OptBool("-sim_adapt", &on), PETSC_ERR_PLIB, "default 'false'", "its reader 'true'", NULL);
  begin_error();
  expect_error(OptChoice("-kind", kinds, &n), PETSC_ERR_PLIB, "'nodal, penalty, aligned'", "'nodal, aligned'", NULL);
}

static void knows_other_modes_and_old_names(void **state)
{
  PetscReal v = 1;

  (void)state;
  give("-z", "1");
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "-z = 1", "is read only with -b true", NULL);
  start(NULL);
  give("-Zed", "1");
  begin_error();
  expect_error(OptCheckRenamed(), PETSC_ERR_USER_INPUT, "Option -Zed = 1 (scene or options file) is now called -z 1",
               NULL);
  start(NULL);
  start(NULL);
  give("-sim_adapt_clf", "1");
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT,
               "did you mean -sim_adapt_cfl? It is read only with -sim_adapt true", NULL);
  start(NULL);
  give("-of_box_mean_size", "1"); /* no thing is known yet */
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "is read only with -b | true", NULL);
  assert_int_equal(OptReal("-of_ball_size", &v), 0);
  begin_error();
  expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, "there is no thing 'box' in this scene (ball)", NULL);
}

static void answers_former_names(void **state)
{
  static const struct {
    const char *name, *value, *wanted;
  } CASES[] = {
    {"-sort", "nodal", "Option -sort = nodal (scene or options file) is now called -kind nodal"},
    {"-sort", "snap", "-sort = snap (scene or options file) is now called -kind aligned"},
    {"-kind", "snap", "-kind = snap (scene or options file) is now called -kind aligned"},
    {"-of_box_radius", "3", "-of_box_radius = 3 (scene or options file) is now called -of_box_size 3"},
  };
  char *lines;

  (void)state;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(CASES); i++) {
    start(NULL);
    give(CASES[i].name, CASES[i].value);
    begin_error();
    expect_error(OptCheckRenamed(), PETSC_ERR_USER_INPUT, CASES[i].wanted, NULL);
  }
  start(NULL);
  give("-kind", "aligned"); /* present names, and what others know, pass */
  give("-of_box_size", "3");
  give("-flow_ksp_rtol", "1e-3");
  assert_int_equal(OptCheckRenamed(), 0);
  give("-sort", "penalty");
  give("-zed", NULL);
  begin_error();
  expect_error(OptCheckRenamed(), PETSC_ERR_USER_INPUT, "(2)", "-sort = penalty", "-kind penalty", "-zed (scene",
               "called -z", NULL);
  assert_int_equal(OptRenameLines("-x 1 2\n-sort snap\n-zed\n-kind nodal\n", &lines), 0);
  assert_string_equal(lines, "-x 1 2\n-kind aligned\n-z\n-kind nodal\n");
  assert_int_equal(PetscFree(lines), 0);
}

static void advises_by_meaning(void **state)
{
  static const struct {
    const char *given, *wanted;
  } CASES[] = {
    {"-flow_nu", "did you mean -flow_viscosity? dynamic viscosity"},
    {"-nu", "did you mean -flow_viscosity? dynamic viscosity"},
    {"-fluid_nu", "did you mean -flow_viscosity? dynamic viscosity"},
    {"-rho", "did you mean -flow_density?"},
    {"-dt", "did you mean -sim_dt?"},
    {"-sim_tend", "did you mean -sim_time?"},
    {"-mu", "did you mean -contact_friction or -flow_viscosity?"},
    {"-gravity", "did you mean -flow_gravity?"},
    {"-grid_cells", "did you mean -mesh_cells?"},
    {"-of_ball_extent", "did you mean -of_ball_size?"},
    {"-of_ball_siez", "did you mean -of_ball_size?"}, /* the spelling comes first */
    {"-pc_type", "need the prefix of a solver: -flow_fieldsplit_pressure_pc_type"},
    {"-ksp_view", "need the prefix of a solver: -flow_fieldsplit_pressure_ksp_view"},
  };
  PetscReal v = 1;

  (void)state;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(CASES); i++) {
    start(NULL);
    assert_int_equal(OptDefault("-flow_fieldsplit_pressure_ksp_type", "cg"), 0);
    assert_int_equal(OptReal("-of_ball_size", &v), 0);
    give(CASES[i].given, "1");
    begin_error();
    expect_error(OptCheckUnused(), PETSC_ERR_USER_INPUT, CASES[i].wanted, NULL);
  }
}

static void advises_words(void **state)
{
  char advice[128];

  (void)state;
  OptAdviseWord("symmetry", "no_slip, slip", "symmetry slip, wall no_slip", advice, sizeof(advice));
  assert_string_equal(advice, "; did you mean slip?");
  OptAdviseWord("Wall", "no_slip, slip", "symmetry slip, wall no_slip", advice, sizeof(advice));
  assert_string_equal(advice, "; did you mean no_slip?");
  OptAdviseWord("no_silp", "no_slip, slip", NULL, advice, sizeof(advice));
  assert_string_equal(advice, "; did you mean no_slip?");
  OptAdviseWord("hot", "no_slip, slip", "symmetry slip", advice, sizeof(advice));
  assert_string_equal(advice, "");
}

/* Degrees, pi, arithmetics: what is read, and what stands in the database afterwards */
static void reads_numbers_as_written(void **state)
{
  static const struct {
    const char *text;
    PetscReal   value;
  } CASES[] = {{"pi/2", 0.5 * PETSC_PI},         {"40 deg", 40 * PETSC_PI / 180},
               {"40deg", 40 * PETSC_PI / 180},   {"40\xc2\xb0", 40 * PETSC_PI / 180},
               {"-90 degrees", -0.5 * PETSC_PI}, {"2*(1 + 0.5)", 3},
               {"(90+90) deg", PETSC_PI}};
  PetscReal v, two[2];
  PetscBool found;
  char      text[64];

  (void)state;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(CASES); i++) {
    v = 0;
    give("-turn", CASES[i].text);
    assert_int_equal(OptPeekReal("-turn", &v, &found), 0);
    assert_true(found && PetscAbsReal(v - CASES[i].value) < 1e-15 * 10);
    v = 0;
    assert_int_equal(OptReal("-turn", &v), 0);
    assert_true(PetscAbsReal(v - CASES[i].value) < 1e-15 * 10);
    assert_int_equal(OptPeek("-turn", text, sizeof(text)), 0);
    assert_true(strtod(text, NULL) == v && !strchr(text, ' '));
  }
  give("-turns", "-30 deg, pi/6");
  assert_int_equal(OptRealArray("-turns", 2, two, NULL), 0);
  assert_true(PetscAbsReal(two[0] + two[1]) < 1e-15 && PetscAbsReal(two[1] - PETSC_PI / 6) < 1e-15);
  give("-flow_viscosity", "40 deg"); /* has no angle */
  v = 0.01;
  begin_error();
  expect_error(read_viscosity(&v), PETSC_ERR_USER_INPUT, "is not a number", NULL);
  for (size_t i = 0; i < 5; i++) {
    give("-turn", ((const char *const[]){"pi/", "a = 3", "1,5", "deg", "1/0"})[i]);
    begin_error();
    expect_error(OptReal("-turn", &v), PETSC_ERR_USER_INPUT, "is not a", NULL);
  }
}

static void fills_placeholders(void **state)
{
  PetscReal v   = 1;
  PetscInt  n   = 0;
  OptSpec   own = {"-of_ball_mean_size", OPT_REAL, "kg", 0, 1, "", .help = "own", .when = "-own"};

  (void)state;
  give("-of_ball_size", "2");
  assert_int_equal(OptReal("-of_ball_size", &v), 0);
  assert_true(v == 2);
  give("-of_ball_mean_size", "3"); /* the row with more text, not the size of a 'ball_mean' */
  assert_int_equal(OptInt("-of_ball_mean_size", &n), 0);
  assert_int_equal(n, 3);
  assert_int_equal(OptDeclareOne(&own), 0);
  begin_error();
  expect_error(OptReal("-of_ball_mean_size", &v), PETSC_ERR_USER_INPUT, "outside its range (0 to 1) kg: own", NULL);
}

static void print(OptFormat format, char text[], size_t len)
{
  FILE *file = tmpfile();

  OptPrint(file, format);
  rewind(file);
  text[fread(text, 1, len - 1, file)] = 0;
  fclose(file);
}

static void prints_tables(void **state)
{
  static char text[200000];

  (void)state;
  print(OPT_PLAIN, text, sizeof(text));
  assert_non_null(
    strstr(text, "\ntest: of options\n-x: share (0 to 1)\n-y: share [m] (> 0 and <= 2)\n-n: steps (>= 1)\n"));
  assert_non_null(strstr(text, "\n-kind: treatment of the surface (one of: nodal, penalty, aligned)\n"));
  assert_non_null(strstr(text, "\n-of_<thing>_size <1>: size of a thing [m]; with -things\n"));
  assert_non_null(strstr(text, "more, for experts: -help expert"));
  print(OPT_PLAIN_EXPERT, text, sizeof(text));
  assert_non_null(strstr(text, "\n-z <3>: share [m] (<= 2); with -b true\n"));
  print(OPT_MARKDOWN, text, sizeof(text));
  assert_non_null(strstr(text, "\n## test: of options\n"));
  assert_non_null(
    strstr(text, "\n| `-of_<thing>_mean_size` | test | | | | of a thing | -b \\| true | extent, bulk |\n"));
  print(OPT_MAN, text, sizeof(text));
  assert_non_null(strstr(text, "\n.TP\n.B \\-z <3>\nshare [m] (<= 2). Read with \\-b true\n"));
}

/* A list is one of numbers, or of none: an expression is not the number that it begins with */
static void peeks_at_lists(void **state)
{
  static const struct {
    const char *text;
    PetscInt    n;
    PetscReal   value[3];
  } list[] = {{"1, -2", 2, {1, -2}},
              {"1+0.5, pi", 2, {1.5, PETSC_PI}},
              {"0, 1+0.5*sin(t)", 0, {0}},
              {"1+0.5*sin(t), 0", 0, {0}},
              {"2*y, 0, 0", 0, {0}},
              {"1, 2, 3", 3, {1, 2, 3}},
              {"1, 2, 3, 4", 0, {0}},
              {"max(x, 2), 1", 0, {0}},
              {"1, 2 + 3*t", 0, {0}},
              {"1, 2x", 0, {0}},
              {"3", 1, {3}},
              {"[1", 0, {0}}};
  PetscReal v[3];
  PetscInt  n;

  (void)state;
  assert_int_equal(OptPeekReals("-point", 3, v, &n), 0);
  assert_int_equal(n, 0);
  for (size_t i = 0; i < sizeof(list) / sizeof(list[0]); i++) {
    give("-point", list[i].text);
    assert_int_equal(OptPeekReals("-point", 3, v, &n), 0);
    if (n != list[i].n) fail_msg("'%s' has %d numbers, not %d", list[i].text, (int)n, (int)list[i].n);
    for (PetscInt k = 0; k < n; k++) assert_true(PetscAbsReal(v[k] - list[i].value[k]) < 1e-15);
  }
}

/* As OptBool reads it, and no more than that */
static void peeks_at_switches(void **state)
{
  static const char *const word[] = {"true", "off", "yes", "0", NULL, "perhaps"};
  const PetscBool          want[] = {PETSC_TRUE, PETSC_FALSE, PETSC_TRUE, PETSC_FALSE, PETSC_TRUE, PETSC_FALSE};
  PetscBool                on     = PETSC_TRUE;

  (void)state;
  assert_int_equal(OptPeekBool("-b", &on), 0); /* absent: stays */
  assert_true(on);
  for (size_t i = 0; i < 6; i++) {
    give("-b", word[i]);
    on = (PetscBool)(i != 5 && !want[i]); /* what is no word for it leaves what was */
    assert_int_equal(OptPeekBool("-b", &on), 0);
    assert_int_equal(on, want[i]);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test_setup_teardown(reads_values, start, stop),
    cmocka_unit_test_setup_teardown(refuses_bad_reals, start, stop),
    cmocka_unit_test_setup_teardown(names_both_bounds, start, stop),
    cmocka_unit_test_setup_teardown(refuses_bad_integers, start, stop),
    cmocka_unit_test_setup_teardown(refuses_bad_words, start, stop),
    cmocka_unit_test_setup_teardown(refuses_bad_arrays, start, stop),
    cmocka_unit_test_setup_teardown(names_the_nearest, start, stop),
    cmocka_unit_test_setup_teardown(names_solver_options, start, stop),
    cmocka_unit_test_setup_teardown(exempts_late_options, start, stop),
    cmocka_unit_test_setup_teardown(shortens_long_lists, start, stop),
    cmocka_unit_test_setup_teardown(default_yields_to_user, start, stop),
    cmocka_unit_test_setup_teardown(says_when_table_is_full, start, stop),
    cmocka_unit_test_setup_teardown(writes_database, start, stop),
    cmocka_unit_test_setup_teardown(prints_tables, start, stop),
    cmocka_unit_test_setup_teardown(tells_mistakes_of_the_program, start, stop),
    cmocka_unit_test_setup_teardown(knows_other_modes_and_old_names, start, stop),
    cmocka_unit_test_setup_teardown(answers_former_names, start, stop),
    cmocka_unit_test_setup_teardown(advises_by_meaning, start, stop),
    cmocka_unit_test_setup_teardown(advises_words, start, stop),
    cmocka_unit_test_setup_teardown(reads_numbers_as_written, start, stop),
    cmocka_unit_test_setup_teardown(fills_placeholders, start, stop),
    cmocka_unit_test_setup_teardown(peeks_at_lists, start, stop),
    cmocka_unit_test_setup_teardown(peeks_at_switches, start, stop),
  };
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  PetscCall(PetscOptionsClear(NULL));
  PetscCall(PetscFinalize());
  return failed;
}
