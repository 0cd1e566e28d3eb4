/* Dataset: see hdf5.h. PETSc writes vectors and index sets. */
#include "compat.h"
#include "base/hdf5.h"
#include <petscvec.h>

PetscErrorCode Hdf5WriteReals(MPI_Comm comm, PetscViewer viewer, const char name[], PetscInt n, PetscInt bs, const PetscReal v[])
{
  Vec          vec;
  PetscScalar *a;

  PetscFunctionBeginUser;
  PetscCall(VecCreate(comm, &vec));
  PetscCall(VecSetSizes(vec, n * bs, PETSC_DETERMINE));
  PetscCall(VecSetBlockSize(vec, bs));
  PetscCall(VecSetType(vec, VECSTANDARD));
  PetscCall(PetscObjectSetName((PetscObject)vec, name));
  PetscCall(VecGetArrayWrite(vec, &a));
  for (PetscInt i = 0; i < n * bs; i++) a[i] = v[i];
  PetscCall(VecRestoreArrayWrite(vec, &a));
  PetscCall(VecView(vec, viewer));
  PetscCall(VecDestroy(&vec));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode Hdf5WriteInts(MPI_Comm comm, PetscViewer viewer, const char name[], PetscInt n, PetscInt bs, const PetscInt v[])
{
  IS          is;
  PetscLayout layout;

  PetscFunctionBeginUser;
  PetscCall(ISCreateGeneral(comm, n * bs, v, PETSC_USE_POINTER, &is));
  /* the block size makes rows of the file, not blocks of consecutive indices, which ISSetBlockSize would insist on */
  PetscCall(ISGetLayout(is, &layout));
  PetscCall(PetscLayoutSetBlockSize(layout, bs));
  PetscCall(PetscObjectSetName((PetscObject)is, name));
  PetscCall(ISView(is, viewer));
  PetscCall(ISDestroy(&is));
  PetscFunctionReturn(PETSC_SUCCESS);
}
