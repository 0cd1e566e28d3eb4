/* Versions: what a run is made of, for options.txt and summary.json. */
#pragma once
#include <petscsys.h>

typedef struct {
  const char *tumble, *commit;                           /* of this program; "unknown" without git */
  char        petsc[128], mpi[128], hypre[64], hdf5[64]; /* "": it is not there */
  PetscBool   optimised;                                 /* else times mean nothing */
} Versions;

PetscErrorCode VersionsGet(Versions *);
