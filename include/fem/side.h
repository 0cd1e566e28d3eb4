/* Side: the sides of a Q2 cell, numbered 2 axis, + 1 for the upper one. */
#pragma once
#include "fem/gauss.h"

#define SIDE_MAX 9 /* nodes, or quadrature points, of a side in space; 3 in the plane */

/* Nodes of a side by lattice position, the next axis fastest; the middle one is that of the face */
static inline void SideList(PetscInt dim, PetscInt side, PetscInt slot[SIDE_MAX])
{
  const PetscInt step[3] = {1, 3, 9}, axis = side / 2, a = (axis + 1) % dim, b = dim == 3 ? (axis + 2) % 3 : 0;

  for (PetscInt i = 0; i < (dim == 3 ? 9 : 3); i++)
    slot[i] = (side % 2 ? 2 : 0) * step[axis] + i % 3 * step[a] + (dim == 3 ? i / 3 * step[b] : 0);
}

/* In space the same, its directions in the order whose product points out of the cell */
static inline void SideListOutward(PetscInt side, PetscInt slot[SIDE_MAX])
{
  PetscInt list[SIDE_MAX];

  SideList(3, side, list);
  for (PetscInt j = 0; j < 9; j++) slot[j] = list[side % 2 ? j : 3 * (j % 3) + j / 3];
}

/* Are all nodes of a side of the cell with these nodes marked? */
static inline PetscBool SideIsMarked(PetscInt dim, PetscInt side, const PetscInt node[], const PetscBool marked[])
{
  PetscInt slot[SIDE_MAX];

  SideList(dim, side, slot);
  for (PetscInt i = 0; i < (dim == 3 ? 9 : 3); i++)
    if (!marked[node[slot[i]]]) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Reference coordinates of quadrature point q of a side, 3-point Gauss an axis, and its weight */
static inline PetscReal SidePoint(PetscInt dim, PetscInt side, PetscInt q, PetscReal xi[3])
{
  const PetscInt axis   = side / 2;
  PetscReal      weight = 1;

  xi[axis] = side % 2 ? 1 : -1;
  for (PetscInt k = 1; k < dim; k++, q /= 3) {
    xi[(axis + k) % dim] = GAUSS3_POINT[q % 3];
    weight *= GAUSS3_WEIGHT[q % 3];
  }
  return weight;
}
