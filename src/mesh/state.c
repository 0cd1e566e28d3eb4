/* State of a mesh: see mesh/state.h. */
#include "compat.h"
#include "mesh/state.h"

#define TOLERANCE 1e-6 /* of the smallest cell size: a node is found again within it */

static PetscErrorCode sync_nodes(void *mesh, PetscInt bs, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(MeshSyncNodes(mesh, bs, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCreateState(Mesh mesh, State *state)
{
  const MeshLocal *l;
  MPI_Comm         comm;
  StateKeys        k;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshGetComm(mesh, &comm));
  k = (StateKeys){.dim          = l->dim,
                  .n            = {l->nnode, l->ncell},
                  .start        = {l->node_start, l->cell_start},
                  .total        = {l->nnode_global, l->ncell_global},
                  .tolerance    = TOLERANCE * l->h,
                  .sync         = sync_nodes,
                  .sync_context = mesh};
  PetscCall(PetscMalloc1(l->nnode * l->dim, &k.x[STATE_NODE]));
  PetscCall(PetscMalloc1(l->ncell * l->dim, &k.x[STATE_CELL]));
  PetscCall(PetscArraycpy(k.x[STATE_NODE], l->x_start, l->nnode * l->dim));
  for (PetscInt c = 0; c < l->ncell; c++)
    PetscCall(
      PetscArraycpy(k.x[STATE_CELL] + c * l->dim, l->x_start + l->cell_node[c * l->nb + l->nb / 2] * l->dim, l->dim));
  PetscCall(StateCreate(comm, &k, state));
  PetscFunctionReturn(PETSC_SUCCESS);
}
