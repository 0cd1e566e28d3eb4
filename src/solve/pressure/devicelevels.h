/* Devicelevels: a multigrid hierarchy for the pressures at vertices in a queue's memory, as cycles of device/device.h
   want it, built on the processor once for as long as the matrix stays. Where the vertices are a lattice (boxes, trees)
   its levels are lattices of twice the width (devicegrid.h), else those of PETSc's smoothed aggregation (GAMG).
   Operators below the finest are P^T A P. One rank. */
#pragma once
#include "device/device.h"
#include "devicegrid.h"
#include <petscmat.h>

/* Of matrix A, which is symmetric; grid: its vertices, or NULL; floating: the constant has no value. n levels, finest
   first. No options: GAMG as it is. Errors: no memory. */
PetscErrorCode DeviceLevelsCreate(const DeviceQueue *, Mat A, const DeviceGrid *grid, PetscBool floating, PetscInt *n,
                                  DeviceLevel *level[]);
PetscErrorCode DeviceLevelsDestroy(const DeviceQueue *, PetscInt n, DeviceLevel *level[]);
/* x [n] from which powers find the largest eigenvalue: parts of all vectors, rough ones most */
void DeviceLevelsFillNoise(PetscInt n, PetscReal x[]);
