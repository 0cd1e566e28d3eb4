/* What the particles of a group are made of. See include/shape/material.h. */
#include "compat.h"
#include "shape/material.h"
#include "base/opt.h"

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
