/* Flow, finer: one cell (finer.h). */
#include "compat.h"
#include "base/algebra.h"
#include "base/inline.h"
#include "fem/gauss.h"
#include "finer.h"
#include <petscblaslapack.h>

#define NP   FINER_LINE /* points of quadrature an axis: as many as functions */
#define WIDE (3 * FINER_Q)

/* At the points of quadrature: weight x det J, slopes of the cell's axes in space; what acts there */
typedef struct {
  PetscReal w[FINER_Q], inverse[FINER_Q][9], y[3][FINER_Q], p[FINER_Q], f[3][FINER_Q];
} Points;

/* A velocity and its gradient there: component, direction */
typedef struct {
  PetscReal u[3][FINER_Q], g[3][3][FINER_Q];
} Field;

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

static PetscInt get_place(const PetscInt digit[3], PetscInt dim)
{
  PetscInt at = 0;

  for (PetscInt d = dim - 1; d >= 0; d--) at = at * FINER_LINE + digit[d];
  return at;
}

void FinerFillTables(PetscInt dim, FinerTables *t)
{
  t->dim = dim;
  t->nb  = dim == 2 ? 9 : 27;
  t->nq  = dim == 2 ? NP * NP : NP * NP * NP;
  t->nl  = dim + dim * (dim + 1) / 2;
  list_functions(dim, t);
  for (PetscInt i = 0; i < t->nw; i++) t->place[i] = get_place(t->digit[i], dim);
  for (PetscInt j = 0; j < t->nb; j++) t->node[j] = get_place((PetscInt[3]){j % 3, j / 3 % 3, j / 9}, dim);
  for (PetscInt q = 0; q < NP; q++) {
    const PetscReal xi = GAUSS4_POINT[q];
    PetscReal       v[3], dv[3];

    ElementLine(xi, v, dv);
    for (PetscInt i = 0; i < FINER_LINE; i++) {
      t->line[0][i][q] = t->back[0][q][i] = i < 3 ? v[i] : xi * (xi * xi - 1);
      t->line[1][i][q] = t->back[1][q][i] = i < 3 ? dv[i] : 3 * xi * xi - 1;
    }
  }
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscInt at[3] = {q % NP, q / NP % NP, q / (NP * NP)};

    t->weight[q] = 1;
    for (PetscInt d = 0; d < dim; d++) t->weight[q] *= GAUSS4_WEIGHT[at[d]];
    for (PetscInt i = 0; i < t->nw; i++)
      for (PetscInt e = 0; e <= dim; e++) {
        PetscReal *value = e == dim ? &t->psi[q][i] : &t->dpsi[q][e][i];

        *value = 1;
        for (PetscInt d = 0; d < dim; d++) *value *= t->line[d == e][t->digit[i][d]][at[d]];
      }
  }
}

/* ---- from functions to points and back, axis by axis (Orszag 1980) ---- */

/* Along the slowest axis of in [4][rest], which is the fastest of out */
INLINE void contract(const int rest, const PetscReal m[FINER_LINE][FINER_LINE], const PetscReal *restrict in,
                     PetscReal *restrict out)
{
  for (int r = 0; r < rest; r++)
    for (int q = 0; q < FINER_LINE; q++)
      out[r * FINER_LINE + q] = m[0][q] * in[r] + m[1][q] * in[rest + r] + m[2][q] * in[2 * rest + r] +
                                m[3][q] * in[3 * rest + r];
}

/* With the second of m along axis `slope`, with the first along the others */
static void transform(PetscInt dim, const PetscReal m[2][FINER_LINE][FINER_LINE], PetscInt slope, const PetscReal in[],
                      PetscReal out[])
{
  PetscReal a[FINER_Q], b[FINER_Q];

  if (dim == 2) {
    contract(4, m[slope == 1], in, a);
    contract(4, m[slope == 0], a, out);
  } else {
    contract(16, m[slope == 2], in, a);
    contract(16, m[slope == 1], a, b);
    contract(16, m[slope == 0], b, out);
  }
}

