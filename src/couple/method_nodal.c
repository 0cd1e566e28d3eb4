/* BoundaryMethod nodal: nodes inside a body take its velocity; the cells inside stay part of the fluid ("fictitious
   fluid"). */
#include "compat.h"
#include "impl.h"

static PetscErrorCode update_nodal(Couple c, void *method, const PenaltyTerm **terms)
{
  PetscFunctionBeginUser;
  (void)method;
  *terms = NULL;
  PetscCall(IndicatorInside(c->indicator, c->rigid.X, c->rigid.q));
  PetscCall(IndicatorCheckSeen(c->indicator));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const BoundaryMethod method_nodal = {.name = "nodal", .update = update_nodal};
