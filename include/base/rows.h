/* Rows: the compressed rows of a sequential AIJ matrix, or of what is like one, to be read. */
#pragma once
#include <petscmat.h>

typedef struct {
  Mat              mat; /* borrowed; NULL: there is none, nothing is to be closed */
  PetscInt         n;
  const PetscInt  *start, *column; /* entries of row i: [start[i], start[i + 1]) */
  const PetscReal *value;
} Rows;

/* Of this matrix, until they are closed. Not collective. */
PetscErrorCode RowsOpen(Mat, Rows *);
PetscErrorCode RowsClose(Rows *);
