/* Inside of the lean Krylov methods; for their files only. */
#pragma once
#include "lean.h"
#include <petsc/private/kspimpl.h>

/* What is solved for */
static inline Mat LeanOperator(KSP ksp)
{
  Mat A = NULL;

  (void)KSPGetOperators(ksp, &A, NULL);
  return A;
}

PetscErrorCode LeanCreateCG(KSP);
