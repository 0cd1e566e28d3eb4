/* Options with units and ranges.

   Every option is read as text and converted here, so that a bad value is reported with option, value, range and unit
   instead of PETSc's bare conversion error. Each name read is kept in a table with its meaning and default: -help
   prints from it, and a misspelt option is answered with the nearest name in it (optimal string alignment distance:
   Damerau 1964, "A technique for computer detection and correction of spelling errors"). Solver options, which PETSc
   reads itself, enter that search as every solver prefix seen in OptDefault() times a list of common endings.
   It does not read files (PETSc does) and does not check the scene's YAML (scenefile.c does). */
#include "compat.h"
#include "base/opt.h"
#include <ctype.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OPT_LINE 512 /* room for one line of text */

/* PETSc up to 3.18 (the cap went during 3.19) keeps options in a table of 512 places; some are left for PETSc's own use. */
#define OPT_TABLE_MAX 500

typedef struct {
  char     *name;       /* with dash */
  char     *text;       /* "meaning [unit] (range)" */
  PetscBool is_default; /* put into the database by OptDefault(), not by the user */
} OptKnown;

static struct {
  PetscInt  n, room;
  OptKnown *known;
} table;

/* Common endings of PETSc's solver options, and general options that PETSc reads on its own. */
static const char *const petsc_names[] = {"ksp_type",
                                          "ksp_rtol",
                                          "ksp_atol",
                                          "ksp_divtol",
                                          "ksp_max_it",
                                          "ksp_norm_type",
                                          "ksp_pc_side",
                                          "ksp_monitor",
                                          "ksp_monitor_true_residual",
                                          "ksp_converged_reason",
                                          "ksp_view",
                                          "ksp_initial_guess_nonzero",
                                          "ksp_gmres_restart",
                                          "ksp_gmres_modifiedgramschmidt",
                                          "ksp_chebyshev_esteig",
                                          "ksp_chebyshev_eigenvalues",
                                          "ksp_richardson_scale",
                                          "ksp_error_if_not_converged",
                                          "ksp_constant_null_space",
                                          "ksp_guess_type",
                                          "pc_type",
                                          "pc_side",
                                          "pc_view",
                                          "pc_factor_mat_solver_type",
                                          "pc_factor_shift_type",
                                          "pc_factor_levels",
                                          "pc_fieldsplit_type",
                                          "pc_fieldsplit_schur_fact_type",
                                          "pc_fieldsplit_schur_precondition",
                                          "pc_mg_levels",
                                          "pc_mg_type",
                                          "pc_mg_cycle_type",
                                          "pc_mg_galerkin",
                                          "pc_gamg_type",
                                          "pc_gamg_threshold",
                                          "pc_gamg_agg_nsmooths",
                                          "pc_hypre_type",
                                          "pc_hypre_boomeramg_strong_threshold",
                                          "pc_hypre_boomeramg_coarsen_type",
                                          "pc_hypre_boomeramg_interp_type",
                                          "pc_hypre_boomeramg_agg_nl",
                                          "pc_hypre_boomeramg_relax_type_all",
                                          "pc_hypre_boomeramg_max_iter",
                                          "pc_sor_omega",
                                          "pc_sor_its",
                                          "pc_sor_lits",
                                          "pc_sor_symmetric",
                                          "pc_jacobi_type",
                                          "pc_bjacobi_blocks",
                                          "pc_asm_overlap",
                                          "mg_levels_ksp_type",
                                          "mg_levels_ksp_max_it",
                                          "mg_levels_pc_type",
                                          "mg_coarse_ksp_type",
                                          "mg_coarse_pc_type",
                                          "sub_ksp_type",
                                          "sub_pc_type",
                                          "snes_type",
                                          "snes_rtol",
                                          "snes_atol",
                                          "snes_stol",
                                          "snes_max_it",
                                          "snes_monitor",
                                          "snes_converged_reason",
                                          "snes_linesearch_type",
                                          "snes_lag_jacobian",
                                          "snes_view",
                                          "mat_type",
                                          "mat_mumps_icntl_14",
                                          "vec_type",
                                          "dm_refine",
                                          "dm_view",
                                          "petscpartitioner_type",
                                          "petscpartitioner_view",
                                          "log_view",
                                          "options_left",
                                          "options_view",
                                          "malloc_debug",
                                          "malloc_dump",
                                          "memory_view",
                                          "info",
                                          "help"};

