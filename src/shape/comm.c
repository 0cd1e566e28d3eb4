/* Shape, ranks: those that load shapes together (see shape/host.h). */
#include "compat.h"
#include "shape/host.h"

static MPI_Comm together = MPI_COMM_NULL;

MPI_Comm ShapeComm(void)
{
  return together == MPI_COMM_NULL ? PETSC_COMM_WORLD : together;
}

PetscErrorCode ShapeSetComm(MPI_Comm comm)
{
  PetscFunctionBeginUser;
  together = comm;
  PetscFunctionReturn(PETSC_SUCCESS);
}
