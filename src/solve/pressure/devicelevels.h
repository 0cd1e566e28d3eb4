/* Devicelevels: a multigrid hierarchy for the pressures at vertices in a queue's memory, as cycles of device/device.h
   want it, built on the processor once for as long as the matrix stays. Where the vertices are a lattice (boxes, trees)
   its levels are lattices of twice the width (devicegrid.h), else those of PETSc's smoothed aggregation (GAMG).
   Operators below the finest are P^T A P. One rank. */
#pragma once
#include "device/device.h"
#include "coarse.h"
#include "devicegrid.h"
#include "flow/flow.h"
#include <petscmat.h>

/* Of matrix A, which is symmetric; grid: its vertices, or NULL; floating: the constant has no value. n levels, finest
   first; *lowest: the matrix of the lowest one, where lattices lead to it, for DeviceLevelsUpdate, else n = 0; the
   caller destroys it. No options: GAMG as it is. Errors: no memory. */
PetscErrorCode DeviceLevelsCreate(const DeviceQueue *, Mat A, const DeviceGrid *grid, PetscBool floating, PetscInt *n,
                                  DeviceLevel *level[], DeviceSparse *lowest);
/* A, the finest matrix, changes, and the levels below it are made anew there; noise [level[0].A.n] and sums
   [DEVICE_PARTIAL + 2] lie there too */
PetscErrorCode DeviceLevelsChange(Flow, Coarse, const DeviceTransfer *, DeviceSparse *A);
PetscErrorCode DeviceLevelsUpdate(const DeviceQueue *, PetscInt n, DeviceLevel level[], DeviceSparse *lowest,
                                  PetscBool floating, const double noise[], double sums[]);
PetscErrorCode DeviceSparseDestroy(const DeviceQueue *, DeviceSparse *);
PetscErrorCode DeviceLevelsDestroy(const DeviceQueue *, PetscInt n, DeviceLevel *level[]);
/* x [n] from which powers find the largest eigenvalue: parts of all vectors, rough ones most */
void DeviceLevelsFillNoise(PetscInt n, PetscReal x[]);
