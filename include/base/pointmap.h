/* PointMap: who holds the point at this position?

   Two distributed lists of points in space describe the same set in different orders (a mesh on another number of
   ranks): finds for every point of one list its partner in the other, by a directory distributed over the ranks by a
   hash of rounded coordinates. Work and memory a rank are proportional to its own points, whatever the number of ranks.
   Lengths in the unit of the points. */
#pragma once
#include <petscsf.h>

/* xroot [nroot][dim], xleaf [nleaf][dim] own points of this rank, dim 1 to 3; partners are at most `tolerance` > 0
   apart in every coordinate, and no two points of one list are so close. *missing is the number of leaf points of all
   ranks without a partner, and where [dim] one of them; if it is 0, *sf has this rank's leaf i connected to its partner
   among the roots (destroyed by the caller), otherwise it is NULL. Collective. */
PetscErrorCode PointMapCreate(MPI_Comm comm, PetscInt dim, PetscReal tolerance, PetscInt nroot, const PetscReal xroot[],
                              PetscInt nleaf, const PetscReal xleaf[], PetscSF *sf, PetscInt *missing,
                              PetscReal where[]);
