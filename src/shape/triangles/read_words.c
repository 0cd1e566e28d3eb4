/* Reading of surfaces: words and numbers of text files, points and faces. */
#include "compat.h"
#include "read.h"
#include "base/array.h"
#include <ctype.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* ---- words ---- */

PetscErrorCode ReadComplain(Reader *r, const char format[], ...)
{
  va_list args;
  size_t  length;

  PetscFunctionBeginUser;
  if (r->error[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscSNPrintf(r->error, TRI_WHY, "%s:%" PetscInt_FMT ": ", r->file, r->line));
  length = strlen(r->error);
  va_start(args, format);
  PetscCall(PetscVSNPrintf(r->error + length, TRI_WHY - length, format, NULL, args));
  va_end(args);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ReadWord(Reader *r, PetscBool here)
{
  size_t n = 0;

  while (r->at < r->size && (isspace((unsigned char)r->text[r->at]) || !r->text[r->at])) {
    if (r->text[r->at] == '\n') {
      if (here) return PETSC_FALSE;
      r->line++;
    }
    r->at++;
  }
  for (; r->at < r->size && r->text[r->at] && !isspace((unsigned char)r->text[r->at]); r->at++)
    if (n < READ_WORD - 1) r->word[n++] = r->text[r->at];
  r->word[n] = 0;
  return (PetscBool)(n > 0);
}

void ReadSkipLine(Reader *r)
{
  while (r->at < r->size && r->text[r->at] != '\n') r->at++;
}

PetscErrorCode ReadNumber(Reader *r, PetscReal *value)
{
  char word[READ_WORD], *end;

  PetscFunctionBeginUser;
  PetscCall(PetscStrncpy(word, r->word, sizeof(word)));
  for (char *c = word; *c; c++)
    if ((*c == 'd' || *c == 'D') && c > word) *c = 'e'; /* as Fortran writes exponents */
  *value = (PetscReal)strtod(word, &end);
  if (end == word || *end || PetscIsInfOrNanReal(*value)) READ_SAY(r, "expected a finite number, found '%s'", r->word);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadNumbers(Reader *r, PetscInt n, const char what[], PetscReal v[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n && !r->error[0]; i++) {
    if (!ReadWord(r, PETSC_TRUE)) READ_SAY(r, "%s, the line ends after %" PetscInt_FMT, what, i);
    else PetscCall(ReadNumber(r, v + i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadInteger(Reader *r, PetscInt *value)
{
  char           *end;
  const long long v = strtoll(r->word, &end, 10);

  PetscFunctionBeginUser;
  *value = (PetscInt)v;
  if (end == r->word || *end || (long long)*value != v) READ_SAY(r, "expected an integer, found '%s'", r->word);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- points and faces ---- */

PetscErrorCode ReadAddPoint(Reader *r, const PetscReal x[3])
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(r->nx + 1, &r->nx_capacity, &r->x, sizeof(*r->x), NULL));
  PetscCall(PetscArraycpy(r->x[r->nx++], x, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadAddCorner(Reader *r, PetscInt point)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(r->ncorner + 1, &r->corner_capacity, &r->corner, sizeof(*r->corner), NULL));
  r->corner[r->ncorner++] = point;
  if (r->ncorner > 3 * TRI_MAX)
    READ_SAY(r, "more than %d triangles: simplify the surface with a mesh program", TRI_MAX);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ReadEndFace(Reader *r, PetscInt corners)
{
  PetscFunctionBeginUser;
  if (corners < 3)
    READ_SAY(r, "a face of %" PetscInt_FMT " corners: it needs 3, the file is cut off or damaged", corners);
  PetscCall(ArrayReserve(r->nface + 1, &r->face_capacity, &r->face, sizeof(*r->face), NULL));
  r->face[r->nface++] = corners;
  PetscFunctionReturn(PETSC_SUCCESS);
}