/* Sum over points of s times a function and of its slopes times g; to c, by place */
static void integrate(const FinerTables *t, const PetscReal s[], const PetscReal g[3][FINER_Q], PetscReal c[])
{
  PetscReal part[FINER_Q];

  transform(t->dim, t->back, -1, s, c);
  for (PetscInt d = 0; d < t->dim; d++) {
    transform(t->dim, t->back, d, g[d], part);
    for (PetscInt i = 0; i < t->nq; i++) c[i] += part[i];
  }
}

/* ---- at the points ---- */

/* Of Q2 u [nb][dim] and what is found v [nw][dim]; either may be NULL */
static void find_field(const FinerTables *t, const Points *o, const PetscReal u[], const PetscReal v[], Field *field)
{
  const PetscInt dim = t->dim;
  PetscReal      c[FINER_Q], slope[3][FINER_Q];

  for (PetscInt a = 0; a < dim; a++) {
    PetscCallVoid(PetscArrayzero(c, FINER_Q));
    for (PetscInt j = 0; j < t->nb && u; j++) c[t->node[j]] = u[j * dim + a];
    for (PetscInt j = 0; j < t->nw && v; j++) c[t->place[j]] += v[j * dim + a];
    transform(dim, t->line, -1, c, field->u[a]);
    for (PetscInt d = 0; d < dim; d++) transform(dim, t->line, d, c, slope[d]);
    for (PetscInt b = 0; b < dim; b++)
      for (PetscInt q = 0; q < t->nq; q++) {
        field->g[a][b][q] = 0;
        for (PetscInt d = 0; d < dim; d++) field->g[a][b][q] += o->inverse[q][d * dim + b] * slope[d][q];
      }
  }
}

static void set_metric(const FinerCell *cell, Points *o)
{
  const FinerTables *t      = cell->t;
  const PetscInt     dim    = t->dim;
  const PetscReal   *centre = cell->x + (t->nb / 2) * dim;
  PetscReal          c[FINER_Q], slope[3][3][FINER_Q];

  PetscCallVoid(PetscArrayzero(c, FINER_Q));
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt j = 0; j < t->nb; j++) c[t->node[j]] = (cell->x[j * dim + a] - centre[a]) / cell->h;
    transform(dim, t->line, -1, c, o->y[a]);
    for (PetscInt d = 0; d < dim; d++) transform(dim, t->line, d, c, slope[a][d]);
  }
  for (PetscInt q = 0; q < t->nq; q++) {
    PetscReal J[9];

    for (PetscInt i = 0; i < dim * dim; i++) J[i] = cell->h * slope[i / dim][i % dim][q];
    o->w[q] = t->weight[q] * DenseInvertMap(dim, J, o->inverse[q]);
    if (o->w[q] < 0) o->w[q] = 0; /* beside a flat corner the cell has no volume */
  }
}

/* Functions of the pressure */
static void fill_pressures(PetscInt dim, const Points *o, PetscInt q, PetscReal f[])
{
  PetscInt k = dim;

  for (PetscInt a = 0; a < dim; a++) {
    f[a] = o->y[a][q];
    for (PetscInt b = 0; b <= a; b++) f[k++] = o->y[a][q] * o->y[b][q];
  }
}

static void set_points(const FinerCell *cell, const FinerFound *before, Points *o)
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim;
  PetscReal          c[FINER_Q], f[FINER_L];

  set_metric(cell, o);
  for (PetscInt q = 0; q < t->nq; q++) {
    fill_pressures(dim, o, q, f);
    o->p[q] = cell->p[0];
    for (PetscInt a = 0; a < dim; a++) o->p[q] += cell->p[1 + a] * f[a];
    for (PetscInt k = 0; k < t->nl; k++) o->p[q] += before->p[k] * f[k];
  }
  PetscCallVoid(PetscArrayzero(c, FINER_Q));
  for (PetscInt a = 0; a < dim; a++) {
    for (PetscInt j = 0; j < t->nb; j++) c[t->node[j]] = cell->source[j * dim + a] + cell->f->par.force[a];
    transform(dim, t->line, -1, c, o->f[a]);
  }
}

