/* Rung nodal: nodes inside a body take its velocity; the cells inside stay part of the fluid ("fictitious fluid"). */
#include "compat.h"
#include "impl.h"

static PetscErrorCode draw_nodal(Couple c, void *rung, const PenaltyTerm **terms)
{
  PetscFunctionBeginUser;
  (void)rung;
  *terms = NULL;
  PetscCall(IndicatorInside(c->indicator, c->rigid.X, c->rigid.q));
  PetscCall(IndicatorCheckSeen(c->indicator));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const Rung rung_nodal = {.name = "nodal", .draw = draw_nodal};
