/* Face: see base/face.h. */
#include "compat.h"
#include "base/face.h"
#include "base/algebra.h"

#define ROUNDS    40
#define HALVINGS  30
#define ROUND_OFF 1e-14 /* step in coordinates */
#define EQUAL     1e-15 /* of the coordinates: distances that differ by it are the same, */
#define FIRST     1e-6  /* nodes whose distances differ by such a share are as near, */
#define TIE       1e-9  /* sizes of a face: two places are as near if they would be from a point so far beside */
#define FLAT      1e-2  /* sine of the angle of tangents */
#define BESIDE    0.9   /* coordinates of a place beside a corner */

/* Lagrange's parabolas of -1, 0, 1 at s: values, first and second derivatives */
static void parabolas(PetscReal s, PetscReal v[3], PetscReal d[3], PetscReal dd[3])
{
  v[0]  = 0.5 * s * (s - 1);
  v[1]  = 1 - s * s;
  v[2]  = 0.5 * s * (s + 1);
  d[0]  = s - 0.5;
  d[1]  = -2 * s;
  d[2]  = s + 0.5;
  dd[0] = dd[2] = 1;
  dd[1]         = -2;
}

static void add_node(FacePoint *p, const PetscReal x[3], PetscReal v, PetscReal d0, PetscReal d1, PetscReal d00,
                     PetscReal d11, PetscReal d01)
{
  for (PetscInt a = 0; a < 3; a++) {
    p->x[a] += v * x[a];
    p->t[0][a] += d0 * x[a];
    p->t[1][a] += d1 * x[a];
    p->tt[0][a] += d00 * x[a];
    p->tt[1][a] += d11 * x[a];
    p->tt[2][a] += d01 * x[a];
  }
}

void FaceEvaluate(PetscInt dim, const PetscReal x[][3], const PetscReal s[2], FacePoint *p)
{
  PetscReal v[2][3], d[2][3], dd[2][3];

  *p = (FacePoint){.s = {s[0], s[1]}};
  for (PetscInt k = 0; k < dim - 1; k++) {
    parabolas(s[k], v[k], d[k], dd[k]);
    p->side[k] = s[k] <= -1 ? -1 : s[k] >= 1;
  }
  if (dim == 2)
    for (PetscInt i = 0; i < 3; i++) add_node(p, x[i], v[0][i], d[0][i], 0, dd[0][i], 0, 0);
  for (PetscInt i = 0; i < 9 && dim == 3; i++) {
    const PetscInt a = i % 3, b = i / 3;

    add_node(p, x[i], v[0][a] * v[1][b], d[0][a] * v[1][b], v[0][a] * d[1][b], dd[0][a] * v[1][b], v[0][a] * dd[1][b],
             d[0][a] * d[1][b]);
  }
}

static PetscReal distance_to(const PetscReal x[3], const PetscReal p[3])
{
  return PetscSqrtReal(PetscSqr(x[0] - p[0]) + PetscSqr(x[1] - p[1]) + PetscSqr(x[2] - p[2]));
}

/* Step of Newton's method for half the squared distance, by tangents alone where its matrix is not definite;
   coordinates at an end that would go further stay */
static void find_step(PetscInt dim, const FacePoint *f, const PetscReal p[3], PetscReal step[2])
{
  const PetscInt  n    = dim - 1;
  const PetscReal r[3] = {f->x[0] - p[0], f->x[1] - p[1], f->x[2] - p[2]};
  PetscReal       g[2] = {0, 0}, T[3] = {0, 0, 0}, H[3];
  PetscBool       bounded[2] = {PETSC_FALSE, PETSC_TRUE};

  step[0] = step[1] = 0;
  for (PetscInt k = 0; k < n; k++) {
    g[k]       = dot3(r, f->t[k]);
    T[k]       = dot3(f->t[k], f->t[k]);
    bounded[k] = (PetscBool)((f->side[k] < 0 && g[k] >= 0) || (f->side[k] > 0 && g[k] <= 0));
  }
  T[2] = n == 2 ? dot3(f->t[0], f->t[1]) : 0;
  for (PetscInt k = 0; k < 3; k++) H[k] = T[k] + dot3(r, f->tt[k]);
  if (!bounded[0] && !bounded[1]) {
    if (H[0] <= 0.1 * T[0] || H[1] <= 0.1 * T[1] || H[0] * H[1] - H[2] * H[2] <= 0.01 * T[0] * T[1])
      for (PetscInt k = 0; k < 3; k++) H[k] = T[k];
    step[0] = -(H[1] * g[0] - H[2] * g[1]) / (H[0] * H[1] - H[2] * H[2]);
    step[1] = -(H[0] * g[1] - H[2] * g[0]) / (H[0] * H[1] - H[2] * H[2]);
    return;
  }
  for (PetscInt k = 0; k < n; k++)
    if (!bounded[k]) step[k] = -g[k] / (H[k] > 0.1 * T[k] ? H[k] : T[k]);
}

