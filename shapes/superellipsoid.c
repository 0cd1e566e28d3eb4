/* Superellipse |x/a|^n + |y/b|^n = 1 in 2D; in 3D the superellipsoid (|x/a|^n + |y/b|^n)^(m/n) + |z/c|^m = 1 (Barr
   1981, Superquadrics and angle-preserving transformations). Exponents from 2, an ellipse, to 10, nearly a box. Centred
   on the body origin.

   The left-hand side is the m-th power of a norm, so that the shape is convex and "divided by its norm" takes any point
   to the surface. Closest point: in the octant of the point, Newton's method for the squared distance over the tangent
   plane, with the curvature of the surface in the Hessian, each step taken back to the surface and halved until the
   distance falls. From outside there is one minimum; from inside there are several, one for each face, and the search
   starts from every point of a table of surface points that is closer than its neighbours and not too far to matter. */
#include "shape.h"

#define K      33   /* angles of the table in a quarter turn */
#define STARTS 6    /* most searches for one point */
#define STEPS  60   /* of Newton's method */
#define LAST   1e-7 /* step in sizes after which none follows: the distance changes by its square */

typedef struct {
  PetscInt   dim;
  PetscReal  e[3];     /* semi-axes, m */
  PetscReal  n, m;     /* exponents in the plane x-y, and of z against that plane */
  PetscReal  size;     /* bounding radius, m */
  PetscInt   rows;     /* of the table: 1 in 2D */
  PetscReal *table[3]; /* [rows * K] coordinates */
  PetscReal  reach;    /* no point of an octant is farther from the table, m */
} Super;

/* Norm of x, and if wanted gradient and Hessian of its m-th power (2D: n-th) at x >= 0, in true lengths */
static PetscReal EvaluateNorm(const Super *p, const PetscReal x[], PetscReal g[], PetscReal H[3][3])
{
  const PetscReal u = x[0] / p->e[0], v = x[1] / p->e[1], w = p->dim == 3 ? x[2] / p->e[2] : 0, n = p->n, m = p->m;
  const PetscReal big   = PetscMax(PetscMax(u, v), 1e-300),
                  plane = big * PetscPowReal(PetscPowReal(u / big, n) + PetscPowReal(v / big, n), 1 / n);
  const PetscReal all   = PetscMax(PetscMax(plane, w), 1e-300),
                  norm  = all * PetscPowReal(PetscPowReal(plane / all, m) + PetscPowReal(w / all, m), 1 / m);

  if (!g) return norm;
  /* plane^m: with q = u/plane, its slope is m plane^(m-1) q^(n-1) along u */
  const PetscReal r = PetscMax(plane, 1e-100), q[2] = {u / r, v / r}, slope = m * PetscPowReal(r, m - 1),
                  bend = m * PetscPowReal(r, m - 2);
  const PetscReal a[2] = {PetscPowReal(q[0], n - 1), PetscPowReal(q[1], n - 1)};

  for (PetscInt i = 0; i < 2; i++) {
    g[i] = slope * a[i] / p->e[i];
    for (PetscInt j = 0; j < 2; j++)
      H[i][j] = bend * ((m - n) * a[i] * a[j] + (i == j ? (n - 1) * PetscPowReal(q[i], n - 2) : 0)) /
                (p->e[i] * p->e[j]);
    H[i][2] = H[2][i] = 0;
  }
  g[2]    = p->dim == 3 ? m * PetscPowReal(w, m - 1) / p->e[2] : 0;
  H[2][2] = p->dim == 3 ? m * (m - 1) * PetscPowReal(w, m - 2) / PetscSqr(p->e[2]) : 0;
  return norm;
}

static PetscReal Dot(const PetscReal a[], const PetscReal b[])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static PetscReal Separation2(const PetscReal a[], const PetscReal b[])
{
  return PetscSqr(a[0] - b[0]) + PetscSqr(a[1] - b[1]) + PetscSqr(a[2] - b[2]);
}

/* Unit normal nu at surface point y, and two unit vectors across it */
static void MakeFrame(const PetscReal g[], PetscReal nu[], PetscReal t[2][3])
{
  const PetscReal len = PetscSqrtReal(Dot(g, g));
  PetscInt        k   = 0;

  for (PetscInt a = 0; a < 3; a++) nu[a] = g[a] / len;
  for (PetscInt a = 1; a < 3; a++) k = PetscAbsReal(nu[a]) <= PetscAbsReal(nu[k]) ? a : k; /* in 2D the third axis */
  for (PetscInt a = 0; a < 3; a++) t[1][a] = (a == k) - nu[k] * nu[a];
  const PetscReal across = PetscSqrtReal(Dot(t[1], t[1]));

  for (PetscInt a = 0; a < 3; a++) t[1][a] /= across;
  for (PetscInt a = 0; a < 3; a++) t[0][a] = t[1][(a + 1) % 3] * nu[(a + 2) % 3] - t[1][(a + 2) % 3] * nu[(a + 1) % 3];
}

