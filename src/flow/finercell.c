/* Flow, finer: one cell (finer.h). */
#include "compat.h"
#include "base/algebra.h"
#include "fem/gauss.h"
#include "finer.h"
#include <petscblaslapack.h>

#define NP 4 /* points of quadrature an axis */

/* At a point of quadrature: weight x det J; the flow, with what was found before, and its functions */
typedef struct {
  PetscReal w, y[3], u[3], gu[3][3], p, f[3];
  PetscReal g[3][MESH_MAX_NB], gw[3][FINER_W], q[FINER_L];
} Point;

static void list_functions(PetscInt dim, FinerTables *t)
{
  const PetscInt all = dim == 2 ? 16 : 64;

  t->nw = 0;
  for (PetscInt i = 0; i < all; i++) {
    const PetscInt at[3] = {i % 4, i / 4 % 4, i / 16};
    PetscBool      odd = PETSC_FALSE, centre = PETSC_TRUE;

    for (PetscInt d = 0; d < dim; d++) {
      odd    = (PetscBool)(odd || at[d] == FINER_ODD);
      centre = (PetscBool)(centre && at[d] == 1);
    }
    if (odd || centre) PetscCallVoid(PetscArraycpy(t->digit[t->nw++], at, 3));
  }
}

void FinerFillTables(PetscInt dim, FinerTables *t)
{
  t->dim = dim;
  t->nb  = dim == 2 ? 9 : 27;
  t->nq  = dim == 2 ? NP * NP : NP * NP * NP;
  t->nl  = dim + dim * (dim + 1) / 2;
  list_functions(dim, t);
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscInt at[3] = {q % NP, q / NP % NP, q / (NP * NP)};
    PetscReal      xi[3], v[3][4], dv[3][4];

    t->weight[q] = 1;
    for (PetscInt d = 0; d < dim; d++) {
      xi[d] = GAUSS4_POINT[at[d]];
      t->weight[q] *= GAUSS4_WEIGHT[at[d]];
      ElementLine(xi[d], v[d], dv[d]);
      v[d][FINER_ODD]  = xi[d] * (xi[d] * xi[d] - 1);
      dv[d][FINER_ODD] = 3 * xi[d] * xi[d] - 1;
    }
    ElementBasis(dim, xi, t->phi[q], t->dphi[q]);
    for (PetscInt i = 0; i < t->nw; i++) {
      t->psi[q][i] = 1;
      for (PetscInt d = 0; d < dim; d++) t->psi[q][i] *= v[d][t->digit[i][d]];
      for (PetscInt e = 0; e < dim; e++) {
        t->dpsi[q][e][i] = 1;
        for (PetscInt d = 0; d < dim; d++) t->dpsi[q][e][i] *= (d == e ? dv : v)[d][t->digit[i][d]];
      }
    }
  }
}

/* ---- at a point ---- */

/* Gradients in space, weight */
static void set_metric(const FinerCell *cell, PetscInt q, Point *o)
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim, nb = t->nb;
  PetscReal          J[9] = {0}, inverse[9];

  for (PetscInt j = 0; j < nb; j++)
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt d = 0; d < dim; d++) J[a * dim + d] += cell->x[j * dim + a] * t->dphi[q][d * nb + j];
  o->w = t->weight[q] * DenseInvertMap(dim, J, inverse);
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt j = 0; j < nb; j++) o->g[a][j] = 0;
    for (PetscInt j = 0; j < t->nw; j++) o->gw[a][j] = 0;
    for (PetscInt d = 0; d < dim; d++) {
      for (PetscInt j = 0; j < nb; j++) o->g[a][j] += inverse[d * dim + a] * t->dphi[q][d * nb + j];
      for (PetscInt j = 0; j < t->nw; j++) o->gw[a][j] += inverse[d * dim + a] * t->dpsi[q][d][j];
    }
  }
}