void FaceNearest(PetscInt dim, const PetscReal x[][3], const PetscReal p[3], FacePoint *f)
{
  PetscReal best = PETSC_MAX_REAL, s[2] = {0, 0}, equal = 0;

  for (PetscInt i = 0; i < (dim == 2 ? 3 : 9); i++) {
    const PetscReal d = distance_to(x[i], p);

    if (d >= (1 - FIRST) * best) continue;
    best = d;
    s[0] = i % 3 - 1;
    s[1] = dim == 3 ? i / 3 - 1 : 0;
  }
  FaceEvaluate(dim, x, s, f);
  f->distance = best;
  for (PetscInt a = 0; a < 3; a++) equal = PetscMax(equal, EQUAL * (PetscAbsReal(p[a]) + best));
  for (PetscInt round = 0; round < ROUNDS; round++) {
    PetscReal step[2], step_fraction = 1, change = 0;
    FacePoint next = *f;

    find_step(dim, f, p, step);
    for (PetscInt half = 0; half < HALVINGS; half++, step_fraction *= 0.5) {
      for (PetscInt k = 0; k < 2; k++) s[k] = PetscMin(1, PetscMax(-1, f->s[k] + step_fraction * step[k]));
      FaceEvaluate(dim, x, s, &next);
      next.distance = distance_to(next.x, p);
      if (next.distance <= f->distance) break;
      if (half == 0 && next.distance <= f->distance + equal) { /* exacter than distances tell */
        *f = next;
        return;
      }
    }
    if (next.distance > f->distance) break;
    for (PetscInt k = 0; k < 2; k++) change = PetscMax(change, PetscAbsReal(next.s[k] - f->s[k]));
    *f = next;
    if (change < ROUND_OFF) break;
  }
}

PetscBool FaceIsNearer(const FacePoint *a, const FacePoint *b, PetscReal size)
{
  return (PetscBool)(PetscSqr(b->distance) - PetscSqr(a->distance) > 2 * TIE * size * distance_to(a->x, b->x));
}

void FaceNormal(PetscInt dim, const FacePoint *f, PetscReal n[3])
{
  PetscReal length;

  if (dim == 3) cross(f->t[0], f->t[1], n);
  else {
    n[0] = -f->t[0][1];
    n[1] = f->t[0][0];
    n[2] = 0;
  }
  length = PetscSqrtReal(dot3(n, n));
  for (PetscInt a = 0; a < 3; a++) n[a] /= length;
}

void FaceNormalAt(PetscReal (*const x)[3], const PetscReal s[2], PetscReal n[3])
{
  const PetscReal beside[2] = {BESIDE * s[0], BESIDE * s[1]};
  PetscReal       area[3];
  FacePoint       p;

  FaceEvaluate(3, x, s, &p);
  cross(p.t[0], p.t[1], area);
  if (dot3(area, area) <= FLAT * FLAT * dot3(p.t[0], p.t[0]) * dot3(p.t[1], p.t[1])) FaceEvaluate(3, x, beside, &p);
  FaceNormal(3, &p, n);
}

void FaceNodeNormal(PetscReal (*const x)[3], PetscInt j, PetscReal n[3])
{
  const PetscReal s[2] = {(PetscReal)(j % 3) - 1, (PetscReal)(j / 3) - 1};

  FaceNormalAt(x, s, n);
}

void FaceCurvature(PetscInt dim, const FacePoint *f, const PetscReal n[3], PetscReal K[9])
{
  const PetscInt m    = dim - 1;
  PetscReal      T[4] = {1, 0, 0, 1}, inv[4], h[4] = {0, 0, 0, 0}, up[2][3] = {{0}};

  for (PetscInt i = 0; i < m; i++)
    for (PetscInt j = 0; j < m; j++) {
      T[2 * i + j] = dot3(f->t[i], f->t[j]);
      h[2 * i + j] = dot3(n, f->tt[i == j ? i : 2]);
    }
  (void)DenseInvertMap(2, T, inv);
  for (PetscInt i = 0; i < m; i++) /* tangents with upper index */
    for (PetscInt a = 0; a < 3; a++) up[i][a] = inv[2 * i] * f->t[0][a] + (m == 2 ? inv[2 * i + 1] * f->t[1][a] : 0);
  for (PetscInt e = 0; e < 9; e++) {
    K[e] = 0;
    for (PetscInt i = 0; i < m; i++)
      for (PetscInt j = 0; j < m; j++) K[e] -= h[2 * i + j] * up[i][e / 3] * up[j][e % 3];
  }
}
