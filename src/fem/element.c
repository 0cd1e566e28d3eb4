/* Element: see element.h. The basis comes from PetscFE, put into lattice order. */
#include "compat.h"
#include "fem/element.h"
#include "base/algebra.h"
#include "base/inline.h"
#include "fem/gauss.h"
#include <petscfe.h>

/* Nodes and quadrature points of a cell, and padded: constants of the inlined kernels */
#define NODES(dim)  ((dim) == 2 ? 9 : 27)
#define PADDED(dim) ((dim) == 2 ? 12 : 28)

/* Newton's method from the middle of a cell may end beyond a corner that is flat. Results so far off are taken for
   that, and it begins again beside the nearest node, so far out; that counts if it ends within the cell. */
#define ELSEWHERE 2
#define BESIDE    0.8
#define WITHIN    1e-6

/* ---- tables ---- */

/* Which PETSc basis function belongs to lattice position j: the one that is 1 there */
static PetscErrorCode match_basis(PetscFE fe, PetscInt dim, PetscInt nb, PetscInt basis_of_lattice[])
{
  PetscReal       points[ELEMENT_MAX_NB * 3];
  PetscTabulation T;

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt lattice[3] = {j % 3, (j / 3) % 3, j / 9};

    for (PetscInt d = 0; d < dim; d++) points[j * dim + d] = lattice[d] - 1.0;
  }
  PetscCall(PetscFECreateTabulation(fe, 1, nb, points, 0, &T));
  PetscCheck(T->Nb == nb, PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "PetscFE has %" PetscInt_FMT " basis functions, expected %" PetscInt_FMT, T->Nb, nb);
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt i = 0; i < nb; i++)
      if (T->T[0][j * nb + i] > 0.5) basis_of_lattice[j] = i;
  PetscCall(PetscTabulationDestroy(&T));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void fill_reference_matrices(ElementTables *t)
{
  const PetscInt dim = t->dim, nbp = t->nbp, size = t->nb * nbp;

  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal *phi = t->phi + q * nbp, *dphi = t->dphi + q * dim * nbp;

    for (PetscInt i = 0; i < t->nb; i++) {
      for (PetscInt j = 0; j < t->nb; j++) {
        t->mass[i * nbp + j] += t->weight[q] * phi[i] * phi[j];
        for (PetscInt e = 0; e < dim; e++)
          for (PetscInt f = 0; f < dim; f++)
            t->stiffness[(e * dim + f) * size + i * nbp + j] += 0.5 * t->weight[q] *
                                                                (dphi[e * nbp + i] * dphi[f * nbp + j] +
                                                                 dphi[f * nbp + i] * dphi[e * nbp + j]);
      }
    }
  }
}

