/* Mark: cells of a refined mesh that are halved one by one, for refinement by the flow.

   A set of cells that are refined, besides those that the formula of -mesh_levels refines (around bodies, in boxes). It
   is closed: where a cell is refined, all cells of its size that touch it exist, so that levels never jump by more than
   one (2:1 balance across corners). Every rank holds what is refined in its own cells, and while a mesh is made what it
   asks about (MeshSurface.look). */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_MeshMarks *MeshMarks;

PetscErrorCode MeshMarksDestroy(MeshMarks *);
/* What is refined in the mesh, and its marked cells (mark [ncell]) that have a level to go: a set of its own.
   Collective. */
PetscErrorCode MeshMarksGrow(Mesh, const PetscBool mark[], MeshMarks *);
/* Level of own cell c, 0: that of base cells. Not collective. */
PetscErrorCode MeshGetLevel(Mesh, PetscInt c, PetscInt *level);
