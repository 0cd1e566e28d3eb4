/* Project: see base/project.h. */
#include "base/project.h"
#include "compat.h"

PetscErrorCode MatrixProject(Mat A, Mat P, Mat *out)
{
  Mat AP;

  PetscFunctionBeginUser;
  PetscCall(MatMatMult(A, P, MAT_INITIAL_MATRIX, PETSC_DEFAULT, &AP));
  PetscCall(MatTransposeMatMult(P, AP, MAT_INITIAL_MATRIX, PETSC_DEFAULT, out));
  PetscCall(MatDestroy(&AP));
  PetscFunctionReturn(PETSC_SUCCESS);
}
