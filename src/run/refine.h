/* Refine: the bodies of a scene as what a mesh refines around (-mesh_levels, MeshSurface). */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

/* Bodies first, then the mesh, around them or in boxes alone (MeshReadLevels). Bodies that stand still are fine at
   their surface, others also inside. Collective. Errors: those of both; a body that moves away from its fine cells.
   */
PetscErrorCode RefineCreateMesh(MPI_Comm, PetscBool around, Bodies *, Mesh *);
