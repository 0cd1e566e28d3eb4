/* Scene files: each fault is found before PETSc reads the file, with file, line and remedy; and PETSc reads the good
   ones as checked. */
/* ranks: 1 2 */
#include "compat.h"
#include "run/scenefile.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <glob.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

static char folder[64] = "/tmp/tumble_scene_XXXXXX"; /* each rank has its own */
static char path[128];
static char message[1024];

static void write_bytes(const char name[], const char text[], size_t size)
{
  FILE *file;

  snprintf(path, sizeof(path), "%s/%s", folder, name);
  file = fopen(path, "w");
  assert_non_null(file);
  assert_int_equal(fwrite(text, 1, size, file), size);
  fclose(file);
}

/* The scene `text` is refused at `line` (0: no line) with all of the given texts in the message. */
static void refuse(int line, const char text[], ...)
{
  va_list     parts;
  const char *part;
  char        start[160];

  if (text) write_bytes("x.yaml", text, strlen(text));
  assert_int_equal(SceneFileCheck(path, message, sizeof(message)), 1);
  if (line) snprintf(start, sizeof(start), "%s:%d: ", path, line);
  else snprintf(start, sizeof(start), "%s: ", path);
  if (strncmp(message, start, strlen(start))) fail_msg("'%s' does not start with '%s'", message, start);
  va_start(parts, text);
  while ((part = va_arg(parts, const char *))) {
    if (!strstr(message, part)) fail_msg("'%s' is not in the message '%s'", part, message);
  }
  va_end(parts);
}

static void accept(const char text[])
{
  write_bytes("x.yaml", text, strlen(text));
  if (SceneFileCheck(path, message, sizeof(message))) fail_msg("%s", message);
  assert_string_equal(message, "");
}

static void finds_the_name(void **state)
{
  char *with[]    = {"tumble", "runs/dkt.yaml", "-sim_dt", "1", NULL},
       *without[] = {"tumble", "-sim_dt", "1", "runs/dkt", NULL};
  char *last[]    = {"tumble", "-options_file_yaml", "more.yaml", "-output_overwrite", "a.yml", "-sim_dt", "1", NULL};
  int   n         = 4;
  char  name[32];

  (void)state;
  assert_int_equal(SceneFileTake(&n, with, name, 5), 1);
  assert_int_equal(SceneFileTake(&n, with, name, sizeof(name)), 0);
  assert_string_equal(name, "runs/dkt.yaml");
  assert_int_equal(n, 3);
  assert_string_equal(with[1], "-sim_dt");
  assert_null(with[3]);
  n = 4;
  assert_int_equal(SceneFileTake(&n, without, name, sizeof(name)), 1);
  n = 7;
  assert_int_equal(SceneFileTake(&n, last, name, sizeof(name)), 0);
  assert_string_equal(name, "a.yml");
  assert_int_equal(n, 6);
  assert_string_equal(last[2], "more.yaml");
  assert_string_equal(last[4], "-sim_dt");
  n = 1;
  assert_int_equal(SceneFileTake(&n, with, name, sizeof(name)), 1);
}

static void cuts_the_stem(void **state)
{
  char stem[32];

  (void)state;
  assert_int_equal(SceneFileStem("runs/sedimentation.yaml", stem, sizeof(stem)), 0);
  assert_string_equal(stem, "sedimentation");
  assert_int_equal(SceneFileStem("./a.b/cylinder-2d1.v2.yaml", stem, sizeof(stem)), 0);
  assert_string_equal(stem, "cylinder-2d1.v2");
  assert_int_equal(SceneFileStem("plain", stem, sizeof(stem)), 0);
  assert_string_equal(stem, "plain");
  assert_int_equal(SceneFileStem("runs/", stem, sizeof(stem)), 1);
  assert_int_equal(SceneFileStem("runs/sedimentation.yaml", stem, 4), 1);
}

