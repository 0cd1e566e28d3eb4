/* NearGrid: boxes that are looked for by how near they are, with their periodic images: a search grid (grid.h) for
   every power of two of the reach, made when it is first asked for. Local (not collective). */
#pragma once
#include "base/grid.h"

typedef struct _p_NearGrid *NearGrid;

/* Boxes [n] with centres x and half-widths half (< 0: none there), both copied, in a domain lower .. upper that is
   periodic along axes with a period > 0. */
PetscErrorCode NearGridCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                              const PetscReal period[3], PetscInt n, const PetscReal (*x)[3], const PetscReal half[],
                              NearGrid *);
PetscErrorCode NearGridDestroy(NearGrid *);
/* The grid whose items include all boxes nearer to a position than reach; box [items]: which box an item is, or an
   image of which. Both borrowed. Error: too many different reaches. */
PetscErrorCode NearGridGet(NearGrid, PetscReal reach, Grid *, const PetscInt *box[]);
