/* Calm: see calm.h. */
#include "compat.h"
#include "calm.h"
#include "mesh/carry.h"

void CalmBegin(const MeshLocal *l, PetscReal age[])
{
  for (PetscInt i = 0; i < l->nnode_all; i++) age[i] = CALM_STEPS;
}

void CalmStep(const MeshLocal *l, const PetscInt body[], PetscReal age[])
{
  const PetscInt dim = l->dim;

  for (PetscInt i = 0; i < l->nnode_all; i++) {
    PetscBool disturbed = (PetscBool)(body[i] >= 0);

    for (PetscInt d = 0; d < dim; d++)
      disturbed = (PetscBool)(disturbed || l->x[i * dim + d] != l->x_start[i * dim + d]);
    age[i] = disturbed ? 0 : PetscMin(CALM_STEPS, age[i] + 1);
  }
}

PetscErrorCode CalmCarry(Mesh old, Mesh now, PetscReal **velocity, PetscReal **age)
{
  const MeshLocal *l;
  PetscReal       *v, *next;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(now, &l));
  PetscCall(PetscMalloc2(l->nnode_all * l->dim, &v, l->nnode_all, &next));
  PetscCall(MeshCarryVelocities(old, now, 1, (const PetscReal *const *)velocity, &v));
  PetscCall(MeshCarryNodes(old, now, 1, *age, next));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    next[i] = PetscMax(0, PetscMin(CALM_STEPS, PetscFloorReal(next[i] + 1e-9)));
  PetscCall(PetscFree2(*velocity, *age));
  *velocity = v;
  *age      = next;
  PetscFunctionReturn(PETSC_SUCCESS);
}
