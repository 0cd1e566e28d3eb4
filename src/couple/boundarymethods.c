/* BoundaryMethod, the registry: see boundarymethod.h. */
#include "compat.h"
#include "boundarymethod.h"
#include "base/opt.h"

const BoundaryMethod *const methods[] = {&method_nodal, &method_penalty, &method_aligned, NULL};

PetscErrorCode BoundaryMethodChoose(const BoundaryMethod **method)
{
  const char *name[PETSC_STATIC_ARRAY_LENGTH(methods)] = {NULL};
  PetscInt    choice                                   = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; methods[i]; i++) name[i] = methods[i]->name;
  PetscCall(OptChoice("-couple_method", name, &choice));
  *method = methods[choice];
  PetscFunctionReturn(PETSC_SUCCESS);
}
