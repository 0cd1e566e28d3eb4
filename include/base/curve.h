/* Curve: the ranks' parts of a box that is cut into a lattice of cells and dealt along the Z curve (Morton 1966): a
   rank has the cells from its first key on to the next rank's. So every rank can tell whose a position is, without
   boxes that overlap, from one number a rank and the lattice's lines. */
#pragma once
#include <petscsys.h>
#include <stdint.h>

typedef struct _p_Curve *Curve;

/* Key of cell x [dim] of the lattice, at most 2^20 cells an axis */
uint64_t CurveKey(PetscInt dim, const PetscInt x[]);
/* Of the first keys [size] of all ranks: whose a key is */
PetscMPIInt CurveRank(PetscMPIInt size, const uint64_t first[], uint64_t key);

/* Lines of the lattice, cells [dim] + 1 an axis, ascending; first [size]: key of every rank's first cell. Copies both.
   Not collective. */
PetscErrorCode CurveCreate(PetscInt dim, const PetscInt cells[], const PetscReal *const line[], PetscMPIInt size,
                           const uint64_t first[], Curve *);
PetscErrorCode CurveDestroy(Curve *);
/* The rank that has the cell at x; outside of the box, that of the cell nearest along the axes. Not collective. */
PetscMPIInt CurveOwner(Curve, const PetscReal x[]);
