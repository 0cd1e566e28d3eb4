/* AlignTargets: see aligntargets.h. */
#include "compat.h"
#include "aligntargets.h"
#include "base/array.h"

PetscErrorCode AlignTargetsCreate(const MeshLocal *l, const AlignSurfaces *surfaces, PetscInt nfield, AlignTargets *t)
{
  PetscFunctionBeginUser;
  *t = (AlignTargets){.loc = l, .surfaces = surfaces, .nfield = nfield};
  PetscCall(PetscCalloc1(l->nnode_all, &t->stamp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignTargetsDestroy(AlignTargets *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->stamp));
  PetscCall(PetscFree(t->node));
  PetscCall(PetscFree(t->side));
  PetscCall(PetscFree(t->x));
  PetscCall(PetscFree(t->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void AlignTargetsBegin(AlignTargets *t)
{
  t->now++;
  t->n = 0;
}

/* Are all cells around node i covered by surfaces? */
static PetscBool is_fully_covered(const MeshLocal *l, PetscInt i, const PetscInt cell_surface[])
{
  for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
    if (cell_surface[l->node_cell[q]] < 0) return PETSC_FALSE;
  return PETSC_TRUE;
}

static PetscErrorCode append(AlignTargets *t, PetscInt i, const PetscReal x[], PetscInt side)
{
  const PetscInt dim = t->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(t->n + 1, &t->capacity, &t->node, sizeof(*t->node), &t->side, sizeof(*t->side), &t->x,
                         dim * sizeof(*t->x), &t->value, t->nfield * dim * sizeof(*t->value), NULL));
  t->node[t->n] = i;
  t->side[t->n] = side;
  PetscCall(PetscArraycpy(t->x + dim * t->n, x, dim));
  t->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignTargetsAdd(AlignTargets *t, const AlignResult *r, PetscInt i, const PetscReal x[])
{
  const AlignSurfaces *s = t->surfaces;
  const PetscInt       k = r->node_surface[i];

  PetscFunctionBeginUser;
  if (t->stamp[i] == t->now) PetscFunctionReturn(PETSC_SUCCESS);
  t->stamp[i] = t->now;
  if (i >= t->loc->nnode || is_fully_covered(t->loc, i, r->cell_surface)) PetscFunctionReturn(PETSC_SUCCESS);
  if (k < 0 || r->inactive[k] || !AlignLeavesFluid(s, k)) PetscCall(append(t, i, x, r->node_side[i]));
  else {
    PetscCall(append(t, i, x, s->number[k] + 1));
    PetscCall(append(t, i, x, -(s->number[k] + 1)));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Was own node i inside a surface whose inside had left the fluid, and which is aligned no more? */
static PetscBool is_given_up(const AlignTargets *t, const AlignResult *r, const PetscBool aligned[], PetscInt i)
{
  const PetscInt k = r->cell_before[t->loc->node_cell[t->loc->node_cell_ptr[i]]];

  return (PetscBool)(!aligned[k] && AlignLeavesFluid(t->surfaces, k));
}

PetscErrorCode AlignTargetsFind(AlignTargets *t, const AlignResult *r, const PetscBool aligned[])
{
  const MeshLocal *l = t->loc;

  PetscFunctionBeginUser;
  AlignTargetsBegin(t);
  for (PetscInt e = 0; e < r->nnode; e++) PetscCall(AlignTargetsAdd(t, r, r->node[e], r->x + l->dim * e));
  for (PetscInt e = 0; e < r->ncell * l->nb; e++) {
    const PetscInt i = l->cell_node[r->cell[e / l->nb] * l->nb + e % l->nb];

    if (t->stamp[i] == t->now || i >= l->nnode || !is_fully_covered(l, i, r->cell_before)) continue;
    if (is_given_up(t, r, aligned, i)) continue;
    PetscCall(AlignTargetsAdd(t, r, i, l->x + l->dim * i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
