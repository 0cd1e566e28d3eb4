/* Does a mesh fit into memory? Asked before it is built, see memory.h. */
#include "compat.h"
#include "memory.h"
#include "base/opt.h"
#include "numbers.h"
#include <unistd.h>

/* Bytes a cell of a whole run, the least that was measured: cavity in recipe fast, growth of the peak from 10,000 to
   40,000 plane and from 1,728 to 8,000 cells in space (balanced: 11,000, 40,000) */
#define BYTES_PLANE 8800.
#define BYTES_SPACE 34000.

/* Sum over the machines that the ranks run on, bytes; 0: not known */
static PetscErrorCode get_memory(MPI_Comm comm, PetscReal *bytes)
{
  MPI_Comm    machine;
  PetscMPIInt rank;
  const long  pages = sysconf(_SC_PHYS_PAGES), size = sysconf(_SC_PAGESIZE);
  PetscReal   mine = 0;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine));
  PetscCallMPI(MPI_Comm_rank(machine, &rank));
  PetscCallMPI(MPI_Comm_free(&machine));
  if (rank == 0 && pages > 0 && size > 0) mine = (PetscReal)pages * (PetscReal)size;
  PetscCallMPI(MPI_Allreduce(&mine, bytes, 1, MPIU_REAL, MPIU_SUM, comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshCheckMemory(MPI_Comm comm, PetscInt dim, PetscReal n)
{
  PetscReal fraction = 1, have, need = dim == 2 ? BYTES_PLANE : BYTES_SPACE;

  PetscFunctionBeginUser;
  PetscCall(OptReal("-mesh_memory", &fraction));
  PetscCall(NumbersCheck(comm, dim, n));
  PetscCall(get_memory(comm, &have));
  PetscCheck(fraction == 0 || have == 0 || n * need <= fraction * have, comm, PETSC_ERR_USER_INPUT,
             "%.3g cells need at least %.3g GB of memory (%g kB a cell, measured), and there are %.3g GB: lower -mesh_cells or -mesh_resolution or raise -mesh_focus_h, use "
             "more machines, or go on with -mesh_memory 0",
             (double)n, (double)(n * need / 1e9), (double)(need / 1e3), (double)(have / 1e9));
  PetscFunctionReturn(PETSC_SUCCESS);
}
