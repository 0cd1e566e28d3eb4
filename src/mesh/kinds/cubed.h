/* Cubed: layers of hexahedra between cubes, six blocks of them, alone (shell) or around a cube of cells (ball).

   In reference coordinates, where all edges are straight; map.h bends the cubes to spheres (the equiangular cubed
   sphere of Ronchi, Iacono & Paolucci, J. Comput. Phys. 124, 93, 1996). */
#pragma once
#include <petscdmplex.h>
#include "map.h"

typedef struct {
  PetscInt  n, nring; /* cells along an edge of the cubes, layers of cells */
  PetscBool middle;   /* the innermost cube is filled with n^3 cells */
} Cubed;

/* The mesh on rank 0; cubes from half-width inner to outer of the map, about 0. Collective; the caller destroys dm. */
PetscErrorCode CubedCreate(MPI_Comm, const Cubed *, const MeshMap *, DM *dm);