PetscErrorCode ElementCreate(PetscInt dim, ElementTables *t)
{
  const PetscInt   nb = dim == 2 ? 9 : 27;
  PetscInt         order[ELEMENT_MAX_NB];
  PetscFE          fe;
  PetscQuadrature  quad;
  PetscTabulation  T;
  const PetscReal *points, *weights;

  PetscFunctionBeginUser;
  t->dim = dim;
  t->nb  = nb;
  t->nbp = 4 * ((nb + 3) / 4);
  PetscCall(PetscFECreateLagrange(PETSC_COMM_SELF, dim, 1, PETSC_FALSE, 2, PETSC_DETERMINE, &fe));
  PetscCall(match_basis(fe, dim, nb, order));
  PetscCall(PetscDTGaussTensorQuadrature(dim, 1, 3, -1, 1, &quad));
  PetscCall(PetscQuadratureGetData(quad, NULL, NULL, &t->nq, &points, &weights));
  t->nqp = 4 * ((t->nq + 3) / 4);
  PetscCall(PetscFECreateTabulation(fe, 1, t->nq, points, 1, &T));
  PetscCall(PetscCalloc5(t->nq * t->nbp, &t->phi, t->nq * dim * t->nbp, &t->dphi, nb * t->nqp, &t->phi_t,
                         nb * dim * t->nqp, &t->dphi_t, t->nqp, &t->weight));
  PetscCall(PetscCalloc2(nb * t->nbp, &t->mass, dim * dim * nb * t->nbp, &t->stiffness));
  for (PetscInt q = 0; q < t->nq; q++) {
    t->weight[q] = weights[q];
    for (PetscInt j = 0; j < nb; j++) {
      t->phi[q * t->nbp + j] = t->phi_t[j * t->nqp + q] = T->T[0][q * nb + order[j]];
      for (PetscInt e = 0; e < dim; e++)
        t->dphi[(q * dim + e) * t->nbp + j] = t->dphi_t[(j * dim + e) * t->nqp +
                                                        q] = T->T[1][(q * nb + order[j]) * dim + e];
    }
  }
  fill_reference_matrices(t);
  PetscCall(PetscTabulationDestroy(&T));
  PetscCall(PetscQuadratureDestroy(&quad));
  PetscCall(PetscFEDestroy(&fe));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ElementDestroy(ElementTables *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree5(t->phi, t->dphi, t->phi_t, t->dphi_t, t->weight));
  PetscCall(PetscFree2(t->mass, t->stiffness));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- metric ---- */

void ElementSetMetric(const ElementTables *t, const PetscReal xc[], ElementMetric *m)
{
  const PetscInt dim = t->dim;

  m->affine = PETSC_FALSE;
  for (PetscInt q = 0; q < t->nq; q++) {
    PetscReal J[9] = {0}; /* dx_a/dxi_e: [a][e] */

    for (PetscInt e = 0; e < dim; e++) {
      const PetscReal *d = t->dphi + (q * dim + e) * t->nbp;

      for (PetscInt j = 0; j < t->nb; j++)
        for (PetscInt a = 0; a < dim; a++) J[a * dim + e] += xc[j * dim + a] * d[j];
    }
    m->weight[q] = t->weight[q] * DenseInvertMap(dim, J, m->inverse[q]);
  }
}

void ElementSetAffine(const ElementTables *t, const PetscReal inverse[], PetscReal det, ElementMetric *m)
{
  m->affine = PETSC_TRUE;
  m->det    = det;
  for (PetscInt i = 0; i < t->dim * t->dim; i++) m->inverse[0][i] = inverse[i];
  for (PetscInt q = 0; q < t->nq; q++) m->weight[q] = t->weight[q] * det;
}

void ElementGradients(const ElementTables *t, const ElementMetric *m, PetscInt q, PetscReal g[3][ELEMENT_MAX_NBP])
{
  const PetscReal *inverse = ElementInverse(m, q);

  for (PetscInt a = 0; a < t->dim; a++) {
    for (PetscInt j = 0; j < t->nbp; j++) g[a][j] = 0;
    for (PetscInt e = 0; e < t->dim; e++) {
      const PetscReal  inv = inverse[e * t->dim + a];
      const PetscReal *d   = t->dphi + (q * t->dim + e) * t->nbp;

      for (PetscInt j = 0; j < t->nbp; j++) g[a][j] += inv * d[j];
    }
  }
}

/* ---- operator ---- */

/* g [nq][nbp] += weight (w . grad phi_j + skew div w phi_j) */
INLINE void add_convection(const int dim, const int nb, const int nbp, const int nq, const ElementTables *restrict t,
                           const ElementMetric *restrict m, PetscBool affine, const PetscReal *restrict wl,
                           PetscReal skew, PetscReal g[restrict][ELEMENT_MAX_NBP])
{
  for (int q = 0; q < nq; q++) {
    const PetscReal *phi = t->phi + q * nbp, *dphi = t->dphi + q * dim * nbp, *inverse = m->inverse[affine ? 0 : q];
    PetscReal        w[3] = {0, 0, 0}, s[3];

    for (int j = 0; j < nb; j++)
      for (int a = 0; a < dim; a++) w[a] += phi[j] * wl[j * dim + a];
    for (int e = 0; e < dim; e++) {
      s[e] = 0;
      for (int a = 0; a < dim; a++) s[e] += inverse[e * dim + a] * w[a];
      s[e] *= m->weight[q];
    }
    for (int e = 0; e < dim; e++)
      for (int j = 0; j < nbp; j++) g[q][j] += s[e] * dphi[e * nbp + j];
    if (skew != 0) {
      PetscReal div = 0;

      for (int e = 0; e < dim; e++)
        for (int a = 0; a < dim; a++) {
          PetscReal slope = 0;

          for (int j = 0; j < nb; j++) slope += dphi[e * nbp + j] * wl[j * dim + a];
          div += inverse[e * dim + a] * slope;
        }
      for (int j = 0; j < nbp; j++) g[q][j] += skew * m->weight[q] * div * phi[j];
    }
  }
}

/* ce [nb][nbp] += sum_q phi_i g_j */
INLINE void add_products(const int nb, const int nbp, const int nq, const PetscReal *restrict phi,
                         PetscReal g[restrict][ELEMENT_MAX_NBP], PetscReal *restrict ce)
{
  for (int i = 0; i < nb; i++) {
    PetscReal row[ELEMENT_MAX_NBP];

    for (int j = 0; j < nbp; j++) row[j] = ce[i * nbp + j];
    for (int q = 0; q < nq; q++)
      for (int j = 0; j < nbp; j++) row[j] += phi[q * nbp + i] * g[q][j];
    for (int j = 0; j < nbp; j++) ce[i * nbp + j] = row[j];
  }
}

INLINE void affine_operator(const int dim, const ElementTables *restrict t, const ElementMetric *restrict m,
                            PetscReal a, PetscReal b, const PetscReal *restrict wl, PetscReal skew,
                            PetscReal *restrict ce)
{
  const int       nb = NODES(dim), nbp = PADDED(dim), nq = nb;
  const PetscReal am = a * m->det;
  PetscReal       g[ELEMENT_MAX_NQ][ELEMENT_MAX_NBP], bk[9];

  for (int e = 0; e < dim; e++) {
    for (int f = 0; f < dim; f++) {
      bk[e * dim + f] = 0;
      for (int d = 0; d < dim; d++)
        bk[e * dim + f] += b * m->det * m->inverse[0][e * dim + d] * m->inverse[0][f * dim + d];
    }
  }
  for (int i = 0; i < nb * nbp; i++) ce[i] = am * t->mass[i];
  for (int e = 0; e < dim; e++) { /* the reference matrices are symmetric in e and f */
    for (int f = e; f < dim; f++) {
      const PetscReal  s = e == f ? bk[e * dim + e] : 2 * bk[e * dim + f];
      const PetscReal *k = t->stiffness + (e * dim + f) * nb * nbp;

      if (s == 0) continue; /* rectangles have no mixed part */
      for (int i = 0; i < nb * nbp; i++) ce[i] += s * k[i];
    }
  }
  if (!wl) return;
  for (int q = 0; q < nq; q++)
    for (int j = 0; j < nbp; j++) g[q][j] = 0;
  add_convection(dim, nb, nbp, nq, t, m, PETSC_TRUE, wl, skew, g);
  add_products(nb, nbp, nq, t->phi, g, ce);
}

INLINE void curved_operator(const int dim, const ElementTables *restrict t, const ElementMetric *restrict m,
                            PetscReal a, PetscReal b, const PetscReal *restrict wl, PetscReal skew,
                            PetscReal *restrict ce)
{
  const int nb = NODES(dim), nbp = PADDED(dim), nq = nb;
  PetscReal g[ELEMENT_MAX_NQ][ELEMENT_MAX_NBP];

  for (int i = 0; i < nb * nbp; i++) ce[i] = 0;
  for (int q = 0; q < nq; q++)
    for (int j = 0; j < nbp; j++) g[q][j] = a * m->weight[q] * t->phi[q * nbp + j];
  if (wl) add_convection(dim, nb, nbp, nq, t, m, PETSC_FALSE, wl, skew, g);
  add_products(nb, nbp, nq, t->phi, g, ce);
  for (int q = 0; q < nq; q++) {
    PetscReal grad[3][ELEMENT_MAX_NBP];

    ElementGradients(t, m, q, grad);
    for (int i = 0; i < nb; i++) {
      for (int d = 0; d < dim; d++) {
        const PetscReal s = b * m->weight[q] * grad[d][i];

        for (int j = 0; j < nbp; j++) ce[i * nbp + j] += s * grad[d][j];
      }
    }
  }
}

void ElementOperator(const ElementTables *t, const ElementMetric *m, PetscReal a, PetscReal b, const PetscReal w[],
                     PetscReal skew, PetscReal ce[])
{
  if (t->dim == 2 && m->affine) affine_operator(2, t, m, a, b, w, skew, ce);
  else if (t->dim == 2) curved_operator(2, t, m, a, b, w, skew, ce);
  else if (m->affine) affine_operator(3, t, m, a, b, w, skew, ce);
  else curved_operator(3, t, m, a, b, w, skew, ce);
}

/* ---- residual ---- */

/* v [dim][nqp] = values of a nodal field [nb][dim] at the quadrature points */
INLINE void evaluate(const int dim, const int nb, const int nqp, const PetscReal *restrict table, const int stride,
                     const PetscReal *restrict nodal, PetscReal v[restrict][ELEMENT_MAX_NQ])
{
  for (int d = 0; d < dim; d++)
    for (int q = 0; q < nqp; q++) v[d][q] = 0;
  for (int j = 0; j < nb; j++)
    for (int d = 0; d < dim; d++)
      for (int q = 0; q < nqp; q++) v[d][q] += nodal[j * dim + d] * table[j * stride + q];
}

/* par: density, viscosity, share of the skew part */
INLINE void residual(const int       dim, const ElementTables *restrict t, const ElementMetric *restrict m,
                     const PetscReal par[3], const PetscReal *restrict force, const PetscReal *restrict sl,
                     const PetscReal *restrict ul, const PetscReal *restrict wl, PetscReal *restrict r)
{
  const int       nb = NODES(dim), nbp = PADDED(dim), nq = nb, nqp = PADDED(dim);
  const PetscReal rho = par[0], mu = par[1], skew = par[2];
  PetscReal       source[3][ELEMENT_MAX_NQ], w[3][ELEMENT_MAX_NQ], u[3][ELEMENT_MAX_NQ], grad[3][3][ELEMENT_MAX_NQ],
    slope[3][3][ELEMENT_MAX_NQ]; /* [e][d]: in reference coordinates, then the viscous flux; that of w */
  PetscReal out[3][ELEMENT_MAX_NBP];

  evaluate(dim, nb, nqp, t->phi_t, nqp, sl, source);
  if (ul)
    for (int e = 0; e < dim; e++) evaluate(dim, nb, nqp, t->dphi_t + e * nqp, dim * nqp, ul, grad[e]);
  if (ul && wl) evaluate(dim, nb, nqp, t->phi_t, nqp, wl, w);
  if (ul && wl && skew != 0) {
    evaluate(dim, nb, nqp, t->phi_t, nqp, ul, u);
    for (int e = 0; e < dim; e++) evaluate(dim, nb, nqp, t->dphi_t + e * nqp, dim * nqp, wl, slope[e]);
  }
  for (int q = 0; q < nq; q++) {
    const PetscReal *inverse = m->inverse[m->affine ? 0 : q];
    PetscReal        div     = 0;

    for (int e = 0; e < dim && ul && wl && skew != 0; e++)
      for (int a = 0; a < dim; a++) div += inverse[e * dim + a] * slope[e][a][q];
    for (int d = 0; d < dim; d++) {
      source[d][q] = rho * source[d][q] - force[d];
      if (div != 0) source[d][q] += rho * skew * div * u[d][q];
      if (ul) {
        PetscReal space[3];

        for (int a = 0; a < dim; a++) {
          space[a] = 0;
          for (int e = 0; e < dim; e++) space[a] += inverse[e * dim + a] * grad[e][d][q];
          if (wl) source[d][q] += rho * w[a][q] * space[a];
        }
        for (int e = 0; e < dim; e++) {
          PetscReal flux = 0;

          for (int a = 0; a < dim; a++) flux += inverse[e * dim + a] * space[a];
          grad[e][d][q] = mu * m->weight[q] * flux;
        }
      }
      source[d][q] *= m->weight[q];
    }
  }
  for (int d = 0; d < dim; d++) {
    for (int j = 0; j < nbp; j++) out[d][j] = 0;
    for (int q = 0; q < nq; q++) {
      for (int j = 0; j < nbp; j++) out[d][j] += source[d][q] * t->phi[q * nbp + j];
      if (ul)
        for (int e = 0; e < dim; e++)
          for (int j = 0; j < nbp; j++) out[d][j] += grad[e][d][q] * t->dphi[(q * dim + e) * nbp + j];
    }
  }
  for (int j = 0; j < nb; j++)
    for (int d = 0; d < dim; d++) r[j * dim + d] = out[d][j];
}

void ElementResidual(const ElementTables *t, const ElementMetric *m, PetscReal rho, PetscReal mu,
                     const PetscReal force[], const PetscReal s[], const PetscReal u[], const PetscReal w[],
                     PetscReal skew, PetscReal r[])
{
  const PetscReal par[3] = {rho, mu, skew};

  if (t->dim == 2) residual(2, t, m, par, force, s, u, w, r);
  else residual(3, t, m, par, force, s, u, w, r);
}

/* ---- the map of a cell and its inverse ---- */

void ElementBasis(PetscInt dim, const PetscReal xi[], PetscReal phi[], PetscReal dphi[])
{
  const PetscInt nb = dim == 2 ? 9 : 27;
  PetscReal      v[3][3], dv[3][3];

  for (PetscInt d = 0; d < dim; d++) ElementLine(xi[d], v[d], dv[d]);
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt at[3] = {j % 3, j / 3 % 3, j / 9};

    phi[j] = 1;
    for (PetscInt d = 0; d < dim; d++) phi[j] *= v[d][at[d]];
    for (PetscInt e = 0; e < dim; e++) {
      dphi[e * nb + j] = 1;
      for (PetscInt d = 0; d < dim; d++) dphi[e * nb + j] *= d == e ? dv[d][at[d]] : v[d][at[d]];
    }
  }
}

