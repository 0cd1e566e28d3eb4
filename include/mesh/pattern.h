/* Pattern of a matrix with a row and a column for each node, as its cells couple them. */
#pragma once
#include "mesh/mesh.h"

/* Rows of own nodes as compressed rows with global columns in ascending order; the caller frees both. Not
   collective. */
PetscErrorCode MeshFindPattern(Mesh, PetscInt **row_start, PetscInt **column);
