/* The communicator of the run that this process takes part in.

   Objects keep their own (MeshGetComm, BodiesComm, ...) and nobody asks here who has one. This one is for what has
   none: options, remarks, tables and expressions that are read, requests to end, errors before there is a mesh. A
   process takes part in one run at a time; runs on communicators that share no rank go on side by side
   (run/scene.h). */
#pragma once
#include <petscsys.h>

/* PETSC_COMM_WORLD unless a run has set another. Not collective. */
MPI_Comm RunComm(void);
/* From now on; MPI_COMM_NULL: PETSC_COMM_WORLD again. Borrowed. By all ranks of it, between runs. */
void RunCommSet(MPI_Comm);
