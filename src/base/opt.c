/* Options: reading and conversion; see opt.h.

   Every option is read as text and converted here, so that a bad value is reported with option, value, range and unit
   instead of PETSc's bare conversion error. It does not read files (PETSc does) and does not check the scene's YAML
   (src/run/scenefile.c does); tables are in opttable.c, the database in optdatabase.c, former names in renamed.c,
   advice is in suggest.c, printing in help.c. */
#include "compat.h"
#include "base/runcomm.h"
#include "optimpl.h"
#include <ctype.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Called by every reader: the row of what is read. */
PetscErrorCode OptBeginReading(const char name[], OptType type, PetscBool any_type, const OptSpec **spec)
{
  OptEntry *entry;

  PetscFunctionBeginUser;
  PetscCheck(name && name[0] == '-', RunComm(), PETSC_ERR_PLIB, "Option name '%s' must start with a dash",
             name ? name : "(null)");
  PetscCall(OptMakeEntry(name, &entry));
  PetscCheck(entry->spec, RunComm(), PETSC_ERR_PLIB,
             "Option %s is read, but no table declares it: add a row to options.c of the room", name);
  PetscCheck(any_type || entry->spec->type == type, RunComm(), PETSC_ERR_PLIB,
             "Option %s is read as another type than its row in options.c has", name);
  entry->is_read = PETSC_TRUE;
  *spec          = entry->spec;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What -help says must be true: a default that is a plain number is the reader's. */
static PetscErrorCode check_number(const OptSpec *spec, double value)
{
  char  *end   = NULL;
  double shown = spec->value ? strtod(spec->value, &end) : 0;

  PetscFunctionBeginUser;
  if (!end || end == spec->value || *end) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(PetscAbsReal(shown - value) <= 1e-5 * PetscAbsReal(shown), RunComm(), PETSC_ERR_PLIB,
             "The row of option %s in options.c has the default %s, its reader %g", spec->name, spec->value, value);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_word(const OptSpec *spec, const char word[])
{
  PetscFunctionBeginUser;
  PetscCheck(!spec->value || !spec->value[0] || strchr(spec->value, ' ') || !strcmp(spec->value, word), RunComm(),
             PETSC_ERR_PLIB, "The row of option %s in options.c has the default '%s', its reader '%s'", spec->name,
             spec->value, word);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the PETSc database ---- */

/* Text of the option as given, NULL when absent; marks it as used. */
PetscErrorCode OptFindText(const char name[], const OptSpec *spec, const char **text)
{
  char      meaning[OPT_LINE];
  PetscBool given;

  PetscFunctionBeginUser;
  *text = NULL;
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, text, &given));
  if (!given) *text = NULL;
  OptFormatMeaning(spec, meaning, sizeof(meaning));
  PetscCheck(!given || *text, RunComm(), PETSC_ERR_USER_INPUT, "Option %s has no value; wanted: %s", name, meaning);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- conversion; `label` is the name, with "(value 2 of 3)" in a list ---- */

static PetscErrorCode check_range(const OptSpec *spec, const char label[], const char text[], PetscBool inside)
{
  char range[64];

  PetscFunctionBeginUser;
  OptFormatRange(spec, range, sizeof(range));
  PetscCheck(inside, RunComm(), PETSC_ERR_USER_INPUT, "Option %s = %s is outside its range (%s)%s%s: %s", label, text,
             range, spec->unit[0] ? " " : "", spec->unit, spec->help);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *tidy: was it something else than a plain number, that the database should not keep? */
static PetscErrorCode parse_real(const OptSpec *spec, const char label[], const char text[], PetscReal *value,
                                 PetscBool *tidy)
{
  char      meaning[OPT_LINE];
  double    number;
  PetscReal v;
  PetscBool plain;

  PetscFunctionBeginUser;
  OptFormatMeaning(spec, meaning, sizeof(meaning));
  /* a look first, so that PETSc's conversion below cannot fail */
  PetscCheck(OptReadNumber(text, spec->unit, &number, &plain), RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s is not a number; wanted: %s", label, text, meaning);
  v = (PetscReal)number;
  if (plain) PetscCall(PetscOptionsStringToReal(text, &v));
  else *tidy = PETSC_TRUE;
  PetscCheck(!PetscIsInfOrNanReal(v), RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s is not a finite number; wanted: %s", label, text, meaning);
  PetscCall(check_range(spec, label, text,
                        (PetscBool)((spec->lower == OPT_POSITIVE ? v > 0 : v >= spec->lower) && v <= spec->upper)));
  *value = v;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode parse_int(const OptSpec *spec, const char label[], const char text[], PetscInt *value)
{
  char      meaning[OPT_LINE], *end;
  long long v;

  PetscFunctionBeginUser;
  OptFormatMeaning(spec, meaning, sizeof(meaning));
  v = strtoll(text, &end, 10); /* saturates, so that a number too long for PetscInt is out of range, not wrapped */
  PetscCheck(end != text && !*end, RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s is not a whole number (digits only); wanted: %s", label, text, meaning);
  PetscCheck(v >= PETSC_MIN_INT && v <= PETSC_MAX_INT && v != LLONG_MAX, RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s does not fit an integer; wanted: %s", label, text, meaning);
  PetscCall(check_range(spec, label, text, (PetscBool)((double)v >= spec->lower && (double)v <= spec->upper)));
  *value = (PetscInt)v;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_count(const OptSpec *spec, const char name[], const char text[], PetscInt wanted)
{
  const PetscInt got = OptCountWords(text);
  char           meaning[OPT_LINE];

  PetscFunctionBeginUser;
  OptFormatMeaning(spec, meaning, sizeof(meaning));
  PetscCheck(got == wanted, RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s has %" PetscInt_FMT " value%s, %" PetscInt_FMT " are wanted (separated by commas): %s",
             name, text, got, got == 1 ? "" : "s", wanted, meaning);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- readers ---- */

PetscErrorCode OptReal(const char name[], PetscReal *value)
{
  const OptSpec *spec = NULL;
  const char    *text;
  PetscBool      tidy = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, OPT_REAL, PETSC_FALSE, &spec));
  PetscCall(check_number(spec, (double)*value));
  PetscCall(OptFindText(name, spec, &text));
  if (text) PetscCall(parse_real(spec, name, text, value, &tidy));
  if (tidy) PetscCall(OptKeepNumbers(name, 1, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptInt(const char name[], PetscInt *value)
{
  const OptSpec *spec = NULL;
  const char    *text;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, OPT_INT, PETSC_FALSE, &spec));
  PetscCall(check_number(spec, (double)*value));
  PetscCall(OptFindText(name, spec, &text));
  if (text) PetscCall(parse_int(spec, name, text, value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* False: it is no word for that */
static PetscBool parse_bool(const char text[], PetscBool *value)
{
  static const char *const words[] = {"false", "true", "no", "yes", "off", "on", "0", "1"}; /* odd places mean true */

  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(words); i++) {
    if (!OptSameName(text, words[i])) continue;
    *value = (PetscBool)(i % 2);
    return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

PetscErrorCode OptBool(const char name[], PetscBool *value)
{
  const OptSpec *spec = NULL;
  const char    *text;
  PetscBool      given;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, OPT_BOOL, PETSC_FALSE, &spec));
  PetscCall(check_word(spec, *value ? "true" : "false"));
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, &text, &given));
  if (!given) PetscFunctionReturn(PETSC_SUCCESS);
  if (!text) text = "true"; /* the bare name switches it on */
  PetscCheck(parse_bool(text, value), RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s = %s is neither true nor false (known: true, yes, on, 1, false, no, off, 0): %s", name, text,
             spec->help);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptPeekBool(const char name[], PetscBool *value)
{
  char      text[OPT_LINE];
  PetscBool present;
  PetscInt  count;

  PetscFunctionBeginUser;
  PetscCall(OptLookUp(name, &present, &count, text, sizeof(text)));
  if (present) (void)parse_bool(text[0] ? text : "true", value);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptChoice(const char name[], const char *const words[], PetscInt *index)
{
  char           entry[OPT_LINE] = "", advice[128];
  const OptSpec *spec            = NULL;
  const char    *text;
  PetscInt       n;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, OPT_CHOICE, PETSC_FALSE, &spec));
  for (n = 0; words[n]; n++) {
    PetscCall(PetscStrlcat(entry, n ? ", " : "", sizeof(entry)));
    PetscCall(PetscStrlcat(entry, words[n], sizeof(entry)));
  }
  PetscCheck(spec->choices && !strcmp(entry, spec->choices), RunComm(), PETSC_ERR_PLIB,
             "The row of option %s in options.c has the words '%s', its reader '%s'", name, spec->choices, entry);
  if (*index >= 0 && *index < n) PetscCall(check_word(spec, words[*index]));
  PetscCall(OptFindText(name, spec, &text));
  if (!text) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < n; i++) {
    if (OptSameName(text, words[i])) {
      *index = i;
      PetscFunctionReturn(PETSC_SUCCESS);
    }
  }
  OptAdviseWord(text, entry, spec->words, advice, sizeof(advice));
  SETERRQ(RunComm(), PETSC_ERR_USER_INPUT, "Option %s = %s is not known (known: %s): %s%s", name, text, entry,
          spec->help, advice);
}

PetscErrorCode OptString(const char name[], char value[], size_t len)
{
  const OptSpec *spec = NULL;
  const char    *text;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, OPT_STRING, PETSC_FALSE, &spec));
  PetscCall(OptFindText(name, spec, &text));
  if (!text) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(strlen(text) < len, RunComm(), PETSC_ERR_USER_INPUT, "Option %s has %zu characters, at most %zu fit: %s",
             name, strlen(text), len - 1, spec->help);
  PetscCall(PetscStrncpy(value, text, len));
  if (spec->path) PetscCall(OptResolvePaths(name, spec->path, value, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One of the two arrays is NULL. */
static PetscErrorCode read_array(const char name[], PetscInt n, PetscReal real[], PetscInt integer[], PetscBool *found)
{
  char           item[OPT_LINE], label[OPT_LINE], *joined;
  const OptSpec *spec = NULL;
  const char    *cursor;
  PetscBool      tidy = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, real ? OPT_REALS : OPT_INTS, PETSC_FALSE, &spec));
  for (PetscInt i = 0; i < n; i++) PetscCall(check_number(spec, real ? (double)real[i] : (double)integer[i]));
  PetscCall(OptFindText(name, spec, &cursor));
  if (found) *found = cursor ? PETSC_TRUE : PETSC_FALSE;
  if (!cursor) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptJoinDegrees(spec, cursor, &joined));
  cursor = joined;
  PetscCall(check_count(spec, name, cursor, n));
  for (PetscInt i = 0; OptNextItem(&cursor, item, sizeof(item)); i++) {
    snprintf(label, sizeof(label), "%s (value %lld of %lld)", name, (long long)i + 1, (long long)n);
    if (real) PetscCall(parse_real(spec, label, item, &real[i], &tidy));
    else PetscCall(parse_int(spec, label, item, &integer[i]));
  }
  PetscCall(PetscFree(joined));
  PetscCall(OptJoinItems(name));
  if (tidy) PetscCall(OptKeepNumbers(name, n, real));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptRealArray(const char name[], PetscInt n, PetscReal value[], PetscBool *found)
{
  PetscFunctionBeginUser;
  PetscCall(read_array(name, n, value, NULL, found));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptIntArray(const char name[], PetscInt n, PetscInt value[], PetscBool *found)
{
  PetscFunctionBeginUser;
  PetscCall(read_array(name, n, NULL, value, found));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptStringArray(const char name[], PetscInt *n, char *words[])
{
  const PetscInt capacity = *n;
  const OptSpec *spec     = NULL;
  const char    *text     = NULL;
  char           item[PETSC_MAX_PATH_LEN];
  PetscBool      given;

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(OptBeginReading(name, OPT_STRINGS, PETSC_FALSE, &spec));
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, &text, &given));
  if (!given || !text) PetscFunctionReturn(PETSC_SUCCESS); /* absent, or the empty list */
  PetscCheck(OptCountWords(text) <= capacity, RunComm(), PETSC_ERR_USER_INPUT,
             "Option %s has %" PetscInt_FMT " values, at most %" PetscInt_FMT " fit: %s", name, OptCountWords(text),
             capacity, spec->help);
  for (const char *cursor = text; OptNextItem(&cursor, item, sizeof(item)); ++*n) {
    if (!item[0]) { /* nothing may leak when the caller goes on after the error */
      for (; *n > 0; --*n) PetscCall(PetscFree(words[*n - 1]));
      SETERRQ(RunComm(), PETSC_ERR_USER_INPUT, "Option %s = %s has an empty entry (two commas, or one at an end): %s",
              name, text, spec->help);
    }
    PetscCall(PetscStrallocpy(item, &words[*n]));
  }
  PetscCall(OptJoinItems(name));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptHas(const char name[], PetscBool *found)
{
  const OptSpec *spec = NULL;

  PetscFunctionBeginUser;
  PetscCall(OptBeginReading(name, OPT_BOOL, PETSC_TRUE, &spec));
  PetscCall(PetscOptionsHasName(NULL, NULL, name, found));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptAxes(const char name[], PetscInt dim, PetscInt *axes, PetscBool *found)
{
  char    *list[4];
  PetscInt n = 4;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray(name, &n, list));
  *axes = 0;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt d = 0;

    while (d < dim && (list[i][0] != "xyz"[d] || list[i][1])) d++;
    PetscCheck(d < dim, RunComm(), PETSC_ERR_USER_INPUT, "Option %s: '%s' is no axis of this scene: give some of %s",
               name, list[i], dim == 2 ? "x, y" : "x, y, z");
    *axes |= 1 << d;
    PetscCall(PetscFree(list[i]));
  }
  *found = (PetscBool)(n > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}
