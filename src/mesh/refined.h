/* Refined: a mesh of the leaves of a tree (leaves.h), with hanging places left to mesh/hang.h. */
#pragma once
#include "impl.h"
#include "leaves.h"

/* Fill a mesh that has its kind: cells, ghosts (all cells that share a node with an own one, also over a jump), nodes,
   boundaries. Nodes of a cell are slots (mesh/hang.h): those of the large face where a face hangs. Collective. Errors:
   those of LeavesCreate. */
PetscErrorCode RefinedBuild(Mesh, PetscInt levels, const MeshSurface *);
PetscErrorCode RefinedDestroy(Mesh);
