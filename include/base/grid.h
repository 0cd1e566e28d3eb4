/* Cells: a search grid that finds neighbours among many boxes without comparing all pairs.

   An item is a square (cube) box, given by its centre and half-width; it is listed in every cell it touches. Two boxes that overlap
   therefore share a cell, whatever their sizes, and a point needs to look into one cell only. Points and boxes outside the grid are
   clamped to its border cells, which keeps both statements true. Layer 0, local (not collective), lengths in the unit of the caller. */
#pragma once
#include <petscsys.h>

typedef struct _p_Cells *Cells;

/* Grid over lower .. upper (dim 2 or 3) with cells at least `size` wide; wider when more than max_cells would be needed. */
PetscErrorCode CellsCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], PetscReal size, PetscInt max_cells, Cells *);
PetscErrorCode CellsDestroy(Cells *);
/* Items must be numbered from 0 without large holes (memory grows with the largest number), each inserted once. */
PetscErrorCode CellsInsert(Cells, PetscInt item, const PetscReal x[3], PetscReal half);

/* Items that may contain point x: for (PetscInt e = CellsFirst(c, x); e >= 0; e = CellsNext(c, e)) use CellsItem(c, e). */
PetscInt CellsFirst(Cells, const PetscReal x[3]);
PetscInt CellsNext(Cells, PetscInt entry);
PetscInt CellsItem(Cells, PetscInt entry);

/* Calls visit(ctx, i, j), i < j, exactly once for every pair of items that share a cell (which includes all that overlap). */
typedef PetscErrorCode (*CellsVisit)(void *ctx, PetscInt i, PetscInt j);
PetscErrorCode CellsForPairs(Cells, CellsVisit visit, void *ctx);