static void refuses_what_is_no_file(void **state)
{
  char here[512];

  (void)state;
  snprintf(path, sizeof(path), "%s/none.yaml", folder);
  refuse(0, NULL, "no such scene file", NULL);
  assert_null(strstr(message, "did you mean"));
  write_bytes("other.yaml", "a: 1\n", 5);
  path[strlen(path) - 5] = 0;
  refuse(0, NULL, "did you mean", "other.yaml?", NULL);
  snprintf(path, sizeof(path), "%s", folder);
  refuse(0, NULL, "is a directory", NULL);
  write_bytes("x.txt", "a: 1\n", 5);
  refuse(0, NULL, "must end in .yaml", NULL);
  /* a bare name that stands in runs/ */
  assert_non_null(getcwd(here, sizeof(here)));
  assert_int_equal(chdir(folder), 0);
  assert_int_equal(mkdir("runs", 0700), 0);
  write_bytes("runs/dkt.yaml", "a: 1\n", 5);
  snprintf(path, sizeof(path), "dkt.yaml");
  refuse(0, NULL, "did you mean runs/dkt.yaml?", NULL);
  snprintf(path, sizeof(path), "dkt");
  refuse(0, NULL, "did you mean runs/dkt.yaml?", NULL);
  assert_int_equal(unlink("runs/dkt.yaml") || rmdir("runs") || chdir(here), 0);
}

static void refuses_empty(void **state)
{
  (void)state;
  refuse(0, "", "empty", NULL);
  refuse(0, "# only a comment\n\n", "empty", NULL);
  refuse(0, "---\n", "empty", NULL);
  refuse(1, "just words\n", "'key: value'", "single value", NULL);
  refuse(2, "\n- a\n- b\n", "'key: value'", "list", NULL);
  write_bytes("x.yaml", "a: 1\0b: 2\n", 10);
  refuse(0, NULL, "zero bytes", NULL);
}

static void refuses_tabs(void **state)
{
  (void)state;
  refuse(2, "flow:\n\tdensity: 1\n", "tab character in the indentation: use blanks", NULL);
  refuse(3, "flow:\n  density: 1\n  \tviscosity: 1\n", "tab character", NULL);
  accept("flow:\t# a tab elsewhere\n  density: 1\t# and here\n");
  refuse(3, "flow:\n  density: 1\n\t# a comment\n", "use blanks", NULL);
}

static void refuses_bad_syntax(void **state)
{
  (void)state;
  refuse(3, "flow:\n  density: 1\n  viscosity 0.1\n  gravity: 2\n", "syntax error", "could not find expected ':'",
         "blank after it", NULL);
  refuse(2, "flow:\n  density: 1 viscosity: 2\n", "syntax error", "mapping values are not allowed", NULL);
  refuse(3, "flow:\n  gravity: [0, -981\nsim: {dt: 1}\n", "syntax error", "bracket", NULL);
  refuse(4, "flow:\n    density: 1\n    viscosity: 2\n  gravity: 1\n", "syntax error", "line 1", NULL);
  refuse(2, "a: 1\nb: *nowhere\n", "undefined alias", NULL);
  refuse(2, "a: 1\nb: @x\n", "syntax error", "quotes", NULL);
  refuse(2, "a: 1\nb: \xff\xfe\n", "UTF-8", NULL);
}

static void refuses_duplicates(void **state)
{
  (void)state;
  refuse(4, "flow:\n  density: 1\n  viscosity: 2\n  density: 3\n",
         "duplicate key 'density' (first at line 2): keep one of them", NULL);
  refuse(3, "flow: {density: 1}\nsim: {dt: 1}\nflow: {viscosity: 1}\n", "duplicate key 'flow' (first at line 1)", NULL);
  refuse(2, "flow: {density: 1}\nflow_density: 2\n",
         "option -flow_density is given twice (first at line 1): keep one of them", NULL);
  /* PETSc's names ignore case */
  refuse(3, "flow:\n  density: 1\n  Density: 2\n", "duplicate key 'Density' (first at line 2)", NULL);
  refuse(2, "particle: {disc: {radius: 1}}\nparticle_disc: {Radius: 2}\n", "-particle_disc_Radius is given twice",
         NULL);
}

