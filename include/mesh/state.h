/* State of a mesh: what nodes and cells of a checkpoint are found again by. */
#pragma once
#include "base/state.h"
#include "mesh/mesh.h"

/* A State (base/state.h) whose nodes and cells are those of the mesh, told apart by where they are before any
   MeshMoveNodes. The mesh is borrowed. Collective. */
PetscErrorCode MeshCreateState(Mesh, State *);
