/* What the particles of a group are made of. See include/shape/material.h. */
#include "compat.h"
#include "shape/material.h"
#include "base/opt.h"

#define MAX_GROUPS 257

PetscErrorCode MaterialRead(const char group[], Material *material)
{
  static const char *const WORDS[] = {"rigid", "neo_hookean", "st_venant_kirchhoff", "fluid", NULL};
  char                     name[OPT_NAME];
  PetscInt                 index = MATERIAL_RIGID;

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_material", name), WORDS, &index));
  *material = (Material)index;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleListGroups(Material first, Material last, PetscInt *n, ParticleGroup *group[])
{
  char    *list[MAX_GROUPS];
  PetscInt all = MAX_GROUPS;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-particle_groups", &all, list));
  PetscCall(PetscCalloc1(all, group));
  *n = 0;
  for (PetscInt g = 0; g < all; g++) {
    ParticleGroup *to = *group + *n;

    PetscCall(MaterialRead(list[g], &to->material));
    PetscCall(PetscStrncpy(to->name, list[g], sizeof(to->name)));
    *n += to->material >= first && to->material <= last;
    PetscCall(PetscFree(list[g]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleCreateShape(const char group[], PetscInt dim, Shape *shape)
{
  char name[OPT_NAME], type[64] = "", prefix[128];

  PetscFunctionBeginUser;
  PetscCall(OptString(OptJoin("-particle_", group, "_shape", name), type, sizeof(type)));
  PetscCheck(type[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no shape: give %s", group, name);
  (void)snprintf(prefix, sizeof(prefix), "particle_%s_", group);
  PetscCall(ShapeCreate(type, prefix, dim, shape));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleReadPosition(const char group[], const char what[], PetscInt dim, PetscReal x[],
                                    PetscReal *angle)
{
  static const char *const PLACES[] = {"single", "lattice", "random", "table", "pack", NULL};
  char                     name[OPT_NAME];
  PetscInt                 place = 0;
  PetscBool                found;

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_place", name), PLACES, &place));
  PetscCheck(place == 0, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s %s: %s are placed one a group, at -particle_%s_position: remove it, or give each its own group", name,
             PLACES[place], what, group);
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_position", name), dim, x, &found));
  PetscCheck(found, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no position: give %s", group, name);
  *angle = 0;
  PetscCall(OptReal(OptJoin("-particle_", group, "_angle", name), angle));
  PetscFunctionReturn(PETSC_SUCCESS);
}
