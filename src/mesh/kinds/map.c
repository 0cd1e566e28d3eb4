/* Meshmap: maps from the reference coordinates of a mesh to its true ones (see map.h).

   Rings around a circle are square rings in reference coordinates: a point at half-width s on side k = 0..3 with -1 <=
   t <= 1 along the side goes to the angle pi/2 k + pi/4 t. Between a circle and a square the map blends linearly along
   straight rays (ruled surface, Gordon & Hall, Numer. Math. 21, 1973). The middle of a disc is a square bulged half-way
   towards the map of a square onto a disc, so that its corners stay well below 180 degrees. Around a sphere the same: a
   point of a cube goes to the direction tan(pi/4 t), the cube in the middle is bulged half-way towards the map of a
   cube onto a ball. */
#include "compat.h"
#include "map.h"

#define DISC_SQUARE 0.55 /* half-width of the middle square over the radius of the disc */
#define DISC_BULGE  0.5
#define BALL_CUBE   0.5 /* half-width of the middle cube over the radius of the ball */

/* Polar coordinates on squares: half-width of the square through q, angle of the point on the circle in place of q */
static void square_polar(const PetscReal q[2], PetscReal *s, PetscReal *angle)
{
  const PetscReal a = PetscAbsReal(q[0]), b = PetscAbsReal(q[1]);
  PetscReal       t;
  PetscInt        side;

  *s   = PetscMax(a, b);
  side = a >= b ? (q[0] > 0 ? 0 : 2) : (q[1] > 0 ? 1 : 3);
  if (a >= b) t = side == 0 ? q[1] : -q[1];
  else t = side == 1 ? -q[0] : q[0];
  *angle = 0.5 * PETSC_PI * side + 0.25 * PETSC_PI * (*s > 0 ? t / *s : 0);
}

static void blend(PetscReal weight, const PetscReal from[2], const PetscReal to[2], PetscReal x[2])
{
  for (PetscInt d = 0; d < 2; d++) x[d] = (1 - weight) * from[d] + weight * to[d];
}

static void on_circle(const PetscReal centre[2], PetscReal radius, PetscReal angle, PetscReal x[2])
{
  x[0] = centre[0] + radius * PetscCosReal(angle);
  x[1] = centre[1] + radius * PetscSinReal(angle);
}

/* Fraction of the way outwards at the fraction w of the layers */
static PetscReal grade(PetscReal ratio, PetscReal w)
{
  const PetscReal beta = ratio > 0 ? PetscLogReal(ratio) : 0;

  return PetscAbsReal(beta) > 1e-6 ? (PetscExpReal(beta * w) - 1) / (ratio - 1) : w;
}

/* Position at the real-valued index i among the lines of an axis */
static PetscReal between_lines(const MeshMap *m, PetscInt axis, PetscReal i)
{
  const PetscInt  k = PetscMax(0, PetscMin(m->ncell[axis] - 1, (PetscInt)PetscFloorReal(i)));
  const PetscReal w = i - k;

  return (1 - w) * m->line[axis][k] + w * m->line[axis][k + 1];
}

static void map_lines(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  for (PetscInt d = 0; d < m->dim; d++)
    x[d] = between_lines(m, d, m->ncell[d] * (q[d] - m->lower[d]) / (m->upper[d] - m->lower[d]));
}

static void map_fitted(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  const PetscReal from[2] = {q[0] - m->middle[0], q[1] - m->middle[1]};
  PetscReal       s, angle, layer, in[2], out[2];

  square_polar(from, &s, &angle);
  if (s >= m->outer) {
    for (PetscInt d = 0; d < 2; d++) x[d] = between_lines(m, d, q[d]);
    return;
  }
  layer = grade(m->ring_ratio, (s - m->inner) / (m->outer - m->inner));
  on_circle(m->centre, m->radius[0], angle, in);
  for (PetscInt d = 0; d < 2; d++) out[d] = between_lines(m, d, m->middle[d] + from[d] * m->outer / s);
  blend(layer, in, out, x);
}

