/* SmallLevels: see smalllevels.h. hypre has this, PETSc no option for it. */
#include "compat.h"
#include "smalllevels.h"
#include <petsc/private/pcimpl.h>

#define FEW_ROWS 3000 /* of all ranks; a sweep over them takes less than an exchange */

#if defined(PETSC_HAVE_HYPRE)
/* HYPRE_Int is an int wherever PetscInt is one, and else may be; the header may not be there. Weak: nor may they. */
extern int HYPRE_BoomerAMGSetRedundant(void *solver, PetscInt redundant) __attribute__((weak));
extern int HYPRE_BoomerAMGSetSeqThreshold(void *solver, PetscInt rows) __attribute__((weak));

/* The first member of what PETSc keeps for this type is hypre's solver (PC_HYPRE in hypre.c) */
static void *get_solver(PC pc)
{
  return pc->data ? *(void **)pc->data : NULL;
}

PetscErrorCode SmallLevelsGather(PC pc)
{
  PetscBool   hypre, boomer = PETSC_FALSE;
  PetscMPIInt size;
  const char *name;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)pc), &size));
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCHYPRE, &hypre));
  if (hypre) {
    PetscCall(PCHYPREGetType(pc, &name));
    PetscCall(PetscStrcmp(name, "boomeramg", &boomer));
  }
  if (!boomer || size == 1 || !get_solver(pc)) PetscFunctionReturn(PETSC_SUCCESS);
  if (!HYPRE_BoomerAMGSetRedundant || !HYPRE_BoomerAMGSetSeqThreshold) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!HYPRE_BoomerAMGSetRedundant(get_solver(pc), 0) && !HYPRE_BoomerAMGSetSeqThreshold(get_solver(pc), FEW_ROWS), PETSC_COMM_SELF,
             PETSC_ERR_LIB, "hypre does not take its small levels to one rank");
  PetscFunctionReturn(PETSC_SUCCESS);
}
#else
PetscErrorCode SmallLevelsGather(PC pc)
{
  PetscFunctionBeginUser;
  (void)pc;
  PetscFunctionReturn(PETSC_SUCCESS);
}
#endif
