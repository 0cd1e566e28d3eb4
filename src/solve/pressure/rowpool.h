/* RowPool: rows of a sparse matrix in which rows that are equal stand once, in single precision and, if wanted, as they
   are.

   Away from bodies and boundaries the rows of a uniform mesh hold the same numbers in the same order, and what sweeps
   and products must load falls from the whole matrix to a few rows, which stay in the cache. Equal means equal in all
   bits that are kept, so that what is stored depends on the rows alone and not on which of them came first.
   Nothing here is collective. */
#pragma once
#include <petscsys.h>

typedef struct {
  PetscInt64 key;               /* of its values */
  PetscInt   at, length, users; /* length -1: given up */
} RowKind;

typedef struct {
  PetscInt   n, unit;        /* rows; numbers of a block: rows are whole blocks long */
  float     *value;          /* rows, one after the other, and four numbers behind the end; moves when a row is set */
  PetscReal *exact;          /* likewise, as they came; or NULL */
  PetscInt  *at;             /* [n] where the values of a row begin, in blocks */
  PetscInt  *own;            /* [n] where a row has a place of its own, or -1 */
  PetscInt  *kind_of;        /* [n] the kind that stands at `at`, or -1 */
  PetscBool  keep;           /* exact */
  PetscInt   used, capacity; /* blocks */
  PetscInt   nset;           /* rows set since all were forgotten */
  PetscInt   mask;           /* a power of 2, less 1 */
  PetscInt  *slot;           /* [mask + 1] kind, by hashing, or -1 */
  PetscInt   nkind, kind_capacity;
  RowKind   *kind;
} RowPool;

PetscErrorCode RowPoolCreate(PetscInt n, PetscInt unit, PetscBool exact, RowPool *);
PetscErrorCode RowPoolDestroy(RowPool *);
/* Forget all rows, before all are set anew. */
void RowPoolClear(RowPool *);
/* Row i <- value [length][unit]; the length of a row never changes. many: most rows are being set, and rows unlike all
   others become kinds to which others are compared. */
PetscErrorCode RowPoolSet(RowPool *, PetscInt i, PetscInt length, const PetscReal value[], PetscBool many);