void ElementMap(PetscInt dim, const PetscReal xc[], const PetscReal xi[], PetscReal x[], PetscReal J[])
{
  const PetscInt nb = dim == 2 ? 9 : 27;
  PetscReal      phi[27], dphi[3 * 27];

  ElementBasis(dim, xi, phi, dphi);
  for (PetscInt a = 0; a < dim; a++) x[a] = 0;
  for (PetscInt i = 0; i < dim * dim; i++) J[i] = 0;
  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt a = 0; a < dim; a++) {
      x[a] += phi[j] * xc[j * dim + a];
      for (PetscInt e = 0; e < dim; e++) J[a * dim + e] += dphi[e * nb + j] * xc[j * dim + a];
    }
}

PetscReal ElementGaussPoint(PetscInt dim, const PetscReal xc[], PetscInt q, PetscReal phi[])
{
  const PetscReal xi[3] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3 % 3], GAUSS3_POINT[q / 9]};
  PetscReal       dphi[3 * ELEMENT_MAX_NB], x[3], J[9];

  ElementBasis(dim, xi, phi, dphi);
  ElementMap(dim, xc, xi, x, J);
  return GAUSS3_WEIGHT[q % 3] * GAUSS3_WEIGHT[q / 3 % 3] * (dim == 3 ? GAUSS3_WEIGHT[q / 9] : 1) *
         DenseDeterminant(dim, J);
}

