/* Nearby: see nearby.h. */
#include "compat.h"
#include "nearby.h"
#include "mesh/remap.h"

#define REACH 0.5 /* of the cells around a node: as large as those that it is looked for in */

/* How far to look around own nodes */
static PetscErrorCode list_sizes(Mesh mesh, const MeshLocal *l, PetscReal size[])
{
  Remap there;

  PetscFunctionBeginUser;
  PetscCall(RemapCreate(mesh, &there));
  for (PetscInt i = 0; i < l->nnode; i++) size[i] = REACH * RemapCellSize(there, i);
  PetscCall(RemapDestroy(&there));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode NearbyStart(const SimComponents *from, const SimComponents *to)
{
  const MeshLocal *l, *old;
  const PetscReal *u, *p;
  PetscReal       *size, *v;
  PetscInt        *side, *inactive;
  Remap            remap;
  RemapCount       count;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(from->mesh, &old));
  PetscCall(MeshGetLocal(to->mesh, &l));
  PetscCall(CoupleGetSolution(from->couple, &u, &p));
  PetscCall(PetscCalloc4(l->nnode, &size, l->nnode, &side, l->nnode_all * l->dim, &v, old->ncell_all, &inactive));
  for (PetscInt c = 0; c < old->ncell_all; c++) inactive[c] = -1; /* bodies move their cells with them */
  PetscCall(list_sizes(to->mesh, l, size));
  PetscCall(RemapCreate(from->mesh, &remap));
  PetscCall(RemapEvaluateAt(remap, l->nnode, l->x, size, side, (RemapCells){.inactive = inactive}, 1, &u, v, &count));
  PetscCall(RemapDestroy(&remap));
  PetscCall(MeshSyncNodes(to->mesh, l->dim, v));
  PetscCall(FlowStartFrom(to->flow, v, NULL));
  PetscCall(PetscFree4(size, side, v, inactive));
  PetscFunctionReturn(PETSC_SUCCESS);
}
