/* ScalarCover: cells that bodies cover, and how they lie in those that surfaces cut: signed distances at the midpoints
   of sub-cells. */
#pragma once
#include "couple/couple.h"

#define SCALAR_MAX_SAMPLES 216 /* of a cell */

typedef struct {
  PetscInt  cell, body, distance; /* distance: offset of its samples, -1: all inside */
  PetscReal inside;               /* part inside */
  PetscBool first;                /* no other body before has it */
} CoveredCell;

typedef struct {
  PetscInt     nsample, count; /* samples an axis, of a cell */
  PetscInt     n, capacity, ndistance, distance_capacity;
  CoveredCell *covered;  /* [n] local ones */
  PetscReal   *distance; /* of samples */
  PetscReal    reach;    /* CutCellReach of the mesh; 0: not known yet */
} ScalarCover;

PetscErrorCode ScalarCoverCreate(PetscInt dim, ScalarCover *);
PetscErrorCode ScalarCoverDestroy(ScalarCover *);
/* Bodies are at X, q (and inside those that the mesh is lined up with). Local. */
PetscErrorCode ScalarCoverFind(ScalarCover *, Couple, const PetscReal (*X)[3], const PetscReal (*q)[4]);
/* Parts of the samples of cut cells outside of bodies: *outside [ndistance], reallocated. Not collective. */
PetscErrorCode ScalarCoverOutside(const ScalarCover *, Couple, PetscReal *outside[]);
/* Part inside of a sample at distance d, with sub-cells of this width */
static inline PetscReal ScalarCoverPart(PetscReal d, PetscReal width)
{
  return PetscMin(1, PetscMax(0, 0.5 - d / width));
}