/* Bulged middle square of a disc; u in [-1,1]^2 */
static void map_square(const MeshMap *m, const PetscReal u[2], PetscReal x[2])
{
  for (PetscInt d = 0; d < 2; d++)
    x[d] = m->centre[d] + m->radius[0] * DISC_SQUARE * u[d] *
                            (1 - DISC_BULGE + DISC_BULGE * PetscSqrtReal(1 - 0.5 * u[1 - d] * u[1 - d]));
}

static void map_disc(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  PetscReal s, angle, u[2], in[2], out[2];

  square_polar(q, &s, &angle);
  for (PetscInt d = 0; d < 2; d++) u[d] = q[d] / PetscMax(s, m->inner);
  map_square(m, u, x);
  if (s <= m->inner) return;
  in[0] = x[0];
  in[1] = x[1];
  on_circle(m->centre, m->radius[0], angle, out);
  blend(grade(m->ring_ratio, (s - m->inner) / (m->outer - m->inner)), in, out, x);
}

static void map_annulus(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  PetscReal s, angle, w;

  square_polar(q, &s, &angle);
  w = (s - m->inner) / (m->outer - m->inner);
  on_circle(m->centre, (1 - w) * m->radius[0] + w * m->radius[1], angle, x);
}

/* Unit vector of the point of a sphere in place of q on a cube of half-width s > 0 */
static void direction_of(const PetscReal q[3], PetscReal s, PetscReal e[3])
{
  PetscReal square = 0;

  for (PetscInt d = 0; d < 3; d++) {
    e[d] = PetscTanReal(0.25 * PETSC_PI * q[d] / s);
    square += e[d] * e[d];
  }
  for (PetscInt d = 0; d < 3; d++) e[d] /= PetscSqrtReal(square);
}

static PetscReal cube_size(const PetscReal q[3])
{
  return PetscMax(PetscMax(PetscAbsReal(q[0]), PetscAbsReal(q[1])), PetscAbsReal(q[2]));
}

static void map_ball(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  const PetscReal s = cube_size(q);
  PetscReal       u[3], e[3], w;

  for (PetscInt d = 0; d < 3; d++) u[d] = q[d] / PetscMax(s, m->inner);
  for (PetscInt d = 0; d < 3; d++) {
    const PetscReal a = PetscSqr(u[(d + 1) % 3]), b = PetscSqr(u[(d + 2) % 3]);

    x[d] = m->centre[d] + m->radius[0] * BALL_CUBE * u[d] *
                            (1 - DISC_BULGE + DISC_BULGE * PetscSqrtReal(1 - a / 2 - b / 2 + a * b / 3));
  }
  if (s <= m->inner) return;
  w = grade(m->ring_ratio, (s - m->inner) / (m->outer - m->inner));
  direction_of(q, s, e);
  for (PetscInt d = 0; d < 3; d++) x[d] = (1 - w) * x[d] + w * (m->centre[d] + m->radius[0] * e[d]);
}

static void map_shell(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  const PetscReal s = cube_size(q), w = grade(m->ring_ratio, (s - m->inner) / (m->outer - m->inner));
  PetscReal       e[3];

  direction_of(q, s, e);
  for (PetscInt d = 0; d < 3; d++) x[d] = m->centre[d] + ((1 - w) * m->radius[0] + w * m->radius[1]) * e[d];
}

