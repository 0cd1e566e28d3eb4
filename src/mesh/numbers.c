/* Numbers: see numbers.h. */
#include "compat.h"
#include "numbers.h"

/* n: a sum may be larger than any number of 64 bits */
static PetscErrorCode check(MPI_Comm comm, const char what[], PetscReal n, PetscReal unknowns)
{
  PetscFunctionBeginUser;
  PetscCheck(unknowns <= (PetscReal)PETSC_MAX_INT, comm, PETSC_ERR_USER_INPUT,
             "%.10g %s have %.4g unknowns, more than this PETSc with %d-bit numbers counts (%.4g): use fewer (-mesh_cells, -mesh_levels, -dm_refine), or "
             "build with a PETSc of 64-bit numbers (make check-64 shows how)",
             (double)n, what, (double)unknowns, (int)(8 * sizeof(PetscInt)), (double)PETSC_MAX_INT);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode NumbersSpread(MPI_Comm comm, const char what[], PetscInt own, PetscInt each, PetscInt *start,
                             PetscInt *total)
{
  const PetscInt64 mine   = own;
  PetscInt64       before = 0, all;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Exscan(&mine, &before, 1, MPIU_INT64, MPI_SUM, comm));
  PetscCallMPI(MPI_Allreduce(&mine, &all, 1, MPIU_INT64, MPI_SUM, comm));
  PetscCall(check(comm, what, (PetscReal)all, (PetscReal)all * (PetscReal)each));
  *start = (PetscInt)before;
  if (total) *total = (PetscInt)all;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode NumbersCheck(MPI_Comm comm, PetscInt dim, PetscReal cells)
{
  const PetscReal nodes = dim == 2 ? 4 : 8; /* of Q2 a cell, without those at the border */

  PetscFunctionBeginUser;
  PetscCall(check(comm, "cells", cells, cells * ((PetscReal)dim * nodes + (PetscReal)dim + 1)));
  PetscFunctionReturn(PETSC_SUCCESS);
}
