/* Whole runs in a folder of their own, which goes with the tests; what the runs say is thrown away. */
#pragma once
#include "base/log.h"
#include "core.h"
#include "shape/host.h"

static char folder[64];

/* PETSc, and the folder /tmp/<name>-... that all ranks share. Not 0: there is none */
static inline int begin_folder(int *argc, char ***argv, const char name[])
{
  PetscMPIInt rank;

  PetscCall(PetscInitialize(argc, argv, NULL, NULL));
  PetscCall(LogInitialize());
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  snprintf(folder, sizeof(folder), "/tmp/%s-XXXXXX", name);
  if (rank == 0 && !mkdtemp(folder)) return 1;
  PetscCallMPI(MPI_Bcast(folder, sizeof(folder), MPI_CHAR, 0, PETSC_COMM_WORLD));
  PETSC_STDOUT = fopen("/dev/null", "w"); /* the runs talk */
  return 0;
}

/* Returns how many have failed, with the folder if it does not go */
static inline int end_folder(int failed)
{
  char        clean[128];
  PetscMPIInt rank;

  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Barrier(PETSC_COMM_WORLD));
  snprintf(clean, sizeof(clean), "rm -rf %s", folder);
  if (rank == 0 && system(clean)) failed++;
  fclose(PETSC_STDOUT);
  PETSC_STDOUT = stdout;
  PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