/* Where in a convex quadrilateral is x? Newton's method for the bilinear map of [0,1]^2; false if x is outside */
static PetscBool find_in_cell(const PetscReal corner[4][2], const PetscReal x[2], PetscReal s[2])
{
  const PetscReal tol    = 1e-9;
  PetscReal       change = 1;

  s[0] = s[1] = 0.5;
  for (PetscInt it = 0; it < 30 && change > 1e-15; it++) {
    PetscReal r[2], a[2], b[2], det, ds[2];

    for (PetscInt d = 0; d < 2; d++) {
      a[d] = (1 - s[1]) * (corner[1][d] - corner[0][d]) + s[1] * (corner[2][d] - corner[3][d]);
      b[d] = (1 - s[0]) * (corner[3][d] - corner[0][d]) + s[0] * (corner[2][d] - corner[1][d]);
      r[d] = x[d] - corner[0][d] - s[0] * (corner[1][d] - corner[0][d]) - s[1] * b[d];
    }
    det = a[0] * b[1] - a[1] * b[0];
    if (det == 0) return PETSC_FALSE;
    ds[0] = (r[0] * b[1] - r[1] * b[0]) / det;
    ds[1] = (a[0] * r[1] - a[1] * r[0]) / det;
    for (PetscInt d = 0; d < 2; d++) s[d] += ds[d];
    change = PetscMax(PetscAbsReal(ds[0]), PetscAbsReal(ds[1]));
    if (!(PetscMax(PetscAbsReal(s[0]), PetscAbsReal(s[1])) < 100)) return PETSC_FALSE;
  }
  for (PetscInt d = 0; d < 2; d++) {
    if (s[d] < -tol || s[d] > 1 + tol) return PETSC_FALSE;
    s[d] = PetscMax(0, PetscMin(1, s[d]));
  }
  return (PetscBool)(change < tol);
}

/* The arc's distance from its chord fades out towards the opposite edge; it is zero at the ends, so cells that share an
   edge agree, and a corner cell with two arcs takes the sum (transfinite interpolation) */
static void map_round(const MeshMap *m, const PetscReal q[], PetscReal x[])
{
  for (PetscInt d = 0; d < m->dim; d++) x[d] = q[d];
  for (PetscInt k = 0; k < m->nbent; k++) {
    const MeshMapBent *c = &m->bent[k];
    PetscReal          s[2], arc[2];

    if (q[0] < c->lower[0] || q[0] > c->upper[0] || q[1] < c->lower[1] || q[1] > c->upper[1] ||
        !find_in_cell(c->corner, q, s))
      continue;
    on_circle(c->centre, c->radius, (1 - s[0]) * c->angle[0] + s[0] * c->angle[1], arc);
    for (PetscInt d = 0; d < 2; d++)
      x[d] += (1 - s[1]) * (arc[d] - (1 - s[0]) * c->corner[0][d] - s[0] * c->corner[1][d]);
  }
}

void MeshMapBend(MeshMapBent *c, const PetscReal centre[2], PetscReal radius)
{
  PetscReal turn;

  c->radius = radius;
  for (PetscInt d = 0; d < 2; d++) {
    PetscReal size;

    c->centre[d] = centre[d];
    c->lower[d]  = PetscMin(PetscMin(c->corner[0][d], c->corner[1][d]), PetscMin(c->corner[2][d], c->corner[3][d]));
    c->upper[d]  = PetscMax(PetscMax(c->corner[0][d], c->corner[1][d]), PetscMax(c->corner[2][d], c->corner[3][d]));
    size         = c->upper[d] - c->lower[d];
    c->lower[d] -= 1e-9 * size;
    c->upper[d] += 1e-9 * size;
  }
  for (PetscInt i = 0; i < 2; i++)
    c->angle[i] = PetscAtan2Real(c->corner[i][1] - centre[1], c->corner[i][0] - centre[0]);
  turn = c->angle[1] - c->angle[0];
  c->angle[1] -= 2 * PETSC_PI * PetscFloorReal(turn / (2 * PETSC_PI) + 0.5); /* the shorter way round */
}

void MeshMapEvaluate(const MeshMap *m, const PetscReal from[], PetscReal x[])
{
  PetscReal q[3] = {0, 0, 0};

  for (PetscInt d = 0; d < m->dim; d++) q[d] = from[d];
  switch (m->type) {
  case MESHMAP_LINES: map_lines(m, q, x); break;
  case MESHMAP_FITTED: map_fitted(m, q, x); break;
  case MESHMAP_DISC: map_disc(m, q, x); break;
  case MESHMAP_ANNULUS: map_annulus(m, q, x); break;
  case MESHMAP_BALL: map_ball(m, q, x); break;
  case MESHMAP_SHELL: map_shell(m, q, x); break;
  case MESHMAP_ROUND: map_round(m, q, x); break;
  default: /* identity */
    for (PetscInt d = 0; d < m->dim; d++) x[d] = q[d];
  }
  if (m->dim == 3 && (m->type == MESHMAP_FITTED || m->type == MESHMAP_DISC || m->type == MESHMAP_ANNULUS))
    x[2] = between_lines(m, 2, q[2]);
}

