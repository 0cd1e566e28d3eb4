/* Bending of a membrane: see solid/element.h. With A(x) the area, l_i = dA/dx_i is minus the integral of phi_i times
   the mean curvature vector, and m_i that of phi_i, both on the surface as it is now. Its curvature vector at node i is
   h_i = -l_i/m_i (Dziuk 2008, with a lumped mass) and the energy B/2 sum m_i |h_i|^2. Its force is exact:
     dE = B sum_i h_i . dl_i - B/2 sum_i |h_i|^2 dm_i,   dl_i = sum_j d2A/dx_i dx_j dx_j,
   its tangent B L M^-1 L with L the Laplacian of that surface, which is never negative. */
#include "compat.h"
#include "solid/element.h"
#include "membrane.h"

PetscErrorCode BendingCreate(SolidMesh *m)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(m->around[m->nnode], &m->laplace, (m->dim + 1) * m->nnode, &m->curvature));
  for (PetscInt i = 0; i < m->nnode; i++)
    PetscCheck(m->around[i + 1] - m->around[i] <= SOLID_MAX_AROUND, PETSC_COMM_SELF, PETSC_ERR_PLIB,
               "A node has too many neighbours");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal SolidFindArea(const SolidMesh *m, const PetscReal x[], PetscReal l[])
{
  const PetscInt dim = m->dim, nd = m->nd, nb = m->nb;
  PetscReal      area = 0;

  for (PetscInt e = 0; e < dim * m->nnode; e++) l[e] = 0;
  for (PetscInt e = 0; e < m->ncell * m->nq; e++) {
    const PetscInt  *node = m->cell_node + e / m->nq * nb;
    const PetscReal *g = m->grad + e * nb * nd, w = m->weight[e];
    PetscReal        xc[SOLID_MAX_N], F[6], Q[6];

    SolidGather(m, e / m->nq, x, xc);
    (void)SolidGradient(m, e / m->nq, e % m->nq, xc, F);
    area += w * MembraneArea(dim, F, Q, NULL, NULL);
    for (PetscInt i = 0; i < nb; i++)
      for (PetscInt a = 0; a < dim * nd; a++) l[dim * node[i] + a / nd] += w * Q[a] * g[nd * i + a % nd];
  }
  return area;
}

static void add_to_row(const SolidMesh *m, PetscInt i, PetscInt node, PetscReal v)
{
  PetscInt e = m->around[i];

  while (m->neighbour[e] != node) e++;
  m->laplace[e] += v;
}

/* L, l and m of the surface at x, into m->laplace, m->curvature */
static void find_curvature(const SolidMesh *m, const PetscReal x[])
{
  const PetscInt dim = m->dim, nd = m->nd, nb = m->nb;
  PetscReal     *mass = m->curvature + dim * m->nnode;

  for (PetscInt e = 0; e < m->around[m->nnode]; e++) m->laplace[e] = 0;
  (void)SolidFindArea(m, x, m->curvature);
  for (PetscInt i = 0; i < m->nnode; i++) mass[i] = 0;
  for (PetscInt e = 0; e < m->ncell * m->nq; e++) {
    const PetscInt   q = e % m->nq, *node = m->cell_node + e / m->nq * nb;
    const PetscReal *g = m->grad + e * nb * nd, w = m->weight[e];
    PetscReal        xc[SOLID_MAX_N], F[6], Q[6], inverse[4], J;

    SolidGather(m, e / m->nq, x, xc);
    (void)SolidGradient(m, e / m->nq, q, xc, F);
    J = MembraneArea(dim, F, Q, NULL, inverse);
    for (PetscInt i = 0; i < nb; i++) {
      mass[node[i]] += w * J * m->phi[q * nb + i];
      for (PetscInt j = 0; j < nb; j++) {
        PetscReal sum = 0;

        for (PetscInt a = 0; a < nd * nd; a++) sum += g[nd * i + a / nd] * inverse[a] * g[nd * j + a % nd];
        add_to_row(m, node[i], node[j], w * J * sum);
      }
    }
  }
}

/* f += what the derivative of l and m makes of it, with h at the nodes */
static void add_force(const SolidMesh *m, PetscReal bending, const PetscReal x[], const PetscReal h[], PetscReal f[])
{
  const PetscInt dim = m->dim, nd = m->nd, nb = m->nb, n = dim * nd;

  for (PetscInt e = 0; e < m->ncell * m->nq; e++) {
    const PetscInt  *node = m->cell_node + e / m->nq * nb;
    const PetscReal *g    = m->grad + e * nb * nd;
    PetscReal        xc[SOLID_MAX_N], hc[SOLID_MAX_N], F[6], Q[6], D[36], H[6], P[6], square = 0;

    SolidGather(m, e / m->nq, x, xc);
    SolidGather(m, e / m->nq, h, hc);
    (void)SolidGradient(m, e / m->nq, e % m->nq, xc, F);
    (void)SolidGradient(m, e / m->nq, e % m->nq, hc, H);
    (void)MembraneArea(dim, F, Q, D, NULL);
    for (PetscInt j = 0; j < nb * dim; j++) square += m->phi[e % m->nq * nb + j / dim] * hc[j] * hc[j];
    for (PetscInt a = 0; a < n; a++) {
      P[a] = -0.5 * square * Q[a];
      for (PetscInt b = 0; b < n; b++) P[a] += D[a * n + b] * H[b];
    }
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt a = 0; a < n; a++) f[dim * node[j] + a / nd] += m->weight[e] * bending * P[a] * g[nd * j + a % nd];
  }
}

PetscReal SolidBend(const SolidMesh *m, PetscReal bending, const PetscReal x[], PetscReal f[])
{
  const PetscInt dim    = m->dim;
  PetscReal     *h      = m->curvature;
  PetscReal      energy = 0;

  find_curvature(m, x);
  for (PetscInt i = 0; i < m->nnode; i++) {
    const PetscReal mass = h[dim * m->nnode + i], scale = PetscSqrtReal(bending / mass);

    for (PetscInt a = 0; a < dim; a++) {
      h[dim * i + a] /= mass;
      energy += 0.5 * bending * mass * PetscSqr(h[dim * i + a]);
    }
    for (PetscInt e = m->around[i]; e < m->around[i + 1]; e++) m->laplace[e] *= scale;
  }
  if (f) add_force(m, bending, x, h, f);
  return energy;
}
