/* RowPool: rows of a sparse matrix in single precision, in which rows that are alike stand once.

   Away from bodies and boundaries the rows of a uniform mesh hold the same numbers in the same order, and what sweeps
   and products must load falls from the whole matrix to a few rows, which stay in the cache. Alike means: no entry
   differs by more than its own round-off as a float (small ones are those of nodes in bodies, and count there).
   Nothing here is collective. */
#pragma once
#include <petscsys.h>

typedef struct {
  PetscInt   n, unit; /* rows; numbers of a block: rows are whole blocks long */
  float     *value;   /* rows, one after the other, and four numbers behind the end; moves when a row is set */
  PetscInt  *at;      /* [n] where the values of a row begin, in blocks */
  PetscInt  *own;     /* [n] where a row has a place of its own, or -1 */
  PetscInt   used, room, nkind, *kind_at, *kind_length;
  PetscReal *kind_sum;
} RowPool;

PetscErrorCode RowPoolCreate(PetscInt n, PetscInt unit, RowPool *);
PetscErrorCode RowPoolDestroy(RowPool *);
/* Forget all rows, before all are set anew. */
void RowPoolClear(RowPool *);
/* Row i <- value [length][unit]; the length of a row never changes. many: most rows are being set, and rows unlike all
   others become kinds to which others are compared, up to a number. */
PetscErrorCode RowPoolSet(RowPool *, PetscInt i, PetscInt length, const PetscReal value[], PetscBool many);
