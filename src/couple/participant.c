/* CouplePart, the list: see participant.h. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"

PetscErrorCode CoupleAddPart(Couple c, const CouplePart *op, void *part)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(c->nparts + 1, &c->part_capacity, &c->part, sizeof(*c->part), NULL));
  c->part[c->nparts++] = (CoupleEntry){op, part};
  if (op->connect) PetscCall((*op->connect)(c, part, c->solver));
  if (op->after_remesh) PetscCall((*op->after_remesh)(c, part, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleNeedsSolver(Couple c)
{
  PetscFunctionBeginUser;
  c->needs_solver = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}
