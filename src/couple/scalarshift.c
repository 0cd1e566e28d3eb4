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

/* v at these vertices, own ones inside, <- mean over the vertices of the cells around, a few times */
static PetscErrorCode spread_vertices(Couple c, PetscInt n, const PetscInt vertex[], PetscReal v[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  PetscReal       *next;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n * dim, &next));
  for (PetscInt sweep = 0; sweep < SWEEPS; sweep++) {
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt i      = vertex[e];
      PetscReal      sum[3] = {0, 0, 0};
      PetscInt       count  = 0;

      for (PetscInt q = l->node_cell_ptr[i]; q < l->node_cell_ptr[i + 1]; q++)
        for (PetscInt j = 0; j < nb; j++) {
          const PetscInt k = l->cell_node[l->node_cell[q] * nb + j];

          if (count_middles(dim, j) || k == i) continue;
          for (PetscInt a = 0; a < dim; a++) sum[a] += v[k * dim + a];
          count++;
        }
      for (PetscInt a = 0; a < dim; a++) next[e * dim + a] = sum[a] / count;
    }
    for (PetscInt e = 0; e < n * dim; e++) v[vertex[e / dim] * dim + e % dim] = next[e];
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
  for (PetscInt e = 0; e < l->ncell_all; e++)
    for (PetscInt j = 0; j < l->nb && inactive[e] < 0; j++) inside[l->cell_node[e * l->nb + j]] = 0;
  PetscCall(MeshSyncNodesInt(c->mesh, inside)); /* outer ghosts do not see all of their cells */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarShiftInside(Couple c, const PetscReal x[], const PetscInt inactive[], PetscReal *shift[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;
  PetscInt        *inside, *cell, *vertex, n = 0, nvertex = 0; /* cells with nodes inside */
  PetscReal       *v;

  PetscFunctionBeginUser;
  if (!*shift) PetscCall(PetscMalloc1(l->nnode_all * dim, shift));
  v = *shift;
  PetscCall(PetscMalloc3(l->nnode_all, &inside, l->ncell_all, &cell, l->nnode, &vertex));
  PetscCall(ScalarMarkInside(c, inactive, inside));
  for (PetscInt e = 0; e < l->ncell_all; e++) {
    PetscInt any = 0;

    for (PetscInt j = 0; j < nb; j++) any += inside[l->cell_node[e * nb + j]];
    if (any) cell[n++] = e;
  }
  PetscCall(PetscArrayzero(v, l->nnode_all * dim));
  for (PetscInt e = 0; e < n; e++)
    for (PetscInt j = 0; j < nb; j++) {
      const PetscInt i = l->cell_node[cell[e] * nb + j];

      if (inside[i] == 1 && i < l->nnode && count_middles(dim, j) == 0) {
        vertex[nvertex++] = i;
        inside[i]         = 2;
      }
      for (PetscInt a = 0; a < dim && !inside[i]; a++) v[i * dim + a] = x[i * dim + a] - l->x_start[i * dim + a];
    }
  PetscCall(spread_vertices(c, nvertex, vertex, v));
  for (PetscInt middles = 1; middles <= dim; middles++)
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt *node = l->cell_node + cell[e] * nb;

      for (PetscInt j = 0; j < nb; j++)
        if (inside[node[j]] && count_middles(dim, j) == middles) fill_node(dim, node, j, v);
    }
  PetscCall(MeshSyncNodes(c->mesh, dim, v));
  for (PetscInt i = 0; i < l->nnode_all; i++)
    for (PetscInt e = i * dim; e < (i + 1) * dim; e++) v[e] = inside[i] ? v[e] - (x[e] - l->x_start[e]) : 0;
  PetscCall(PetscFree3(inside, cell, vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}
