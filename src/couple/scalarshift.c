/* ScalarShiftInside: see scalarshift.h. */
#include "compat.h"
#include "impl.h"
#include "scalarshift.h"

#define SWEEPS 8

/* Lattice positions of a cell's node: how many axes are in the middle */
static PetscInt count_middles(PetscInt dim, PetscInt j)
{
  return (j % 3 == 1) + (j / 3 % 3 == 1) + (dim == 3 && j / 9 == 1);
}

/* v at vertices inside <- mean over the vertices of the cells around, a few times */
static PetscErrorCode spread_vertices(Couple c, const PetscInt inside[], const PetscBool vertex[], PetscReal v[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  PetscReal       *next;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(l->nnode_all * dim, &next));
  for (PetscInt sweep = 0; sweep < SWEEPS; sweep++) {
    PetscCall(PetscArraycpy(next, v, l->nnode_all * dim));
    for (PetscInt i = 0; i < l->nnode; i++) {
      PetscReal sum[3] = {0, 0, 0};
      PetscInt  n      = 0;

      if (!inside[i] || !vertex[i]) continue;
      for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
        for (PetscInt j = 0; j < nb; j++) {
          const PetscInt k = l->cell_node[l->node_cell[q] * nb + j];

          if (count_middles(dim, j) || k == i) continue;
          for (PetscInt a = 0; a < dim; a++) sum[a] += v[k * dim + a];
          n++;
        }
      for (PetscInt a = 0; a < dim; a++) next[i * dim + a] = sum[a] / n;
    }
    PetscCall(PetscArraycpy(v, next, l->nnode * dim));
    PetscCall(MeshSyncNodes(c->mesh, dim, v));
  }
  PetscCall(PetscFree(next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Node j of a cell whose axes `middle` are in the middle, from nodes with fewer: transfinite interpolation */
static void fill_node(PetscInt dim, const PetscInt node[], PetscInt j, PetscReal v[])
{
  const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9}, stride[3] = {1, 3, 9};

  for (PetscInt a = 0; a < dim; a++) {
    PetscReal sum = 0;

    /* over all non-empty sets of middle axes, moved to both ends: signs alternate, halves of each */
    for (PetscInt set = 1; set < 8; set++) {
      PetscReal weight = -1, difference = 0;
      PetscInt  n = 0, fits = 1;

      for (PetscInt e = 0; e < 3; e++)
        if ((set >> e) & 1) {
          if (e >= dim || at[e] != 1) fits = 0;
          weight *= -0.5;
          n++;
        }
      if (!fits) continue;
      for (PetscInt ends = 0; ends < 8; ends++) {
        PetscInt k = j, valid = 1;

        for (PetscInt e = 0; e < 3; e++) {
          if ((set >> e) & 1) k += (ends >> e) & 1 ? stride[e] : -stride[e];
          else if ((ends >> e) & 1) valid = 0;
        }
        if (valid) difference += v[node[k] * dim + a];
      }
      sum += weight * difference;
    }
    v[node[j] * dim + a] = sum;
  }
}

PetscErrorCode ScalarMarkInside(Couple c, const PetscInt inactive[], PetscInt inside[])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) inside[i] = 1;
  for (PetscInt e = 0; e < l->ncell_all * l->nb; e++)
    if (inactive[e / l->nb] < 0) inside[l->cell_node[e]] = 0;
  PetscCall(MeshSyncNodesInt(c->mesh, inside)); /* outer ghosts do not see all of their cells */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarShiftInside(Couple c, const PetscReal x[], const PetscInt inactive[], PetscReal *shift[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  PetscInt        *inside;
  PetscBool       *vertex;
  PetscReal       *v;

  PetscFunctionBeginUser;
  if (!*shift) PetscCall(PetscMalloc1(l->nnode_all * dim, shift));
  v = *shift;
  PetscCall(PetscMalloc2(l->nnode_all, &inside, l->nnode_all, &vertex));
  PetscCall(ScalarMarkInside(c, inactive, inside));
  for (PetscInt e = 0; e < l->ncell_all * nb; e++)
    vertex[l->cell_node[e]] = (PetscBool)(count_middles(dim, e % nb) == 0);
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) v[i] = inside[i / dim] ? 0 : x[i] - l->x_start[i];
  PetscCall(spread_vertices(c, inside, vertex, v));
  for (PetscInt middles = 1; middles <= dim; middles++)
    for (PetscInt e = 0; e < l->ncell_all; e++)
      for (PetscInt j = 0; j < nb; j++)
        if (inside[l->cell_node[e * nb + j]] && count_middles(dim, j) == middles)
          fill_node(dim, l->cell_node + e * nb, j, v);
  PetscCall(MeshSyncNodes(c->mesh, dim, v));
  for (PetscInt i = 0; i < l->nnode_all * dim; i++) v[i] = inside[i / dim] ? v[i] - (x[i] - l->x_start[i]) : 0;
  PetscCall(PetscFree2(inside, vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}
