/* Hdf5: arrays that are spread over the ranks as named datasets of an HDF5 file.

   v [n][bs] of every rank, one rank after the other -> dataset [sum of n][bs], where the viewer points to. Collective; n may be 0 on some ranks. */
#pragma once
#include <petscviewer.h>

PetscErrorCode Hdf5WriteReals(MPI_Comm, PetscViewer, const char name[], PetscInt n, PetscInt bs, const PetscReal v[]);
PetscErrorCode Hdf5WriteInts(MPI_Comm, PetscViewer, const char name[], PetscInt n, PetscInt bs, const PetscInt v[]);
