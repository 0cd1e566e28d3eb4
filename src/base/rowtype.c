/* RowType: see rowtype.h. */
#include "compat.h"
#include "base/rowtype.h"

PetscErrorCode RowTypeCreate(PetscInt n, MPI_Datatype *type)
{
  PetscFunctionBeginUser;
  *type = MPIU_REAL;
  if (n == 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallMPI(MPI_Type_contiguous((PetscMPIInt)n, MPIU_REAL, type));
  PetscCallMPI(MPI_Type_commit(type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowTypeDestroy(MPI_Datatype *type)
{
  PetscFunctionBeginUser;
  if (*type != MPIU_REAL) PetscCallMPI(MPI_Type_free(type));
  PetscFunctionReturn(PETSC_SUCCESS);
}