/* Newton's step s along t[0], t[1] for the squared distance to x, or along the gradient where the Hessian is not
   positive */
static void FindStep(const Super *p, const PetscReal x[], const PetscReal y[], PetscReal nu[], PetscReal step[])
{
  PetscReal g[3], H[3][3], t[2][3], r[3], b[2], A[2][2], det;

  (void)EvaluateNorm(p, y, g, H);
  MakeFrame(g, nu, t);
  for (PetscInt a = 0; a < 3; a++) r[a] = x[a] - y[a];
  const PetscReal lever = Dot(r, nu) / PetscSqrtReal(Dot(g, g));

  for (PetscInt i = 0; i < 2; i++) {
    b[i] = Dot(r, t[i]);
    for (PetscInt j = 0; j < 2; j++) {
      PetscReal bend = 0;

      for (PetscInt k = 0; k < 3; k++) bend += t[i][k] * Dot(H[k], t[j]);
      A[i][j] = (i == j) + lever * bend;
    }
  }
  if (p->dim == 2) { /* the second vector is the third axis */
    b[1]    = 0;
    A[0][1] = A[1][0] = 0;
    A[1][1]           = 1;
  }
  det = A[0][0] * A[1][1] - A[0][1] * A[1][0];
  if (A[0][0] > 1e-8 && det > 1e-8) {
    const PetscReal s[2] = {(A[1][1] * b[0] - A[0][1] * b[1]) / det, (A[0][0] * b[1] - A[1][0] * b[0]) / det};

    b[0] = s[0];
    b[1] = s[1];
  }
  for (PetscInt a = 0; a < 3; a++) step[a] = b[0] * t[0][a] + b[1] * t[1][a];
}

/* The point of the surface that the step leads to, back from the tangent plane and from other octants */
static void Advance(const Super *p, const PetscReal y[], PetscReal fraction, const PetscReal step[], PetscReal next[])
{
  PetscReal norm;

  for (PetscInt a = 0; a < 3; a++) next[a] = PetscAbsReal(y[a] + fraction * step[a]);
  norm = EvaluateNorm(p, next, NULL, NULL);
  for (PetscInt a = 0; a < 3; a++) next[a] /= norm;
}

/* From the surface point y to one that is no farther from x, both in the positive octant; nu: normal there */
static void Descend(const Super *p, const PetscReal x[], PetscReal y[], PetscReal nu[])
{
  PetscReal now = Separation2(x, y), step[3], next[3], then = now;

  for (PetscInt it = 0; it < STEPS; it++) {
    PetscReal fraction = 1;
    PetscBool last;

    FindStep(p, x, y, nu, step);
    last = (PetscBool)(Dot(step, step) <= PetscSqr(LAST * p->size));
    for (; fraction > 1e-9; fraction *= 0.5) {
      Advance(p, y, fraction, step, next);
      then = Separation2(x, next);
      if (last || then < now) break;
    }
    if (!last && !(then < now)) return;
    for (PetscInt a = 0; a < 3; a++) y[a] = next[a];
    now = then;
    if (last) break;
  }
  FindStep(p, x, y, nu, step);
}

/* Is d[row][column] no larger than its neighbours? */
static PetscBool IsValley(const Super *p, const PetscReal d[], PetscInt row, PetscInt column)
{
  for (PetscInt i = PetscMax(0, row - 1); i <= PetscMin(p->rows - 1, row + 1); i++)
    for (PetscInt j = PetscMax(0, column - 1); j <= PetscMin(K - 1, column + 1); j++)
      if (d[i * K + j] < d[row * K + column]) return PETSC_FALSE;
  return PETSC_TRUE;
}

