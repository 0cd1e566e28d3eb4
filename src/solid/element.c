/* SolidElement: see solid/element.h. */
#include "compat.h"
#include "solid/element.h"
#include "base/algebra.h"
#include "membrane.h"
#include "space.h"

static const PetscInt ROW[6] = {0, 1, 2, 0, 0, 1}, COLUMN[6] = {0, 1, 2, 1, 2, 2}; /* of a symmetric tensor */

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

/* Second moments from those about the origin, the volume and the centroid */
static void shift_moments(PetscInt dim, SolidSums *s)
{
  for (PetscInt a = 0; a < dim; a++) s->centroid[a] /= s->volume;
  for (PetscInt e = 0; e < 6; e++) s->second[e] -= s->volume * (s->centroid[ROW[e]] * s->centroid[COLUMN[e]]);
}

/* What a quadrature point counts of integrals of 1, x, x x over the volume: of a membrane, around which div (x f) is
   (dim + degree) f, through its surface */
static void get_volumes(const SolidMesh *m, const PetscReal F[], PetscReal J, const PetscReal x[3], PetscReal dV[3])
{
  PetscReal normal[3];

  if (SolidIsMembrane(m)) MembraneNormal(m->dim, F, normal);
  for (PetscInt degree = 0; degree < 3; degree++)
    dV[degree] = SolidIsMembrane(m) ? dot3(x, normal) / (PetscReal)(m->dim + degree) : J;
}

void SolidMeasure(const SolidMesh *m, const SolidMaterial *material, const PetscReal x[], SolidSums *s)
{
  const PetscInt dim     = m->dim;
  PetscReal      mean[9] = {0};

  *s = (SolidSums){0};
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[SOLID_MAX_N];

    SolidGather(m, c, x, xc);
    for (PetscInt q = 0; q < m->nq; q++) {
      const PetscReal w = m->weight[c * m->nq + q];
      PetscReal       F[9], at[3], dV[3], J = SolidGradient(m, c, q, xc, F);

      SolidLocate(m, q, xc, at);
      get_volumes(m, F, J, at, dV);
      s->volume += w * dV[0];
      for (PetscInt a = 0; a < dim; a++) s->centroid[a] += w * dV[1] * at[a];
      for (PetscInt e = 0; e < 6; e++) s->second[e] += w * dV[2] * at[ROW[e]] * at[COLUMN[e]];
      for (PetscInt e = 0; e < dim * m->nd; e++) mean[e] += w * F[e];
      s->area += SolidIsMembrane(m) ? w * J : 0;
      s->strain_energy += w * SolidLawEnergy(dim, material, F);
      s->stretch_max = PetscMax(s->stretch_max, SolidLargestStretch(dim, m->nd, F));
    }
  }
  shift_moments(dim, s);
  if (m->nd == 2 && dim == 2) s->rotation = PetscAtan2Real(mean[dim] - mean[1], mean[0] + mean[dim + 1]);
}

void SolidMeanVelocity(const SolidMesh *m, const PetscReal x[], const PetscReal u[], PetscReal mean[3])
{
  PetscReal volume = 0;

  for (PetscInt a = 0; a < 3; a++) mean[a] = 0;
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[SOLID_MAX_N], uc[SOLID_MAX_N];

    SolidGather(m, c, x, xc);
    SolidGather(m, c, u, uc);
    for (PetscInt q = 0; q < m->nq; q++) {
      PetscReal F[9], at[3], v[3], normal[3], w = m->weight[c * m->nq + q];

      SolidLocate(m, q, uc, v);
      if (SolidIsMembrane(m)) { /* int u_a dV is that of x_a u . n over the surface */
        (void)SolidGradient(m, c, q, xc, F);
        MembraneNormal(m->dim, F, normal);
        SolidLocate(m, q, xc, at);
        volume += w * dot3(at, normal) / (PetscReal)m->dim;
        for (PetscInt a = 0; a < m->dim; a++) mean[a] += w * at[a] * dot3(v, normal);
      } else {
        volume += w;
        for (PetscInt a = 0; a < m->dim; a++) mean[a] += w * v[a];
      }
    }
  }
  for (PetscInt a = 0; a < m->dim; a++) mean[a] /= volume;
}
