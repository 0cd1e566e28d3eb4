/* SolidFields: snapshots of elastic solids, solid_<step>.h5 and solid_<step>.xdmf for ParaView: their meshes as they
   are, displacement and velocity at the nodes, Cauchy stress of the law (without the pressure of the flow) and J in the
   cells; of membranes edges or faces, with tensions (force/length) and J of the area. Rank 0 writes, since all ranks
   have all. Called by run. */
#pragma once
#include "solid/solid.h"

/* Into the existing folder dir. Collective. Error: a file that cannot be written. */
PetscErrorCode SolidFieldsWrite(MPI_Comm, Solids, const char dir[], PetscInt step, PetscReal time);
