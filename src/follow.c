/* Follow: see follow.h. */
#include "compat.h"
#include "follow.h"

struct _p_Follow {
  Flow             flow;
  Mesh             mesh;
  const MeshLocal *loc;
  Deform           deform;
  PetscReal       *now, *old, *drift; /* [nnode_all][dim] places at the last two times; velocity of the nodes */
  PetscInt        *all, *fluid;       /* [nnode_all] 0, 1, ...; [ncell_all] -1 */
  DeformResult     result;
};

PetscErrorCode FollowCreate(Flow flow, Deform deform, Follow *follow)
{
  Follow   f;
  PetscInt n, size;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  f->flow   = flow;
  f->deform = deform;
  PetscCall(FlowGetMesh(flow, &f->mesh));
  PetscCall(MeshGetLocal(f->mesh, &f->loc));
  n    = f->loc->nnode_all;
  size = n * f->loc->dim;
  PetscCall(PetscMalloc5(size, &f->now, size, &f->old, size, &f->drift, n, &f->all, f->loc->ncell_all, &f->fluid));
  PetscCall(PetscArraycpy(f->now, f->loc->x, size));
  PetscCall(PetscArraycpy(f->old, f->loc->x, size));
  for (PetscInt i = 0; i < n; i++) f->all[i] = i;
  for (PetscInt c = 0; c < f->loc->ncell_all; c++) f->fluid[c] = -1;
  f->result = (DeformResult){{1, 1}, 1, 0};
  *follow   = f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FollowDestroy(Follow *follow)
{
  PetscFunctionBeginUser;
  if (!*follow) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree5((*follow)->now, (*follow)->old, (*follow)->drift, (*follow)->all, (*follow)->fluid));
  PetscCall(PetscFree(*follow));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FollowUpdate(Follow f, FlowSolver solver, PetscReal (*X)[3], PetscReal (*q)[4])
{
  const MeshLocal *l = f->loc;
  const FlowStep  *s;

  PetscFunctionBeginUser;
  if (X) {
    PetscCall(FlowSolverForgetCells(solver, l->ncell_all, f->all));
    PetscCall(MeshMoveNodes(f->mesh, l->nnode_all, f->all, f->now));
    PetscCall(DeformFollow(f->deform, X, q, &f->result));
    PetscCall(FlowUpdateCells(f->flow, l->ncell_all, f->all, f->fluid));
  }
  PetscCall(FlowGetStep(f->flow, &s));
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) f->drift[i] = s->ct * l->x[i] - s->d0 * f->now[i] - s->d1 * f->old[i];
  PetscCall(FlowSetDrift(f->flow, f->drift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FollowAccept(Follow f)
{
  const PetscInt size = f->loc->nnode_all * f->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->old, f->now, size));
  PetscCall(PetscArraycpy(f->now, f->loc->x, size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FollowGetResult(Follow f, const DeformResult **result)
{
  PetscFunctionBeginUser;
  *result = &f->result;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The mesh of the fields that are there, whose pressures already belong to it */
static PetscErrorCode restore_mesh(Follow f)
{
  const MeshLocal *l  = f->loc;
  const PetscInt   np = l->ncell * (l->dim + 1);
  PetscReal       *p[2], *keep;

  PetscFunctionBeginUser;
  PetscCall(MeshMoveNodes(f->mesh, l->nnode_all, f->all, f->now));
  PetscCall(MeshRebase(f->mesh));
  PetscCall(FlowGetFields(f->flow, NULL, NULL, &p[0]));
  PetscCall(FlowGetOldPressure(f->flow, &p[1]));
  PetscCall(PetscMalloc1(2 * np, &keep));
  for (PetscInt s = 0; s < 2; s++) PetscCall(PetscArraycpy(keep + s * np, p[s], np));
  PetscCall(FlowUpdateCells(f->flow, l->ncell_all, f->all, f->fluid));
  for (PetscInt s = 0; s < 2; s++) PetscCall(PetscArraycpy(p[s], keep + s * np, np));
  PetscCall(PetscFree(keep));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FollowVisitState(Follow f, State state)
{
  PetscFunctionBeginUser;
  PetscCall(StateNodes(state, "place", f->loc->dim, f->now));
  PetscCall(StateNodes(state, "place_old", f->loc->dim, f->old));
  if (StateIsLoading(state)) PetscCall(restore_mesh(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}