/* Newton's method from xi */
static PetscBool locate_from(PetscInt dim, const PetscReal xc[], const PetscReal x[], PetscReal xi[])
{
  PetscReal step = 1;

  for (PetscInt it = 0; it < 30 && step > 1e-13; it++) {
    PetscReal at[3], J[9], inverse[9];

    ElementMap(dim, xc, xi, at, J);
    if (!(PetscAbsReal(DenseInvertMap(dim, J, inverse)) > 0)) return PETSC_FALSE;
    step = 0;
    for (PetscInt e = 0; e < dim; e++) {
      PetscReal change = 0;

      for (PetscInt a = 0; a < dim; a++) change += inverse[e * dim + a] * (x[a] - at[a]);
      xi[e] += change;
      step = PetscMax(step, PetscAbsReal(change));
    }
    if (!(step < 1e3)) return PETSC_FALSE;
  }
  return (PetscBool)(step <= 1e-8);
}

static PetscReal largest_of(PetscInt dim, const PetscReal xi[])
{
  PetscReal largest = 0;

  for (PetscInt d = 0; d < dim; d++) largest = PetscMax(largest, PetscAbsReal(xi[d]));
  return largest;
}

PetscBool ElementLocate(PetscInt dim, const PetscReal xc[], const PetscReal x[], PetscReal xi[])
{
  const PetscInt nb      = dim == 2 ? 9 : 27;
  PetscInt       nearest = 0;
  PetscReal      closest = PETSC_MAX_REAL, at[3];
  PetscBool      found;

  for (PetscInt d = 0; d < dim; d++) xi[d] = 0;
  found = locate_from(dim, xc, x, xi);
  if (found && largest_of(dim, xi) <= ELSEWHERE) return PETSC_TRUE;
  for (PetscInt j = 0; j < nb; j++) {
    PetscReal square = 0;

    for (PetscInt a = 0; a < dim; a++) square += PetscSqr(x[a] - xc[j * dim + a]);
    if (square >= closest) continue;
    closest = square;
    nearest = j;
  }
  for (PetscInt d = 0, j = nearest; d < dim; d++, j /= 3) at[d] = BESIDE * (PetscReal)(j % 3 - 1);
  if (!locate_from(dim, xc, x, at) || !(largest_of(dim, at) <= 1 + WITHIN)) return found;
  for (PetscInt d = 0; d < dim; d++) xi[d] = at[d];
  return PETSC_TRUE;
}

