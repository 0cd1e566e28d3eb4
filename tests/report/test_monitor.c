/* ranks: 1 2 3
   Reports of a made-up run of 10 steps with a free disc and a fixed one: every file is read back, progress lines are
   counted, and what can go wrong (directory, range of bodies) must name its option. */
#include "compat.h"
#include "bodies/write.h"
#include "report/monitor.h"
#include "files.h"
#include "base/log.h"
#include "base/opt.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <sys/stat.h>
#include <unistd.h>

#define OK(call) assert_int_equal((call), 0)
#define STEPS    10
static char root[PETSC_MAX_PATH_LEN];
static char message[2048];

static PetscErrorCode record_message(MPI_Comm comm, int line, const char *fun, const char *file, PetscErrorCode n,
                                     PetscErrorType p, const char *mess, void *ctx)
{
  (void)comm, (void)line, (void)fun, (void)file, (void)ctx;
  if (p == PETSC_ERROR_INITIAL) snprintf(message, sizeof(message), "%s", mess);
  return n;
}

static void set_option(const char name[], const char value[])
{
  OK(value ? PetscOptionsSetValue(NULL, name, value) : PetscOptionsClearValue(NULL, name));
}

static PetscMPIInt my_rank(void)
{
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  return rank;
}

/* ---- the made-up run ---- */

static Bodies create_bodies(void)
{
  const PetscReal lower[3] = {0, 0, 0}, upper[3] = {4, 4, 0};
  Bodies          b;

  OK(BodiesCreate(2, lower, upper, &b));
  return b;
}

static void set_discs(void)
{
  set_option("-particle_bed_shape", NULL);
  set_option("-particle_groups", "disc,post");
  set_option("-particle_disc_shape", "circle");
  set_option("-particle_disc_radius", "0.125");
  set_option("-particle_disc_density", "1.25");
  set_option("-particle_disc_position", "1,3");
  set_option("-particle_post_shape", "circle");
  set_option("-particle_post_radius", "0.25");
  set_option("-particle_post_free", "none");
  set_option("-particle_post_position", "3,1");
}

/* Speed of the free disc has its peak 7.5 at step 4, its overlap 10 % of the diameter at step 5; the post is driven
   faster than all */
static void set_state(BodyArrays *b, PetscInt step)
{
  b->u[0][0]      = step == 4 ? 4.5 : 0;
  b->u[0][1]      = step == 4 ? -6 : 0.5;
  b->x[0][1]      = 3 - 0.25 * step;
  b->angle[0]     = 0.5 * step;
  b->gap[0]       = step == 5 ? -0.025 : PETSC_MAX_REAL;
  b->gap[1]       = 0.01;
  b->force[0][1]  = 2.5;
  b->torque[0][2] = -1.5;
  b->u[1][1]      = -100;
}

static MonitorStep make_step(PetscInt step)
{
  return (MonitorStep){.step             = step,
                       .time             = 0.125 * step,
                       .dt               = 0.125,
                       .cfl              = 0.5,
                       .outer_iterations = step == 7 ? 9 : 5,
                       .divergence       = 1e-9,
                       .gradient         = 4e-6,
                       .speed            = 0.75,
                       .kinetic_energy   = 2.25,
                       .momentum_error   = -1e-11,
                       .seconds          = 0.01};
}

static Monitor start_monitor(const char name[], Bodies bodies, char dir[])
{
  Monitor m;

  OK(PetscSNPrintf(dir, PETSC_MAX_PATH_LEN, "%s/%s", root, name));
  if (my_rank() == 0) OK(PetscMkdir(dir));
  OK(PetscBarrier(NULL));
  OK(MonitorCreate(PETSC_COMM_WORLD, bodies, &m));
  OK(MonitorOpen(m, dir));
  return m;
}

