/* Options: what a row means, in one line; see optimpl.h. */
#include "compat.h"
#include "optimpl.h"
#include <stdio.h>

static void join_range(const char lower[], const char upper[], PetscBool positive, char text[], size_t len)
{
  if (positive && upper[0]) snprintf(text, len, "> 0 and <= %s", upper);
  else if (positive) snprintf(text, len, "> 0");
  else if (lower[0] && upper[0]) snprintf(text, len, "%s to %s", lower, upper);
  else if (lower[0]) snprintf(text, len, ">= %s", lower);
  else if (upper[0]) snprintf(text, len, "<= %s", upper);
  else text[0] = 0;
}

void OptFormatRange(const OptSpec *spec, char text[], size_t len)
{
  const double huge = spec->type == OPT_INT || spec->type == OPT_INTS ? (double)PETSC_MAX_INT : (double)PETSC_MAX_REAL;
  char         lo[32] = "", hi[32] = "";

  text[0] = 0;
  if (spec->type == OPT_BOOL || spec->type == OPT_CHOICE || spec->type == OPT_STRING || spec->type == OPT_STRINGS)
    return;
  if (spec->lower > -huge) snprintf(lo, sizeof(lo), "%.10g", spec->lower);
  if (spec->upper < huge) snprintf(hi, sizeof(hi), "%.10g", spec->upper);
  join_range(lo, hi, (PetscBool)(spec->lower == OPT_POSITIVE), text, len);
}

void OptFormatMeaning(const OptSpec *spec, char text[], size_t len)
{
  const char *unit = spec->unit ? spec->unit : "";
  char        range[OPT_LINE];

  OptFormatRange(spec, range, sizeof(range));
  if (spec->choices) snprintf(range, sizeof(range), "one of: %s", spec->choices);
  if (spec->variables) snprintf(range, sizeof(range), "or expressions of %s", spec->variables);
  snprintf(text, len, "%s%s%s%s%s%s%s", spec->help, unit[0] ? " [" : "", unit, unit[0] ? "]" : "", range[0] ? " (" : "",
           range, range[0] ? ")" : "");
}
