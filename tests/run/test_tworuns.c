/* Two runs in one process, one after the other: the second knows nothing of the first, and a third that repeats the
   first gives its bits. On two ranks both at once, each on a rank of its own: the same bits again. */
/* ranks: 2 */
#include "foldercase.h"
#include "run/scene.h"

#define LID \
  "-mesh_cells 6,6 -flow_viscosity 0.01 -flow_bc_top_type moving_wall -flow_bc_top_velocity 1,0 -sim_dt 0.1 -sim_steps 3"
#define DISC \
  "-mesh_cells 6,12 -mesh_lower 0,0 -mesh_upper 1,2 -flow_viscosity 0.1 -flow_gravity 0,-981 -particle_groups a -particle_a_shape circle " \
  "-particle_a_radius 0.2 -particle_a_density 1.5 -particle_a_position 0.5,1.2 -sim_adapt -sim_dt 0.002 -sim_steps 3"

static const char *const SCENE[] = {LID, DISC};

/* The options are the process's: these are cleared, those are given */
static void run(MPI_Comm comm, const char folder[], PetscInt scene, const char name[])
{
  char text[2048];

  OK(PetscOptionsClear(NULL));
  snprintf(text, sizeof(text), "%s -output_dir %s/%s", SCENE[scene], folder, name);
  OK(PetscOptionsInsertString(NULL, text));
  OK(SceneRun(comm, name));
}

/* The file, without the times of the machine and without the folder: columns that begin with "seconds", entries of the
   summary from "seconds" to "memory_mb" */
static char *read_file(const char folder[], const char name[], const char file[])
{
  char  path[512];
  char *text = calloc(1, 1 << 20);
  FILE *f;

  snprintf(path, sizeof(path), "%s/%s/%s", folder, name, file);
  f = fopen(path, "r");
  assert_non_null(f);
  assert_true(fread(text, 1, (1 << 20) - 1, f) > 100);
  fclose(f);
  return text;
}

static void blank_seconds(char text[])
{
  int  from = -1, to = -1, column = 0;
  char heading[8192];

  snprintf(heading, sizeof(heading), "%.*s", (int)strcspn(text, "\n"), text);
  for (char *word = strtok(heading, ","); word; word = strtok(NULL, ","), column++) {
    if (strncmp(word, "seconds", 7)) continue;
    if (from < 0) from = column;
    to = column;
  }
  assert_true(from > 0);
  column = 0;
  for (char *c = text + strcspn(text, "\n"); *c; c++) {
    if (*c == '\n') column = 0;
    else if (*c == ',') column++;
    else if (column >= from && column <= to) *c = '#';
  }
}

/* Lengths of times differ: what is blanked is compared by fields */
static void compare_tables(const char *a, const char *b)
{
  while (*a || *b) {
    while (*a == '#') a++;
    while (*b == '#') b++;
    if (*a != *b) fail_msg("the tables differ from here: '%.80s' and '%.80s'", a, b);
    if (*a) a++, b++;
  }
}

static void expect_same(const char folder[], const char one[], const char other[])
{
  char *a = read_file(folder, one, "series.csv"), *b = read_file(folder, other, "series.csv");

  blank_seconds(a);
  blank_seconds(b);
  compare_tables(a, b);
  free(a);
  free(b);
}

static void test_one_after_the_other(void **state)
{
  char *a, *b;

  (void)state;
  run(PETSC_COMM_WORLD, folder, 0, "lid");
  run(PETSC_COMM_WORLD, folder, 1, "disc");
  run(PETSC_COMM_WORLD, folder, 0, "lid_again");
  run(PETSC_COMM_WORLD, folder, 1, "disc_again");
  expect_same(folder, "lid", "lid_again");
  expect_same(folder, "disc", "disc_again");
  a = read_file(folder, "lid_again", "summary.json"); /* remarks and options of the disc are not the lid's */
  b = read_file(folder, "disc", "summary.json");
  assert_null(strstr(a, "\"remarks\": [\n"));
  assert_non_null(strstr(b, "\"remarks\": [\n"));
  free(a);
  free(b);
  a = read_file(folder, "lid_again", "options.txt");
  assert_null(strstr(a, "-sim_adapt"));
  assert_null(strstr(a, "-couple_method"));
  free(a);
}

static void test_at_the_same_time(void **state)
{
  static const char *const NAME[2][2] = {{"alone_lid", "alone_disc_later"}, {"alone_disc", "alone_lid_later"}};
  PetscMPIInt              rank, size;

  (void)state;
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  if (rank < 2) { /* each rank has another scene, and later that of the other */
    run(PETSC_COMM_SELF, folder, rank, NAME[rank][0]);
    run(PETSC_COMM_SELF, folder, 1 - rank, NAME[rank][1]);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  if (rank || size < 2) return;
  expect_same(folder, "alone_lid", "alone_lid_later");
  expect_same(folder, "alone_disc", "alone_disc_later");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_one_after_the_other),
                                     cmocka_unit_test(test_at_the_same_time)};
  int                     failed;

  if (begin_folder(&argc, &argv, "tworuns")) return 1;
  failed = cmocka_run_group_tests_name("tworuns", tests, NULL, NULL);
  return end_folder(failed);
}
