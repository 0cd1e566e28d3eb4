/* Exact: see exact.h. */
#include "compat.h"
#include "base/exact.h"

#define LOWEST 1074 /* 2^-LOWEST is the smallest real */

void ExactCarry(Exact *e)
{
  for (PetscInt i = 0; i + 1 < EXACT_WORDS; i++) {
    const PetscInt64 over = e->digit[i] >> 32;

    e->digit[i] -= over * ((PetscInt64)1 << 32);
    e->digit[i + 1] += over;
  }
  e->added = 0;
}

PetscErrorCode ExactGetSum(MPI_Comm comm, Exact *e, PetscReal *sum)
{
  PetscInt    sign = 1;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(comm, &size));
  ExactCarry(e);
  if (size > 1) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, e->digit, EXACT_WORDS + 2, MPIU_INT64, MPI_SUM, comm));
  ExactCarry(e);
  if (e->digit[EXACT_WORDS - 1] < 0) {
    sign = -1;
    for (PetscInt i = 0; i < EXACT_WORDS; i++) e->digit[i] = -e->digit[i];
    ExactCarry(e);
  }
  *sum = 0;
  for (PetscInt i = 0; i < EXACT_WORDS; i++) *sum += ldexp((PetscReal)e->digit[i], (int)(32 * i - LOWEST));
  *sum = e->bad ? NAN : sign * *sum;
  PetscFunctionReturn(PETSC_SUCCESS);
}
