/* CoupleParticipant, the list: see participant.h. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"

PetscErrorCode CoupleAddParticipant(Couple c, const CoupleParticipant *op, void *data)
{
  PetscFunctionBeginUser;
  PetscCall(
    ArrayReserve(c->nparticipants + 1, &c->participant_capacity, &c->participant, sizeof(*c->participant), NULL));
  c->participant[c->nparticipants++] = (CoupleEntry){op, data};
  if (op->connect) PetscCall((*op->connect)(c, data, c->solver));
  if (op->after_remesh) PetscCall((*op->after_remesh)(c, data, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleNeedsSolver(Couple c)
{
  PetscFunctionBeginUser;
  c->needs_solver = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}
