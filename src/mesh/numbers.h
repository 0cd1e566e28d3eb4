/* Numbers of cells and nodes over all ranks, and whether they fit into PetscInt: 32 bits, unless PETSc was built with
   64. */
#pragma once
#include <petscsys.h>

/* Numbers of what each rank has `own` of: *start of this rank, *total of all (may be NULL), exact whatever the sum.
   Error, the same on all ranks: their unknowns, `each` of one, are more than PetscInt counts; what: "nodes", for the
   message. Collective. */
PetscErrorCode NumbersSpread(MPI_Comm, const char what[], PetscInt own, PetscInt each, PetscInt *start,
                             PetscInt *total);
/* The same error for the velocities and pressures of a mesh of so many cells, before it is built. Not collective, to be
   called by all ranks. */
PetscErrorCode NumbersCheck(MPI_Comm, PetscInt dim, PetscReal cells);
