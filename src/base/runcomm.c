/* The communicator of a run: see runcomm.h. */
#include "compat.h"
#include "base/runcomm.h"

static MPI_Comm of_run = MPI_COMM_NULL;

MPI_Comm RunComm(void)
{
  return of_run == MPI_COMM_NULL ? PETSC_COMM_WORLD : of_run;
}

void RunCommSet(MPI_Comm comm)
{
  of_run = comm;
}