/* Run all steps with the options of the caller, leaving the files in dir */
static void run_steps(const char name[], const char scene[], char dir[])
{
  Bodies      bodies = create_bodies();
  BodyArrays *state;
  Monitor     m = start_monitor(name, bodies, dir);
  PetscBool   measure;
  Mat         S;

  OK(MatCreateConstantDiagonal(PETSC_COMM_WORLD, 100, 100, PETSC_DETERMINE, PETSC_DETERMINE, 2, &S));
  OK(BodiesGetArrays(bodies, &state));
  for (PetscInt step = 1; step <= STEPS; step++) {
    MonitorStep s = make_step(step);

    set_state(state, step);
    OK(MonitorPhaseSeconds(m, MONITOR_NSE, 0.25));
    OK(MonitorPhaseSeconds(m, MONITOR_PARTICLE, 0.125 * step));
    OK(MonitorWrite(m, &s, 0.125 * STEPS));
  }
  OK(MonitorPhaseSeconds(m, MONITOR_SETUP, 2));
  OK(MonitorBalance(m, "cells", 100));
  OK(MonitorBalance(m, "cells", 10. * (1 + my_rank())));
  OK(MonitorEnd(m, &measure));
  if (measure) OK(MonitorBandwidth(m, S));
  OK(MatDestroy(&S));
  OK(MonitorQuantity(m, "cd", 1));
  OK(MonitorQuantity(m, "cd", 3.25));
  OK(MonitorQuantity(m, "lost", 1 / (PetscReal)0));
  OK(MonitorFinish(m, scene, 64, 700, STEPS, 0.125 * STEPS));
  OK(MonitorDestroy(&m));
  assert_null(m);
  OK(BodiesDestroy(&bodies));
  OK(PetscBarrier(NULL));
}

/* ---- reading ---- */

static char *read_text(const char dir[], const char name[])
{
  static char text[65536];
  char        path[PETSC_MAX_PATH_LEN];
  FILE       *f;

  OK(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, name));
  f = fopen(path, "r");
  if (!f) fail_msg("%s does not exist", path);
  text[fread(text, 1, sizeof(text) - 1, f)] = 0;
  fclose(f);
  return text;
}

static PetscInt count_lines(const char text[])
{
  PetscInt n = 0;

  for (; *text; text++) n += *text == '\n';
  return n;
}

static const char *line_number(const char text[], PetscInt n)
{
  for (; n && text; n--) {
    text = strchr(text, '\n');
    if (text) text++;
  }
  assert_non_null(text);
  return text;
}

/* Number behind "name": in JSON text */
static PetscReal json_number(const char text[], const char name[])
{
  char        key[80];
  const char *found;

  snprintf(key, sizeof(key), "\"%s\": ", name);
  found = strstr(text, key);
  if (!found) fail_msg("summary.json has no %s:\n%s", key, text);
  return (PetscReal)atof(found + strlen(key));
}

static void assert_close(const char what[], PetscReal value, PetscReal wanted)
{
  if (PetscAbsReal(value - wanted) > 1e-9 * (1 + PetscAbsReal(wanted)))
    fail_msg("%s = %.12g, wanted %.12g", what, (double)value, (double)wanted);
}

static void assert_starts(const char text[], const char wanted[])
{
  if (strncmp(text, wanted, strlen(wanted))) fail_msg("wanted:\n%s\nfound:\n%.200s", wanted, text);
}

/* ---- cases ---- */

/* Columns of other modules follow the monitor's own, and hold the last value that was set */
static void columns_are_added(void **state)
{
  Bodies      bodies = create_bodies();
  Monitor     m;
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;
  PetscInt    drag, lift;

  (void)state;
  OK(PetscSNPrintf(dir, PETSC_MAX_PATH_LEN, "%s/columns", root));
  if (my_rank() == 0) OK(PetscMkdir(dir));
  OK(PetscBarrier(NULL));
  OK(MonitorCreate(PETSC_COMM_WORLD, bodies, &m));
  OK(MonitorAddColumn(m, "cd_disc", &drag));
  OK(MonitorAddColumn(m, "dp", &lift));
  OK(MonitorOpen(m, dir));
  for (PetscInt step = 1; step <= 2; step++) {
    MonitorStep s = make_step(step);

    if (step == 1) OK(MonitorSetColumn(m, lift, 0.1));
    OK(MonitorSetColumn(m, drag, 1.0 / step));
    OK(MonitorWrite(m, &s, 0.25));
  }
  OK(MonitorDestroy(&m));
  OK(BodiesDestroy(&bodies));
  text = read_text(dir, "series.csv");
  if (my_rank() == 0) {
    for (PetscInt line = 0; line < 3; line++) {
      const char *const want[] = {",cd_disc,dp\n", ",1,0.1\n", ",0.5,0.1\n"}, *at = line_number(text, line),
                        *end = strchr(at, '\n') + 1;

      assert_memory_equal(end - strlen(want[line]), want[line], strlen(want[line]));
    }
  }
}