static void refuses_lists_of_maps(void **state)
{
  (void)state;
  refuse(3, "particle:\n  groups:\n    - {shape: circle, radius: 1}\n", "'groups' is a list of maps",
         "give each entry a name", NULL);
  refuse(3, "particle:\n  groups:\n    - shape: circle\n      radius: 1\n", "list of maps", NULL);
  refuse(3, "particle:\n  position:\n    - [[1, 2]]\n", "'position' is a list of lists of lists", NULL);
  refuse(4, "particle:\n  points:\n    - [1, 2]\n    - [1]\n", "the entries of 'points' have 2 and 1 values", NULL);
  refuse(1, "a: [[1, 2], 3]\n", "the entries of 'a' have 2 and 1 values", NULL);
  refuse(1, "a: [1, , 2]\n", "syntax error", NULL);
  refuse(1, "a: [1, '', 2]\n", "empty entry in the list 'a'", NULL);
}

static void refuses_bad_keys(void **state)
{
  (void)state;
  refuse(2, "a: 1\n-flow_density: 1\n", "'-flow_density' starts with a dash: write 'flow_density'", NULL);
  refuse(1, "flow: {density:1}\n", "put a blank after the colon", NULL);
  refuse(1, "my flow: 1\n", "key 'my flow' cannot be an option name", NULL);
  refuse(1, "2d: 1\n", "must start with a letter", NULL);
  refuse(1, "[a, b]: 1\n", "cannot be a key", NULL);
  refuse(1, "'': 1\n", "empty key", NULL);
}

static void refuses_two_documents(void **state)
{
  (void)state;
  refuse(2, "a: 1\n---\nb: 2\n", "second document", NULL);
  accept("%YAML 1.1\n---\na: 1\n...\n");
}

static void refuses_too_many(void **state)
{
  char text[8192] = "", line[32];

  (void)state;
  for (int i = 0; i < 450; i++) {
    snprintf(line, sizeof(line), "k%d: 1\n", i);
    strcat(text, line);
  }
  accept(text);
  strcat(text, "last: 1\n");
  refuse(451, text, "more than 450 options", "table file", NULL);
}

static void refuses_merges(void **state)
{
  (void)state;
  refuse(3, "$$base: &b {radius: 1}\nparticle:\n  disc: {radius: 2, <<: *b}\n", "merges ('<<') are not allowed",
         "write the keys out", NULL);
  refuse(1, "$$x: !include other.yaml\n", "!include", NULL);
  refuse(1, "a: &a {b: *a}\n", "nested deeper", NULL);
  refuse(1, "a: {<<: 3}\n", "merges ('<<')", NULL);
}

/* What the check lets pass must arrive in PETSc as flattened here: this guards against another PETSc reading YAML
   differently. */
static void petsc_reads_the_same(void **state)
{
  const char *const wanted[][2] = {
    {"-flow_viscosity", "0.1"},     {"-flow_gravity", "0,-981"},     {"-flow_ksp_monitor", ""},
    {"-particle_groups", "disc,b"}, {"-particle_disc_density", "2"}, {"-particle_disc_position", "1,4"},
    {"-particle_b_radius", "1"},    {"-particle_b_density", "2"},
  };
  char     value[64];
  PetscInt n = 8, left;

  (void)state;
  accept("$$base: &base {density: 2, radius: 1}\n"
         "flow: {Viscosity: 0.1, gravity: [0, -981], ksp_monitor: }\n"
         "particle:\n  groups: [disc, b]\n  disc: {density: 2, position: [1, 4]}\n  b: *base\n");
  assert_int_equal(PetscOptionsClear(NULL), 0);
  assert_int_equal(PetscOptionsInsertFile(PETSC_COMM_SELF, NULL, path, PETSC_TRUE), 0);
  for (PetscInt i = 0; i < n; i++) {
    PetscBool found;

    assert_int_equal(PetscOptionsGetString(NULL, NULL, wanted[i][0], value, sizeof(value), &found), 0);
    if (!found) fail_msg("%s is missing", wanted[i][0]);
    assert_string_equal(value, wanted[i][1]);
  }
  assert_int_equal(PetscOptionsAllUsed(NULL, &left), 0);
  assert_int_equal(left, 0);
  assert_int_equal(PetscOptionsClear(NULL), 0);
}

