/* Rung nodal: nodes inside a body take its velocity; the cells inside stay part of the fluid ("fictitious fluid"). */
#include "compat.h"
#include "impl.h"

static PetscErrorCode draw_nodal(Couple c, void *rung, const PenaltyTerm **terms)
{
  PetscFunctionBeginUser;
  (void)rung;
  *terms = NULL;
  PetscCall(IndicatorInside(c->mark, c->X, c->q));
  PetscCall(IndicatorCheckSeen(c->mark));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const Rung rung_nodal = {.name = "nodal", .draw = draw_nodal};
