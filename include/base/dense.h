/* Dense: inverse and factor of tiny symmetric positive definite matrices (blocks of bodies and cells) and of Jacobians. */
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

/* L [n][n] lower triangular with L L^T = M, M symmetric and positive semidefinite; rows of M that are zero (fixed degrees of freedom) stay zero */
static inline void DenseFactor(PetscInt n, const PetscReal M[], PetscReal L[])
{
  for (PetscInt j = 0; j < n; j++) {
    for (PetscInt i = 0; i < n; i++) {
      PetscReal sum = M[i * n + j];

      for (PetscInt k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
      if (i < j) L[i * n + j] = 0;
      else if (i == j) L[i * n + j] = sum > 0 ? PetscSqrtReal(sum) : 0;
      else L[i * n + j] = L[j * n + j] > 0 ? sum / L[j * n + j] : 0;
    }
  }
}

/* Determinant of the Jacobian J [dim][dim] of a map in 2 or 3 dimensions */
static inline PetscReal DenseDeterminant(PetscInt dim, const PetscReal J[])
{
  if (dim == 2) return J[0] * J[3] - J[1] * J[2];
  return J[0] * (J[4] * J[8] - J[5] * J[7]) + J[1] * (J[5] * J[6] - J[3] * J[8]) + J[2] * (J[3] * J[7] - J[4] * J[6]);
}

/* Its inverse inv [dim][dim] by cofactors; returns the determinant (if that is zero, inv is not finite) */
static inline PetscReal DenseInvertMap(PetscInt dim, const PetscReal J[], PetscReal inv[])
{
  const PetscReal det = DenseDeterminant(dim, J);

  if (dim == 2) {
    inv[0] = J[3] / det;
    inv[1] = -J[1] / det;
    inv[2] = -J[2] / det;
    inv[3] = J[0] / det;
  } else {
    inv[0] = (J[4] * J[8] - J[5] * J[7]) / det;
    inv[3] = (J[5] * J[6] - J[3] * J[8]) / det;
    inv[6] = (J[3] * J[7] - J[4] * J[6]) / det;
    inv[1] = (J[2] * J[7] - J[1] * J[8]) / det;
    inv[4] = (J[0] * J[8] - J[2] * J[6]) / det;
    inv[7] = (J[1] * J[6] - J[0] * J[7]) / det;
    inv[2] = (J[1] * J[5] - J[2] * J[4]) / det;
    inv[5] = (J[2] * J[3] - J[0] * J[5]) / det;
    inv[8] = (J[0] * J[4] - J[1] * J[3]) / det;
  }
  return det;
}
