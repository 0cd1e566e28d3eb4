/* Options: what PETSc's database holds, looked at without marking it as used, and the defaults put into it; see opt.h.
   */
#include "compat.h"
#include "base/runcomm.h"
#include "optimpl.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* PETSc up to 3.18 keeps options in a table of 512 places, of which some are left for its own use. */
#define OPT_TABLE_MAX 500

/* Whole database as text, one option a line, without marking anything as used; free() it. */
static PetscErrorCode list_database(char **text)
{
  size_t      len = 0;
  FILE       *file;
  PetscViewer viewer;

  PetscFunctionBeginUser;
  *text = NULL;
  file  = open_memstream(text, &len);
  PetscCheck(file, RunComm(), PETSC_ERR_MEM, "Out of memory for the list of options");
  PetscCall(PetscViewerASCIIOpenWithFILE(PETSC_COMM_SELF, file, &viewer));
  PetscCall(PetscOptionsView(NULL, viewer));
  PetscCall(PetscViewerDestroy(&viewer));
  fclose(file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Next "-name[ value]" of the list, which is cut into lines, without headings and the source (PETSc 3.19 and newer). */
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

PetscErrorCode OptLookUp(const char name[], PetscBool *present, PetscInt *count, char value[], size_t len)
{
  char *text, *cursor, *line;

  PetscFunctionBeginUser;
  *present = PETSC_FALSE;
  *count   = 0;
  value[0] = 0;
  PetscCall(list_database(&text));
  for (cursor = text; (line = next_option(&cursor)); ++*count) {
    char *blank = strchr(line, ' ');

    if (blank) *blank = 0;
    if (!OptSameName(line, name)) continue;
    *present = PETSC_TRUE;
    snprintf(value, len, "%s", blank ? blank + 1 : "");
  }
  free(text);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptPeek(const char name[], char text[], size_t len)
{
  PetscBool present;
  PetscInt  count;

  PetscFunctionBeginUser;
  PetscCall(OptLookUp(name, &present, &count, text, len));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptDefault(const char name[], const char value[])
{
  OptEntry *entry;
  char      text[OPT_LINE];
  PetscBool present;
  PetscInt  count;

  PetscFunctionBeginUser;
  PetscCall(OptLookUp(name, &present, &count, text, sizeof(text)));
  PetscCall(OptMakeEntry(name, &entry));
  if (present && !entry->is_default) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(present || PETSC_VERSION_GE(3, 20, 0) || count < OPT_TABLE_MAX, RunComm(), PETSC_ERR_USER_INPUT,
             "No room for option %s: scene and command line hold %" PetscInt_FMT
             " options, PETSC's table has 512 places; move per-body values into a table file (-particle_<group>_table bodies.csv)",
             name, count);
  PetscCall(PetscOptionsSetValue(NULL, name, value));
  entry->is_default = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptTake(const char name[], char text[], size_t len)
{
  const OptEntry *entry = OptFindEntry(name);
  PetscBool       present;
  PetscInt        count;

  PetscFunctionBeginUser;
  PetscCall(OptLookUp(name, &present, &count, text, len));
  if (present && !OptIsArgument(name) && !(entry && entry->is_default)) PetscCall(PetscOptionsClearValue(NULL, name));
  else text[0] = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptGetAll(char **text)
{
  char  *all, *cursor, *line;
  size_t len;

  PetscFunctionBeginUser;
  PetscCall(list_database(&all));
  len = strlen(all) + 2;
  PetscCall(PetscCalloc1(len, text));
  for (cursor = all; (line = next_option(&cursor));) {
    PetscCall(PetscStrlcat(*text, line, len));
    PetscCall(PetscStrlcat(*text, "\n", len));
  }
  free(all);
  PetscFunctionReturn(PETSC_SUCCESS);
}