static void write_other(const char name[], const char text[])
{
  write_bytes(name, text, strlen(text));
}

/* The first option of this name in what SceneFileRead gives, with its file; NULL: there is none */
static const char *find_value(const char options[], size_t size, const char name[], const char **file)
{
  for (const char *at = options; at < options + size;) {
    const char *value = at + strlen(at) + 1;

    *file = value + strlen(value) + 1;
    if (!strcmp(at, name)) return value;
    at = *file + strlen(*file) + 1;
  }
  return NULL;
}

/* What the including scene says goes over the included one, through two files */
static void includes(void **state)
{
  const char *const wanted[][3] = {{"flow_viscosity", "0.1", "other.yaml"},
                                   {"flow_gravity", "0,-9", "x.yaml"},
                                   {"mesh_cells", "8,4", "base.yaml"},
                                   {"mesh_lower", "1,1", "x.yaml"}};
  const char *removed[] = {"include", "particle_disc_radius", "particle_disc_density", "particle_disc", "flow_density"},
             *file      = "";
  char  *options;
  size_t size, n = 0;

  (void)state;
  write_other("base.yaml", "mesh: {cells: [8, 4], lower: [0, 0]}\nflow: {density: 2, gravity: [0, -1]}\n");
  write_other("other.yaml",
              "flow: {viscosity: 0.1, density: ~}\ninclude: base.yaml\nparticle: {disc: {radius: 1, density: 2}, discs: {radius: 3}}\n");
  write_other("x.yaml", "include: other.yaml\nflow_Gravity: [0, -9]\nmesh: {lower: [1, 1]}\nparticle: {disc: null}\n");
  assert_int_equal(SceneFileRead(path, &options, &size, message, sizeof(message)), 0);
  assert_non_null(options);
  for (size_t i = 0; i < sizeof(wanted) / sizeof(wanted[0]); i++) {
    const char *value = find_value(options, size, wanted[i][0], &file);

    if (!value && !strcmp(wanted[i][0], "flow_gravity")) value = find_value(options, size, "flow_Gravity", &file);
    assert_non_null(value);
    assert_string_equal(value, wanted[i][1]);
    assert_non_null(strstr(file, wanted[i][2]));
  }
  for (size_t i = 0; i < sizeof(removed) / sizeof(removed[0]); i++)
    assert_null(find_value(options, size, removed[i], &file));
  assert_non_null(find_value(options, size, "particle_discs_radius", &file));
  for (size_t i = 0; i < size; i++) n += !options[i];
  assert_int_equal(n, 3 * 5);
  free(options);
  accept("include: other.yaml\n");
  assert_int_equal(SceneFileRead(path, &options, &size, message, sizeof(message)), 0);
  free(options);
  accept("flow: {viscosity: 1}\n");
  assert_int_equal(SceneFileRead(path, &options, &size, message, sizeof(message)), 0);
  assert_null(options);
}

/* Names of boundaries may have blanks, as in mesh files; other keys may not */
static void boundaries_with_blanks(void **state)
{
  const char *file = "";
  char       *options;
  size_t      size;

  (void)state;
  accept(
    "mesh: {round_post (1): [0, 0, 1]}\nflow:\n  viscosity: 0.1\n  bc_left wall: {type: slip}\n  \"bc_out.let\": {type: outflow}\n");
  assert_int_equal(SceneFileRead(path, &options, &size, message, sizeof(message)), 0);
  assert_non_null(options);
  assert_string_equal(find_value(options, size, "flow_bc_left_wall_type", &file), "slip");
  assert_string_equal(find_value(options, size, "flow_bc_out_let_type", &file), "outflow");
  assert_string_equal(find_value(options, size, "mesh_round_post__1_", &file), "0,0,1");
  assert_string_equal(find_value(options, size, "flow_viscosity", &file), "0.1");
  free(options);
  refuse(3, "flow:\n  bc_a b: {type: slip}\n  bc_a_b: {type: slip}\n", "-flow_bc_a_b_type is given twice", "line 2",
         NULL);
  refuse(2, "flow:\n  left wall: 1\n", "cannot be an option name", NULL);
  refuse(1, "bc_left wall: 1\n", "cannot be an option name", NULL);
}

