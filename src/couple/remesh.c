/* Couple: what goes by the mesh, made and made anew (CoupleRemesh of couple.h). */
#include "compat.h"
#include "impl.h"

PetscErrorCode CoupleCreateSolver(Couple c)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(c->bodies, &still));
  PetscCall(FlowSolverCreate(c->flow, c->constraint, (PetscBool)!still, &c->solver));
  PetscCall(FlowSolverSetOwing(c->solver, CoupleOwes(c)));
  if (c->drive) PetscCall(DriveSetSolver(c->drive, c->solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode tell_rung(void *couple)
{
  Couple c = (Couple)couple;

  PetscFunctionBeginUser;
  if (c->rung->moved) PetscCall((*c->rung->moved)(c->rung_data));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What goes by the mesh */
PetscErrorCode CoupleCreateParts(Couple c)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  PetscCall(FittedCreate(c->flow, c->bodies, &c->hole));
  PetscCall(BoundariesCreate(c->flow, c->hole, &c->boundaries));
  PetscCall(CoupleFindNormals(c));
  PetscCall(CoupleCreateConstraint(c));
  PetscCall(ConstraintGetRigidSize(c->constraint, &c->nr));
  if (!c->drive) PetscCall(DriveCreate(c, &c->drive)); /* goes by no mesh, but by the number of rigid velocities */
  PetscCall(CoupleCreateSolver(c));
  PetscCall(IndicatorCreate(c->mesh, c->bodies, &c->mark));
  PetscCall(MovedCreate(c->flow, tell_rung, c, &c->moved));
  PetscCall(MovedSetSolver(c->moved, c->solver));
  if (c->rung->create) PetscCall((*c->rung->create)(c, &c->rung_data));
  PetscCall(
    PetscCalloc4(l->nnode_all * l->dim, &c->u, l->ncell * (l->dim + 1), &c->p, l->ncell * (l->dim + 1), &c->dp, l->nnode_all * l->dim, &c->rhs));
  PetscCall(CoupleCreateOwed(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroyParts(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(FittedDestroy(&c->hole));
  PetscCall(BoundariesDestroy(&c->boundaries));
  PetscCall(PetscFree2(c->rim, c->outward));
  PetscCall(ConstraintDestroy(&c->constraint));
  PetscCall(IndicatorDestroy(&c->mark));
  if (c->rung->destroy && c->rung_data) PetscCall((*c->rung->destroy)(c->rung_data));
  c->rung_data = NULL;
  c->terms     = NULL;
  c->hollow    = NULL;
  PetscCall(AleDestroy(&c->follow));
  PetscCall(MovedDestroy(&c->moved));
  PetscCall(PetscFree4(c->u, c->p, c->dp, c->rhs));
  PetscCall(CoupleDestroyOwed(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleLeave(Couple c)
{
  PetscFunctionBeginUser;
  if (c->rung->leave) PetscCall((*c->rung->leave)(c->rung_data, &c->left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleRemesh(Couple c, Mesh *old)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleDestroyParts(c));
  PetscCall(CoupleCreateParts(c));
  c->domain = 0;
  if (c->owed && c->residue.steps > 0) c->residue.meshes++;
  PetscCall(PetscArrayzero(c->owed_U, c->s->n * c->nr)); /* as the new arrays on the mesh: none is owed */
  if (c->left) PetscCall((*c->rung->arrive)(c->rung_data, &c->left, old));
  PetscFunctionReturn(PETSC_SUCCESS);
}
