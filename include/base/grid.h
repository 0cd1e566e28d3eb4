/* Grid: a search grid that finds neighbours among many boxes without comparing all pairs.

   An item is a square (cube) box, given by its centre and half-width; it is listed in every cell it touches. Two boxes
   that overlap therefore share a cell, whatever their sizes, and a point needs to look into one cell only. Points and
   boxes outside the grid are clamped to its border cells, which keeps both statements true. Local (not collective),
   lengths in the unit of the caller. */
#pragma once
#include <petscsys.h>

typedef struct _p_Grid *Grid;

/* Over lower .. upper (dim 2 or 3) with cells at least `size` wide; wider when more than max_cells would be needed. */
PetscErrorCode GridCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], PetscReal size,
                          PetscInt max_cells, Grid *);
PetscErrorCode GridDestroy(Grid *);
/* Items must be numbered from 0 without large holes (memory grows with the largest number), each inserted once. */
PetscErrorCode GridInsert(Grid, PetscInt item, const PetscReal x[3], PetscReal half);

/* Items that may contain point x: for (PetscInt e = GridFirst(c, x); e >= 0; e = GridNext(c, e)) use GridItem(c, e). */
PetscInt GridFirst(Grid, const PetscReal x[3]);
PetscInt GridNext(Grid, PetscInt entry);
PetscInt GridItem(Grid, PetscInt entry);

/* Calls visit(ctx, i, j), i < j, once for every pair of items that share a cell (which includes all that overlap). */
typedef PetscErrorCode (*GridVisit)(void *ctx, PetscInt i, PetscInt j);
PetscErrorCode GridForPairs(Grid, GridVisit visit, void *ctx);