PetscReal MeshMapCountCells(PetscReal d, PetscReal h, PetscReal growth, PetscReal coarsest)
{
  const PetscReal far = growth > 0 ? (coarsest - 1) * h / growth : PETSC_MAX_REAL; /* where the size stops to grow */

  if (growth <= 0) return d / h;
  if (d <= far) return PetscLogReal(1 + growth * d / h) / growth;
  return PetscLogReal(coarsest) / growth + (d - far) / (coarsest * h);
}

PetscReal MeshMapDistance(PetscReal count, PetscReal h, PetscReal growth, PetscReal coarsest)
{
  const PetscReal max = growth > 0 ? PetscLogReal(coarsest) / growth : PETSC_MAX_REAL;

  if (growth <= 0) return count * h;
  if (count <= max) return h * (PetscExpReal(growth * count) - 1) / growth;
  return (coarsest - 1) * h / growth + (count - max) * coarsest * h;
}

/* Takes over the n + 1 mesh lines x across an axis */
static PetscErrorCode take_lines(MeshMap *m, PetscInt axis, PetscInt n, PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(m->line[axis]));
  m->line[axis]  = x;
  m->ncell[axis] = n;
  m->lower[axis] = x[0];
  m->upper[axis] = x[n];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMapSetLines(MeshMap *m, PetscInt axis, const PetscReal end[4], const PetscInt n[3], PetscReal h,
                               PetscReal growth, PetscReal coarsest)
{
  const PetscInt total = n[0] + n[1] + n[2];
  PetscReal      count[2], *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(total + 1, &x));
  count[0] = MeshMapCountCells(end[1] - end[0], h, growth, coarsest);
  count[1] = MeshMapCountCells(end[3] - end[2], h, growth, coarsest);
  for (PetscInt i = 0; i < n[0]; i++)
    x[i] = end[1] - MeshMapDistance(count[0] * (n[0] - i) / n[0], h, growth, coarsest);
  for (PetscInt i = 0; i <= n[1]; i++) x[n[0] + i] = end[1] + (end[2] - end[1]) * i / n[1];
  for (PetscInt i = 1; i <= n[2]; i++)
    x[n[0] + n[1] + i] = end[2] + MeshMapDistance(count[1] * i / n[2], h, growth, coarsest);
  x[0]     = end[0];
  x[total] = end[3];
  PetscCall(take_lines(m, axis, total, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMapSetLayers(MeshMap *m, PetscInt axis, PetscReal lower, PetscReal upper, PetscInt n,
                                PetscReal ratio)
{
  PetscReal *x, sum = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n + 1, &x));
  x[0] = 0;
  for (PetscInt i = 0; i < n; i++) {
    sum += PetscPowReal(ratio, n > 2 ? 2.0 * PetscMin(i, n - 1 - i) / (n - 1) : 0);
    x[i + 1] = sum;
  }
  for (PetscInt i = 0; i < n; i++) x[i] = lower + (upper - lower) * (x[i] / sum);
  x[n] = upper;
  PetscCall(take_lines(m, axis, n, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMapSetStretched(MeshMap *m, PetscInt axis, PetscReal lower, PetscReal upper, PetscInt n, PetscReal s)
{
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n + 1, &x));
  for (PetscInt i = 0; i <= n; i++) {
    const PetscReal eta = (2. * i - n) / n, fraction = s > 0 ? PetscTanhReal(s * eta) / PetscTanhReal(s) : eta;

    x[i] = 0.5 * (lower + upper) + 0.5 * (upper - lower) * fraction;
  }
  x[0] = lower;
  x[n] = upper;
  PetscCall(take_lines(m, axis, n, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeshMapClear(MeshMap *m)
{
  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 3; d++) PetscCall(PetscFree(m->line[d]));
  PetscCall(PetscFree(m->bent));
  PetscFunctionReturn(PETSC_SUCCESS);
}