/* Signed distance of a point and the normal nu at its closest point */
static PetscReal FindClosest(const Super *p, const PetscReal at[], PetscReal nu[])
{
  const PetscReal x[3] = {PetscAbsReal(at[0]), PetscAbsReal(at[1]), p->dim == 3 ? PetscAbsReal(at[2]) : 0};
  const PetscReal norm = EvaluateNorm(p, x, NULL, NULL);
  PetscReal       y[3], best = PETSC_MAX_REAL, n[3], to[3] = {0, 0, 0};
  PetscReal       d[K * K];
  PetscInt        starts = 0;

  if (norm > 1e-3) { /* straight out or in from the point */
    for (PetscInt a = 0; a < 3; a++) to[a] = x[a] / norm;
    Descend(p, x, to, nu);
    best = Separation2(x, to);
  }
  for (PetscInt i = 0; i < p->rows * K && norm < 1; i++)
    d[i] = PetscSqr(x[0] - p->table[0][i]) + PetscSqr(x[1] - p->table[1][i]) + PetscSqr(x[2] - p->table[2][i]);
  for (PetscInt i = 0; i < p->rows && norm < 1; i++)
    for (PetscInt j = 0; j < K && starts < STARTS; j++) {
      if (d[i * K + j] > PetscSqr(PetscSqrtReal(best) + p->reach) || !IsValley(p, d, i, j)) continue;
      for (PetscInt a = 0; a < 3; a++) y[a] = p->table[a][i * K + j];
      Descend(p, x, y, n);
      starts++;
      if (Separation2(x, y) >= best) continue;
      best = Separation2(x, y);
      for (PetscInt a = 0; a < 3; a++) {
        to[a] = y[a];
        nu[a] = n[a];
      }
    }
  for (PetscInt a = 0; a < p->dim; a++) nu[a] = PetscCopysignReal(nu[a], at[a]);
  return norm < 1 ? -PetscSqrtReal(best) : PetscSqrtReal(best);
}

/* ---- operations ---- */

