/* Pivots: see pivots.h. */
#include "compat.h"
#include "base/pivots.h"

PetscErrorCode PivotsOfAnySize(KSP ksp)
{
  PetscBool blocks;
  PetscInt  n = 0;
  KSP      *sub;
  PC        pc;

  PetscFunctionBeginUser;
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCFactorSetZeroPivot(pc, PETSC_MIN_REAL)); /* ignored by what has no factors */
  PetscCall(PetscObjectTypeCompare((PetscObject)pc, PCBJACOBI, &blocks));
  if (!blocks) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPSetUp(ksp));
  PetscCall(PCBJacobiGetSubKSP(pc, &n, NULL, &sub));
  for (PetscInt i = 0; i < n; i++) {
    PetscCall(KSPGetPC(sub[i], &pc));
    PetscCall(PCFactorSetZeroPivot(pc, PETSC_MIN_REAL));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
