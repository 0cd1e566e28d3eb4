/* AlignKept: see alignkept.h. */
#include "compat.h"
#include "alignkept.h"
#include "mesh/carry.h"

PetscErrorCode AlignKeptCreate(const MeshLocal *l, const AlignResult *r, AlignKept *kept)
{
  PetscFunctionBeginUser;
  *kept = (AlignKept){.done = r != NULL};
  PetscCall(PetscMalloc2(l->ncell_all, &kept->inactive, l->ncell_all, &kept->side));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    kept->inactive[c] = r ? r->cell_surface[c] : -1;
    kept->side[c]     = r ? r->cell_side[c] : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignKeptDestroy(AlignKept *kept)
{
  PetscFunctionBeginUser;
  PetscCall(RemapDestroy(&kept->remap));
  PetscCall(MeshDestroy(&kept->mesh));
  for (PetscInt k = 0; k < ALIGN_FIELDS; k++) PetscCall(PetscFree(kept->field[k]));
  PetscCall(PetscFree2(kept->inactive, kept->side));
  PetscCall(PetscFree(kept->near));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* 1 at the nodes of cells of the old mesh that were lined up or inactive, brought over as a velocity is */
static PetscErrorCode find_near(AlignKept *kept, Mesh now)
{
  const MeshLocal *l, *m;
  PetscReal       *at;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(kept->mesh, &l));
  PetscCall(MeshGetLocal(now, &m));
  PetscCall(PetscCalloc1(l->nnode_all, &at));
  PetscCall(PetscMalloc1(m->nnode_all, &kept->near));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    const PetscInt *node   = l->cell_node + c * l->nb;
    PetscBool       placed = (PetscBool)(kept->inactive[c] >= 0);

    for (PetscInt j = 0; j < l->nb && !placed; j++)
      for (PetscInt a = 0; a < l->dim; a++)
        placed = (PetscBool)(placed || l->x[l->dim * node[j] + a] != l->x_start[l->dim * node[j] + a]);
    for (PetscInt j = 0; j < l->nb && placed; j++) at[node[j]] = 1;
  }
  PetscCall(MeshCarryNodes(kept->mesh, now, 1, at, kept->near));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignKeptArrive(AlignKept *kept, Mesh *old, Mesh now)
{
  PetscFunctionBeginUser;
  kept->mesh = *old;
  *old       = NULL;
  PetscCall(RemapCreate(kept->mesh, &kept->remap));
  PetscCall(find_near(kept, now));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own fluid nodes that the fit moves, or where the old mesh was lined up */
static PetscErrorCode find_targets(const AlignKept *kept, const AlignResult *r, AlignTargets *t)
{
  const MeshLocal *l = t->loc;

  PetscFunctionBeginUser;
  AlignTargetsBegin(t);
  for (PetscInt e = 0; e < r->nnode; e++) PetscCall(AlignTargetsAdd(t, r, r->node[e], r->x + l->dim * e));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (kept->near[i] != 0) PetscCall(AlignTargetsAdd(t, r, i, l->x + l->dim * i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignKeptEvaluate(const AlignKept *kept, const AlignResult *r, Remap of_new,
                                 const PetscReal *const now[], AlignTargets *t, RemapCount *count)
{
  const PetscInt dim = t->loc->dim, bs = t->nfield * dim;
  PetscReal     *size;

  PetscFunctionBeginUser;
  PetscCall(find_targets(kept, r, t));
  PetscCall(PetscMalloc1(t->n, &size));
  for (PetscInt i = 0; i < t->n; i++) {
    size[i] = RemapCellSize(of_new, t->node[i]);
    for (PetscInt e = 0; e < bs; e++) t->value[bs * i + e] = now[e / dim][dim * t->node[i] + e % dim];
  }
  PetscCall(RemapEvaluateAt(kept->remap, t->n, t->x, size, t->side, (RemapCells){kept->inactive, kept->side}, t->nfield,
                            (const PetscReal *const *)kept->field, t->value, count));
  PetscCall(PetscFree(size));
  PetscFunctionReturn(PETSC_SUCCESS);
}
