/* SolidLaw: see law.h. */
#include "compat.h"
#include "solid/law.h"
#include "base/algebra.h"
#include "membrane.h"

/* P = mu (F - F^-T), C = mu (1 + what the inverse changes by) */
static void add_neo_hookean(PetscInt n, PetscReal mu, const PetscReal F[], const PetscReal inv[], PetscReal P[],
                            PetscReal C[])
{
  for (PetscInt e = 0; e < n * n; e++) {
    const PetscInt i = e / n, a = e % n;

    P[e] += mu * (F[e] - inv[a * n + i]);
    for (PetscInt f = 0; f < n * n && C; f++) {
      const PetscInt j = f / n, b = f % n;

      C[e * n * n + f] += mu * ((e == f) + inv[a * n + j] * inv[b * n + i]);
    }
  }
}

/* P = F S with S = 2 mu E + lambda tr E */
static void add_st_venant_kirchhoff(PetscInt n, const SolidMaterial *m, const PetscReal F[], PetscReal P[],
                                    PetscReal C[])
{
  PetscReal S[9], G[9], trace = 0;

  for (PetscInt e = 0; e < n * n; e++) {
    S[e] = -0.5 * (e % (n + 1) == 0);
    G[e] = 0; /* F F^T */
    for (PetscInt k = 0; k < n; k++) {
      S[e] += 0.5 * F[k * n + e / n] * F[k * n + e % n];
      G[e] += F[e / n * n + k] * F[e % n * n + k];
    }
  }
  for (PetscInt a = 0; a < n; a++) trace += S[a * n + a];
  for (PetscInt e = 0; e < n * n; e++) S[e] = 2 * m->mu * S[e] + (e % (n + 1) ? 0 : m->lambda * trace);
  for (PetscInt e = 0; e < n * n; e++) {
    const PetscInt i = e / n, a = e % n;

    for (PetscInt k = 0; k < n; k++) P[e] += F[i * n + k] * S[k * n + a];
    for (PetscInt f = 0; f < n * n && C; f++) {
      const PetscInt j = f / n, b = f % n;

      C[e * n * n + f] += (i == j ? S[b * n + a] : 0) + m->lambda * F[e] * F[f] + m->mu * F[i * n + b] * F[j * n + a] +
                          (a == b ? m->mu * G[i * n + j] : 0);
    }
  }
}

/* P = p F^-T; slope: J dp/dJ */
static void add_isotropic(PetscInt n, PetscReal p, PetscReal slope, const PetscReal inv[], PetscReal P[], PetscReal C[])
{
  for (PetscInt e = 0; e < n * n; e++) {
    const PetscInt i = e / n, a = e % n;

    P[e] += p * inv[a * n + i];
    for (PetscInt f = 0; f < n * n && C; f++) {
      const PetscInt j = f / n, b = f % n;

      C[e * n * n + f] += slope * inv[a * n + i] * inv[b * n + j] - p * inv[a * n + j] * inv[b * n + i];
    }
  }
}

PetscReal SolidLawStress(PetscInt dim, const SolidMaterial *m, const PetscReal F[], PetscReal P[], PetscReal C[])
{
  const PetscInt n = dim * dim;
  PetscReal      inv[9], J, k = -m->kappa;

  if (m->law >= SOLID_MEMBRANE_NEO_HOOKEAN) return MembraneLawStress(dim, m, F, P, C);
  J = DenseInvertMap(dim, F, inv);
  for (PetscInt e = 0; e < n; e++) P[e] = 0;
  for (PetscInt e = 0; e < n * n && C; e++) C[e] = 0;
  if (m->law == SOLID_ST_VENANT_KIRCHHOFF) add_st_venant_kirchhoff(dim, m, F, P, C);
  else {
    add_neo_hookean(dim, m->mu, F, inv, P, C);
    k += m->lambda;
  }
  if (k != 0 || m->bulk != 0)
    add_isotropic(dim, k * (J - 1) * J + 0.5 * m->bulk * (J * J - 1), k * (2 * J - 1) * J + m->bulk * J * J, inv, P, C);
  return J;
}

PetscReal SolidLawEnergy(PetscInt dim, const SolidMaterial *m, const PetscReal F[])
{
  PetscReal norm = 0, trace = 0, J, held;

  if (m->law >= SOLID_MEMBRANE_NEO_HOOKEAN) return MembraneLawEnergy(dim, m, F);
  J    = DenseDeterminant(dim, F);
  held = m->bulk > 0 ? 0.25 * m->bulk * (J * J - 1 - 2 * PetscLogReal(J)) : 0;
  if (m->law == SOLID_NEO_HOOKEAN) {
    for (PetscInt e = 0; e < dim * dim; e++) norm += F[e] * F[e];
    return 0.5 * m->mu * (norm - (PetscReal)dim - 2 * PetscLogReal(J)) + 0.5 * m->lambda * PetscSqr(J - 1) + held;
  }
  for (PetscInt e = 0; e < dim * dim; e++) {
    PetscReal E = -0.5 * (e % (dim + 1) == 0);

    for (PetscInt k = 0; k < dim; k++) E += 0.5 * F[k * dim + e / dim] * F[k * dim + e % dim];
    norm += E * E;
    if (e % (dim + 1) == 0) trace += E;
  }
  return m->mu * norm + 0.5 * m->lambda * PetscSqr(trace) + held;
}