/* ---- divergence ---- */

typedef PetscReal Eight __attribute__((vector_size(8 * sizeof(PetscReal)), aligned(sizeof(PetscReal)), may_alias));

INLINE void divergence(const int dim, const int nb, PetscInt ncell, const PetscInt *restrict cell_node,
                       const PetscReal *const *bs, const PetscReal *restrict u, PetscReal *restrict y)
{
  const int n = nb * dim, whole = n / 8 * 8;

  for (PetscInt c = 0; c < ncell; c++) {
    const PetscReal *restrict b = bs[c];
    PetscReal ul[ELEMENT_MAX_NBP * 3];
    Eight     sum[4] = {{0}};

    for (int j = 0; j < nb; j++)
      for (int a = 0; a < dim; a++) ul[j * dim + a] = u[cell_node[c * nb + j] * dim + a];
    for (int i = 0; i < whole; i += 8)
      for (int k = 0; k < dim + 1; k++) sum[k] += *(const Eight *)(b + k * n + i) * *(const Eight *)(ul + i);
    for (int k = 0; k < dim + 1; k++) {
      const Eight v = sum[k];
      PetscReal   s = ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));

      for (int i = whole; i < n; i++) s += b[k * n + i] * ul[i];
      y[c * (dim + 1) + k] = s;
    }
  }
}