static void files_hold_every_step(void **state)
{
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;

  (void)state;
  run_steps("every", "box", dir);
  text = read_text(dir, "series.csv");
  assert_starts(text,
                "step,time,dt,cfl,outer_iterations,divergence,kinetic_energy,momentum_error,seconds,seconds_nse,seconds_force,seconds_particle,"
                "bodies_energy,contact_energy,contact_work\n"
                "1,0.125,0.125,0.5,5,1e-09,2.25,-1e-11,0.01,0.25,0,0.125,0,0,0\n2,0.25,0.125,0.5,5,1e-09,2.25,-1e-11,0.01,0.25,0,0.25,0,0,0\n");
  assert_int_equal(count_lines(text), 1 + STEPS);
  text = read_text(dir, "bodies.csv");
  assert_starts(text,
                "step,time,body,group,x,y,z,angle,u,v,w,omega_x,omega_y,omega_z,force_x,force_y,force_z,torque_x,torque_y,torque_z,gap,radius,size,density,"
                "contact_force_x,contact_force_y,contact_force_z,contact_torque_x,contact_torque_y,contact_torque_z\n");
  assert_int_equal(count_lines(text), 1 + 2 * STEPS);
  assert_starts(line_number(text, 1),
                "1,0.125,0,disc,1,2.75,0,0.5,0,0.5,0,0,0,0,0,2.5,0,0,0,-1.5,inf,0.125,1,1.25,0,0,0,0,0,0\n1,0.125,1,post,3,1,0,0,0,-100,0,0,0,0,0,0,0,0,0,0,0.01,0.25,1,1,0,0,0,0,0,0\n");
  assert_starts(line_number(text, 1 + 2 * 4),
                "5,0.625,0,disc,1,1.75,0,2.5,0,0.5,0,0,0,0,0,2.5,0,0,0,-1.5,-0.025,0.125,1,1.25,0,0,0,0,0,0\n");
}

/* Lines every third step and at the end; the peaks lie between them and are not lost */
static void unreported_steps_are_tracked(void **state)
{
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;

  (void)state;
  set_option("-output_series", "3");
  run_steps("third", "box", dir);
  set_option("-output_series", NULL);
  text = read_text(dir, "series.csv");
  assert_int_equal(count_lines(text), 1 + 4);
  /* seconds of that step alone */
  assert_starts(line_number(text, 1), "3,0.375,0.125,0.5,5,1e-09,2.25,-1e-11,0.01,0.25,0,0.375,0,0,0\n");
  assert_starts(line_number(text, 3), "9,");
  assert_starts(line_number(text, 4), "10,1.25,");
  text = read_text(dir, "summary.json");
  assert_close("fall_speed_max", json_number(text, "fall_speed_max"), 6);
  assert_close("speed_max", json_number(text, "speed_max"), 7.5);
  assert_close("overlap_max", json_number(text, "overlap_max"), 0.1);
  assert_close("mean", json_number(text, "mean"), 5.4);
  assert_close("max", json_number(text, "max"), 9);
}

