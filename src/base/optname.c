/* Opt: names of options, see base/opt.h. */
#include "compat.h"
#include "base/opt.h"
#include "optimpl.h"

PetscBool OptSameName(const char a[], const char b[])
{
  PetscBool same = PETSC_FALSE;

  (void)PetscStrcasecmp(a, b, &same);
  return same;
}

PetscBool OptFits(const char pattern[], const char name[], char word[], size_t len)
{
  const char  *open = strchr(pattern, '<'), *close = strchr(pattern, '>');
  const size_t n = strlen(name), before = open ? (size_t)(open - pattern) : 0, after = open ? strlen(close + 1) : 0;

  if (word) word[0] = 0;
  if (!open) return OptSameName(pattern, name);
  if (n <= before + after || strncasecmp(pattern, name, before) || strcasecmp(close + 1, name + n - after)) return PETSC_FALSE;
  if (word) snprintf(word, len, "%.*s", (int)(n - before - after), name + before);
  return PETSC_TRUE;
}

const char *OptJoin(const char before[], const char word[], const char after[], char name[OPT_NAME])
{
  (void)snprintf(name, OPT_NAME, "%s%s%s", before, word, after);
  return name;
}