static void refuses_bad_includes(void **state)
{
  (void)state;
  refuse(2, "flow: {viscosity: 1}\ninclude: missing.yaml\n", "there is no scene", "missing.yaml",
         "relative to the scene that includes", NULL);
  refuse(1, "include: x.yaml\n", "includes itself", NULL);
  refuse(1, "include: [a.yaml, b.yaml]\n", "path of one scene file", NULL);
  refuse(1, "include:\n", "path of one scene file", NULL);
  refuse(1, "include: out/options.txt\n", "list of options", NULL);
  write_other("other.yaml", "flow: {viscosity: 1}\n");
  refuse(2, "include: other.yaml\nflow: {viscosty: ~}\n", "takes away", "other.yaml says nothing of -flow_viscosty",
         NULL);
  refuse(1, "flow: {viscosity: ~}\n", "includes none", "-flow_viscosity", NULL);
  write_other("other.yaml", "include: x.yaml\n");
  write_other("x.yaml", "include: other.yaml\n");
  assert_int_equal(SceneFileCheck(path, message, sizeof(message)), 1);
  if (!strstr(message, "other.yaml:1: ") || !strstr(message, "x.yaml' includes itself by way of"))
    fail_msg("%s", message);
  write_other("other.yaml", "flow: {viscosity: 1\n");
  write_other("x.yaml", "include: other.yaml\n");
  assert_int_equal(SceneFileCheck(path, message, sizeof(message)), 1);
  if (!strstr(message, "other.yaml:") || !strstr(message, "syntax error")) fail_msg("%s", message);
}

static void reads_all_of_runs(void **state)
{
  const char *const where[] = {"runs/*.yaml", "runs/*/*.yaml", "runs/studies/*/*.yaml"};
  glob_t            scenes  = {0};

  (void)state;
  for (int i = 0; i < 3; i++) assert_int_equal(glob(where[i], i ? GLOB_APPEND : 0, NULL, &scenes), 0);
  for (size_t i = 0; i < scenes.gl_pathc; i++)
    if (SceneFileCheck(scenes.gl_pathv[i], message, sizeof(message))) fail_msg("%s", message);
  globfree(&scenes);
}

static int clean_up(void **state)
{
  const char *const names[] = {"x.yaml", "x.txt", "other.yaml", "base.yaml"};

  (void)state;
  for (int i = 0; i < 4; i++) {
    snprintf(path, sizeof(path), "%s/%s", folder, names[i]);
    unlink(path);
  }
  return rmdir(folder);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(finds_the_name),
    cmocka_unit_test(cuts_the_stem),
    cmocka_unit_test(refuses_what_is_no_file),
    cmocka_unit_test(refuses_empty),
    cmocka_unit_test(refuses_tabs),
    cmocka_unit_test(refuses_bad_syntax),
    cmocka_unit_test(refuses_duplicates),
    cmocka_unit_test(refuses_lists_of_maps),
    cmocka_unit_test(refuses_bad_keys),
    cmocka_unit_test(refuses_two_documents),
    cmocka_unit_test(refuses_too_many),
    cmocka_unit_test(refuses_merges),
    cmocka_unit_test(petsc_reads_the_same),
    cmocka_unit_test(includes),
    cmocka_unit_test(boundaries_with_blanks),
    cmocka_unit_test(refuses_bad_includes),
    cmocka_unit_test(reads_all_of_runs),
  };
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCheck(mkdtemp(folder), PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "Cannot make the folder %s", folder);
  failed = cmocka_run_group_tests(tests, NULL, clean_up);
  PetscCall(PetscFinalize());
  return failed;
}
