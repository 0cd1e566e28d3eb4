/* Former names of options and of their choices: OptSpec.old and old_words, see opt.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "optimpl.h"
#include <stdio.h>
#include <string.h>

/* Today's word for a former choice; FALSE if it was never called otherwise. */
static PetscBool find_choice(const OptSpec *row, const char value[], char now[64])
{
  const char *pairs = row->old_words;
  char        old[64];

  while (OptNextPair(&pairs, old, now))
    if (OptSameName(old, value)) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* An option that was called otherwise, or whose value was. */
typedef struct {
  char        name[OPT_LINE], choice[64];
  const char *value; /* as given, or choice */
} Renamed;

static PetscBool rename_option(const char name[], const char value[], Renamed *now)
{
  for (size_t t = 0; t < opt_ntable; t++) {
    for (size_t i = 0; i < opt_table[t].n; i++) {
      const OptSpec  *row            = opt_table[t].spec + i;
      const char     *open           = strchr(row->name, '<');
      char            word[OPT_LINE] = "";
      const PetscBool other_name     = (PetscBool)(row->old && OptFits(row->old, name, word, sizeof(word)));
      PetscBool       other_value;

      if (!other_name && !(row->old_words && OptFits(row->name, name, word, sizeof(word)))) continue;
      other_value = find_choice(row, value, now->choice);
      if (!other_name && !other_value) continue;
      now->value = other_value ? now->choice : value;
      if (open)
        snprintf(now->name, OPT_LINE, "%.*s%.500s%s", (int)(open - row->name), row->name, word, strchr(open, '>') + 1);
      else snprintf(now->name, OPT_LINE, "%s", row->name);
      return PETSC_TRUE;
    }
  }
  return PETSC_FALSE;
}

/* Name and value of a line "-name value"; cuts it in two. */
static const char *cut_line(char line[])
{
  char *blank = strchr(line, ' ');

  if (!blank) return "";
  *blank = 0;
  return blank + 1;
}

PetscErrorCode OptCheckRenamed(void)
{
  char    *all, *line, *tail, list[1600] = ""; /* PETSc cuts messages at 2048 characters */
  Renamed  now;
  PetscInt n = 0;

  PetscFunctionBeginUser;
  PetscCall(OptGetAll(&all));
  for (line = strtok_r(all, "\n", &tail); line; line = strtok_r(NULL, "\n", &tail)) {
    const char  *value = cut_line(line), *source = OptIsArgument(line) ? "command line" : "scene or options file";
    const size_t used = strlen(list);

    if (!rename_option(line, value, &now)) continue;
    n++;
    snprintf(list + used, sizeof(list) - used, "%s%s%s%.50s (%s) is now called %s%s%.50s", used ? "\n  " : "", line,
             value[0] ? " = " : "", value, source, now.name, now.value[0] ? " " : "", now.value);
  }
  PetscCall(PetscFree(all));
  PetscCheck(n != 1, RunComm(), PETSC_ERR_USER_INPUT, "Option %s", list);
  PetscCheck(!n, RunComm(), PETSC_ERR_USER_INPUT, "Options with new names (%" PetscInt_FMT "):\n  %s", n, list);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OptRenameLines(const char text[], char **renamed)
{
  const size_t len = 2 * strlen(text) + 256; /* no name became twice as long */
  char        *copy, *line, *tail;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(len, renamed));
  PetscCall(PetscStrallocpy(text, &copy));
  for (line = strtok_r(copy, "\n", &tail); line; line = strtok_r(NULL, "\n", &tail)) {
    const char *value = cut_line(line), *name = line;
    Renamed     now;

    if (rename_option(line, value, &now)) {
      name  = now.name;
      value = now.value;
    }
    PetscCall(PetscStrlcat(*renamed, name, len));
    if (value[0]) PetscCall(PetscStrlcat(*renamed, " ", len));
    PetscCall(PetscStrlcat(*renamed, value, len));
    PetscCall(PetscStrlcat(*renamed, "\n", len));
  }
  PetscCall(PetscFree(copy));
  PetscFunctionReturn(PETSC_SUCCESS);
}
