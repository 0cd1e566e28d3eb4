/* Refined: a mesh of the leaves of a tree (leaves.h), with hanging places left to mesh/hang.h. */
#pragma once
#include "../impl.h"
#include "leaves.h"

/* Fill a mesh that has its kind: cells, ghosts (all cells that share a node with an own one, also over a jump), nodes,
   boundaries. Nodes of a cell are slots (mesh/hang.h): those of the large face where a face hangs. Takes the leaves
   over, closed. Collective. Errors: more memory than there is; levels that jump. */
PetscErrorCode RefinedBuild(Mesh, Leaves *);
PetscErrorCode RefinedDestroy(Mesh);
/* The whole mesh of leaves that are given: those of LeavesCreateFromList, in the box of the options with these base
   cells. Collective. */
PetscErrorCode MeshCreateOf(MPI_Comm, const PetscInt cells[3], PetscInt levels, PetscInt64 total, const Leaf[], Mesh *);
