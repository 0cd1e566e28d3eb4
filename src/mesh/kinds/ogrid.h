/* Ogrid: square rings of quadrilaterals, alone (annulus), around a block of squares (disc) or inside one (a circle
   fitted into a channel); in space layers of hexahedra over them.

   In reference coordinates, where all edges are straight; map.h bends the rings to circles. */
#pragma once
#include <petscdmplex.h>
#include "map.h"

typedef struct {
  PetscInt  n, nring;   /* cells along a side of the rings, layers of cells */
  PetscInt  nsquare[2]; /* unit squares along x, y; 0: none */
  PetscInt  block[2];   /* first of the n x n squares whose place the rings take */
  PetscBool middle;     /* the squares, n x n, are the middle of the rings, with their centre at 0 */
  PetscInt  nlayer;     /* layers along z; 0: in the plane */
  PetscBool periodic;   /* the last layer ends at the first one */
} OGrid;

/* The mesh on rank 0; rings from half-width inner to outer of the map. Collective; the caller destroys dm. */
PetscErrorCode OGridCreate(MPI_Comm, const OGrid *, const MeshMap *, DM *dm);
