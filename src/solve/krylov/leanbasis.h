/* Vectors that a Krylov method keeps: own parts alone, taken one by one, in double or in single precision (half the
   memory and traffic). In single precision each is what rounding leaves of it, in units of its largest entry on each
   rank, those before `split` and those behind apart: no unit makes it too large, nor changes how it is rounded. Who
   needs an exact relation works with the rounded vector that LeanBasisPut returns. No function is collective: products
   are those of a rank's own part. */
#pragma once
#include <petscvec.h>

typedef struct {
  PetscBool single; /* entries are float */
  PetscInt  length; /* entries of a vector */
  PetscInt  split;  /* of which so many are of one unit, the others of another */
  PetscInt  n, capacity;
  void    **vector;
  PetscReal (*scale)[2]; /* of the entries of a vector */
} LeanBasis;

/* Vectors are of this length and precision from now on; those that are of another are forgotten. */
PetscErrorCode LeanBasisUse(LeanBasis *, PetscBool single, PetscInt length, PetscInt split);
/* Vector i = x; x[length] = vector i as it is kept. Vectors up to i are made where there are none. */
PetscErrorCode LeanBasisPut(LeanBasis *, PetscInt i, PetscReal x[]);
/* dot[j] = products of x[length] with the first n vectors, dot[n] = that of x with itself */
void LeanBasisDot(const LeanBasis *, PetscInt n, const PetscReal x[], PetscReal dot[]);
/* y[end - begin] += sum_j c[j] (entries [begin, end) of vector j), j < n */
void LeanBasisAdd(const LeanBasis *, PetscInt n, const PetscReal c[], PetscInt begin, PetscInt end, PetscReal y[]);
/* Vectors from the n-th on are freed. */
PetscErrorCode LeanBasisKeep(LeanBasis *, PetscInt n);
PetscErrorCode LeanBasisDestroy(LeanBasis *);
