/* Vectors in the memory of a device: see devicevec.h. With a GPU PETSc keeps both copies of a vector and moves it when
   the other one is asked for; the emulation's memory is the processor's. */
#include "compat.h"
#include "devicevec.h"

/* Is the memory that of a GPU? */
static PetscBool is_cuda(const DeviceQueue *q)
{
  return (PetscBool)(q && !strcmp(q->run->name, "cuda"));
}

PetscErrorCode DeviceVecCreate(MPI_Comm comm, const DeviceQueue *q, PetscInt bs, PetscInt n, PetscBool empty, Vec *v)
{
  PetscFunctionBeginUser;
#if defined(PETSC_HAVE_CUDA)
  if (is_cuda(q) && empty) {
    PetscCall(VecCreateMPICUDAWithArrays(comm, bs, n, PETSC_DETERMINE, NULL, NULL, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (is_cuda(q)) {
    PetscCall(VecCreate(comm, v));
    PetscCall(VecSetSizes(*v, n, PETSC_DETERMINE));
    PetscCall(VecSetBlockSize(*v, bs));
    PetscCall(VecSetType(*v, VECMPICUDA));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
#endif
  if (empty) PetscCall(VecCreateMPIWithArray(comm, bs, n, PETSC_DETERMINE, NULL, v));
  else PetscCall(VecCreateMPI(comm, n, PETSC_DETERMINE, v));
  if (!empty && bs > 1) PetscCall(VecSetBlockSize(*v, bs));
  (void)q;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceVecSetShell(const DeviceQueue *q, Mat shell)
{
  VecType type = VECMPI;

  PetscFunctionBeginUser;
  if (!q) PetscFunctionReturn(PETSC_SUCCESS);
#if defined(PETSC_HAVE_CUDA)
  if (is_cuda(q)) type = VECMPICUDA;
#endif
  PetscCall(MatShellSetVecType(shell, type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceVecPlace(const DeviceQueue *q, Vec v, const PetscReal a[])
{
  PetscFunctionBeginUser;
#if defined(PETSC_HAVE_CUDA)
  if (is_cuda(q)) {
    PetscCall(VecCUDAPlaceArray(v, a));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
#endif
  (void)q;
  PetscCall(VecPlaceArray(v, a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceVecReset(const DeviceQueue *q, Vec v)
{
  PetscFunctionBeginUser;
#if defined(PETSC_HAVE_CUDA)
  if (is_cuda(q)) {
    PetscCall(VecCUDAResetArray(v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
#endif
  (void)q;
  PetscCall(VecResetArray(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the array lie where it should? */
static PetscErrorCode check(const DeviceQueue *q, PetscMemType type)
{
  PetscFunctionBeginUser;
  PetscCheck(PetscMemTypeDevice(type) == is_cuda(q), PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "A vector's entries are in another memory than kernels take");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceVecGetRead(const DeviceQueue *q, Vec v, const PetscReal **a)
{
  PetscMemType type;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayReadAndMemType(v, a, &type));
  PetscCall(check(q, type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceVecGet(const DeviceQueue *q, Vec v, PetscReal **a)
{
  PetscMemType type;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayAndMemType(v, a, &type));
  PetscCall(check(q, type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceVecGetWrite(const DeviceQueue *q, Vec v, PetscReal **a)
{
  PetscMemType type;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayWriteAndMemType(v, a, &type));
  PetscCall(check(q, type));
  PetscFunctionReturn(PETSC_SUCCESS);
}