static void summary_has_its_keys(void **state)
{
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;
  PetscMPIInt size;

  (void)state;
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  run_steps("summary", "a \"quoted\" \\ name", dir);
  text = read_text(dir, "summary.json");
  assert_starts(text, "{\n  \"scene\": \"a \\\"quoted\\\" \\\\ name\",\n");
  assert_close("ranks", json_number(text, "ranks"), size);
  assert_close("cells", json_number(text, "cells"), 64);
  assert_close("unknowns", json_number(text, "unknowns"), 700);
  assert_close("steps", json_number(text, "steps"), STEPS);
  assert_close("time_end", json_number(text, "time_end"), 0.125 * STEPS);
  assert_close("setup", json_number(text, "setup"), 2);
  assert_close("nse", json_number(text, "nse"), 2.5);
  assert_close("force", json_number(text, "force"), 0);
  assert_close("cd", json_number(text, "cd"), 3.25); /* set twice: the second value */
  assert_true(json_number(text, "total") >= 2.01);   /* set-up and the first step */
  assert_true(json_number(text, "memory_mb") > size);
  for (const char **key = (const char *[]){"\"commit\": \"", "\"versions\": {\"tumble\": \"", "\"petsc\": \"3.",
                                           "\"mpi\": \"", "\"particle\": ", "\"output\": ", "\"lost\": null", NULL};
       *key; key++) {
    if (!strstr(text, *key)) fail_msg("summary.json has no %s:\n%s", *key, text);
  }
}

static void balance_is_over_the_ranks(void **state)
{
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;
  PetscMPIInt size;

  (void)state;
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  run_steps("balance", "box", dir);
  text = strstr(read_text(dir, "summary.json"), "\"balance\"");
  assert_non_null(text);
  assert_close("min", json_number(text, "min"), 10);
  assert_close("mean", json_number(text, "mean"), 5. * (1 + size));
  assert_close("max", json_number(text, "max"), 10. * size);
}

/* Only on request; between a slow memory and the registers of a core */
static void bandwidth_on_request(void **state)
{
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;

  (void)state;
  run_steps("without", "box", dir);
  assert_null(strstr(read_text(dir, "summary.json"), "bandwidth"));
  set_option("-output_bandwidth", "true");
  run_steps("with", "box", dir);
  set_option("-output_bandwidth", NULL);
  text = read_text(dir, "summary.json");
  assert_true(json_number(text, "triad_one") > 1e8 && json_number(text, "triad_one") < 1e12);
  assert_true(json_number(text, "triad_all") > 1e8 && json_number(text, "triad_all") < 1e13);
  assert_true(json_number(text, "sweep") > 1e-9 && json_number(text, "sweep") < 1);
}

static void options_are_kept(void **state)
{
  char        dir[PETSC_MAX_PATH_LEN];
  const char *text;
  Bodies      bodies = create_bodies();
  Monitor     m      = start_monitor("options", bodies, dir);

  (void)state;
  OK(PetscBarrier(NULL));
  text = read_text(dir, "options.txt"); /* before any step */
  assert_starts(text, "# tumble ");
  assert_non_null(strstr(text, "PETSc 3."));
  assert_non_null(strstr(text, "-particle_disc_density 1.25"));
  OK(MonitorDestroy(&m));
  OK(BodiesDestroy(&bodies));
}

/* Lines of progress of n steps; the heading comes once, the last line says that nothing is left, and the divergence as
   a part of the velocity gradient */
static PetscInt count_progress(PetscInt n, const char name[], const char unit[])
{
  char     dir[PETSC_MAX_PATH_LEN], path[PETSC_MAX_PATH_LEN];
  Bodies   bodies = create_bodies();
  Monitor  m;
  FILE    *terminal = PETSC_STDOUT;
  char    *text;
  PetscInt lines;

  set_option("-output_series", "1000");
  m = start_monitor(name, bodies, dir);
  OK(PetscSNPrintf(path, sizeof(path), "%s/stdout", dir));
  if (my_rank() == 0) PETSC_STDOUT = fopen(path, "w");
  for (PetscInt step = 1; step <= n; step++) {
    MonitorStep s = make_step(step);

    OK(MonitorWrite(m, &s, 0.125 * n));
  }
  if (my_rank() == 0) fclose(PETSC_STDOUT);
  PETSC_STDOUT = terminal;
  set_option("-output_series", NULL);
  OK(MonitorDestroy(&m));
  OK(BodiesDestroy(&bodies));
  OK(PetscBarrier(NULL));
  text  = read_text(dir, "stdout");
  lines = count_lines(text) - 1;
  assert_non_null(strstr(text, unit));
  assert_null(strstr(strstr(text, unit) + 1, unit));
  assert_non_null(strstr(line_number(text, lines), " 100 %       0 s\n"));
  assert_non_null(strstr(line_number(text, lines), "      0.5           0.75      2.5e-04 "));
  assert_null(strstr(text, "momentum error"));
  return lines;
}