/* u, grad u of what is found are added */
static void add_found(const FinerTables *t, PetscInt q, const Point *o, const PetscReal v[], PetscReal u[3],
                      PetscReal gu[3][3])
{
  for (PetscInt j = 0; j < t->nw; j++)
    for (PetscInt a = 0; a < t->dim; a++) {
      u[a] += t->psi[q][j] * v[j * t->dim + a];
      for (PetscInt b = 0; b < t->dim; b++) gu[a][b] += o->gw[b][j] * v[j * t->dim + a];
    }
}

static void set_point(const FinerCell *cell, const FinerFound *before, PetscInt q, Point *o)
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim, nb = t->nb;
  const PetscReal   *centre = cell->x + (nb / 2) * dim;
  PetscInt           k      = dim;

  set_metric(cell, q, o);
  PetscCallVoid(PetscMemzero(o->gu, sizeof(o->gu)));
  for (PetscInt a = 0; a < dim; a++) {
    PetscReal x = 0;

    o->u[a] = 0;
    o->f[a] = cell->f->par.force[a];
    for (PetscInt j = 0; j < nb; j++) {
      x += t->phi[q][j] * cell->x[j * dim + a];
      o->u[a] += t->phi[q][j] * cell->u[j * dim + a];
      o->f[a] += t->phi[q][j] * cell->source[j * dim + a];
      for (PetscInt b = 0; b < dim; b++) o->gu[a][b] += o->g[b][j] * cell->u[j * dim + a];
    }
    o->y[a] = (x - centre[a]) / cell->h;
  }
  o->p = cell->p[0];
  for (PetscInt a = 0; a < dim; a++) {
    o->q[a] = o->y[a];
    o->p += cell->p[1 + a] * o->y[a];
    for (PetscInt b = 0; b <= a; b++) o->q[k++] = o->y[a] * o->y[b];
  }
  if (!before) return;
  for (PetscInt i = 0; i < t->nl; i++) o->p += before->p[i] * o->q[i];
  add_found(t, q, o, before->v, o->u, o->gu);
}

/* rho (u.grad u + skew div u u) */
static void convect(const FlowParameters *par, PetscInt dim, const PetscReal u[3], PetscReal gu[3][3], PetscReal c[3])
{
  PetscReal div = 0;

  for (PetscInt a = 0; a < dim; a++) div += gu[a][a];
  for (PetscInt a = 0; a < dim; a++) {
    c[a] = 0;
    if (!par->convection) continue;
    c[a] = par->density * par->skew * div * u[a];
    for (PetscInt b = 0; b < dim; b++) c[a] += par->density * u[b] * gu[a][b];
  }
}

/* ---- the residual ---- */

void FinerResidual(const FinerCell *cell, const FinerFound *before, PetscReal r[])
{
  const FinerTables    *t   = cell->t;
  const FlowParameters *par = &cell->f->par;
  const PetscInt        dim = t->dim;
  Point                 o;
  PetscReal             c[3];

  for (PetscInt i = 0; i < t->nw * dim; i++) r[i] = 0;
  for (PetscInt q = 0; q < t->nq; q++) {
    set_point(cell, before, q, &o);
    convect(par, dim, o.u, o.gu, c);
    for (PetscInt i = 0; i < t->nw; i++)
      for (PetscInt a = 0; a < dim; a++) {
        PetscReal sum = (o.f[a] - c[a]) * t->psi[q][i] + o.p * o.gw[a][i];

        for (PetscInt b = 0; b < dim; b++) sum -= par->viscosity * o.gu[a][b] * o.gw[b][i];
        r[i * dim + a] += o.w * sum;
      }
  }
}

/* ---- the cell's own problem ---- */

typedef struct {
  PetscReal A[FINER_W * FINER_W];   /* of one component */
  PetscReal B[3][FINER_L][FINER_W]; /* of the divergence of a component */
  PetscReal flux[3][FINER_W], g[FINER_L], mean[FINER_L], volume;
  PetscReal Y[3][(FINER_L + 1) * FINER_W]; /* A^-1 (B^T, r) */
} Oseen;

