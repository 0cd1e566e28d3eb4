/* P^T A P of sparse matrices over ranks. */
#pragma once
#include <petscmat.h>

/* As two products. MatPtAP of PETSc 3.18 takes some ten times as long where P has many empty rows, or few entries a
   row. Collective; caller destroys. */
PetscErrorCode MatrixProject(Mat A, Mat P, Mat *out);
