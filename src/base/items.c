/* Lists in the database: see optimpl.h. */
#include "compat.h"
#include "optimpl.h"
#include <stdio.h>
#include <string.h>

PetscBool OptNextItem(const char **cursor, char item[], size_t len)
{
  static const char blanks[] = " \t\n\r";
  const char       *start    = *cursor, *end;

  if (!start) return PETSC_FALSE;
  start += strspn(start, blanks);
  end = start + strcspn(start, ", \t\n\r");
  snprintf(item, len, "%.*s", (int)(end - start), start);
  end += strspn(end, blanks);
  *cursor = *end ? end + (*end == ',') : NULL;
  return PETSC_TRUE;
}

PetscInt OptCountWords(const char text[])
{
  char     item[2];
  PetscInt n = 0;

  while (OptNextItem(&text, item, sizeof(item))) n++;
  return n;
}

PetscErrorCode OptCountItems(const char name[], PetscInt *n)
{
  char text[OPT_LINE];

  PetscFunctionBeginUser;
  PetscCall(OptPeek(name, text, sizeof(text)));
  *n = text[0] ? OptCountWords(text) : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptJoinItems(const char name[])
{
  const char *text, *cursor;
  char        item[OPT_LINE], *joined;
  PetscBool   given;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsFindPair(NULL, NULL, name, &text, &given));
  if (!given || !text || !strchr(text, ' ')) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(strlen(text) + 1, &joined));
  for (cursor = text; OptNextItem(&cursor, item, sizeof(item));) {
    if (joined[0]) strcat(joined, ",");
    strcat(joined, item);
  }
  PetscCall(PetscOptionsSetValue(NULL, name, joined));
  PetscCall(PetscFree(joined));
  PetscFunctionReturn(PETSC_SUCCESS);
}