static void progress_fits_on_a_page(void **state)
{
  const PetscInt few  = count_progress(7, "progress7", "  time          dt "),
                 many = count_progress(3300, "progress3300", "  time          dt ");

  (void)state;
  assert_int_equal(few, 7);
  if (many < 20 || many > 60) fail_msg("%d lines of progress for 3300 steps, wanted 20 to 60", (int)many);
  set_option("-output_progress", "1000");
  set_option("-units_time", "ms");
  assert_int_equal(count_progress(3300, "progress_set", "time [ms]     dt [ms]"), 5); /* first, three, last */
  set_option("-output_progress", NULL);
}

/* Numbers of the solver on demand; nothing of a fluid where there is none */
static void columns_are_what_the_run_has(void **state)
{
  Bodies      bodies   = create_bodies();
  MonitorStep s        = make_step(1);
  FILE       *terminal = PETSC_STDOUT;
  char        dir[PETSC_MAX_PATH_LEN], path[PETSC_MAX_PATH_LEN];
  const char *text;
  Monitor     m;

  (void)state;
  set_option("-output_progress_solver", "true");
  m = start_monitor("solver", bodies, dir);
  set_option("-output_progress_solver", NULL);
  OK(PetscSNPrintf(path, sizeof(path), "%s/stdout", dir));
  if (my_rank() == 0) PETSC_STDOUT = fopen(path, "w");
  OK(MonitorWrite(m, &s, s.time));
  s.gradient = s.speed = 0;
  OK(MonitorWrite(m, &s, s.time));
  if (my_rank() == 0) fclose(PETSC_STDOUT);
  PETSC_STDOUT = terminal;
  OK(MonitorDestroy(&m));
  OK(BodiesDestroy(&bodies));
  OK(PetscBarrier(NULL));
  text = read_text(dir, "stdout");
  assert_non_null(strstr(text, "div/gradient iterations kinetic energy momentum error"));
  assert_non_null(strstr(line_number(text, 1), "     2.5e-04          5           2.25     -1.000e-11 "));
  assert_non_null(strstr(line_number(text, 2), "        -              -            -          5 "));
}

static PetscErrorCode try_create(const char dir[], Bodies bodies)
{
  Monitor        m = NULL;
  PetscErrorCode err;

  message[0] = 0;
  OK(PetscPushErrorHandler(record_message, NULL));
  err = MonitorCreate(PETSC_COMM_WORLD, bodies, &m);
  if (!err) err = MonitorOpen(m, dir);
  OK(PetscPopErrorHandler());
  if (m) OK(MonitorDestroy(&m));
  return err;
}

static void set_bed(const char count[])
{
  set_option("-particle_groups", "bed");
  set_option("-particle_disc_shape", NULL); /* no group any more */
  set_option("-particle_post_shape", NULL);
  set_option("-particle_bed_shape", "circle");
  set_option("-particle_bed_radius", "0.01");
  set_option("-particle_bed_density", "2");
  set_option("-particle_bed_place", "lattice");
  set_option("-particle_bed_count", count);
}

/* Lines of bodies.csv of one step of a bed of discs */
static PetscInt count_bed(const char count[], const char name[])
{
  char        dir[PETSC_MAX_PATH_LEN];
  Bodies      bodies;
  Monitor     m;
  MonitorStep s = make_step(1);

  set_bed(count);
  bodies = create_bodies();
  m      = start_monitor(name, bodies, dir);
  OK(MonitorWrite(m, &s, s.time));
  OK(MonitorDestroy(&m));
  OK(BodiesDestroy(&bodies));
  OK(PetscBarrier(NULL));
  return count_lines(read_text(dir, "bodies.csv")) - 1;
}

