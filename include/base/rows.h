/* Rows: the compressed rows of a sequential AIJ matrix, to be read. */
#pragma once
#include <petscmat.h>

typedef struct {
  Mat              mat; /* borrowed */
  PetscInt         n;
  const PetscInt  *start, *column; /* entries of row i: [start[i], start[i + 1]) */
  const PetscReal *value;
} Rows;

/* Of this matrix, until they are closed. Not collective. */
PetscErrorCode RowsOpen(Mat, Rows *);
PetscErrorCode RowsClose(Rows *);
