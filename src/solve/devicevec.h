/* Devicevec: vectors in the memory of a device (include/flow/device.h). Inside of solve. */
#pragma once
#include "flow/device.h"
#include <petscvec.h>

/* A vector of n own entries in the queue's memory, NULL: the processor's; empty: it is lent its entries. Collective. */
PetscErrorCode DeviceVecCreate(MPI_Comm, const DeviceQueue *, PetscInt bs, PetscInt n, PetscBool empty, Vec *);
/* Its entries are a [n], in the queue's memory, until DeviceVecReset */
PetscErrorCode DeviceVecPlace(const DeviceQueue *, Vec, const PetscReal a[]);
PetscErrorCode DeviceVecReset(const DeviceQueue *, Vec);
/* Its entries in the queue's memory, as VecGetArrayRead, VecGetArray and VecGetArrayWrite have them in the processor's
 */
PetscErrorCode DeviceVecGetRead(const DeviceQueue *, Vec, const PetscReal **a);
PetscErrorCode DeviceVecRestoreRead(const DeviceQueue *, Vec, const PetscReal **a);
PetscErrorCode DeviceVecGet(const DeviceQueue *, Vec, PetscReal **a);
PetscErrorCode DeviceVecRestore(const DeviceQueue *, Vec, PetscReal **a);
PetscErrorCode DeviceVecGetWrite(const DeviceQueue *, Vec, PetscReal **a);
PetscErrorCode DeviceVecRestoreWrite(const DeviceQueue *, Vec, PetscReal **a);
