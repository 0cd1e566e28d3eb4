/* Advice for options that nobody has read: see OptCheckUnused in opt.h.

   A name of another mode is answered with what it is read with, any other (former ones: renamed.c) with the
   nearest known name (optimal string alignment distance: Damerau 1964, "A technique for computer detection and
   correction of spelling errors"). Known are the names this run has read, the rows of all tables, their placeholders
   filled with every name of the scene that was read in their place, and for solver options, which PETSc reads itself,
   every solver prefix seen in OptDefault() times a list of common endings. */
#include "compat.h"
#include "base/runcomm.h"
#include "optimpl.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#define TYPO 2 /* edits; what is farther may be meant for another shape */

/* Common endings of PETSc's solver options, and general options that PETSc reads on its own. */
static const char petsc_names
  [] = "ksp_type, ksp_rtol, ksp_atol, ksp_divtol, ksp_max_it, ksp_norm_type, ksp_pc_side, ksp_monitor, "
       "ksp_monitor_true_residual, ksp_converged_reason, ksp_view, ksp_initial_guess_nonzero, "
       "ksp_gmres_restart, ksp_gmres_modifiedgramschmidt, ksp_chebyshev_esteig, ksp_chebyshev_eigenvalues, "
       "ksp_richardson_scale, ksp_error_if_not_converged, ksp_constant_null_space, ksp_guess_type, pc_type, "
       "pc_side, pc_view, pc_factor_mat_solver_type, pc_factor_shift_type, pc_factor_levels, "
       "pc_mg_levels, "
       "pc_mg_type, pc_mg_cycle_type, pc_mg_galerkin, pc_gamg_type, pc_gamg_threshold, pc_gamg_agg_nsmooths, "
       "pc_hypre_type, pc_hypre_boomeramg_strong_threshold, pc_hypre_boomeramg_coarsen_type, "
       "pc_hypre_boomeramg_interp_type, pc_hypre_boomeramg_agg_nl, pc_hypre_boomeramg_relax_type_all, "
       "pc_hypre_boomeramg_max_iter, pc_sor_omega, pc_sor_its, pc_sor_lits, pc_sor_symmetric, pc_jacobi_type, "
       "pc_bjacobi_blocks, pc_asm_overlap, mg_levels_ksp_type, mg_levels_ksp_max_it, mg_levels_pc_type, "
       "mg_coarse_ksp_type, mg_coarse_pc_type, sub_ksp_type, sub_pc_type, snes_type, snes_rtol, snes_atol, "
       "snes_stol, snes_max_it, snes_monitor, snes_converged_reason, snes_linesearch_type, snes_lag_jacobian, "
       "snes_view, mat_type, mat_mumps_icntl_14, vec_type, dm_refine, dm_view, petscpartitioner_type, "
       "petscpartitioner_view, log_view, options_left, options_view, malloc_debug, malloc_dump, memory_view, "
       "info, help";

/* Read by PETSc only in PetscFinalize(), or on events that may never come. A trailing '*' stands for any ending. */
static const char late_names
  [] = "log, log_*, options_left, options_view, options_monitor*, options_file*, options_string_yaml, "
       "options_suppress_deprecated_warnings, malloc*, memory_view, objects_dump, help, version, skip_petscrc, "
       "prefix_push, prefix_pop, info*, on_error_*, start_in_debugger, stop_for_debugger, debugger_*, "
       "debug_terminal, citations, saws*, get_total_flops, mpidump, process_view, stack_view, viewfromoptions, "
       "nox, nox_warning, x_virtual, petsc_ci*, check_pointer_intensity, checkfunctionlist, fp_trap, "
       "no_signal_handler, omp_view, blas_view";

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
  const PetscInt d = OptEditDistance(name, candidate);

  if (d < *distance) {
    *distance = d;
    snprintf(nearest, len, "%.1000s", candidate);
  }
}

static void keep_nearest_solver_option(const char name[], const char prefix[], int n, char nearest[], size_t len,
                                       PetscInt *distance)
{
  const char *cursor = n ? petsc_names : NULL;
  char        ending[64], candidate[OPT_LINE];

  while (OptNextItem(&cursor, ending, sizeof(ending))) {
    snprintf(candidate, sizeof(candidate), "%.*s%s", n, prefix, ending);
    keep_nearer(name, candidate, nearest, len, distance);
  }
}