/* Read by PETSc only in PetscFinalize(), or on events that may never come. A trailing '*' stands for any ending. */
static const char *const late_names[] = {"log",
                                         "log_*",
                                         "options_left",
                                         "options_view",
                                         "options_monitor*",
                                         "options_file*",
                                         "options_string_yaml",
                                         "options_suppress_deprecated_warnings",
                                         "malloc*",
                                         "memory_view",
                                         "objects_dump",
                                         "help",
                                         "version",
                                         "skip_petscrc",
                                         "prefix_push",
                                         "prefix_pop",
                                         "info*",
                                         "on_error_*",
                                         "start_in_debugger",
                                         "stop_for_debugger",
                                         "debugger_*",
                                         "debug_terminal",
                                         "citations",
                                         "saws*",
                                         "get_total_flops",
                                         "mpidump",
                                         "process_view",
                                         "stack_view",
                                         "viewfromoptions",
                                         "nox",
                                         "nox_warning",
                                         "x_virtual",
                                         "petsc_ci*",
                                         "check_pointer_intensity",
                                         "checkfunctionlist",
                                         "fp_trap",
                                         "no_signal_handler",
                                         "omp_view",
                                         "blas_view"};

/* ---- text ---- */

static void join_range(const char lower[], const char upper[], PetscBool positive, char text[], size_t len)
{
  if (positive && upper[0]) snprintf(text, len, "> 0 and <= %s", upper);
  else if (positive) snprintf(text, len, "> 0");
  else if (lower[0] && upper[0]) snprintf(text, len, "%s to %s", lower, upper);
  else if (lower[0]) snprintf(text, len, ">= %s", lower);
  else if (upper[0]) snprintf(text, len, "<= %s", upper);
  else text[0] = 0;
}

static void format_real_range(PetscReal lower, PetscReal upper, char text[], size_t len)
{
  char lo[32] = "", hi[32] = "";

  if (lower > PETSC_MIN_REAL) snprintf(lo, sizeof(lo), "%g", (double)lower);
  if (upper < PETSC_MAX_REAL) snprintf(hi, sizeof(hi), "%g", (double)upper);
  join_range(lo, hi, (PetscBool)(lower == OPT_POSITIVE), text, len);
}

static void format_int_range(PetscInt lower, PetscInt upper, char text[], size_t len)
{
  char lo[32] = "", hi[32] = "";

  if (lower > PETSC_MIN_INT) snprintf(lo, sizeof(lo), "%lld", (long long)lower);
  if (upper < PETSC_MAX_INT) snprintf(hi, sizeof(hi), "%lld", (long long)upper);
  join_range(lo, hi, PETSC_FALSE, text, len);
}

/* "meaning [unit] (range)" */
static void format_meaning(const char help[], const char unit[], const char range[], char text[], size_t len)
{
  const PetscBool has_unit = (PetscBool)(unit && unit[0]), has_range = (PetscBool)(range && range[0]);

  snprintf(text, len, "%s%s%s%s%s%s%s", help, has_unit ? " [" : "", has_unit ? unit : "", has_unit ? "]" : "", has_range ? " (" : "",
           has_range ? range : "", has_range ? ")" : "");
}

/* The next item of a comma-separated list, without blanks around it. *cursor becomes NULL after the last. */
static PetscBool next_item(const char **cursor, char item[], size_t len)
{
  const char *start = *cursor, *end;
  size_t      n;

  if (!start) return PETSC_FALSE;
  end     = strchr(start, ',');
  *cursor = end ? end + 1 : NULL;
  if (!end) end = start + strlen(start);
  while (start < end && isspace((unsigned char)*start)) start++;
  while (end > start && isspace((unsigned char)end[-1])) end--;
  n = PetscMin((size_t)(end - start), len - 1);
  memcpy(item, start, n);
  item[n] = 0;
  return PETSC_TRUE;
}

