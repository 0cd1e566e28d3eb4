/* Membrane: see membrane.h. W(I1, I2) of c = F^T F, n = dim - 1: S = 2 (W1 1 + W2 adj c), P = F S. */
#include "compat.h"
#include "membrane.h"

/* c [n][n], its adjugate, the invariants and the derivatives of the energy by them; what is not here is zero */
typedef struct {
  PetscInt  n;
  PetscReal c[4], adj[4], I1, I2, W, W1, W2, W11, W22;
} Point;

/* c and its invariants; no energy */
static void measure(PetscInt dim, const PetscReal F[], Point *p)
{
  const PetscInt n = dim - 1;

  *p = (Point){.n = n, .I1 = -(PetscReal)n, .adj = {1}};
  for (PetscInt e = 0; e < n * n; e++)
    for (PetscInt k = 0; k < dim; k++) p->c[e] += F[k * n + e / n] * F[k * n + e % n];
  for (PetscInt e = 0; e < n; e++) p->I1 += p->c[e * (n + 1)];
  if (n == 2) {
    p->adj[0] = p->c[3];
    p->adj[1] = p->adj[2] = -p->c[1];
    p->adj[3]             = p->c[0];
  }
  p->I2 = p->c[0] * p->adj[0] + (n == 2 ? p->c[1] * p->adj[1] : 0) - 1;
}

static void evaluate(PetscInt dim, const SolidMaterial *m, const PetscReal F[], Point *p)
{
  measure(dim, F, p);
  p->W   = 0.25 * m->area * p->I2 * p->I2;
  p->W2  = 0.5 * m->area * p->I2;
  p->W22 = 0.5 * m->area;
  if (m->law == SOLID_MEMBRANE_SKALAK) {
    p->W += 0.25 * m->mu * (p->I1 * p->I1 + 2 * p->I1 - 2 * p->I2);
    p->W1 = 0.5 * m->mu * (p->I1 + 1);
    p->W2 -= 0.5 * m->mu;
    p->W11 = 0.5 * m->mu;
  } else if (m->law == SOLID_MEMBRANE_ZERO_THICKNESS) {
    const PetscReal thin = 1 / (1 + p->I2), L = PetscLogReal(1 + p->I2);

    p->W += 0.5 * m->mu * (p->I1 - L + 0.5 * L * L);
    p->W1 = 0.5 * m->mu;
    p->W2 += 0.5 * m->mu * (L - 1) * thin;
    p->W22 += 0.5 * m->mu * (2 - L) * thin * thin;
  } else {
    const PetscReal thin = 1 / (1 + p->I2);

    p->W += 0.5 * m->mu * (p->I1 - 1 + thin);
    p->W1 = 0.5 * m->mu;
    p->W2 -= 0.5 * m->mu * thin * thin;
    p->W22 += m->mu * thin * thin * thin;
  }
}

/* Change of S [n][n] with that of c, symmetric */
static void differentiate_stress(const Point *p, const PetscReal dc[], PetscReal dS[])
{
  const PetscInt n     = p->n;
  PetscReal      trace = 0, dI2 = 0;

  for (PetscInt e = 0; e < n * n; e++) {
    dI2 += p->adj[e] * dc[e];
    if (e % (n + 1) == 0) trace += dc[e];
  }
  for (PetscInt e = 0; e < n * n; e++) {
    const PetscReal one = e % (n + 1) == 0, dadj = n == 2 ? one * trace - dc[e] : 0;

    dS[e] = 2 * (p->W11 * trace * one + p->W22 * dI2 * p->adj[e] + p->W2 * dadj);
  }
}

/* P and C of the energy whose derivatives the point has */
static void differentiate_energy(PetscInt dim, const Point *p, const PetscReal F[], PetscReal P[], PetscReal C[])
{
  const PetscInt n = dim - 1, all = dim * n;
  PetscReal      S[4], dc[4], dS[4];

  for (PetscInt e = 0; e < n * n; e++) S[e] = 2 * (p->W1 * (e % (n + 1) == 0) + p->W2 * p->adj[e]);
  for (PetscInt e = 0; e < all; e++) {
    P[e] = 0;
    for (PetscInt k = 0; k < n; k++) P[e] += F[e / n * n + k] * S[k * n + e % n];
  }
  for (PetscInt f = 0; f < all && C; f++) {
    const PetscInt b = f / n, B = f % n;

    for (PetscInt e = 0; e < n * n; e++)
      dc[e] = (e / n == B ? F[b * n + e % n] : 0) + (e % n == B ? F[b * n + e / n] : 0);
    differentiate_stress(p, dc, dS);
    for (PetscInt e = 0; e < all; e++) {
      C[e * all + f] = e / n == b ? S[B * n + e % n] : 0;
      for (PetscInt k = 0; k < n; k++) C[e * all + f] += F[e / n * n + k] * dS[k * n + e % n];
    }
  }
}

PetscReal MembraneArea(PetscInt dim, const PetscReal F[], PetscReal Q[], PetscReal D[], PetscReal inverse[])
{
  PetscReal J;
  Point     p;

  measure(dim, F, &p);
  J     = PetscSqrtReal(1 + p.I2);
  p.W2  = 0.5 / J;
  p.W22 = -0.25 / (J * J * J);
  differentiate_energy(dim, &p, F, Q, D);
  for (PetscInt e = 0; e < p.n * p.n && inverse; e++) inverse[e] = p.adj[e] / (J * J);
  return J;
}

/* Where it is pressure C would make the matrix indefinite: it is left out */
static void add_tension(PetscInt dim, PetscReal tension, const PetscReal F[], PetscReal P[], PetscReal C[])
{
  const PetscInt all = dim * (dim - 1);
  PetscReal      Q[6], D[36];

  (void)MembraneArea(dim, F, Q, D, NULL);
  for (PetscInt e = 0; e < all; e++) P[e] += tension * Q[e];
  for (PetscInt e = 0; e < all * all && C && tension > 0; e++) C[e] += tension * D[e];
}

PetscReal MembraneLawStress(PetscInt dim, const SolidMaterial *m, const PetscReal F[], PetscReal P[], PetscReal C[])
{
  Point p;

  evaluate(dim, m, F, &p);
  differentiate_energy(dim, &p, F, P, C);
  if (m->tension != 0) add_tension(dim, m->tension, F, P, C);
  return PetscSqrtReal(PetscMax(0, 1 + p.I2));
}

PetscReal MembraneLawEnergy(PetscInt dim, const SolidMaterial *m, const PetscReal F[])
{
  Point p;

  evaluate(dim, m, F, &p);
  return p.W;
}
