/* Scalars, values where nothing is solved for: means over the nodes around, ring by ring. */
#include "compat.h"
#include "impl.h"

#define RINGS 3

PetscErrorCode ScalarsExtend(Scalars all, PetscInt s)
{
  PetscFunctionBeginUser;
  all->scalar[s].extended = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own nodes that have no value yet and lie in a cell with one that has */
static void extend_ring(const MeshLocal *l, const PetscReal has[], const PetscReal x[], PetscReal next[])
{
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal sum = 0, n = 0;

    if (has[i] != 0) continue;
    for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
      for (PetscInt j = 0; j < l->nb; j++) {
        const PetscInt k = l->cell_node[l->node_cell[q] * l->nb + j];

        sum += has[k] * x[k];
        n += has[k];
      }
    next[2 * i]     = n > 0 ? sum / n : x[i];
    next[2 * i + 1] = n > 0;
  }
}

static PetscBool has_value(const Scalar *s, PetscInt i)
{
  return (PetscBool)(s->seen[i] || s->owner[i] >= 0 || ScalarIsLumped(s, i));
}

PetscErrorCode ScalarExtendSolution(Scalars all, Scalar *s)
{
  const MeshLocal *l   = all->loc;
  PetscBool        any = PETSC_FALSE;
  PetscReal       *has, *next;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode; i++) any = (PetscBool)(any || !has_value(s, i));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, COMPAT_MPI_BOOL, MPI_LOR, all->comm));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc2(l->nnode_all, &has, 2 * l->nnode_all, &next));
  for (PetscInt i = 0; i < l->nnode_all; i++) has[i] = has_value(s, i);
  PetscCall(MeshSyncNodes(all->mesh, 1, has)); /* outer ghosts do not see all of their cells */
  for (PetscInt ring = 0; ring < RINGS; ring++) {
    for (PetscInt i = 0; i < l->nnode_all; i++) {
      next[2 * i]     = s->x[i];
      next[2 * i + 1] = has[i];
    }
    extend_ring(l, has, s->x, next);
    PetscCall(MeshSyncNodes(all->mesh, 2, next));
    for (PetscInt i = 0; i < l->nnode_all; i++) {
      s->x[i] = next[2 * i];
      has[i]  = next[2 * i + 1];
    }
  }
  PetscCall(PetscFree2(has, next));
  PetscFunctionReturn(PETSC_SUCCESS);
}