/* The convection in skew-symmetric form: what it lacks at the surface of a cell cancels between two of them, and the
   problem of each is definite (Achdou, Le Tallec, Nataf & Vidrascu, Comput. Methods Appl. Mech. Eng. 184, 2000) */
static void add_point(const FinerCell *cell, PetscInt q, const Point *o, Oseen *s)
{
  const FinerTables    *t   = cell->t;
  const FlowParameters *par = &cell->f->par;
  const PetscInt        dim = t->dim, nw = t->nw;
  PetscReal             c[FINER_W], div  = 0;

  for (PetscInt j = 0; j < nw; j++) {
    c[j] = 0;
    for (PetscInt b = 0; b < dim && par->convection; b++) c[j] += 0.5 * par->density * o->u[b] * o->gw[b][j];
  }
  for (PetscInt i = 0; i < nw; i++) {
    const PetscReal psi = o->w * t->psi[q][i], ci = o->w * c[i];
    PetscReal      *A = s->A + i * nw;

    for (PetscInt b = 0; b < dim; b++) {
      const PetscReal slope = o->w * par->viscosity * o->gw[b][i];

      for (PetscInt j = 0; j < nw; j++) A[j] += slope * o->gw[b][j];
    }
    for (PetscInt j = 0; j < nw && par->convection; j++) A[j] += psi * c[j] - ci * t->psi[q][j];
  }
  s->volume += o->w;
  for (PetscInt a = 0; a < dim; a++) {
    div += o->gu[a][a];
    for (PetscInt j = 0; j < nw; j++) s->flux[a][j] += o->w * o->gw[a][j];
  }
  for (PetscInt k = 0; k < t->nl; k++) {
    s->mean[k] += o->w * o->q[k];
    s->g[k] -= o->w * o->q[k] * div;
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt j = 0; j < nw; j++) s->B[a][k][j] += o->w * o->q[k] * o->gw[a][j];
  }
}