static PetscInt count_items(const char text[])
{
  PetscInt n = 1;

  for (; *text; text++) n += *text == ',';
  return n;
}

static PetscBool same_name(const char a[], const char b[])
{
  PetscBool same = PETSC_FALSE;

  (void)PetscStrcasecmp(a, b, &same); /* PETSc's option names do not tell upper from lower case */
  return same;
}

/* ---- the table of known names ---- */

static OptKnown *find_known(const char name[])
{
  for (PetscInt i = 0; i < table.n; i++) {
    if (same_name(table.known[i].name, name)) return &table.known[i];
  }
  return NULL;
}

static PetscErrorCode add_known(const char name[], const char text[], PetscBool is_default)
{
  PetscFunctionBeginUser;
  if (table.n == table.room) {
    OptKnown *known;

    table.room = PetscMax(64, 2 * table.room);
    PetscCall(PetscCalloc1(table.room, &known));
    if (table.n) PetscCall(PetscArraycpy(known, table.known, table.n));
    PetscCall(PetscFree(table.known));
    table.known = known;
  }
  PetscCall(PetscStrallocpy(name, &table.known[table.n].name));
  PetscCall(PetscStrallocpy(text, &table.known[table.n].text));
  table.known[table.n++].is_default = is_default;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Called by every reader: the first time it is read an option enters the table and, under -help, is printed. */
static PetscErrorCode register_option(const char name[], const char text[], const char value[])
{
  PetscBool help;

  PetscFunctionBeginUser;
  PetscCheck(name && name[0] == '-', PETSC_COMM_WORLD, PETSC_ERR_ARG_WRONG, "Option name '%s' must start with a dash", name ? name : "(null)");
  if (find_known(name)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_known(name, text, PETSC_FALSE));
  PetscCall(PetscOptionsHasHelp(NULL, &help));
  if (help && value[0]) PetscCall((*PetscHelpPrintf)(PETSC_COMM_WORLD, "%s <%s>: %s\n", name, value, text));
  else if (help) PetscCall((*PetscHelpPrintf)(PETSC_COMM_WORLD, "%s: %s\n", name, text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the PETSc database ---- */

/* Text of the option as given, NULL when absent; marks it as used. */
static PetscErrorCode find_text(const char name[], const char meaning[], const char **text)
{
  PetscBool given;

  PetscFunctionBeginUser;
  *text = NULL;
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, text, &given));
  if (!given) *text = NULL;
  PetscCheck(!given || *text, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s has no value; wanted: %s", name, meaning);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Whole database as text, one option a line, without marking anything as used; free() it. */
static PetscErrorCode list_database(char **text)
{
  size_t      len = 0;
  FILE       *file;
  PetscViewer viewer;

  PetscFunctionBeginUser;
  *text = NULL;
  file  = open_memstream(text, &len);
  PetscCheck(file, PETSC_COMM_WORLD, PETSC_ERR_MEM, "No memory for the list of options");
  PetscCall(PetscViewerASCIIOpenWithFILE(PETSC_COMM_SELF, file, &viewer));
  PetscCall(PetscOptionsView(NULL, viewer));
  PetscCall(PetscViewerDestroy(&viewer));
  fclose(file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Next "-name[ value]" of the list. Cuts the list into lines; drops the headings and the source that PETSc 3.19 and newer append. */
static char *next_option(char **cursor)
{
  while (*cursor && **cursor) {
    char *line = *cursor, *end = strchr(line, '\n'), *source;

    *cursor = end ? end + 1 : NULL;
    if (end) *end = 0;
    source = strstr(line, " # (source: ");
    if (source) *source = 0;
    if (line[0] == '-') return line;
  }
  return NULL;
}

static PetscErrorCode look_up(const char name[], PetscBool *present, PetscInt *count)
{
  char *text, *cursor, *line;

  PetscFunctionBeginUser;
  *present = PETSC_FALSE;
  *count   = 0;
  PetscCall(list_database(&text));
  for (cursor = text; (line = next_option(&cursor)); ++*count) {
    line[strcspn(line, " ")] = 0;
    if (same_name(line, name)) *present = PETSC_TRUE;
  }
  free(text);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where a left-over option came from. PETSC_OPTIONS and .petscrc are rare enough to share a name with the scene. */
static PetscErrorCode find_source(const char name[], const char **source)
{
  int    argc;
  char **argv;

  PetscFunctionBeginUser;
  *source = "scene or options file";
  PetscCall(PetscGetArgs(&argc, &argv));
  for (int i = 1; i < argc; i++) {
    if (argv[i][0] == '-' && same_name(argv[i] + 1, name)) *source = "command line";
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- conversion ---- */

/* Option under conversion: what the messages need. */
typedef struct {
  const char *name; /* may carry "(value 2 of 3)" */
  const char *help; /* bare meaning */
  const char *unit;
  const char *range;
  char        meaning[OPT_LINE];
} OptSpec;

static OptSpec describe_option(const char name[], const char help[], const char unit[], const char range[])
{
  OptSpec spec = {name, help, unit ? unit : "", range, ""};

  format_meaning(help, unit, range, spec.meaning, sizeof(spec.meaning));
  return spec;
}

static PetscErrorCode check_range(const OptSpec *spec, const char text[], PetscBool inside)
{
  PetscFunctionBeginUser;
  PetscCheck(inside, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s = %s is outside its range (%s)%s%s: %s", spec->name, text, spec->range,
             spec->unit[0] ? " " : "", spec->unit, spec->help);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode parse_real(const OptSpec *spec, const char text[], PetscReal lower, PetscReal upper, PetscReal *value)
{
  char     *end;
  PetscReal v;

  PetscFunctionBeginUser;
  (void)strtod(text, &end); /* only a look, so that PETSc's conversion below cannot fail */
  PetscCheck(end != text && !*end, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s = %s is not a number; wanted: %s", spec->name, text,
             spec->meaning);
  PetscCall(PetscOptionsStringToReal(text, &v));
  PetscCheck(!PetscIsInfOrNanReal(v), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s = %s is not a finite number; wanted: %s", spec->name, text,
             spec->meaning);
  PetscCall(check_range(spec, text, (PetscBool)((lower == OPT_POSITIVE ? v > 0 : v >= lower) && v <= upper)));
  *value = v;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode parse_int(const OptSpec *spec, const char text[], PetscInt lower, PetscInt upper, PetscInt *value)
{
  char     *end;
  long long v;

  PetscFunctionBeginUser;
  v = strtoll(text, &end, 10); /* saturates, so that a number too long for PetscInt is out of range, not wrapped */
  PetscCheck(end != text && !*end, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s = %s is not a whole number (digits only); wanted: %s",
             spec->name, text, spec->meaning);
  PetscCheck(v >= PETSC_MIN_INT && v <= PETSC_MAX_INT && v != LLONG_MAX, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Option %s = %s does not fit an integer; wanted: %s", spec->name, text, spec->meaning);
  PetscCall(check_range(spec, text, (PetscBool)(v >= lower && v <= upper)));
  *value = (PetscInt)v;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_count(const OptSpec *spec, const char text[], PetscInt wanted)
{
  const PetscInt got = count_items(text);

  PetscFunctionBeginUser;
  PetscCheck(got == wanted, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Option %s = %s has %" PetscInt_FMT " value%s, %" PetscInt_FMT " are wanted (separated by commas, no blanks): %s", spec->name, text, got,
             got == 1 ? "" : "s", wanted, spec->meaning);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- nearest name ---- */

/* Least number of insertions, deletions, replacements and swaps of neighbours that turn a into b, upper case as lower. */
static PetscInt edit_distance(const char a[], const char b[])
{
  static PetscInt row[3][OPT_LINE + 1]; /* the rows i-2, i-1, i of the table, in turn */
  const PetscInt  na = (PetscInt)PetscMin(strlen(a), OPT_LINE), nb = (PetscInt)PetscMin(strlen(b), OPT_LINE);

  for (PetscInt j = 0; j <= nb; j++) row[0][j] = j;
  for (PetscInt i = 1; i <= na; i++) {
    PetscInt *two = row[(i + 1) % 3], *one = row[(i + 2) % 3], *now = row[i % 3];

    now[0] = i;
    for (PetscInt j = 1; j <= nb; j++) {
      const PetscBool same = (PetscBool)(tolower((unsigned char)a[i - 1]) == tolower((unsigned char)b[j - 1]));

      now[j] = PetscMin(PetscMin(one[j], now[j - 1]) + 1, one[j - 1] + !same);
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) now[j] = PetscMin(now[j], two[j - 2] + 1);
    }
  }
  return row[na % 3][nb];
}

/* Length of the solver prefix of "-flow_fieldsplit_pressure_ksp_type" (up to ksp_), 0 when it is no solver option. */
static size_t measure_prefix(const char name[])
{
  const char *const objects[] = {"ksp_", "pc_", "snes_", "mat_"};
  size_t            shortest  = 0;

  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(objects); i++) {
    for (const char *at = strstr(name, objects[i]); at; at = strstr(at + 1, objects[i])) {
      const size_t len = (size_t)(at - name);

      if ((at[-1] == '_' || at[-1] == '-') && (!shortest || len < shortest)) shortest = len;
    }
  }
  return shortest;
}

static void keep_nearer(const char name[], const char candidate[], char nearest[], size_t len, PetscInt *distance)
{
  const PetscInt d = edit_distance(name, candidate);

  if (d < *distance) {
    *distance = d;
    snprintf(nearest, len, "%s", candidate);
  }
}

/* Nearest known name to `name` (with dash); *distance in edits. Our own options come first, so they win ties. */
static void find_nearest(const char name[], char nearest[], size_t len, PetscInt *distance)
{
  char candidate[OPT_LINE];

  *distance = PETSC_MAX_INT;
  for (PetscInt i = 0; i < table.n; i++) keep_nearer(name, table.known[i].name, nearest, len, distance);
  for (PetscInt i = -1; i < table.n; i++) {
    const size_t prefix = i < 0 ? 1 : measure_prefix(table.known[i].name);

    for (size_t k = 0; prefix && k < PETSC_STATIC_ARRAY_LENGTH(petsc_names); k++) {
      snprintf(candidate, sizeof(candidate), "%.*s%s", (int)prefix, i < 0 ? "-" : table.known[i].name, petsc_names[k]);
      keep_nearer(name, candidate, nearest, len, distance);
    }
  }
}

/* ---- left-over options ---- */

static PetscBool is_read_late(const char name[])
{
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(late_names); i++) {
    const char  *late = late_names[i];
    const size_t n    = strlen(late);

    if (strstr(name, "ksp_view") || strstr(name, "ksp_converged_") || strstr(name, "snes_view") || strstr(name, "snes_converged_"))
      return PETSC_TRUE; /* read after a solve */
    if (late[n - 1] == '*' ? !strncmp(name, late, n - 1) : !strcmp(name, late)) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Is this left-over (name without dash) the user's mistake? */
static PetscBool is_mistake(const char name[])
{
  char            full[OPT_LINE];
  const OptKnown *known;

  snprintf(full, sizeof(full), "-%s", name);
  known = find_known(full);
  return (PetscBool)(!is_read_late(name) && !(known && known->is_default));
}

/* "-flow_viscosty = 0.1 (command line): did you mean -flow_viscosity?" */
static PetscErrorCode explain_mistake(const char name[], const char value[], char text[], size_t len)
{
  char        full[OPT_LINE], nearest[OPT_LINE] = "", shown[64] = "";
  const char *source, *advice;
  PetscInt    distance;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(full, sizeof(full), "-%s", name));
  if (value) PetscCall(PetscSNPrintf(shown, sizeof(shown), " = %.50s%s", value, strlen(value) > 50 ? "..." : ""));
  PetscCall(find_source(name, &source));
  find_nearest(full, nearest, sizeof(nearest), &distance);
  if (!distance) advice = "a valid name, but nothing in this run reads";
  else advice = distance <= (PetscInt)strlen(full) / 2 ? "did you mean" : "the nearest known name is";
  PetscCall(PetscSNPrintf(text, len, "%s%s (%s): %s %s%s", full, shown, source, advice, nearest, distance && advice[0] == 'd' ? "?" : ""));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Words that belong to no option ("-mesh_cells 8, 24", or a forgotten dash): PETSc drops them without a word. */
static PetscErrorCode check_arguments(void)
{
  int       argc;
  char    **argv;
  PetscBool after_name = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscGetArgs(&argc, &argv));
  for (int i = 1; i < argc; i++) {
    PetscBool is_name;

    PetscCall(PetscOptionsValidKey(argv[i], &is_name));
    PetscCheck(is_name || after_name || i == 1, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "Argument '%s' on the command line belongs to no option: names start with a dash, the scene file is the first argument, and a value has no blanks (-mesh_cells 8,24)",
               argv[i]);
    after_name = is_name;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

PetscErrorCode OptReal(const char name[], const char help[], const char unit[], PetscReal lower, PetscReal upper, PetscReal *value)
{
  char        range[64], shown[32];
  const char *text;
  OptSpec     spec;

  PetscFunctionBeginUser;
  format_real_range(lower, upper, range, sizeof(range));
  spec = describe_option(name, help, unit, range);
  snprintf(shown, sizeof(shown), "%g", (double)*value);
  PetscCall(register_option(name, spec.meaning, shown));
  PetscCall(find_text(name, spec.meaning, &text));
  if (text) PetscCall(parse_real(&spec, text, lower, upper, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptInt(const char name[], const char help[], const char unit[], PetscInt lower, PetscInt upper, PetscInt *value)
{
  char        range[64], shown[32];
  const char *text;
  OptSpec     spec;

  PetscFunctionBeginUser;
  format_int_range(lower, upper, range, sizeof(range));
  spec = describe_option(name, help, unit, range);
  snprintf(shown, sizeof(shown), "%lld", (long long)*value);
  PetscCall(register_option(name, spec.meaning, shown));
  PetscCall(find_text(name, spec.meaning, &text));
  if (text) PetscCall(parse_int(&spec, text, lower, upper, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptBool(const char name[], const char help[], PetscBool *value)
{
  const char *const words[] = {"false", "true", "no", "yes", "0", "1", "off", "on"}; /* odd places are true */
  const char       *text    = NULL;
  OptSpec           spec    = describe_option(name, help, "", "true or false");
  PetscBool         given;
  size_t            i = 0;

  PetscFunctionBeginUser;
  PetscCall(register_option(name, spec.meaning, *value ? "true" : "false"));
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, &text, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  if (!text) text = "true"; /* the bare name switches it on */
  while (i < PETSC_STATIC_ARRAY_LENGTH(words) && !same_name(text, words[i])) i++;
  PetscCheck(i < PETSC_STATIC_ARRAY_LENGTH(words), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Option %s = %s is neither true nor false (known: true, yes, on, 1, false, no, off, 0): %s", name, text, help);
  *value = (PetscBool)(i % 2);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptChoice(const char name[], const char help[], const char *const list[], PetscInt *index)
{
  char        known[OPT_LINE] = "", meaning[2 * OPT_LINE];
  const char *text;
  PetscInt    n;

  PetscFunctionBeginUser;
  for (n = 0; list[n]; n++) {
    PetscCall(PetscStrlcat(known, n ? ", " : "", sizeof(known)));
    PetscCall(PetscStrlcat(known, list[n], sizeof(known)));
  }
  snprintf(meaning, sizeof(meaning), "%s (one of: %s)", help, known);
  PetscCall(register_option(name, meaning, *index >= 0 && *index < n ? list[*index] : ""));
  PetscCall(find_text(name, meaning, &text));
  if (!text) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < n; i++) {
    if (same_name(text, list[i])) {
      *index = i;
      PetscFunctionReturn(PETSC_SUCCESS);
    }
  }
  SETERRQ(PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s = %s is not known (known: %s): %s", name, text, known, help);
}

PetscErrorCode OptString(const char name[], const char help[], char value[], size_t len)
{
  const char *text;

  PetscFunctionBeginUser;
  PetscCall(register_option(name, help, value));
  PetscCall(find_text(name, help, &text));
  if (!text) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(strlen(text) < len, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s has %zu characters, at most %zu fit: %s", name, strlen(text),
             len - 1, help);
  PetscCall(PetscStrncpy(value, text, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptRealArray(const char name[], const char help[], const char unit[], PetscReal lower, PetscReal upper, PetscInt n, PetscReal value[],
                            PetscBool *found)
{
  char        range[64], shown[OPT_LINE] = "", item[OPT_LINE], label[OPT_LINE];
  const char *text, *cursor;
  OptSpec     spec;

  PetscFunctionBeginUser;
  format_real_range(lower, upper, range, sizeof(range));
  spec = describe_option(name, help, unit, range);
  for (PetscInt i = 0; i < n; i++) {
    snprintf(item, sizeof(item), "%s%g", i ? "," : "", (double)value[i]);
    PetscCall(PetscStrlcat(shown, item, sizeof(shown)));
  }
  PetscCall(register_option(name, spec.meaning, shown));
  PetscCall(find_text(name, spec.meaning, &text));
  if (found) *found = text ? PETSC_TRUE : PETSC_FALSE;
  if (!text) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(check_count(&spec, text, n));
  spec.name = label;
  cursor    = text;
  for (PetscInt i = 0; next_item(&cursor, item, sizeof(item)); i++) {
    snprintf(label, sizeof(label), "%s (value %lld of %lld)", name, (long long)i + 1, (long long)n);
    PetscCall(parse_real(&spec, item, lower, upper, &value[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptIntArray(const char name[], const char help[], const char unit[], PetscInt lower, PetscInt upper, PetscInt n, PetscInt value[],
                           PetscBool *found)
{
  char        range[64], shown[OPT_LINE] = "", item[OPT_LINE], label[OPT_LINE];
  const char *text, *cursor;
  OptSpec     spec;

  PetscFunctionBeginUser;
  format_int_range(lower, upper, range, sizeof(range));
  spec = describe_option(name, help, unit, range);
  for (PetscInt i = 0; i < n; i++) {
    snprintf(item, sizeof(item), "%s%lld", i ? "," : "", (long long)value[i]);
    PetscCall(PetscStrlcat(shown, item, sizeof(shown)));
  }
  PetscCall(register_option(name, spec.meaning, shown));
  PetscCall(find_text(name, spec.meaning, &text));
  if (found) *found = text ? PETSC_TRUE : PETSC_FALSE;
  if (!text) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(check_count(&spec, text, n));
  spec.name = label;
  cursor    = text;
  for (PetscInt i = 0; next_item(&cursor, item, sizeof(item)); i++) {
    snprintf(label, sizeof(label), "%s (value %lld of %lld)", name, (long long)i + 1, (long long)n);
    PetscCall(parse_int(&spec, item, lower, upper, &value[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptStringArray(const char name[], const char help[], PetscInt *n, char *list[])
{
  const PetscInt room = *n;
  const char    *text = NULL;
  char           item[PETSC_MAX_PATH_LEN];
  PetscBool      given;

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(register_option(name, help, ""));
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, &text, &given));
  if (!given || !text) PetscFunctionReturn(PETSC_SUCCESS); /* absent, or the empty list */
  PetscCheck(count_items(text) <= room, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "Option %s has %" PetscInt_FMT " values, at most %" PetscInt_FMT " fit: %s", name, count_items(text), room, help);
  for (const char *cursor = text; next_item(&cursor, item, sizeof(item)); ++*n) {
    if (!item[0]) { /* nothing may leak when the caller goes on after the error */
      for (; *n > 0; --*n) PetscCall(PetscFree(list[*n - 1]));
      SETERRQ(PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Option %s = %s has an empty entry (two commas, or one at an end): %s", name, text, help);
    }
    PetscCall(PetscStrallocpy(item, &list[*n]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptHas(const char name[], const char help[], PetscBool *found)
{
  PetscFunctionBeginUser;
  PetscCall(register_option(name, help, ""));
  PetscCall(PetscOptionsHasName(NULL, NULL, name, found));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of two defaults for one name the later holds, so that a recipe may refine a general default. */
PetscErrorCode OptDefault(const char name[], const char value[])
{
  OptKnown *known = find_known(name);
  PetscBool present;
  PetscInt  count;

  PetscFunctionBeginUser;
  PetscCall(look_up(name, &present, &count));
  if (present && !(known && known->is_default)) {
    if (!known) PetscCall(add_known(name, "solver option of PETSc", PETSC_FALSE));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCheck(present || PETSC_VERSION_GE(3, 20, 0) || count < OPT_TABLE_MAX, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "No room for option %s: scene and command line hold %" PetscInt_FMT
             " options, PETSC's table has 512 places; move per-body values into a table file (-particle_<group>_table bodies.csv)",
             name, count);
  PetscCall(PetscOptionsSetValue(NULL, name, value));
  if (!known) PetscCall(add_known(name, "solver option of PETSc", PETSC_TRUE));
  else known->is_default = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptCheckUnused(void)
{
  char     list[1600] = "", line[OPT_LINE]; /* PETSc cuts messages at 2048 characters */
  PetscInt n, mistakes = 0, left_off = 0;
  char   **name, **value;

  PetscFunctionBeginUser;
  PetscCall(check_arguments());
  PetscCall(PetscOptionsLeftGet(NULL, &n, &name, &value));
  for (PetscInt i = 0; i < n; i++) {
    if (!is_mistake(name[i])) continue;
    mistakes++;
    PetscCall(explain_mistake(name[i], value[i], line, sizeof(line)));
    if (strlen(list) + strlen(line) + 4 > sizeof(list)) {
      left_off++;
      continue;
    }
    PetscCall(PetscStrlcat(list, list[0] ? "\n  " : "", sizeof(list)));
    PetscCall(PetscStrlcat(list, line, sizeof(list)));
  }
  PetscCall(PetscOptionsLeftRestore(NULL, &n, &name, &value));
  PetscCheck(mistakes != 1, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Unknown or unused option %s", list);
  PetscCheck(!left_off, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Unknown or unused options (%" PetscInt_FMT "):\n  %s\n  and %" PetscInt_FMT " more",
             mistakes, list, left_off);
  PetscCheck(!mistakes, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Unknown or unused options (%" PetscInt_FMT "):\n  %s", mistakes, list);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptWrite(FILE *file)
{
  PetscMPIInt rank;
  char       *text, *cursor, *line;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (rank) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(file, PETSC_COMM_SELF, PETSC_ERR_ARG_NULL, "No open file to write the options to");
  PetscCall(list_database(&text));
  for (cursor = text; (line = next_option(&cursor));) fprintf(file, "%s\n", line);
  free(text);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptGetAll(char **text)
{
  char  *list, *cursor, *line;
  size_t len;

  PetscFunctionBeginUser;
  PetscCall(list_database(&list));
  len = strlen(list) + 2;
  PetscCall(PetscCalloc1(len, text));
  for (cursor = list; (line = next_option(&cursor));) {
    PetscCall(PetscStrlcat(*text, line, len));
    PetscCall(PetscStrlcat(*text, "\n", len));
  }
  free(list);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptFinalize(void)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < table.n; i++) {
    PetscCall(PetscFree(table.known[i].name));
    PetscCall(PetscFree(table.known[i].text));
  }
  PetscCall(PetscFree(table.known));
  table.n = table.room = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
