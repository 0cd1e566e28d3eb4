/* Memory of a run, estimated from the number of cells before the mesh is built. */
#pragma once
#include <petscsys.h>

/* For so many cells (PetscInt may not hold their number). Collective. Error: a run needs more than -mesh_memory (1; 0:
   not checked) times the memory of the machines the ranks run on. */
PetscErrorCode MeshCheckMemory(MPI_Comm, PetscInt dim, PetscReal cells);
