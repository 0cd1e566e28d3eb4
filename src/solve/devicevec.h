/* Devicevec: vectors in the memory of a device (include/flow/device.h). Inside of solve. */
#pragma once
#include "flow/device.h"
#include <petscmat.h>

/* A vector of n own entries in the queue's memory, NULL: the processor's; empty: it is lent its entries. Collective. */
PetscErrorCode DeviceVecCreate(MPI_Comm, const DeviceQueue *, PetscInt bs, PetscInt n, PetscBool empty, Vec *);
/* Solvers with this shell take vectors of that kind; before one does. Not collective. */
PetscErrorCode DeviceVecSetShell(const DeviceQueue *, Mat shell);
/* Its entries are a [n], in the queue's memory, until DeviceVecReset */
PetscErrorCode DeviceVecPlace(const DeviceQueue *, Vec, const PetscReal a[]);
PetscErrorCode DeviceVecReset(const DeviceQueue *, Vec);
/* Its entries in the queue's memory, until VecRestoreArrayReadAndMemType, VecRestoreArrayAndMemType and
   VecRestoreArrayWriteAndMemType. Error: they are not there. */
PetscErrorCode DeviceVecGetRead(const DeviceQueue *, Vec, const PetscReal **a);
PetscErrorCode DeviceVecGet(const DeviceQueue *, Vec, PetscReal **a);
PetscErrorCode DeviceVecGetWrite(const DeviceQueue *, Vec, PetscReal **a);
