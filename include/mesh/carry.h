/* Carry: fields from one refined mesh to the next, when cells are made anew around bodies that have moved.

   Both meshes have the same base cells and levels. Values at new nodes are those of the old Q2 polynomials: exact where
   cells are halved, taken at the nodes that stay where they are joined. Cell functions 1, xi: those of the old cell
   where it was as large or larger, else through the values at the middles of the new cell's children. */
#pragma once
#include "mesh/mesh.h"

/* Make the cells of a refined mesh anew, around this surface; the Mesh and its MeshLocal stay where they are in memory,
   with other contents, and *old has what they were (destroyed by the caller). Whoever has arrays by cells or nodes must
   make them anew. Collective. Errors: those of MeshCreateAround. */
PetscErrorCode MeshRemesh(Mesh, const MeshSurface *, Mesh *old);

/* v [nnode_all of old][bs] -> w [nnode_all of now][bs], ghosts up to date. Collective. */
PetscErrorCode MeshCarryNodes(Mesh old, Mesh now, PetscInt bs, const PetscReal v[], PetscReal w[]);
/* Functions p [ncell of old][dim + 1] of own cells, at the centre and by reference coordinate (xi, -1 to 1 over the
   cell) -> q [ncell of now][dim + 1]. Collective. */
PetscErrorCode MeshCarryCells(Mesh old, Mesh now, const PetscReal p[], PetscReal q[]);
