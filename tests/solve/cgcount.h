/* How good a preconditioner is, for tests: iterations of CG. */
#pragma once
#include <petscksp.h>
#include "core.h"

/* To a residual of rtol, from noise; reuse: the preconditioner is set up and stays. At most `most`. */
static inline PetscInt count_iterations(Mat A, PC pc, PetscBool reuse, PetscReal rtol, PetscInt most)
{
  Vec      b, x;
  KSP      ksp;
  PetscInt its;

  OK(MatCreateVecs(A, &x, &b));
  fill_noise_vec(1, b);
  OK(KSPCreate(PETSC_COMM_WORLD, &ksp));
  OK(KSPSetType(ksp, KSPCG));
  OK(KSPSetPC(ksp, pc));
  OK(KSPSetOperators(ksp, A, A));
  OK(KSPSetReusePreconditioner(ksp, reuse));
  OK(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, most));
  OK(KSPSolve(ksp, b, x));
  OK(KSPGetIterationNumber(ksp, &its));
  OK(KSPDestroy(&ksp));
  OK(VecDestroy(&b));
  OK(VecDestroy(&x));
  return its;
}