static PetscErrorCode ShapeCreate_Super(Shape s)
{
  Super *p;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  PetscCall(ShapeSetData(s, p));
  PetscCall(ShapeGetDimension(s, &p->dim));
  p->e[0] = 1;
  p->e[1] = p->e[2] = 0.5;
  p->n              = 4;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Super(Shape s)
{
  Super *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCall(ShapeOptionReal(s, "a", "Semi-axis along x", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &p->e[0]));
  PetscCall(ShapeOptionReal(s, "b", "Semi-axis along y", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &p->e[1]));
  PetscCall(
    ShapeOptionReal(s, "exponent", "Exponent of x and y: 2 an ellipse, 10 nearly a rectangle", "", 2, 10, &p->n));
  p->m = p->n;
  if (p->dim == 2) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeOptionReal(s, "c", "Semi-axis along z", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &p->e[2]));
  PetscCall(ShapeOptionReal(s, "exponent_z", "Exponent of z, that of x and y unless given", "", 2, 10, &p->m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest q1 u1 + q2 u2 for u1^(k/2) + u2^(k/2) = 1: the dual norm of q (Hoelder) */
static PetscReal DualNorm(PetscReal k, PetscReal q1, PetscReal q2)
{
  const PetscReal big = PetscMax(q1, q2), small = PetscMin(q1, q2), m = k > 2 ? k / (k - 2) : PETSC_MAX_REAL;

  return k > 2 ? big * PetscPowReal(1 + PetscPowReal(small / big, m), 1 / m) : big;
}

/* Angles of the table in a quarter turn, ascending: even ones, and between them those that crowd at the corner */
static void MakeAngles(PetscReal exponent, PetscReal angle[K])
{
  for (PetscInt k = 0; k < K; k++) {
    const PetscReal even = 0.5 * PETSC_PI * k / (K - 1), t = PetscTanReal(PetscMin(even, 0.5 * PETSC_PI - 1e-9));

    angle[k] = k % 2 ? PetscAtanReal(PetscPowReal(t, 2 / exponent)) : even;
  }
  (void)PetscSortReal(K, angle);
}

static PetscErrorCode ShapeSetUp_Super(Shape s)
{
  Super    *p;
  PetscReal ups[K], rounds[K];

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  p->size = DualNorm(p->n, PetscSqr(p->e[0]), PetscSqr(p->e[1]));
  if (p->dim == 3) p->size = DualNorm(p->m, p->size, PetscSqr(p->e[2]));
  p->size = PetscSqrtReal(p->size);
  p->rows = p->dim == 3 ? K : 1;
  MakeAngles(p->m, ups);
  MakeAngles(p->n, rounds);
  for (PetscInt a = 0; a < 3; a++) PetscCall(PetscMalloc1(p->rows * K, &p->table[a]));
  for (PetscInt i = 0; i < p->rows; i++)
    for (PetscInt j = 0; j < K; j++) {
      const PetscReal up = ups[i], round = rounds[j];
      PetscReal       y[3], norm;

      y[0] = p->e[0] * PetscCosReal(up) * PetscCosReal(round);
      y[1] = p->e[1] * PetscCosReal(up) * PetscSinReal(round);
      y[2] = p->dim == 3 ? p->e[2] * PetscSinReal(up) : 0;
      for (PetscInt a = 0; a < 3; a++) y[a] = PetscMax(y[a], 0.0);
      norm = EvaluateNorm(p, y, NULL, NULL);
      for (PetscInt a = 0; a < 3; a++) p->table[a][i * K + j] = y[a] / norm;
    }
  p->reach = 0; /* the longest diagonal of a mesh of the table, twice what is needed */
  for (PetscInt i = 0; i < p->rows; i++)
    for (PetscInt j = 0; j < K - 1; j++) {
      const PetscInt at = i * K + j, next = PetscMin(i + 1, p->rows - 1) * K + j + 1;
      PetscReal      far = 0;

      for (PetscInt a = 0; a < 3; a++) far += PetscSqr(p->table[a][at] - p->table[a][next]);
      p->reach = PetscMax(p->reach, PetscSqrtReal(far));
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Super(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Super    *p;
  PetscReal nu[3];

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 0; i < n; i++) d[i] = FindClosest(p, x + i * p->dim, nu);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Super(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Super *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal nu[3];

    (void)FindClosest(p, x + i * p->dim, nu);
    for (PetscInt a = 0; a < p->dim; a++) normal[i * p->dim + a] = nu[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Super(Shape s, PetscReal *r)
{
  Super *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  *r = p->size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Integral of u^i v^j over the positive part of u^n + v^n <= 1 (Dirichlet) */
static PetscReal PlaneMoment(PetscReal n, PetscInt i, PetscInt j)
{
  return PetscExpReal(PetscLGamma((i + 1) / n) + PetscLGamma((j + 1) / n) - PetscLGamma(1 + (i + j + 2) / n)) / (n * n);
}

/* Integral of w^i (1 - w^m)^(k/m) from 0 to 1: a section at w is smaller by (1 - w^m)^(1/m) */
static PetscReal HeightMoment(PetscReal m, PetscInt i, PetscInt k)
{
  return PetscExpReal(PetscLGamma((i + 1) / m) + PetscLGamma(1 + k / m) - PetscLGamma(1 + (i + 1 + k) / m)) / m;
}

static PetscErrorCode ShapeMass_Super(Shape s, ShapeMass *mass)
{
  Super    *p;
  PetscReal xx[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  const PetscReal area = 4 * p->e[0] * p->e[1] * PlaneMoment(p->n, 0, 0);

  for (PetscInt a = 0; a < 2; a++) xx[a] = 4 * p->e[0] * p->e[1] * PetscSqr(p->e[a]) * PlaneMoment(p->n, 2, 0);
  mass->volume = area;
  if (p->dim == 3) {
    mass->volume = area * 2 * p->e[2] * HeightMoment(p->m, 0, 2);
    for (PetscInt a = 0; a < 2; a++) xx[a] *= 2 * p->e[2] * HeightMoment(p->m, 0, 4);
    xx[2]            = area * 2 * p->e[2] * PetscSqr(p->e[2]) * HeightMoment(p->m, 2, 2);
    mass->inertia[0] = xx[1] + xx[2];
    mass->inertia[1] = xx[0] + xx[2];
  }
  mass->inertia[2] = xx[0] + xx[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Super(Shape s, PetscViewer viewer)
{
  Super *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  if (p->dim == 2)
    PetscCall(PetscViewerASCIIPrintf(viewer, "semi-axes a %g m, b %g m, exponent %g\n", (double)p->e[0],
                                     (double)p->e[1], (double)p->n));
  else
    PetscCall(PetscViewerASCIIPrintf(viewer, "semi-axes a %g m, b %g m, c %g m, exponents %g in the plane, %g of z\n",
                                     (double)p->e[0], (double)p->e[1], (double)p->e[2], (double)p->n, (double)p->m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Super(Shape s)
{
  Super *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt a = 0; p && a < 3; a++) PetscCall(PetscFree(p->table[a]));
  PetscCall(PetscFree(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "superellipsoid",
  .description = "superellipse (2D) or superellipsoid (3D)",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create   = ShapeCreate_Super,
                  .options  = ShapeOptions_Super,
                  .setup    = ShapeSetUp_Super,
                  .distance = ShapeDistance_Super,
                  .radius   = ShapeRadius_Super,
                  .normal   = ShapeNormal_Super,
                  .mass     = ShapeMass_Super,
                  .view     = ShapeView_Super,
                  .destroy  = ShapeDestroy_Super},
};
