/* Parcels: numbers for a few other ranks, which do not know that they come. */
#pragma once
#include <petscsys.h>

/* Parcels out [n] of so many bytes go to the ranks to [n] of comm, those of one rank one after the other; *in [*comes]
   come from the ranks *from [*comes], likewise, both the caller's to free; in: a pointer to a pointer. tag: of comm
   (PetscCommGetNewTag), free again afterwards. Collective. */
PetscErrorCode SparseExchange(MPI_Comm comm, PetscMPIInt tag, PetscInt n, const PetscMPIInt to[], size_t bytes,
                              const void *out, PetscInt *comes, void *in, PetscMPIInt **from);

/* Own parcels own [n] of so many bytes become those of all ranks, in their order: *all [*total], the caller's to free;
   a pointer to a pointer. *rank [*total], if wanted: whose they are, likewise. Collective. */
PetscErrorCode SparseGather(MPI_Comm comm, PetscInt n, size_t bytes, const void *own, PetscInt *total, void *all,
                            PetscMPIInt **rank);
