/* Pattern: see mesh/pattern.h. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"
#include "mesh/pattern.h"

PetscErrorCode MeshFindPattern(Mesh m, PetscInt **row_start, PetscInt **column)
{
  const MeshLocal *l        = &m->loc;
  PetscInt         capacity = 18 * l->nnode + 125, n = 0, *start, *col, *last_row;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode + 1, &start));
  PetscCall(PetscMalloc1(capacity, &col));
  PetscCall(PetscMalloc1(l->nnode_all, &last_row)); /* that a node is in */
  for (PetscInt i = 0; i < l->nnode_all; i++) last_row[i] = -1;
  start[0] = 0;
  for (PetscInt i = 0; i < l->nnode; i++) {
    const PetscInt first = l->node_cell_ptr[i], last = l->node_cell_ptr[i + 1];

    PetscCall(ArrayReserve(n + (last - first) * l->nb, &capacity, &col, sizeof(*col), NULL));
    for (PetscInt q = first; q < last; q++)
      for (PetscInt j = 0; j < l->nb; j++) {
        const PetscInt node = l->cell_node[l->node_cell[q] * l->nb + j];

        if (last_row[node] == i) continue;
        last_row[node] = i;
        col[n++]       = l->node_global[node];
      }
    PetscCall(PetscSortInt(n - start[i], col + start[i]));
    start[i + 1] = n;
  }
  PetscCall(PetscFree(last_row));
  *row_start = start;
  *column    = col;
  PetscFunctionReturn(PETSC_SUCCESS);
}
