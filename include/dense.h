/* Dense: inverse of tiny symmetric positive definite matrices (blocks of bodies and cells). Layer 0. */
#pragma once
#include <petscsys.h>

#define DENSE_MAX 6

/* inv = M^{-1} by Gauss-Jordan, which needs no pivoting for definite matrices; M and inv [n][n], n <= DENSE_MAX, may not be the same array */
static inline void DenseInvert(PetscInt n, const PetscReal M[], PetscReal inv[])
{
  PetscReal a[DENSE_MAX * DENSE_MAX];

  for (PetscInt i = 0; i < n * n; i++) {
    a[i]   = M[i];
    inv[i] = i % (n + 1) == 0;
  }
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal pivot = 1 / a[k * n + k];

    for (PetscInt j = 0; j < n; j++) {
      a[k * n + j] *= pivot;
      inv[k * n + j] *= pivot;
    }
    for (PetscInt i = 0; i < n; i++) {
      const PetscReal factor = a[i * n + k];

      if (i == k || factor == 0) continue;
      for (PetscInt j = 0; j < n; j++) {
        a[i * n + j] -= factor * a[k * n + j];
        inv[i * n + j] -= factor * inv[k * n + j];
      }
    }
  }
}