/* Was `word` read in the place of the pattern's placeholder, in this row or another with the same one? */
static PetscBool next_word(const char pattern[], PetscInt *i, char word[], size_t len)
{
  const char     *open = strchr(pattern, '<');
  PetscInt        n;
  const OptEntry *entry = OptGetEntries(&n);

  for (; *i < n; ++*i) {
    const OptSpec *spec  = entry[*i].spec;
    const char    *other = spec && !entry[*i].own ? strchr(spec->name, '<') : NULL;

    if (!other || strncmp(open, other, strcspn(open, ">") + 1) || !OptFits(spec->name, entry[*i].name, word, len))
      continue;
    ++*i;
    return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* A row's name, or all that its placeholder can make of it in this run. */
static void keep_nearest_row(const char name[], const char pattern[], char nearest[], size_t len, PetscInt *distance)
{
  const char *open = strchr(pattern, '<');
  char        word[OPT_LINE], candidate[2 * OPT_LINE], last[OPT_LINE] = "";

  if (!open) keep_nearer(name, pattern, nearest, len, distance);
  for (PetscInt i = 0; open && next_word(pattern, &i, word, sizeof(word));) {
    if (!strcmp(word, last)) continue;
    snprintf(last, sizeof(last), "%s", word);
    snprintf(candidate, sizeof(candidate), "%.*s%s%s", (int)(open - pattern), pattern, word, strchr(open, '>') + 1);
    keep_nearer(name, candidate, nearest, len, distance);
  }
}

/* Nearest known name to `name` (with dash); *distance in edits. Our own options come first, so they win ties. */
static void find_nearest(const char name[], char nearest[], size_t len, PetscInt *distance)
{
  PetscInt        n;
  const OptEntry *entry = OptGetEntries(&n);

  *distance = PETSC_MAX_INT;
  for (PetscInt i = 0; i < n; i++) keep_nearer(name, entry[i].name, nearest, len, distance);
  for (size_t t = 0; t < opt_ntable; t++) {
    for (size_t i = 0; i < opt_table[t].n; i++)
      keep_nearest_row(name, opt_table[t].spec[i].name, nearest, len, distance);
  }
  keep_nearest_solver_option(name, "-", 1, nearest, len, distance);
  for (PetscInt i = 0; i < n; i++)
    keep_nearest_solver_option(name, entry[i].name, (int)measure_prefix(entry[i].name), nearest, len, distance);
}

/* ---- left-over options ---- */

static PetscBool is_read_late(const char name[])
{
  const char *cursor = late_names;
  char        late[64];

  if (strstr(name, "_ksp_view") || strstr(name, "_ksp_converged_") || strstr(name, "_snes_view") ||
      strstr(name, "_snes_converged_"))
    return PETSC_TRUE; /* read after a solve */
  while (OptNextItem(&cursor, late, sizeof(late))) {
    const size_t n = strlen(late);

    if (late[n - 1] == '*' ? !strncmp(name, late, n - 1) : !strcmp(name, late)) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Is this left-over (name without dash) the user's mistake? */
static PetscBool is_mistake(const char name[])
{
  char            full[OPT_LINE];
  const OptEntry *entry;

  snprintf(full, sizeof(full), "-%s", name);
  entry = OptFindEntry(full);
  return (PetscBool)(!is_read_late(name) && !(entry && entry->is_default));
}

/* All words that were read in the place of a pattern's placeholder, each once: "left, right" */
static void list_words(const char pattern[], char text[], size_t len)
{
  char     word[OPT_LINE], quoted[OPT_LINE + 4], padded[OPT_LINE + 4];
  PetscInt i = 0;

  text[0] = 0;
  while (next_word(pattern, &i, word, sizeof(word))) {
    const size_t used = strlen(text);

    snprintf(quoted, sizeof(quoted), ", %s,", word);
    snprintf(padded, sizeof(padded), ", %.1000s,", text);
    if (strstr(padded, quoted) || used + 2 > len) continue;
    snprintf(text + used, len - used, "%s%.200s", used ? ", " : "", word);
  }
}

/* A word of no group or boundary of this scene, unless it is one misspelt */
static void explain_word(const char pattern[], const char word[], char text[], size_t len)
{
  const char *open           = strchr(pattern, '<');
  const int   n              = (int)strcspn(open + 1, ">");
  char        list[OPT_LINE] = "", seen[OPT_LINE];
  PetscInt    i = 0, groups = 0;

  while (next_word(pattern, &i, seen, sizeof(seen))) {
    const size_t m = strlen(seen);

    /* of a part of a shape, the nearest name is asked for */
    if (OptEditDistance(seen, word) <= TYPO || (!strncasecmp(seen, word, m) && word[m] == '_')) return;
  }
  for (size_t t = 0; t < opt_ntable; t++) /* a word of another kind? */
    for (size_t k = 0; k < opt_table[t].n; k++) {
      const char *other = opt_table[t].spec[k].name, *at = strchr(other, '<');

      if (!at || strncmp(at, "<group>", 7)) continue;
      for (i = 0; !groups && strncmp(open, "<group>", 7) && next_word(other, &i, seen, sizeof(seen));)
        groups = OptSameName(seen, word);
    }
  list_words(pattern, list, sizeof(list));
  if (groups)
    snprintf(text, len,
             "'%s' is a group of bodies, and no %.*s of the mesh (%s): fluid keeps to the surface of a body by itself, without an option",
             word, n, open + 1, list);
  else snprintf(text, len, "there is no %.*s '%s' in this scene (%s)", n, open + 1, word, list);
}

/* A name that some table has: what to do. "" for others. */
static void explain_entry(const char name[], char text[], size_t len)
{
  const OptSpec  *spec = NULL;
  const OptEntry *entry;
  char            word[OPT_LINE], seen[OPT_LINE];
  PetscInt        i = 0;
  PetscBool       there;

  text[0] = 0;
  entry   = OptFindEntry(name);
  spec    = OptFindSpec(name);
  if (!spec) return;
  if (strchr(spec->name, '<')) { /* of a group or boundary of this scene? */
    (void)OptFits(spec->name, name, word, sizeof(word));
    /* without any the row's condition is all there is to say */
    there = (PetscBool)!next_word(spec->name, &i, seen, sizeof(seen));
    for (i = 0; !there && next_word(spec->name, &i, seen, sizeof(seen));) there = OptSameName(seen, word);
    if (!there) explain_word(spec->name, word, text, len);
    if (!there) return;
  }
  if (spec->when && !(entry && entry->is_read)) snprintf(text, len, "is read only with %s", spec->when);
  else snprintf(text, len, "a valid name, but nothing in this run reads it");
}

/* What the shape of the group takes that a name belongs to: OptDeclareOne made its rows, read with
   "-particle_disc_shape ellipse". " -particle_disc_shape ellipse takes -particle_disc_a, -particle_disc_b", "" for
   other names. */
static void list_parameters(const char name[], char text[], size_t len)
{
  PetscInt        n;
  const OptEntry *entry = OptGetEntries(&n);

  text[0] = 0;
  for (PetscInt i = 0; i < n; i++) {
    const char *when = entry[i].own ? entry[i].own->when : NULL, *end = when ? strstr(when, "shape ") : NULL;
    size_t      used = strlen(text);

    if (!end || strncmp(name, when, (size_t)(end - when)) || strchr(entry[i].name, '<')) continue;
    if (!used) used = (size_t)snprintf(text, len, " %s takes", when);
    else if (used < len) used += (size_t)snprintf(text + used, len - used, ",");
    if (used < len) snprintf(text + used, len - used, " %s", entry[i].name);
  }
}

/* An option of PETSc's solvers without the prefix of one: those that this run has */
static void explain_prefix(const char name[], char text[], size_t len)
{
  const char *const objects[] = {"-ksp_", "-pc_", "-snes_", "-fieldsplit_", "-mg_", "-sub_"};
  PetscInt          n;
  const OptEntry   *entry = OptGetEntries(&n);
  size_t            i     = 0;

  while (i < PETSC_STATIC_ARRAY_LENGTH(objects) && strncasecmp(name, objects[i], strlen(objects[i]))) i++;
  if (i == PETSC_STATIC_ARRAY_LENGTH(objects)) return;
  snprintf(text, len, "options of PETSc's solvers need the prefix of a solver:");
  for (PetscInt k = 0; k < n; k++) {
    const int    m    = (int)measure_prefix(entry[k].name);
    const size_t used = strlen(text);
    char         offer[OPT_LINE];

    snprintf(offer, sizeof(offer), " %.*s%.200s", PetscMin(m, 200), entry[k].name, name + 1);
    if (!m || strstr(text, offer) || used + strlen(offer) + 32 > len ||
        (strstr(name, "snes") && strstr(offer, "fieldsplit")))
      continue;
    snprintf(text + used, len - used, "%s", offer);
  }
  if (text[strlen(text) - 1] == ':') snprintf(text + strlen(text), len - strlen(text), " such as -flow_%s", name + 1);
}

/* "-flow_viscosty = 0.1 (command line): did you mean -flow_viscosity?" */
static PetscErrorCode explain_mistake(const char name[], const char value[], char text[], size_t len)
{
  char            full[OPT_LINE], nearest[OPT_LINE] = "", shown[64] = "", advice[2 * OPT_LINE], more[OPT_LINE] = "";
  const char     *source;
  const OptSpec  *spec;
  const OptEntry *entry;
  PetscInt        distance;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(full, sizeof(full), "-%s", name));
  if (value) PetscCall(PetscSNPrintf(shown, sizeof(shown), " = %.50s%s", value, strlen(value) > 50 ? "..." : ""));
  source = OptIsArgument(full) ? "command line" : "scene or options file";
  explain_entry(full, advice, sizeof(advice));
  if (!advice[0]) explain_prefix(full, advice, sizeof(advice));
  if (!advice[0]) {
    find_nearest(full, nearest, sizeof(nearest), &distance);
    if (distance > 1 || strlen(full) < 6) OptAdviseName(full, advice, sizeof(advice));
  }
  if (!advice[0]) {
    spec  = OptFindSpec(nearest);
    entry = OptFindEntry(nearest);
    if (!distance) snprintf(advice, sizeof(advice), "a valid name, but nothing in this run reads %s", nearest);
    else if (distance <= (PetscInt)strlen(full) / 2) snprintf(advice, sizeof(advice), "did you mean %s?", nearest);
    else snprintf(advice, sizeof(advice), "the nearest known name is %s", nearest);
    if (distance > TYPO) list_parameters(full, more, sizeof(more));
    if (more[0]) snprintf(advice, sizeof(advice), "no such option (the nearest name is %s);", nearest);
    else if (distance && spec && spec->when && !(entry && entry->is_read) && !OptFindEntry(spec->when))
      PetscCall(PetscSNPrintf(more, sizeof(more), " It is read only with %s", spec->when));
    PetscCall(PetscStrlcat(advice, more, sizeof(advice)));
  }
  PetscCall(PetscSNPrintf(text, len, "%s%s (%s): %s", full, shown, source, advice));
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
    PetscCheck(is_name || after_name, RunComm(), PETSC_ERR_USER_INPUT,
               "Argument '%s' on the command line belongs to no option: names start with a dash, a scene file ends in .yaml, and a value has no blanks (-mesh_cells 8,24)",
               argv[i]);
    after_name = is_name;
  }
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
  PetscCheck(mistakes != 1, RunComm(), PETSC_ERR_USER_INPUT, "Unknown or unused option %s", list);
  PetscCheck(!left_off, RunComm(), PETSC_ERR_USER_INPUT,
             "Unknown or unused options (%" PetscInt_FMT "):\n  %s\n  and %" PetscInt_FMT " more", mistakes, list,
             left_off);
  PetscCheck(!mistakes, RunComm(), PETSC_ERR_USER_INPUT, "Unknown or unused options (%" PetscInt_FMT "):\n  %s",
             mistakes, list);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is the option of a line a default that nobody has read, one of those left [n]? */
static PetscBool is_idle_default(const char line[], PetscInt n, char *const left[])
{
  char            name[OPT_LINE];
  const OptEntry *entry;
  PetscInt        i = 0;

  (void)snprintf(name, sizeof(name), "%.*s", (int)strcspn(line, " \n"), line);
  entry = OptFindEntry(name);
  if (!entry || !entry->is_default) return PETSC_FALSE;
  while (i < n && !OptSameName(left[i], name + 1)) i++;
  return (PetscBool)(i < n);
}

PetscErrorCode OptGetRead(char **text)
{
  char    *all, *line, *tail, **left, **value;
  size_t   len;
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(OptGetAll(&all));
  len = strlen(all) + 1;
  PetscCall(PetscCalloc1(len, text));
  PetscCall(PetscOptionsLeftGet(NULL, &n, &left, &value));
  for (line = strtok_r(all, "\n", &tail); line; line = strtok_r(NULL, "\n", &tail)) {
    if (is_idle_default(line, n, left)) continue;
    PetscCall(PetscStrlcat(*text, line, len));
    PetscCall(PetscStrlcat(*text, "\n", len));
  }
  PetscCall(PetscOptionsLeftRestore(NULL, &n, &left, &value));
  PetscCall(PetscFree(all));
  PetscFunctionReturn(PETSC_SUCCESS);
}