INLINE void gradient(const int dim, const int nb, PetscInt ncell, const PetscInt *restrict cell_node,
                     const PetscReal *const *bs, PetscReal scale, const PetscReal *restrict p, PetscReal *restrict r)
{
  const int n = nb * dim;

  for (PetscInt c = 0; c < ncell; c++) {
    const PetscReal *restrict b       = bs[c];
    PetscReal rl[ELEMENT_MAX_NBP * 3] = {0};

    for (int k = 0; k < dim + 1; k++, b += n)
      for (int i = 0; i < n; i++) rl[i] += scale * p[c * (dim + 1) + k] * b[i];
    for (int j = 0; j < nb; j++)
      for (int a = 0; a < dim; a++) r[cell_node[c * nb + j] * dim + a] += rl[j * dim + a];
  }
}

void ElementDivergence(PetscInt dim, PetscInt ncell, const PetscInt cell_node[], const PetscReal *const b[],
                       const PetscReal u[], PetscReal y[])
{
  if (dim == 2) divergence(2, 9, ncell, cell_node, b, u, y);
  else divergence(3, 27, ncell, cell_node, b, u, y);
}

void ElementGradient(PetscInt dim, PetscInt ncell, const PetscInt cell_node[], const PetscReal *const b[],
                     PetscReal scale, const PetscReal p[], PetscReal r[])
{
  if (dim == 2) gradient(2, 9, ncell, cell_node, b, scale, p, r);
  else gradient(3, 27, ncell, cell_node, b, scale, p, r);
}
