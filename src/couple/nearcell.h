/* NearCell: the cell at a place, from one close to it. h [ncell_all]: sizes of cells. Nothing here is collective. */
#pragma once
#include "mesh/mesh.h"

static inline const PetscReal *NearCellMiddle(const MeshLocal *l, PetscInt e)
{
  return l->x + l->cell_node[e * l->nb + l->nb / 2] * l->dim;
}

/* The cell, known here, that place y is in or nearest to, from cell e close to it: across the corner nearest to y,
   again and again */
PetscInt NearCellFind(const MeshLocal *, const PetscReal h[], PetscInt e, const PetscReal y[]);
/* Reference coordinates of y in cell e, by the middle where the cell is a box along the axes; found: it is near enough
   to have some */
PetscErrorCode NearCellLocate(Mesh, const MeshLocal *, const PetscReal h[], PetscInt e, const PetscReal y[],
                              PetscReal xi[3], PetscBool *found);
