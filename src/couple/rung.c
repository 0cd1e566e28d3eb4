/* Rung, the registry: see rung.h. */
#include "compat.h"
#include "rung.h"
#include "base/opt.h"

const Rung *const rungs[] = {&rung_nodal, &rung_penalty, &rung_snap, NULL};

PetscErrorCode RungChoose(const Rung **rung)
{
  const char *name[PETSC_STATIC_ARRAY_LENGTH(rungs)] = {NULL};
  PetscInt    choice                                 = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; rungs[i]; i++) name[i] = rungs[i]->name;
  PetscCall(OptChoice("-couple_method", name, &choice));
  *rung = rungs[choice];
  PetscFunctionReturn(PETSC_SUCCESS);
}
