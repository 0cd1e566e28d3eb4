/* Rows: see rows.h. */
#include "compat.h"
#include "base/rows.h"

PetscErrorCode RowsOpen(Mat mat, Rows *rows)
{
  PetscBool done;

  PetscFunctionBeginUser;
  rows->mat = mat;
  PetscCall(MatGetRowIJ(mat, 0, PETSC_FALSE, PETSC_FALSE, &rows->n, &rows->start, &rows->column, &done));
  PetscCall(MatSeqAIJGetArrayRead(mat, &rows->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RowsClose(Rows *rows)
{
  PetscBool done;

  PetscFunctionBeginUser;
  PetscCall(MatSeqAIJRestoreArrayRead(rows->mat, &rows->value));
  PetscCall(MatRestoreRowIJ(rows->mat, 0, PETSC_FALSE, PETSC_FALSE, &rows->n, &rows->start, &rows->column, &done));
  PetscFunctionReturn(PETSC_SUCCESS);
}
