/* CoupleDrops, parts: which cells of the interface's inside are connected. Every cell takes the least number of those
   that it shares an edge (in space a face) with, until nothing changes on any rank. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/sparse.h"

/* The smallest label >= 0 of the cells around the middle node i of a side: those on both its sides, of several sizes
   where levels of the mesh jump */
static PetscReal smallest_around(const MeshLocal *l, PetscInt i, const PetscReal label[])
{
  PetscReal smallest = PETSC_MAX_REAL;

  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++) {
    const PetscReal v = label[l->cell_node[l->node_cell[q] * l->nb + l->nb / 2]];

    if (v >= 0) smallest = PetscMin(smallest, v);
  }
  return smallest;
}

/* Until nothing changes on this rank */
static PetscBool spread(const MeshLocal *l, PetscReal label[])
{
  const PetscInt middle = l->nb / 2, axes[3] = {1, 3, 9};
  PetscBool      any = PETSC_FALSE, again = PETSC_TRUE;

  while (again) {
    again = PETSC_FALSE;
    for (PetscInt c = 0; c < l->ncell_all; c++) {
      const PetscInt *node = l->cell_node + c * l->nb;

      for (PetscInt e = 0; e < 2 * l->dim && label[node[middle]] >= 0; e++) {
        const PetscReal v = smallest_around(l, node[middle + (e % 2 ? 1 : -1) * axes[e / 2]], label);

        if (v >= label[node[middle]]) continue;
        label[node[middle]] = v;
        again = any = PETSC_TRUE;
      }
    }
  }
  return any;
}

/* Labels of cells that have kept their own, ascending, of all ranks: the parts */
static PetscErrorCode gather_roots(Couple c, const PetscReal label[], PetscInt *n, PetscReal **root)
{
  const MeshLocal *l    = c->loc;
  PetscInt         mine = 0;
  PetscReal       *own;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->ncell, &own));
  for (PetscInt e = 0; e < l->ncell; e++)
    if (label[l->cell_node[e * l->nb + l->nb / 2]] == (PetscReal)l->cell_global[e])
      own[mine++] = (PetscReal)l->cell_global[e];
  PetscCall(SparseGather(c->comm, mine, sizeof(*own), own, n, root, NULL));
  PetscCall(PetscFree(own));
  PetscCall(PetscSortReal(*n, *root));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsFindParts(Couple c, const PetscInt cell_surface[], PetscInt part[], PetscInt *n)
{
  const MeshLocal *l = c->loc;
  PetscReal       *label, *root;
  PetscBool        any = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all, &label));
  for (PetscInt i = 0; i < l->nnode_all; i++) label[i] = -1;
  for (PetscInt e = 0; e < l->ncell_all; e++)
    if (cell_surface[e] >= 0) label[l->cell_node[e * l->nb + l->nb / 2]] = (PetscReal)l->cell_global[e];
  while (any) {
    any = spread(l, label);
    PetscCall(MeshSyncNodes(c->mesh, 1, label));
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, COMPAT_MPI_BOOL, MPI_LOR, c->comm));
  }
  PetscCall(gather_roots(c, label, n, &root));
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    PetscInt at = 0;

    while (at < *n && root[at] != label[l->cell_node[e * l->nb + l->nb / 2]]) at++;
    part[e] = at < *n ? at : -1;
  }
  PetscCall(PetscFree(root));
  PetscCall(PetscFree(label));
  PetscFunctionReturn(PETSC_SUCCESS);
}