/* rho (u.grad u + skew div u u) at point q */
static void convect(const FlowParameters *par, PetscInt dim, const Field *v, PetscInt q, PetscReal c[3])
{
  PetscReal div = 0;

  for (PetscInt a = 0; a < dim; a++) div += v->g[a][a][q];
  for (PetscInt a = 0; a < dim; a++) {
    c[a] = 0;
    if (!par->convection) continue;
    c[a] = par->density * par->skew * div * v->u[a][q];
    for (PetscInt b = 0; b < dim; b++) c[a] += par->density * v->u[b][q] * v->g[a][b][q];
  }
}

/* Component a of the stress viscosity grad v - p, along the cell's axes, times the weight */
static void set_stress(const FinerCell *cell, const Points *o, const Field *v, const PetscReal p[], PetscInt a,
                       PetscReal stress[3][FINER_Q])
{
  const PetscInt dim = cell->t->dim;

  for (PetscInt d = 0; d < dim; d++)
    for (PetscInt q = 0; q < cell->t->nq; q++) {
      PetscReal sum = -p[q] * o->inverse[q][d * dim + a];

      for (PetscInt b = 0; b < dim; b++) sum += cell->f->par.viscosity * v->g[a][b][q] * o->inverse[q][d * dim + b];
      stress[d][q] = o->w[q] * sum;
    }
}

/* ---- the residual ---- */

void FinerResidual(const FinerCell *cell, const FinerFound *before, PetscReal r[])
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim;
  Points             o;
  Field              u;
  PetscReal          s[3][FINER_Q], stress[3][FINER_Q], sum[FINER_Q], c[3];

  set_points(cell, before, &o);
  find_field(t, &o, cell->u, before->v, &u);
  for (PetscInt q = 0; q < t->nq; q++) {
    convect(&cell->f->par, dim, &u, q, c);
    for (PetscInt a = 0; a < dim; a++) s[a][q] = o.w[q] * (c[a] - o.f[a][q]);
  }
  for (PetscInt a = 0; a < dim; a++) {
    set_stress(cell, &o, &u, o.p, a, stress);
    integrate(t, s[a], stress, sum);
    for (PetscInt i = 0; i < t->nw; i++) r[i * dim + a] = -sum[t->place[i]];
  }
}

/* ---- the cell's own problem ---- */

typedef struct {
  PetscReal    A[FINER_W * FINER_W];          /* of one component */
  PetscReal    B[3][(FINER_L + 1) * FINER_W]; /* of the divergence of a component; last that with 1 */
  PetscReal    g[FINER_L + 1], mean[FINER_L + 1];
  PetscReal    Y[3][(FINER_L + 1) * FINER_W]; /* A^-1 (B^T, r) */
  PetscReal    factor[FINER_W * FINER_W];     /* of A, of the component that was solved last */
  PetscBLASInt pivot[FINER_W];
} Oseen;

