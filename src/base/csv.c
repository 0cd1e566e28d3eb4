/* Csv: see csv.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "base/csv.h"
#include <ctype.h>
#include <stdlib.h>
#include <string.h>

/* All ranks get the text of the file, or all raise the same error. */
static PetscErrorCode read_text(const char file[], char **text)
{
  PetscMPIInt rank, count;
  PetscInt    length = -1;

  PetscFunctionBeginUser;
  *text = NULL;
  PetscCallMPI(MPI_Comm_rank(RunComm(), &rank));
  if (!rank) {
    FILE *f = fopen(file, "rb");

    if (f) {
      if (!fseek(f, 0, SEEK_END)) length = (PetscInt)ftell(f);
      rewind(f);
      if (length >= 0) {
        PetscCall(PetscMalloc1(length + 1, text));
        if (fread(*text, 1, (size_t)length, f) != (size_t)length) length = -1;
      }
      fclose(f);
    }
  }
  PetscCallMPI(MPI_Bcast(&length, 1, MPIU_INT, 0, RunComm()));
  if (length < 0) PetscCall(PetscFree(*text));
  PetscCheck(length >= 0, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN,
             "Table '%s' cannot be read: check the path and its permissions (in a scene it is relative to the scene file)",
             file);
  if (rank) PetscCall(PetscMalloc1(length + 1, text));
  PetscCall(PetscMPIIntCast(length, &count));
  PetscCallMPI(MPI_Bcast(*text, count, MPI_CHAR, 0, RunComm()));
  (*text)[length] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static char *trim(char *s)
{
  char *end = s + strlen(s);

  while (end > s && isspace((unsigned char)end[-1])) *--end = 0;
  while (isspace((unsigned char)*s)) s++;
  return s;
}

/* Cut the next item off a comma-separated line; NULL at the end. */
static char *cut_field(char **tail)
{
  char *start = *tail, *comma;

  if (!start) return NULL;
  comma = strchr(start, ',');
  *tail = comma ? comma + 1 : NULL;
  if (comma) *comma = 0;
  return trim(start);
}

PetscInt CsvColumn(const Csv *t, const char name[])
{
  for (PetscInt i = 0; i < t->ncolumn; i++)
    if (!strcmp(t->name[i], name)) return i;
  return -1;
}

static PetscErrorCode parse_header(Csv *t, PetscInt at, char *line)
{
  PetscFunctionBeginUser;
  t->header = at;
  for (char *field, *tail = line; (field = cut_field(&tail));) {
    PetscCheck(CsvColumn(t, field) < 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": column '%s' appears twice: remove one", t->file, at, field);
    PetscCheck(t->ncolumn < CSV_COLUMNS, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": more than %d columns: remove some", t->file, at, CSV_COLUMNS);
    PetscCall(PetscStrncpy(t->name[t->ncolumn++], field, sizeof(t->name[0])));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode parse_row(Csv *t, PetscInt at, char *line)
{
  PetscInt i = 0;

  PetscFunctionBeginUser;
  for (char *field, *tail = line, *end; (field = cut_field(&tail)); i++) {
    double value;

    PetscCheck(i < t->ncolumn, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": more values than the %" PetscInt_FMT " columns of the header line", t->file, at,
               t->ncolumn);
    value = strtod(field, &end);
    PetscCheck(end != field && !*end && !PetscIsInfOrNanReal((PetscReal)value), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s:%" PetscInt_FMT ": '%s' in column '%s' is not a finite number", t->file, at, field, t->name[i]);
    t->value[t->nrow * t->ncolumn + i] = (PetscReal)value;
  }
  PetscCheck(i == t->ncolumn, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": %" PetscInt_FMT " values, the header line names %" PetscInt_FMT " columns", t->file,
             at, i, t->ncolumn);
  t->line[t->nrow++] = at;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CsvRead(const char file[], const char first[], Csv *t)
{
  char    *text;
  PetscInt capacity = 1, at = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(t, sizeof(*t)));
  PetscCall(PetscStrncpy(t->file, file, sizeof(t->file)));
  PetscCall(read_text(file, &text));
  for (const char *s = text; *s; s++) capacity += *s == '\n';
  PetscCall(PetscMalloc1(capacity, &t->line));
  for (char *next = strncmp(text, "\xef\xbb\xbf", 3) ? text : text + 3; next;) { /* after a byte-order mark */
    char *line = next, *end = strchr(line, '\n');

    next = end ? end + 1 : NULL;
    if (end) *end = 0;
    at++;
    line = trim(line);
    if (!*line || *line == '#') continue;
    if (t->ncolumn) {
      PetscCall(parse_row(t, at, line));
      continue;
    }
    PetscCall(parse_header(t, at, line));
    PetscCall(PetscMalloc1(capacity * t->ncolumn, &t->value));
  }
  PetscCheck(t->ncolumn, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s:%" PetscInt_FMT ": the table is empty: its first line names the columns %s", file, at, first);
  PetscCall(PetscFree(text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CsvDestroy(Csv *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->value));
  PetscCall(PetscFree(t->line));
  t->ncolumn = t->nrow = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
