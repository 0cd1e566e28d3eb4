/* MshText: see mshtext.h. */
#include "compat.h"
#include "mshtext.h"
#include <ctype.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void MshFault(MshText *t, const char format[], ...)
{
  va_list args;

  if (*t->fault) return;
  va_start(args, format);
  (void)vsnprintf(t->fault, MSH_FAULT, format, args);
  va_end(args);
  t->at = t->end;
}

PetscErrorCode MshOpen(const char path[], char fault[MSH_FAULT], MshText *t)
{
  FILE  *file;
  long   size = -1;
  size_t got  = 0;

  PetscFunctionBeginUser;
  *t     = (MshText){.version = 1, .fault = fault};
  *fault = 0;
  file   = fopen(path, "rb");
  if (file && !fseek(file, 0, SEEK_END)) size = ftell(file);
  if (file && size >= 0) {
    PetscCall(PetscMalloc1((size_t)size + 1, &t->text));
    rewind(file);
    got          = fread(t->text, 1, (size_t)size, file);
    t->text[got] = 0;
  }
  if (file) fclose(file);
  t->at  = t->text;
  t->end = t->text + got;
  if (!t->text || got != (size_t)size) MshFault(t, "cannot be read to its end");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MshClose(MshText *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sections ---- */

PetscBool MshNextSection(MshText *t, char name[])
{
  size_t n = 0;

  while (t->at < t->end && *t->at != '$') t->at++;
  if (t->at >= t->end) return PETSC_FALSE;
  t->at++;
  while (t->at < t->end && !isspace((unsigned char)*t->at)) {
    if (n + 1 < MSH_NAME) name[n++] = *t->at;
    t->at++;
  }
  name[n] = 0;
  MshBody(t);
  return PETSC_TRUE;
}

void MshEndSection(MshText *t, const char name[])
{
  char         wanted[MSH_NAME + 5];
  const size_t n = (size_t)snprintf(wanted, sizeof(wanted), "%s%s", strlen(name) == 3 ? "$END" : "$End", name);

  if (*t->fault) return;
  while (t->at + n <= t->end && memcmp(t->at, wanted, n)) t->at++;
  if (t->at + n > t->end) MshFault(t, "ends within its section $%s: it was not written to its end", name);
  else t->at += n;
}

void MshBody(MshText *t)
{
  while (t->at < t->end && *t->at != '\n') t->at++;
  if (t->at < t->end) t->at++;
}

void MshFormat(MshText *t)
{
  PetscBool binary;

  t->version = MshReal(t);
  binary     = (PetscBool)(MshNumber(t) == 1);
  t->size    = (size_t)MshNumber(t);
  t->binary  = binary;
  if (t->version < 2 || (t->version >= 2.3 && t->version < 4) || t->version >= 4.2)
    MshFault(t, "is of format %g of Gmsh, which is not known here: save it in format 4.1 (gmsh -format msh41)",
             t->version);
  if (t->size != 8 && (t->size != 4 || t->version < 4))
    MshFault(t, "has numbers of %d bytes instead of 8: save it again (gmsh -format msh41)", (int)t->size);
  if (!t->binary || *t->fault) return;
  MshBody(t);
  t->swap = (PetscBool)(MshInt(t) != 1);
}

/* ---- numbers ---- */

/* size bytes in the order of this machine; FALSE: the file ends */
static PetscBool take_bytes(MshText *t, size_t size, void *value)
{
  unsigned char bytes[8];

  if ((size_t)(t->end - t->at) < size) {
    MshFault(t, "ends too early: it was not written to its end");
    return PETSC_FALSE;
  }
  for (size_t i = 0; i < size; i++) bytes[t->swap ? size - 1 - i : i] = (unsigned char)t->at[i];
  memcpy(value, bytes, size);
  t->at += size;
  return PETSC_TRUE;
}

/* What is no number, up to the next blank */
static void fault_number(MshText *t, const char wanted[])
{
  size_t n = 0;

  while (isspace((unsigned char)*t->at)) t->at++;
  while (n < 24 && t->at[n] && !isspace((unsigned char)t->at[n])) n++;
  MshFault(t, "has '%.*s' where %s belongs", (int)n, t->at, wanted);
}

PetscInt MshNumber(MshText *t)
{
  char           *end   = NULL;
  const long long value = *t->fault ? 0 : strtoll(t->at, &end, 10);

  if (*t->fault) return 0;
  if (end == t->at || value > PETSC_MAX_INT || value < -(long long)PETSC_MAX_INT) {
    fault_number(t, "a whole number");
    return 0;
  }
  t->at = end;
  return (PetscInt)value;
}

PetscInt MshInt(MshText *t)
{
  int32_t value = 0;

  if (!t->binary) return MshNumber(t);
  return !*t->fault && take_bytes(t, 4, &value) ? (PetscInt)value : 0;
}

PetscInt MshSize(MshText *t)
{
  int64_t value = 0;

  if (!t->binary) return MshNumber(t);
  if (t->size == 4) return MshInt(t);
  if (*t->fault || !take_bytes(t, 8, &value)) return 0;
  if (value < 0 || value > PETSC_MAX_INT)
    MshFault(t, "counts or numbers something up to %lld, more than this build of PETSc can", (long long)value);
  return *t->fault ? 0 : (PetscInt)value;
}

PetscReal MshReal(MshText *t)
{
  char  *end   = NULL;
  double value = 0;

  if (*t->fault) return 0;
  if (t->binary) return take_bytes(t, 8, &value) ? (PetscReal)value : 0;
  value = strtod(t->at, &end);
  if (end == t->at || !(value - value == 0)) fault_number(t, "a number");
  else t->at = end;
  return *t->fault ? 0 : (PetscReal)value;
}

void MshQuoted(MshText *t, char name[])
{
  size_t n = 0;

  name[0] = 0;
  while (!*t->fault && t->at < t->end && *t->at != '"' && *t->at != '\n') t->at++;
  if (*t->fault || t->at >= t->end || *t->at != '"') {
    MshFault(t, "has a physical name without quotes");
    return;
  }
  for (t->at++; t->at < t->end && *t->at != '"' && *t->at != '\n'; t->at++)
    if (n + 1 < MSH_NAME) name[n++] = *t->at;
  name[n] = 0;
  if (t->at < t->end) t->at++;
}

PetscInt MshCount(MshText *t, PetscInt n, PetscInt numbers)
{
  if (n >= 0 && (double)n * (double)numbers <= (double)(t->end - t->at)) return n;
  MshFault(t, "says that %" PetscInt_FMT " things follow, more than it has: it was not written to its end", n);
  return 0;
}
