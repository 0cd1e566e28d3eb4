/* Couple: what all participants share on a mesh, and the solver. */
#include "compat.h"
#include "impl.h"

PetscErrorCode CoupleCreateSolver(Couple c)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(c->bodies, &still));
  PetscCall(FlowSolverCreate(c->flow, c->constraint, (PetscBool)!still, &c->solver));
  PetscCall(MovedSetSolver(c->moved, c->solver));
  CoupleEach(c, connect, c->solver);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleRenewSolver(Couple c)
{
  PetscFunctionBeginUser;
  c->renewed = PETSC_TRUE;
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(CoupleCreateSolver(c));
  PetscCall(IndicatorForget(c->indicator)); /* the solver learns of a boundary method's terms when bodies are drawn */
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode tell_moved(void *couple)
{
  Couple c = (Couple)couple;

  PetscFunctionBeginUser;
  CoupleEach(c, moved);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleCreateSystem(Couple c)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  PetscCall(FittedCreate(c->flow, c->bodies, &c->fitted)); /* first: it may send bodies to where they are seen */
  PetscCall(CoupleCreateConstraint(c));
  PetscCall(ConstraintGetRigidSize(c->constraint, &c->nr));
  PetscCall(IndicatorCreate(c->mesh, c->bodies, &c->indicator));
  PetscCall(MovedCreate(c->flow, tell_moved, c, &c->moved));
  PetscCall(CoupleCreateSolver(c));
  PetscCall(PetscCalloc4(l->nnode_all * l->dim, &c->field.u, l->ncell * (l->dim + 1), &c->field.p, l->ncell * (l->dim + 1), &c->field.dp,
                         l->nnode_all * l->dim, &c->field.rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroySystem(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(FittedDestroy(&c->fitted));
  PetscCall(ConstraintDestroy(&c->constraint));
  PetscCall(IndicatorDestroy(&c->indicator));
  PetscCall(MovedDestroy(&c->moved));
  PetscCall(PetscFree4(c->field.u, c->field.p, c->field.dp, c->field.rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}
