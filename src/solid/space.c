/* Solids in space: see space.h. */
#include "compat.h"
#include "space.h"
#include "base/algebra.h"

/* Largest eigenvalue of F^T F, by the angle of its invariants (Smith 1961) */
static PetscReal largest_square(const PetscReal F[9])
{
  PetscReal C[9], mean = 0, size = 0, cosine;

  for (PetscInt e = 0; e < 9; e++) {
    C[e] = 0;
    for (PetscInt k = 0; k < 3; k++) C[e] += F[3 * k + e / 3] * F[3 * k + e % 3];
  }
  for (PetscInt a = 0; a < 3; a++) mean += C[4 * a] / 3;
  for (PetscInt a = 0; a < 3; a++) C[4 * a] -= mean;
  for (PetscInt e = 0; e < 9; e++) size += C[e] * C[e];
  size = PetscSqrtReal(size / 6);
  if (size <= PETSC_MACHINE_EPSILON * mean) return mean;
  cosine = PetscMax(-1, PetscMin(1, 0.5 * DenseDeterminant(3, C) / (size * size * size)));
  return mean + 2 * size * PetscCosReal(PetscAcosReal(cosine) / 3);
}

PetscReal SolidLargestStretch(PetscInt dim, PetscInt nd, const PetscReal G[])
{
  PetscReal F[9] = {0}, sum, diff;

  for (PetscInt e = 0; e < dim * nd; e++) F[e / nd * dim + e % nd] = G[e];
  if (dim == 3) return PetscSqrtReal(largest_square(F));
  sum  = PetscHypotReal(F[0] + F[3], F[2] - F[1]);
  diff = PetscHypotReal(F[0] - F[3], F[1] + F[2]);
  return 0.5 * (sum + diff);
}
