/* Couple: the momentum that the solve of a step leaves over goes into the next step (FlowSolverGetOwed), so that errors
   of single steps do not add up (runs/studies/flow-solver, "Residual carried to the next step"). With a penalty only: where
   nodes are rigid, residuals sit beside surfaces that move on, and a body would receive what a node there is owed. */
#include "compat.h"
#include "impl.h"

PetscBool CoupleOwes(Couple c)
{
  PetscBool free = PETSC_FALSE;

  for (PetscInt g = 0; g < c->s->ngroups; g++) free = (PetscBool)(free || c->s->group[g].free);
  return (PetscBool)(free && c->implicit && c->rung->soft);
}

PetscErrorCode CoupleCreateOwed(Couple c)
{
  PetscFunctionBeginUser;
  if (CoupleOwes(c)) PetscCall(PetscCalloc2(c->loc->nnode_all * c->loc->dim, &c->owed, c->loc->nnode * c->loc->dim, &c->owed_next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroyOwed(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree2(c->owed, c->owed_next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The force of a body is that of its equation with the velocities that are told, without what is owed: what the body
   receives then, the fluid gives */
static void add_to_bodies(Couple c, PetscReal factor)
{
  for (PetscInt i = 0; i < c->s->n * c->nr; i++) c->g[i] += factor * c->owed_U[i];
}

void CoupleAddOwed(Couple c)
{
  if (!c->owed || c->step->dt == 0) return;
  for (PetscInt i = 0; i < c->loc->nnode * c->loc->dim; i++) c->rhs[i] += c->step->ct * c->owed[i];
  add_to_bodies(c, c->step->ct);
}

PetscErrorCode CoupleFindOwed(Couple c)
{
  PetscFunctionBeginUser;
  if (!c->owed || c->step->dt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  add_to_bodies(c, -c->step->ct);
  PetscCall(FlowSolverGetOwed(c->solver, c->owed_next, c->owed_U_next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleAcceptOwed(Couple c)
{
  PetscFunctionBeginUser;
  if (!c->owed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(c->owed, c->owed_next, c->loc->nnode * c->loc->dim));
  PetscCall(PetscArraycpy(c->owed_U, c->owed_U_next, c->s->n * c->nr));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleGetDropped(Couple c, PetscReal *meshes, PetscReal *residuals)
{
  PetscFunctionBeginUser;
  *meshes    = c->residue.meshes;
  *residuals = c->residue.large;
  PetscFunctionReturn(PETSC_SUCCESS);
}
