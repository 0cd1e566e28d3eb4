/* Devicelevels: a multigrid hierarchy for the pressures at vertices in a queue's memory, as cycles of device/device.h
   want it. PETSc's smoothed aggregation (GAMG) builds it on the processor, of any mesh; once for as long as the matrix
   stays. One rank. */
#pragma once
#include "device/device.h"
#include <petscmat.h>

/* Of matrix A, which is symmetric; floating: the constant has no value. n levels, finest first. No options:
   GAMG as it is. Errors: no memory. */
PetscErrorCode DeviceLevelsCreate(const DeviceQueue *, Mat A, PetscBool floating, PetscInt *n, DeviceLevel *level[]);
PetscErrorCode DeviceLevelsDestroy(const DeviceQueue *, PetscInt n, DeviceLevel *level[]);
/* x [n] from which powers find the largest eigenvalue: parts of all vectors, rough ones most */
void DeviceLevelsFillNoise(PetscInt n, PetscReal x[]);
