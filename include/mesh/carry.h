/* Carry: fields from one refined mesh to the next, when cells are rebuilt around bodies that have moved.

   Both meshes fill the same box. Values at new nodes are those of the old Q2 polynomials: exact where cells are halved,
   taken at the nodes that stay where they are joined. Cell functions 1, xi: those of the old cell where it was as large
   or larger, else through the values at the middles of the new cell's children. Base cells and levels may differ, too,
   when a run goes on from a checkpoint with others. */
#pragma once
#include "base/state.h"
#include "mesh/mesh.h"

/* Make the cells of a refined mesh anew, around this surface; the Mesh and its MeshLocal stay where they are in memory,
   with other contents, and *old has what they were (destroyed by the caller). Whoever has arrays by cells or nodes must
   make them anew. Collective. Errors: those of MeshCreateAround. */
PetscErrorCode MeshRemesh(Mesh, const MeshSurface *, Mesh *old);
/* The same with a mesh that is there: *now becomes the old one. Not collective. */
PetscErrorCode MeshReplace(Mesh, Mesh now);
/* Are its cells those that the options ask for around this surface? Collective. */
PetscErrorCode MeshIsAround(Mesh, const MeshSurface *, PetscBool *same);

/* The cells of a refined mesh in a checkpoint. Saving: StateVisit of a Mesh; nothing for others, and for loading. */
PetscErrorCode MeshVisitTree(void *mesh, State);
/* Give a refined mesh the cells that MeshVisitTree has saved; *old has what they were, as from MeshRemesh, NULL: it has
   them, or the file has none. `look`: at that module (StateBeginLook). The box is that of the options. Collective.
   Errors: other base cells in a graded box; those of loading. */
PetscErrorCode MeshRestore(Mesh, State look, Mesh *old);

/* v [nnode_all of old][bs] -> w [nnode_all of now][bs], ghosts up to date. Collective. */
PetscErrorCode MeshCarryNodes(Mesh old, Mesh now, PetscInt bs, const PetscReal v[], PetscReal w[]);
/* The same for up to six fields v [nnode_all][dim], NULL: none, but that where cells are joined the values in the
   middle of edges, faces and cells keep the integrals along and over them: momentum and flow through faces stay what
   they were, exactly where levels change by one. The positions are not those of a mesh whose nodes move. Nodes of cells
   that stay as they are are copied; positions in old cells of other ranks are asked of these alone. Collective. */
PetscErrorCode MeshCarryVelocities(Mesh old, Mesh now, PetscInt count, const PetscReal *const v[],
                                   PetscReal *const w[]);
/* Functions p [ncell of old][dim + 1] of own cells, at the centre and by reference coordinate (xi, -1 to 1 over the
   cell) -> q [ncell of now][dim + 1]. Collective. */
PetscErrorCode MeshCarryCells(Mesh old, Mesh now, const PetscReal p[], PetscReal q[]);