/* C += alpha A^T B of A [n][na], B [n][nb], rows one after the other */
static PetscErrorCode add_product(PetscInt n, PetscInt na, PetscInt nb, const PetscReal A[], const PetscReal B[],
                                  PetscReal alpha, PetscReal C[])
{
  PetscBLASInt k, l, m;
  PetscReal    one = 1;

  PetscFunctionBeginUser;
  PetscCall(PetscBLASIntCast(n, &k));
  PetscCall(PetscBLASIntCast(nb, &l));
  PetscCall(PetscBLASIntCast(na, &m));
  PetscCallBLAS("BLASgemm", BLASgemm_("N", "T", &l, &m, &k, &alpha, B, &l, A, &m, &one, C, &l));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A and B, by products over all points of functions times the root of the weight. The convection in skew-symmetric
   form: what it lacks at the surface of a cell cancels between two of them, and the problem of each is definite
   (Achdou, Le Tallec, Nataf & Vidrascu, Comput. Methods Appl. Mech. Eng. 184, 2000) */
static PetscErrorCode set_matrices(const FinerCell *cell, const Points *o, const Field *u, Oseen *s)
{
  const FinerTables    *t   = cell->t;
  const FlowParameters *par = &cell->f->par;
  const PetscInt        dim = t->dim, nw = t->nw, nl = t->nl;
  PetscReal             G[WIDE * FINER_W], P[FINER_Q * FINER_W], C[FINER_Q * FINER_W], L[FINER_Q * (FINER_L + 1)];
  PetscReal             M[FINER_W * FINER_W] = {0};

  PetscFunctionBeginUser;
  for (PetscInt q = 0; q < t->nq; q++) {
    const PetscReal root = PetscSqrtReal(o->w[q]);
    PetscReal      *l = L + q * (nl + 1), div = 0, *g[3];

    for (PetscInt a = 0; a < dim; a++) {
      g[a] = G + (a * t->nq + q) * nw;
      for (PetscInt j = 0; j < nw; j++) g[a][j] = 0;
      for (PetscInt d = 0; d < dim; d++)
        for (PetscInt j = 0; j < nw; j++) g[a][j] += root * o->inverse[q][d * dim + a] * t->dpsi[q][d][j];
      div += u->g[a][a][q];
    }
    fill_pressures(dim, o, q, l);
    l[nl] = 1;
    for (PetscInt k = 0; k <= nl; k++) {
      s->mean[k] += o->w[q] * l[k];
      s->g[k] -= o->w[q] * l[k] * div;
      l[k] *= root;
    }
    for (PetscInt j = 0; j < nw && par->convection; j++) {
      P[q * nw + j] = root * t->psi[q][j];
      C[q * nw + j] = 0;
      for (PetscInt b = 0; b < dim; b++) C[q * nw + j] += 0.5 * par->density * u->u[b][q] * g[b][j];
    }
  }
  PetscCall(add_product(dim * t->nq, nw, nw, G, G, par->viscosity, s->A));
  for (PetscInt a = 0; a < dim; a++) PetscCall(add_product(t->nq, nl + 1, nw, L, G + a * t->nq * nw, 1, s->B[a]));
  for (PetscInt a = 0; a < dim; a++)
    for (PetscInt i = 0; i < nl * nw; i++) s->B[a][i] -= s->mean[i / nw] / s->mean[nl] * s->B[a][nl * nw + i % nw];
  if (!par->convection) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_product(t->nq, nw, nw, P, C, 1, M));
  for (PetscInt i = 0; i < nw; i++)
    for (PetscInt j = 0; j < nw; j++) s->A[i * nw + j] += M[i * nw + j] - M[j * nw + i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Y of component a: LAPACK has columns, and so A transposed. Where the same is given of the component before, its
   factors serve. */
static PetscErrorCode solve_component(const FinerCell *cell, PetscInt a, const PetscReal r[], Oseen *s)
{
  const PetscInt nw = cell->t->nw, nl = cell->t->nl, dim = cell->t->dim;
  PetscBLASInt   n, m, info;
  PetscReal     *Y = s->Y[a], *M = s->factor;
  PetscBool      same = (PetscBool)(a > 0);

  PetscFunctionBeginUser;
  PetscCall(PetscBLASIntCast(nw, &n));
  PetscCall(PetscBLASIntCast(nl + 1, &m));
  for (PetscInt i = 0; i < nw && same; i++)
    same = (PetscBool)(((cell->given[i] >> a) & 1) == ((cell->given[i] >> (a - 1)) & 1));
  if (!same) PetscCall(PetscArraycpy(M, s->A, nw * nw));
  for (PetscInt i = 0; i < nw; i++) {
    const PetscBool given = (PetscBool)((cell->given[i] >> a) & 1);

    for (PetscInt j = 0; j < nw && given && !same; j++) M[j * nw + i] = M[i * nw + j] = j == i;
    for (PetscInt k = 0; k < nl; k++) {
      if (given) s->B[a][k * nw + i] = 0;
      Y[k * nw + i] = s->B[a][k * nw + i];
    }
    Y[nl * nw + i] = given ? 0 : r[i * dim + a];
  }
  if (!same) PetscCallBLAS("LAPACKgetrf", LAPACKgetrf_(&n, &n, M, &n, s->pivot, &info));
  PetscCheck(same || info == 0, PETSC_COMM_SELF, PETSC_ERR_LIB, "The problem of a cell is singular");
  PetscCallBLAS("LAPACKgetrs", LAPACKgetrs_("T", &n, &m, M, &n, s->pivot, Y, &n, &info));
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
        p[k] -= s->B[a][k * nw + j] * s->Y[a][nl * nw + j];
        for (PetscInt i = 0; i < nl; i++) S[i * nl + k] += s->B[a][k * nw + j] * s->Y[a][i * nw + j];
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
  Oseen              s = {.g = {0}};
  Points             o;
  Field              u;
  PetscReal          p[FINER_L];

  PetscFunctionBeginUser;
  set_metric(cell, &o);
  find_field(t, &o, cell->u, found->v, &u);
  PetscCall(set_matrices(cell, &o, &u, &s));
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

/* At point q, of flow u and what is found v */
static void add_sums(const FlowParameters *par, PetscInt dim, const Field *u, const Field *v, PetscInt q, PetscReal w,
                     FinerSums *sums)
{
  for (PetscInt a = 0; a < dim; a++) {
    sums->velocity[a] += w * v->u[a][q];
    sums->energy += w * par->density * (u->u[a][q] + 0.5 * v->u[a][q]) * v->u[a][q];
    for (PetscInt b = 0; b < dim; b++) {
      sums->correction += w * par->viscosity * PetscSqr(v->g[a][b][q]);
      sums->dissipation += w * par->viscosity * PetscSqr(u->g[a][b][q]);
    }
  }
}

/* At the points */
static void add_fields(const FinerTables *t, const Field *u, const Field *v, Field *sum)
{
  for (PetscInt a = 0; a < t->dim; a++)
    for (PetscInt q = 0; q < t->nq; q++) {
      sum->u[a][q] = u->u[a][q] + v->u[a][q];
      for (PetscInt b = 0; b < t->dim; b++) sum->g[a][b][q] = u->g[a][b][q] + v->g[a][b][q];
    }
}

void FinerAnswer(const FinerCell *cell, const FinerFound *found, PetscReal r[], PetscReal source[], FinerSums *sums)
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim;
  Points             o;
  Field              u, v, both;
  PetscReal          s[3][FINER_Q], stress[3][FINER_Q], sum[FINER_Q], p[FINER_Q], f[FINER_L], before[3], after[3];

  for (PetscInt k = 0; k <= dim; k++) source[k] = 0;
  set_metric(cell, &o);
  find_field(t, &o, cell->u, NULL, &u);
  find_field(t, &o, NULL, found->v, &v);
  add_fields(t, &u, &v, &both);
  for (PetscInt q = 0; q < t->nq; q++) {
    PetscReal div = 0;

    convect(&cell->f->par, dim, &u, q, before);
    convect(&cell->f->par, dim, &both, q, after);
    add_sums(&cell->f->par, dim, &u, &v, q, o.w[q], sums);
    fill_pressures(dim, &o, q, f);
    p[q] = 0;
    for (PetscInt k = 0; k < t->nl; k++) p[q] += found->p[k] * f[k];
    for (PetscInt a = 0; a < dim; a++) {
      div += v.g[a][a][q];
      s[a][q] = o.w[q] * (after[a] - before[a]);
    }
    source[0] -= o.w[q] * div;
    for (PetscInt a = 0; a < dim; a++) source[1 + a] -= o.w[q] * div * o.y[a][q];
  }
  for (PetscInt a = 0; a < dim; a++) {
    set_stress(cell, &o, &v, p, a, stress);
    integrate(t, s[a], stress, sum);
    for (PetscInt i = 0; i < t->nb; i++) r[i * dim + a] = sum[t->node[i]];
  }
}

void FinerConvect(const FinerCell *cell, const PetscReal u[], PetscReal r[])
{
  const FinerTables *t   = cell->t;
  const PetscInt     dim = t->dim;
  Points             o;
  Field              v;
  PetscReal          s[3][FINER_Q], sum[FINER_Q], c[3];

  set_metric(cell, &o);
  find_field(t, &o, u, NULL, &v);
  for (PetscInt q = 0; q < t->nq; q++) {
    convect(&cell->f->par, dim, &v, q, c);
    for (PetscInt a = 0; a < dim; a++) s[a][q] = o.w[q] * c[a];
  }
  for (PetscInt a = 0; a < dim; a++) {
    transform(dim, t->back, -1, s[a], sum);
    for (PetscInt i = 0; i < t->nb; i++) r[i * dim + a] = sum[t->node[i]];
  }
}
