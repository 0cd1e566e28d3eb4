/* SolidElement: see solid/element.h. */
#include "compat.h"
#include "solid/element.h"
#include "base/algebra.h"
#include "membrane.h"

PetscReal SolidGradient(const SolidMesh *m, PetscInt c, PetscInt q, const PetscReal x[], PetscReal F[])
{
  const PetscInt   dim = m->dim, nd = m->nd;
  const PetscReal *g = m->grad + (c * m->nq + q) * m->nb * nd;
  PetscReal        normal[3];

  for (PetscInt e = 0; e < dim * nd; e++) {
    F[e] = 0;
    for (PetscInt j = 0; j < m->nb; j++) F[e] += x[dim * j + e / nd] * g[nd * j + e % nd];
  }
  if (nd == dim) return DenseDeterminant(dim, F);
  MembraneNormal(dim, F, normal);
  return PetscSqrtReal(dot3(normal, normal));
}

/* K += w g C g at one point, row (i, a), column (j, b): C is contracted with the gradients of j first */
static void add_tangent(PetscInt dim, PetscInt nd, PetscInt nb, PetscReal w, const PetscReal C[], const PetscReal g[],
                        PetscReal K[])
{
  const PetscInt n = nb * dim, nn = dim * nd;

  for (PetscInt j = 0; j < nb; j++) {
    PetscReal Cg[9 * 3]; /* [i][A][b] */

    for (PetscInt e = 0; e < nn; e++)
      for (PetscInt b = 0; b < dim; b++) {
        Cg[e * dim + b] = 0;
        for (PetscInt B = 0; B < nd; B++) Cg[e * dim + b] += w * C[e * nn + b * nd + B] * g[nd * j + B];
      }
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt b = 0; b < dim; b++) {
          PetscReal sum = 0;

          for (PetscInt A = 0; A < nd; A++) sum += g[nd * i + A] * Cg[(a * nd + A) * dim + b];
          K[(i * dim + a) * n + j * dim + b] += sum;
        }
  }
}

PetscReal SolidCellForce(const SolidMesh *m, const SolidMaterial *material, PetscInt c, const PetscReal x[],
                         PetscReal f[], PetscReal K[])
{
  const PetscInt dim = m->dim, nd = m->nd, nb = m->nb;
  PetscReal      min = PETSC_MAX_REAL;

  for (PetscInt e = 0; e < nb * dim; e++) f[e] = 0;
  if (K) memset(K, 0, sizeof(*K) * (size_t)(nb * dim * nb * dim));
  for (PetscInt q = 0; q < m->nq; q++) {
    const PetscReal *g = m->grad + (c * m->nq + q) * nb * nd, w = m->weight[c * m->nq + q];
    PetscReal        F[9], P[9], C[81];

    (void)SolidGradient(m, c, q, x, F);
    min = PetscMin(min, SolidLawStress(dim, material, F, P, K ? C : NULL));
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt A = 0; A < nd; A++) f[dim * j + a] += w * P[a * nd + A] * g[nd * j + A];
    if (K) add_tangent(dim, nd, nb, w, C, g, K);
  }
  return min;
}

void SolidCellMass(const SolidMesh *m, PetscInt c, PetscReal out[])
{
  const PetscInt nb = m->nb;

  memset(out, 0, sizeof(*out) * (size_t)(nb * nb));
  for (PetscInt q = 0; q < m->nq; q++)
    for (PetscInt e = 0; e < nb * nb; e++)
      out[e] += m->weight[c * m->nq + q] * m->phi[q * nb + e / nb] * m->phi[q * nb + e % nb];
}

void SolidCellViscosity(const SolidMesh *m, PetscInt c, const PetscReal x[], PetscReal V[])
{
  const PetscInt dim = m->dim, nb = m->nb, n = nb * dim;

  memset(V, 0, sizeof(*V) * (size_t)(n * n));
  for (PetscInt q = 0; q < m->nq; q++) {
    const PetscReal *g = m->grad + (c * m->nq + q) * nb * dim;
    PetscReal        F[9], inv[9], s[27 * 3], w;

    (void)SolidGradient(m, c, q, x, F);
    w = m->weight[c * m->nq + q] * DenseInvertMap(dim, F, inv);
    for (PetscInt e = 0; e < n; e++) {
      s[e] = 0;
      for (PetscInt A = 0; A < dim; A++) s[e] += g[e / dim * dim + A] * inv[A * dim + e % dim];
    }
    for (PetscInt e = 0; e < n * n; e++) {
      const PetscInt i = e / n / dim, a = e / n % dim, j = e % n / dim, b = e % n % dim;
      PetscReal      both = 0;

      for (PetscInt k = 0; k < dim && a == b; k++) both += s[i * dim + k] * s[j * dim + k];
      V[e] += w * (both + s[i * dim + b] * s[j * dim + a]);
    }
  }
}
