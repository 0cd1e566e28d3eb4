/* Bodies: the names of the groups, see bodies.h. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "shape/material.h"
#include <string.h>
#include <strings.h>

/* list [n]: names of the groups, one more than there may be at most; the caller frees each */
static PetscErrorCode read_names(PetscInt *n, char *list[])
{
  PetscFunctionBeginUser;
  *n = BODIES_MAX_GROUPS + 1;
  PetscCall(OptStringArray("-particle_groups", n, list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is it the name of a group, or of a part of the shape of one? */
static PetscBool is_named(const BodyArrays *s, const char word[])
{
  for (PetscInt g = 0; g < s->ngroups; g++) {
    const size_t n = strlen(s->group[g].name);

    if (!strncasecmp(word, s->group[g].name, n) && (!word[n] || word[n] == '_')) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* A group whose shape is given, and that -particle_groups does not name */
static PetscErrorCode find_forgotten(const BodyArrays *s)
{
  static const char before[] = "-particle_", after[] = "_shape";
  char             *all, *line, *rest, word[OPT_NAME] = "", list[1024] = "", value[64];

  PetscFunctionBeginUser;
  PetscCall(OptGetAll(&all));
  for (line = strtok_r(all, "\n", &rest); line && !word[0]; line = strtok_r(NULL, "\n", &rest)) {
    const char  *blank = line + strcspn(line, " ");
    const size_t n = (size_t)(blank - line), fixed = sizeof(before) + sizeof(after) - 2;

    if (n <= fixed || n - fixed >= sizeof(word) || strncasecmp(line, before, sizeof(before) - 1) ||
        strncasecmp(blank - sizeof(after) + 1, after, sizeof(after) - 1))
      continue;
    PetscCall(PetscStrncpy(word, line + sizeof(before) - 1, n - fixed + 1));
    PetscCall(PetscStrncpy(value, *blank ? blank + 1 : "", sizeof(value)));
    if (is_named(s, word)) word[0] = 0;
  }
  PetscCall(PetscFree(all));
  for (PetscInt g = 0; g < s->ngroups; g++) {
    PetscCall(PetscStrlcat(list, s->group[g].name, sizeof(list)));
    PetscCall(PetscStrlcat(list, ",", sizeof(list)));
  }
  PetscCheck(!word[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' is described (-particle_%s_shape %s), but -particle_groups %s it: give -particle_groups %s%s, or remove what describes it",
             word, word, value, s->ngroups ? "does not name" : "is not given, which names", list, word);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Groups of another material leave the list */
static PetscErrorCode keep_rigid(BodyArrays *s)
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) {
    Material material;

    PetscCall(MaterialRead(s->group[g].name, &material));
    if (material == MATERIAL_RIGID && n++ < g)
      PetscCall(PetscStrncpy(s->group[n - 1].name, s->group[g].name, sizeof(s->group[g].name)));
  }
  s->ngroups = n;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodyGroupsName(BodyArrays *s)
{
  char    *list[BODIES_MAX_GROUPS + 1];
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(read_names(&n, list));
  PetscCheck(n <= BODIES_MAX_GROUPS, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_groups has more than %d names: join bodies of one shape in one group with -particle_<group>_place table",
             BODIES_MAX_GROUPS);
  s->ngroups = n;
  PetscCall(PetscCalloc1(n, &s->group));
  for (PetscInt g = 0; g < n; g++) {
    PetscCheck(list[g][0] && strlen(list[g]) < sizeof(s->group[g].name), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_groups: '%s' must have 1 to %d characters", list[g], (int)sizeof(s->group[g].name) - 1);
    PetscCall(PetscStrncpy(s->group[g].name, list[g], sizeof(s->group[g].name)));
    for (PetscInt f = 0; f < g; f++)
      PetscCheck(strcmp(s->group[f].name, s->group[g].name), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "-particle_groups names '%s' twice: remove one", list[g]);
    PetscCall(PetscFree(list[g]));
  }
  PetscCall(find_forgotten(s));
  PetscCall(keep_rigid(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
