/* RowType: the MPI datatype of a row of n reals, for star forests. One real is MPIU_REAL itself: PETSc does not see
   that sums of a row of one are sums of a number. */
#pragma once
#include <petscsys.h>

/* n at least 1; freed by RowTypeDestroy. Not collective. */
PetscErrorCode RowTypeCreate(PetscInt n, MPI_Datatype *);
PetscErrorCode RowTypeDestroy(MPI_Datatype *);
