/* Numbers as people write them: see OptReadNumber in optimpl.h. */
#include "compat.h"
#include "optimpl.h"
#include <ctype.h>
#include <muParserDLL.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Endings for degrees; the longest first */
static const char *const DEGREES[] = {"degrees", "degree", "deg", "\xc2\xb0"};

/* An expression of numbers and pi; muParser would let it set variables, and there are none */
static PetscBool evaluate(const char text[], double *value)
{
  muParserHandle_t p;
  PetscBool        good;

  if (!text[0] || strchr(text, '=') || strchr(text, ',')) return PETSC_FALSE;
  p = mupCreate(muBASETYPE_FLOAT);
  mupDefineConst(p, "pi", PETSC_PI);
  mupSetExpr(p, text);
  *value = mupEval(p);
  good   = (PetscBool)!mupError(p);
  mupRelease(p);
  return good;
}

PetscBool OptReadNumber(const char text[], const char unit[], double *value, PetscBool *plain)
{
  char   copy[OPT_LINE], *end;
  double factor = 1;
  size_t n;

  *value = strtod(text, &end);
  *plain = (PetscBool)(end != text && !*end);
  if (*plain) return PETSC_TRUE;
  n = (size_t)snprintf(copy, sizeof(copy), "%s", text);
  if (n >= sizeof(copy)) return PETSC_FALSE;
  for (size_t i = 0; unit && strstr(unit, "rad") && factor == 1 && i < PETSC_STATIC_ARRAY_LENGTH(DEGREES); i++) {
    const size_t m = strlen(DEGREES[i]);

    if (n <= m || strcasecmp(copy + n - m, DEGREES[i])) continue;
    factor = PETSC_PI / 180;
    for (n -= m; n > 0 && isspace((unsigned char)copy[n - 1]);) n--;
    copy[n] = 0;
  }
  *value = strtod(copy, &end);
  if ((end == copy || *end) && !evaluate(copy, value)) return PETSC_FALSE;
  *value *= factor;
  return PETSC_TRUE;
}

PetscErrorCode OptKeepNumbers(const char name[], PetscInt n, const PetscReal value[])
{
  char *text;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(32 * n + 1, &text));
  for (PetscInt i = 0; i < n; i++) snprintf(text + strlen(text), 32, "%s%.17g", i ? "," : "", (double)value[i]);
  PetscCall(PetscOptionsSetValue(NULL, name, text));
  PetscCall(PetscFree(text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptJoinDegrees(const OptSpec *spec, const char text[], char **joined)
{
  char *o;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(strlen(text) + 1, joined));
  o = *joined;
  for (const char *c = text; *c; c++) {
    const size_t blanks = strspn(c, " \t");

    if (blanks && strstr(spec->unit, "rad") &&
        (!strncasecmp(c + blanks, "deg", 3) || !strncmp(c + blanks, "\xc2\xb0", 2)))
      c += blanks;
    *o++ = *c;
  }
  *o = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptPeekReal(const char name[], PetscReal *value, PetscBool *found)
{
  const OptSpec *spec = OptFindSpec(name);
  char           text[OPT_LINE];
  double         v = 0;
  PetscBool      plain;

  PetscFunctionBeginUser;
  PetscCall(OptPeek(name, text, sizeof(text)));
  *found = (PetscBool)(text[0] && OptReadNumber(text, spec ? spec->unit : NULL, &v, &plain) && !PetscIsInfOrNanReal(v));
  if (*found) *value = (PetscReal)v;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptPeekReals(const char name[], PetscInt max, PetscReal value[], PetscInt *n)
{
  const OptSpec *spec = OptFindSpec(name);
  const char    *cursor;
  char           text[OPT_LINE], item[OPT_LINE];
  double         v;
  PetscBool      plain;

  PetscFunctionBeginUser;
  *n = 0;
  PetscCall(OptPeek(name, text, sizeof(text)));
  cursor = text[0] ? text : NULL;
  while (cursor && OptNextItem(&cursor, item, sizeof(item))) {
    if (*n == max || !OptReadNumber(item, spec ? spec->unit : NULL, &v, &plain) || PetscIsInfOrNanReal(v)) {
      *n = 0;
      break;
    }
    value[(*n)++] = (PetscReal)v;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