static void many_bodies_are_written_on_request(void **state)
{
  Bodies bodies;

  (void)state;
  assert_int_equal(count_bed("64", "bed64"), 64);
  assert_int_equal(count_bed("65", "bed65"), 0);
  set_option("-output_bodies", "60,64");
  assert_int_equal(count_bed("65", "bed5"), 5);
  set_option("-output_bodies", "60,65");
  bodies = create_bodies();
  assert_int_equal(try_create(root, bodies), PETSC_ERR_USER_INPUT);
  assert_non_null(strstr(message, "-output_bodies 60,65"));
  assert_non_null(strstr(message, "last < 65"));
  set_option("-output_bodies", NULL);
  OK(BodiesDestroy(&bodies));
  set_discs();
}

/* What a run left of later steps goes, of every kind that is written step by step; what is of no step stays */
static void later_files_go(void **state)
{
  static const char *const LATER[] = {"fields_12.h5", "mesh_12.h5",   "bonds_12.h5",   "drops_12.h5",
                                      "solid_12.h5",  "table_12.csv", "drops_12.xdmf", "solid_12.xdmf"};
  static const char *const STAY[]  = {"fields_9.h5", "drops_9.xdmf", "fields_last.xdmf", "drops.csv", "drops_12.png"};
  char                     path[2 * PETSC_MAX_PATH_LEN], dir[PETSC_MAX_PATH_LEN];

  (void)state;
  if (my_rank() != 0) return;
  OK(PetscSNPrintf(dir, sizeof(dir), "%s/later", root));
  OK(mkdir(dir, 0700));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(LATER) + PETSC_STATIC_ARRAY_LENGTH(STAY); i++) {
    const size_t n = PETSC_STATIC_ARRAY_LENGTH(LATER);
    FILE        *f;

    OK(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, i < n ? LATER[i] : STAY[i - n]));
    f = fopen(path, "w");
    assert_non_null(f);
    assert_int_equal(fclose(f), 0);
  }
  assert_int_equal(FilesRemoveAfter(dir, 9), PETSC_STATIC_ARRAY_LENGTH(LATER));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(STAY); i++) {
    OK(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, STAY[i]));
    assert_int_equal(access(path, F_OK), 0);
  }
}

static void unwritable_directory_is_named(void **state)
{
  char   dir[PETSC_MAX_PATH_LEN];
  Bodies bodies = create_bodies();

  (void)state;
  OK(PetscSNPrintf(dir, sizeof(dir), "%s/nowhere", root));
  assert_int_equal(try_create(dir, bodies), PETSC_ERR_FILE_WRITE);
  assert_non_null(strstr(message, dir));
  assert_non_null(strstr(message, "-output_dir"));
  OK(BodiesDestroy(&bodies));
}

static void make_root(void)
{
  snprintf(root, sizeof(root), "/tmp/tumble-test-monitor-XXXXXX");
  if (my_rank() == 0) assert_non_null(mkdtemp(root));
  OK(MPI_Bcast(root, sizeof(root), MPI_CHAR, 0, PETSC_COMM_WORLD));
}

static void remove_root(void)
{
  char command[PETSC_MAX_PATH_LEN + 16];

  OK(PetscBarrier(NULL));
  snprintf(command, sizeof(command), "rm -rf '%s'", root);
  if (my_rank() == 0) OK(system(command));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(files_hold_every_step),
    cmocka_unit_test(columns_are_added),
    cmocka_unit_test(unreported_steps_are_tracked),
    cmocka_unit_test(summary_has_its_keys),
    cmocka_unit_test(options_are_kept),
    cmocka_unit_test(progress_fits_on_a_page),
    cmocka_unit_test(columns_are_what_the_run_has),
    cmocka_unit_test(many_bodies_are_written_on_request),
    cmocka_unit_test(balance_is_over_the_ranks),
    cmocka_unit_test(bandwidth_on_request),
    cmocka_unit_test(later_files_go),
    cmocka_unit_test(unwritable_directory_is_named),
  };
  int failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  if (LogInitialize()) return 1;
  make_root();
  set_discs();
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  remove_root();
  if (ShapeFinalize() || OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
