/* Couple: what all participants share on a mesh, and the solver. */
#include "compat.h"
#include "impl.h"

#define SPARE 64 /* bodies, for which arrays of the solver have capacity at least */

PetscErrorCode CoupleDescribeBodies(Couple c)
{
  PetscBool *united;
  PetscReal *length;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(c->s->n, &united, c->s->n, &length));
  for (PetscInt k = 0; k < c->s->n; k++) {
    united[k] = BodiesGetGroup(c->s, k)->obstacle;
    length[k] = BodiesGetGroup(c->s, k)->radius;
  }
  PetscCall(ConstraintSetUnited(c->constraint, united));
  PetscCall(ConstraintSetLengths(c->constraint, length));
  PetscCall(PetscFree2(united, length));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleCreateConstraint(Couple c)
{
  PetscFunctionBeginUser;
  if (BodiesComm(c->bodies) == PETSC_COMM_SELF) {
    PetscCall(ConstraintCreate(c->mesh, c->s->n, &c->constraint));
    PetscCall(CoupleDescribeBodies(c));
  } else {
    c->slots = PetscMax(c->slots, ConstraintSlots(c->comm, c->s->nall));
    PetscCall(ConstraintCreateLocal(c->mesh, c->s->nall, c->s->n + c->s->n / 4 + SPARE, c->slots, &c->constraint));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleCreateSolver(Couple c)
{
  PetscBool still;

  PetscFunctionBeginUser;
  PetscCall(BodiesAreStill(c->bodies, &still));
  PetscCall(FlowSolverCreate(c->flow, c->constraint, (PetscBool)!still, &c->solver));
  PetscCall(MeshUpdateSetSolver(c->mesh_update, c->solver));
  CoupleEach(c, connect, c->solver);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleRenewSolver(Couple c)
{
  PetscFunctionBeginUser;
  c->renewed = PETSC_TRUE;
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(CoupleCreateSolver(c));
  PetscCall(
    IndicatorInvalidate(c->indicator)); /* the solver learns of a boundary method's terms when bodies are drawn */
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_mesh_data(void *couple)
{
  Couple c = (Couple)couple;

  PetscFunctionBeginUser;
  CoupleEach(c, mesh_updated);
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
  PetscCall(MeshUpdateCreate(c->flow, update_mesh_data, c, &c->mesh_update));
  PetscCall(CoupleCreateSolver(c));
  PetscCall(PetscCalloc4(l->nnode_all * l->dim, &c->field.u, l->ncell * (l->dim + 1), &c->field.p,
                         l->ncell * (l->dim + 1), &c->field.dp, l->nnode_all * l->dim, &c->field.rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleDestroySystem(Couple c)
{
  PetscFunctionBeginUser;
  PetscCall(FlowSolverDestroy(&c->solver));
  PetscCall(FittedDestroy(&c->fitted));
  PetscCall(ConstraintDestroy(&c->constraint));
  PetscCall(IndicatorDestroy(&c->indicator));
  PetscCall(MeshUpdateDestroy(&c->mesh_update));
  PetscCall(PetscFree4(c->field.u, c->field.p, c->field.dp, c->field.rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}
