/* Opt: names of options, see base/opt.h. */
#include "compat.h"
#include "base/opt.h"
#include "optimpl.h"
#include <ctype.h>

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
  if (n <= before + after || strncasecmp(pattern, name, before) || strcasecmp(close + 1, name + n - after))
    return PETSC_FALSE;
  if (word) snprintf(word, len, "%.*s", (int)(n - before - after), name + before);
  return PETSC_TRUE;
}

const char *OptJoin(const char before[], const char word[], const char after[], char name[OPT_NAME])
{
  (void)snprintf(name, OPT_NAME, "%s%s%s", before, word, after);
  return name;
}

/* Least number of insertions, deletions, replacements and swaps of neighbours from a to b, whatever the case. */
PetscInt OptEditDistance(const char a[], const char b[])
{
  static PetscInt row[3][OPT_LINE + 1]; /* the rows i-2, i-1, i of the table, in turn */
  const PetscInt  na = (PetscInt)PetscMin(strlen(a), OPT_LINE), nb = (PetscInt)PetscMin(strlen(b), OPT_LINE);

  for (PetscInt j = 0; j <= nb; j++) row[0][j] = j;
  for (PetscInt i = 1; i <= na; i++) {
    PetscInt *two = row[(i + 1) % 3], *one = row[(i + 2) % 3], *now = row[i % 3];

    now[0] = i;
    for (PetscInt j = 1; j <= nb; j++) {
      const PetscBool same = (PetscBool)(tolower((unsigned char)a[i - 1]) == tolower((unsigned char)b[j - 1]));

      now[j] = PetscMin(PetscMin(one[j], now[j - 1]) + 1, one[j - 1] + !same);
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) now[j] = PetscMin(now[j], two[j - 2] + 1);
    }
  }
  return row[na % 3][nb];
}