/* Y of component a: LAPACK has columns, and so A transposed */
static PetscErrorCode solve_component(const FinerCell *cell, PetscInt a, const PetscReal r[], Oseen *s)
{
  const PetscInt nw = cell->t->nw, nl = cell->t->nl, dim = cell->t->dim;
  PetscBLASInt   n, m, pivot[FINER_W], info;
  PetscReal      M[FINER_W * FINER_W], *Y = s->Y[a];

  PetscFunctionBeginUser;
  PetscCall(PetscBLASIntCast(nw, &n));
  PetscCall(PetscBLASIntCast(nl + 1, &m));
  PetscCall(PetscArraycpy(M, s->A, nw * nw));
  for (PetscInt i = 0; i < nw; i++) {
    const PetscBool given = (PetscBool)((cell->given[i] >> a) & 1);

    for (PetscInt j = 0; j < nw && given; j++) M[j * nw + i] = M[i * nw + j] = 0;
    for (PetscInt k = 0; k < nl; k++) {
      if (given) s->B[a][k][i] = 0;
      Y[k * nw + i] = s->B[a][k][i];
    }
    if (given) M[i * nw + i] = 1;
    Y[nl * nw + i] = given ? 0 : r[i * dim + a];
  }
  PetscCallBLAS("LAPACKgetrf", LAPACKgetrf_(&n, &n, M, &n, pivot, &info));
  PetscCheck(info == 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "The problem of a cell is singular");
  PetscCallBLAS("LAPACKgetrs", LAPACKgetrs_("T", &n, &m, M, &n, pivot, Y, &n, &info));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_pressure(const FinerTables *t, const Oseen *s, PetscReal p[])
{
  const PetscInt nw = t->nw, nl = t->nl;
  PetscBLASInt   n, one         = 1, pivot[FINER_L], info;
  PetscReal      S[FINER_L * FINER_L];

  PetscFunctionBeginUser;
  PetscCall(PetscBLASIntCast(nl, &n));
  for (PetscInt k = 0; k < nl; k++) {
    p[k] = s->g[k];
    for (PetscInt i = 0; i < nl; i++) S[i * nl + k] = 0;
    for (PetscInt a = 0; a < t->dim; a++)
      for (PetscInt j = 0; j < nw; j++) {
        p[k] -= s->B[a][k][j] * s->Y[a][nl * nw + j];
        for (PetscInt i = 0; i < nl; i++) S[i * nl + k] += s->B[a][k][j] * s->Y[a][i * nw + j];
      }
  }
  PetscCallBLAS("LAPACKgetrf", LAPACKgetrf_(&n, &n, S, &n, pivot, &info));
  PetscCheck(info == 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "The pressures of a cell are singular");
  PetscCallBLAS("LAPACKgetrs", LAPACKgetrs_("N", &n, &one, S, &n, pivot, p, &n, &info));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FinerSolve(const FinerCell *cell, const PetscReal r[], const FinerFound *found, PetscReal v[])
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim, nw = t->nw, nl = t->nl;
  Oseen              s = {.volume = 0};
  Point              o;
  PetscReal          p[FINER_L];

  PetscFunctionBeginUser;
  for (PetscInt q = 0; q < t->nq; q++) {
    set_point(cell, found, q, &o);
    add_point(cell, q, &o, &s);
  }
  for (PetscInt k = 0; k < nl; k++)
    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt j = 0; j < nw; j++) s.B[a][k][j] -= s.mean[k] / s.volume * s.flux[a][j];
  for (PetscInt a = 0; a < dim; a++) PetscCall(solve_component(cell, a, r, &s));
  PetscCall(solve_pressure(t, &s, p));
  for (PetscInt k = 0; k < nl; k++) found->p[k] += p[k];
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt j = 0; j < nw; j++) {
      v[j * dim + a] = s.Y[a][nl * nw + j];
      for (PetscInt k = 0; k < nl; k++) v[j * dim + a] += s.Y[a][k * nw + j] * p[k];
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what it does to the others ---- */

void FinerAnswer(const FinerCell *cell, const FinerFound *found, PetscReal s[], PetscReal source[], FinerSums *sums)
{
  const FinerTables    *t   = cell->t;
  const FlowParameters *par = &cell->f->par;
  const PetscInt        dim = t->dim;
  Point                 o;

  for (PetscInt i = 0; i < t->nb * dim; i++) s[i] = 0;
  for (PetscInt k = 0; k <= dim; k++) source[k] = 0;
  for (PetscInt q = 0; q < t->nq; q++) {
    PetscReal before[3], after[3], v[3] = {0, 0, 0}, gv[3][3] = {{0}}, p = 0, div = 0;

    set_point(cell, NULL, q, &o);
    convect(par, dim, o.u, o.gu, before);
    add_found(t, q, &o, found->v, v, gv);
    for (PetscInt a = 0; a < dim; a++) {
      div += gv[a][a];
      sums->velocity[a] += o.w * v[a];
      sums->energy += o.w * par->density * (o.u[a] + 0.5 * v[a]) * v[a];
      o.u[a] += v[a];
      for (PetscInt b = 0; b < dim; b++) {
        sums->correction += o.w * par->viscosity * PetscSqr(gv[a][b]);
        sums->dissipation += o.w * par->viscosity * PetscSqr(o.gu[a][b]);
        o.gu[a][b] += gv[a][b];
      }
    }
    convect(par, dim, o.u, o.gu, after);
    for (PetscInt k = 0; k < t->nl; k++) p += found->p[k] * o.q[k];
    for (PetscInt i = 0; i < t->nb; i++)
      for (PetscInt a = 0; a < dim; a++) {
        PetscReal sum = (after[a] - before[a]) * t->phi[q][i] - p * o.g[a][i];

        for (PetscInt b = 0; b < dim; b++) sum += par->viscosity * gv[a][b] * o.g[b][i];
        s[i * dim + a] += o.w * sum;
      }
    source[0] -= o.w * div;
    for (PetscInt a = 0; a < dim; a++) source[1 + a] -= o.w * div * o.y[a];
  }
}
