/* Defaults of shape operations, computed from the signed distance alone (see default.h).

   Method: a tree of cells over [-r, r]^dim, refined level by level; a cell that the surface cannot reach (1-Lipschitz distance larger than half
   its diagonal at the centre) is full or empty, the others go on. In the last cells the distance is linear on 2 triangles (6 tetrahedra), whose
   clipped parts have closed-form moments and whose cuts, linked edge by edge, are the outline (marching triangles: Allgower & Georg,
   Numerical Continuation Methods, ch. 15). Vertices are numbered by integers, so neighbours see identical values and the outline closes.
   Lengths in the unit of the scene; nothing here is collective. Thin parts below the smallest cell are not resolved. */
#include "compat.h"
#include "default.h"

#define CHUNK 64 /* points or cells handled at a time */

typedef struct {
  PetscReal v, x[3], xx[6]; /* integrals of 1, x, and x_a x_b: xx yy zz xy xz yz */
} Moments;

typedef struct {
  Shape     shape;
  PetscInt  dim, level; /* cells have width 2 half / 2^level */
  PetscReal half;       /* of the box */
  PetscInt  n, *cell;   /* [n][dim] integer position of cells that may be cut */
  Moments   full;       /* of the cells found to lie inside */
} Tree;

/* One straight piece of a 2D outline, with the inside on its left. */
typedef struct {
  PetscInt  from, to; /* keys of the grid edges the ends lie on */
  PetscReal a[2], b[2];
} Segment;

typedef struct {
  PetscInt n, room;
  Segment *seg;
} Outline;

static const PetscInt pair[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};

/* ---- normal ---- */

/* Differences for up to CHUNK points; `shift` moves the points off a place where they vanish. */
static PetscErrorCode DifferenceChunk(Shape s, PetscReal h, PetscInt dim, PetscInt n, const PetscReal x[], const PetscReal shift[], PetscReal g[])
{
  PetscReal p[CHUNK * 3 * 2 * 3], d[CHUNK * 3 * 2];
  PetscInt  m = 0;

  PetscFunctionBeginUser;
  if (n < 1 || dim < 1) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < 2 * dim; a++, m++) {
      for (PetscInt b = 0; b < dim; b++) p[m * dim + b] = x[i * dim + b] + shift[b];
      p[m * dim + a / 2] += a % 2 ? h : -h;
    }
  PetscCall(ShapeDistance(s, m, p, d));
  for (PetscInt i = 0; i < n * dim; i++) g[i] = (d[2 * i + 1] - d[2 * i]) / (2.0 * h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal Length(PetscInt dim, const PetscReal v[])
{
  PetscReal s = 0;

  for (PetscInt a = 0; a < dim; a++) s += v[a] * v[a];
  return PetscSqrtReal(s);
}

PetscErrorCode ShapeDefaultNormal(Shape s, PetscReal r, PetscInt dim, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  const PetscReal h = 1e-5 * r, zero[3] = {0, 0, 0}; /* truncation h^2 and round-off eps/h balance near 1e-10 */

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i += CHUNK) PetscCall(DifferenceChunk(s, h, dim, PetscMin(CHUNK, n - i), x + i * dim, zero, normal + i * dim));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal *g = normal + i * dim, len = Length(dim, g);

    for (PetscInt attempt = 1; len < 0.1 && attempt <= 4; attempt++) {
      const PetscReal shift[3] = {3.1 * h * attempt, 1.7 * h, 0.9 * h};

      PetscCall(DifferenceChunk(s, h, dim, 1, x + i * dim, shift, g));
      len = Length(dim, g);
    }
    if (len > 0)
      for (PetscInt a = 0; a < dim; a++) g[a] /= len;
    else
      for (PetscInt a = 0; a < dim; a++) g[a] = a == 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the tree ---- */

static PetscErrorCode CreateTree(Shape s, PetscReal r, PetscInt dim, Tree *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(t, sizeof(*t)));
  t->shape = s;
  t->dim   = dim;
  t->half  = 1.0173 * r; /* an odd margin: grid lines should not run along flat faces */
  t->n     = 1;
  PetscCall(PetscCalloc1(dim, &t->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode DestroyTree(Tree *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal CellWidth(const Tree *t)
{
  return 2.0 * t->half / (PetscReal)((PetscInt)1 << t->level);
}

static PetscReal HalfDiagonal(const Tree *t)
{
  return 0.5 * CellWidth(t) * PetscSqrtReal((PetscReal)t->dim);
}

static void CellCentre(const Tree *t, const PetscInt cell[], PetscReal x[])
{
  const PetscReal h = CellWidth(t);

  for (PetscInt a = 0; a < t->dim; a++) x[a] = -t->half + ((PetscReal)cell[a] + 0.5) * h;
}

static void AddBox(PetscInt dim, const PetscReal c[], PetscReal h, Moments *m)
{
  const PetscReal v = dim == 2 ? h * h : h * h * h;

  m->v += v;
  for (PetscInt a = 0; a < dim; a++) m->x[a] += v * c[a];
  for (PetscInt k = 0; k < 6; k++) {
    const PetscInt a = pair[k][0], b = pair[k][1];

    if (a < dim && b < dim) m->xx[k] += v * (c[a] * c[b] + (a == b ? h * h / 12.0 : 0.0));
  }
}

/* Go down one level: the children of all cells; full ones are added to t->full, empty ones dropped. */
static PetscErrorCode RefineTree(Tree *t)
{
  const PetscInt dim = t->dim, nc = 1 << dim, nold = t->n;
  PetscInt      *old = t->cell, n = 0;
  PetscReal      x[CHUNK * 8 * 3], d[CHUNK * 8], reach;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(nold * nc * dim, &t->cell));
  t->level++;
  reach = HalfDiagonal(t) * (1.0 + 1e-10);
  for (PetscInt start = 0; start < nold; start += CHUNK) {
    const PetscInt m = PetscMin(CHUNK, nold - start) * nc;

    for (PetscInt i = 0; i < m; i++) {
      PetscInt *cell = t->cell + (n + i) * dim;

      for (PetscInt a = 0; a < dim; a++) cell[a] = 2 * old[(start + i / nc) * dim + a] + ((i % nc) >> a & 1);
      CellCentre(t, cell, x + i * dim);
    }
    PetscCall(ShapeDistance(t->shape, m, x, d));
    for (PetscInt i = 0, first = n; i < m; i++) { /* compact in place: n never overtakes first + i */
      if (d[i] <= -reach) AddBox(dim, x + i * dim, CellWidth(t), &t->full);
      else if (d[i] < reach) {
        for (PetscInt a = 0; a < dim; a++) t->cell[n * dim + a] = t->cell[(first + i) * dim + a];
        n++;
      }
    }
  }
  t->n = n;
  PetscCall(PetscFree(old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- simplices ---- */

/* Corners of the simplices of the unit cell, as bit patterns: paths from 0 to 1...1, one for each order of the axes. */
static const int triangle[2][3]    = {{0, 1, 3}, {0, 3, 2}};
static const int tetrahedron[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

static PetscReal Cross(const PetscReal a[], const PetscReal b[], PetscReal c[])
{
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
  return Length(3, c);
}

static PetscReal SimplexVolume(PetscInt dim, PetscReal v[][3])
{
  PetscReal e[3][3], c[3];

  for (PetscInt k = 0; k < dim; k++)
    for (PetscInt a = 0; a < 3; a++) e[k][a] = v[k + 1][a] - v[0][a];
  if (dim == 2) return 0.5 * PetscAbsReal(e[0][0] * e[1][1] - e[0][1] * e[1][0]);
  Cross(e[0], e[1], c);
  return PetscAbsReal(c[0] * e[2][0] + c[1] * e[2][1] + c[2] * e[2][2]) / 6.0;
}

static void AddSimplex(PetscInt dim, PetscReal v[][3], PetscReal sign, Moments *m)
{
  const PetscReal vol = sign * SimplexVolume(dim, v), nv = (PetscReal)(dim + 1);
  PetscReal       sum[3] = {0, 0, 0};

  for (PetscInt k = 0; k <= dim; k++)
    for (PetscInt a = 0; a < dim; a++) sum[a] += v[k][a];
  m->v += vol;
  for (PetscInt a = 0; a < dim; a++) m->x[a] += vol * sum[a] / nv;
  for (PetscInt k = 0; k < 6; k++) {
    const PetscInt a = pair[k][0], b = pair[k][1];
    PetscReal      q = sum[a] * sum[b];

    if (a >= dim || b >= dim) continue;
    for (PetscInt i = 0; i <= dim; i++) q += v[i][a] * v[i][b];
    m->xx[k] += vol * q / (nv * (nv + 1.0));
  }
}

static void CutEdge(const PetscReal a[], PetscReal da, const PetscReal b[], PetscReal db, PetscReal p[])
{
  const PetscReal t = da / (da - db);

  for (PetscInt k = 0; k < 3; k++) p[k] = a[k] + t * (b[k] - a[k]);
}

/* Order the corners with the inside ones (d < 0) first; returns how many are inside. */
static PetscInt SortCorners(PetscInt dim, PetscReal v[][3], PetscReal d[])
{
  PetscInt in = 0;

  for (PetscInt k = 0; k <= dim; k++) {
    if (d[k] >= 0) continue;
    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal tmp = v[k][a];

      v[k][a]  = v[in][a];
      v[in][a] = tmp;
    }
    {
      const PetscReal tmp = d[k];

      d[k]  = d[in];
      d[in] = tmp;
    }
    in++;
  }
  return in;
}

/* The small simplex at corner k, cut off by the surface, is inside (sign 1) or missing from the inside (sign -1). */
static void AddCorner(PetscInt dim, PetscReal v[][3], const PetscReal d[], PetscInt k, PetscReal sign, Moments *m)
{
  PetscReal p[4][3];

  for (PetscInt i = 0; i <= dim; i++) {
    if (i == k)
      for (PetscInt a = 0; a < 3; a++) p[i][a] = v[i][a];
    else CutEdge(v[k], d[k], v[i], d[i], p[i]);
  }
  AddSimplex(dim, p, sign, m);
}

/* Two corners of a tetrahedron inside: the wedge between edge 0-1 and the quadrilateral of cuts, as three tetrahedra. */
static void AddWedge(PetscReal v[][3], const PetscReal d[], Moments *m)
{
  PetscReal w[6][3], p[4][3];
  const int part[3][4] = {{0, 1, 2, 3}, {1, 2, 3, 4}, {1, 3, 4, 5}};

  for (PetscInt a = 0; a < 3; a++) {
    w[0][a] = v[0][a];
    w[1][a] = v[1][a];
  }
  CutEdge(v[0], d[0], v[2], d[2], w[2]);
  CutEdge(v[0], d[0], v[3], d[3], w[3]);
  CutEdge(v[1], d[1], v[2], d[2], w[4]);
  CutEdge(v[1], d[1], v[3], d[3], w[5]);
  for (PetscInt k = 0; k < 3; k++) {
    for (PetscInt i = 0; i < 4; i++)
      for (PetscInt a = 0; a < 3; a++) p[i][a] = w[part[k][i]][a];
    AddSimplex(3, p, 1.0, m);
  }
}

/* Moments of the part of a simplex where the linear interpolant is negative. Changes the order of v and d. */
static void AddClipped(PetscInt dim, PetscReal v[][3], PetscReal d[], Moments *m)
{
  const PetscInt in = SortCorners(dim, v, d);

  if (in == 0) return;
  if (in == 1) AddCorner(dim, v, d, 0, 1.0, m);
  else if (in == 2 && dim == 3) AddWedge(v, d, m);
  else {
    AddSimplex(dim, v, 1.0, m);
    if (in == dim) AddCorner(dim, v, d, dim, -1.0, m);
  }
}

/* Area and centre of the cut through a tetrahedron (3D). */
static void AddCut(PetscReal v[][3], PetscReal d[], PetscReal *area, PetscReal centre[])
{
  const PetscInt in = SortCorners(3, v, d);
  PetscReal      p[4][3], e[2][3], c[3];
  PetscInt       ntri = 1;

  if (in == 0 || in == 4) return;
  if (in == 2) { /* in the order around the quadrilateral */
    CutEdge(v[0], d[0], v[2], d[2], p[0]);
    CutEdge(v[0], d[0], v[3], d[3], p[1]);
    CutEdge(v[1], d[1], v[3], d[3], p[2]);
    CutEdge(v[1], d[1], v[2], d[2], p[3]);
    ntri = 2;
  } else {
    const PetscInt k = in == 1 ? 0 : 3;

    for (PetscInt i = 0, j = 0; i < 4; i++)
      if (i != k) CutEdge(v[k], d[k], v[i], d[i], p[j++]);
  }
  for (PetscInt t = 0; t < ntri; t++) {
    PetscReal s;

    for (PetscInt a = 0; a < 3; a++) {
      e[0][a] = p[t + 1][a] - p[0][a];
      e[1][a] = p[t + 2][a] - p[0][a];
    }
    s = 0.5 * Cross(e[0], e[1], c);
    *area += s;
    for (PetscInt a = 0; a < 3; a++) centre[a] += s * (p[0][a] + p[t + 1][a] + p[t + 2][a]) / 3.0;
  }
}

/* ---- cells of the last level ---- */

/* Positions and distances of the 2^dim corners of m cells. Corners are computed from integers: equal in all cells that share them. */
static PetscErrorCode EvaluateCorners(const Tree *t, PetscInt m, const PetscInt cell[], PetscReal x[], PetscReal d[])
{
  const PetscInt  dim = t->dim, nc = 1 << dim;
  const PetscReal h = CellWidth(t);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < m * nc; i++)
    for (PetscInt a = 0; a < dim; a++) x[i * dim + a] = -t->half + h * (PetscReal)(cell[i / nc * dim + a] + ((i % nc) >> a & 1));
  PetscCall(ShapeDistance(t->shape, m * nc, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Gather simplex k of a cell from its corners. */
static void TakeSimplex(PetscInt dim, PetscInt k, const PetscReal x[], const PetscReal d[], PetscReal v[][3], PetscReal dv[])
{
  for (PetscInt i = 0; i <= dim; i++) {
    const int c = dim == 2 ? triangle[k][i] : tetrahedron[k][i];

    v[i][2] = 0;
    for (PetscInt a = 0; a < dim; a++) v[i][a] = x[c * dim + a];
    dv[i] = d[c];
  }
}

/* Moments of the cells that may be cut. */
static PetscErrorCode AddCutCells(const Tree *t, Moments *m)
{
  const PetscInt dim = t->dim, nc = 1 << dim, ns = dim == 2 ? 2 : 6;
  PetscReal      x[CHUNK * 8 * 3], d[CHUNK * 8], v[4][3], dv[4];

  PetscFunctionBeginUser;
  for (PetscInt start = 0; start < t->n; start += CHUNK) {
    const PetscInt n = PetscMin(CHUNK, t->n - start);

    PetscCall(EvaluateCorners(t, n, t->cell + start * dim, x, d));
    for (PetscInt i = 0; i < n; i++)
      for (PetscInt k = 0; k < ns; k++) {
        TakeSimplex(dim, k, x + i * nc * dim, d + i * nc, v, dv);
        AddClipped(dim, v, dv, m);
      }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- mass ---- */

/* Raw moments about the body origin to centroid and inertia about it. */
static void ConvertMoments(PetscInt dim, const Moments *m, ShapeMass *mass)
{
  PetscReal s[6];

  for (PetscInt a = 0; a < 3; a++) mass->centroid[a] = a < dim ? m->x[a] / m->v : 0.0;
  for (PetscInt k = 0; k < 6; k++) s[k] = m->xx[k] - m->v * mass->centroid[pair[k][0]] * mass->centroid[pair[k][1]];
  mass->volume = m->v;
  for (PetscInt k = 0; k < 6; k++) mass->inertia[k] = 0;
  mass->inertia[2] = s[0] + s[1];
  if (dim == 2) return;
  mass->inertia[0] = s[1] + s[2];
  mass->inertia[1] = s[0] + s[2];
  for (PetscInt k = 3; k < 6; k++) mass->inertia[k] = -s[k];
}

PetscErrorCode ShapeDefaultMass(Shape s, PetscReal r, PetscInt dim, ShapeMass *mass)
{
  const PetscInt  first = dim == 2 ? 8 : 4, last = dim == 2 ? 14 : 8;
  const PetscReal tolerance = dim == 2 ? 1e-6 : 1e-4;
  Tree            t;
  Moments         m;
  ShapeMass       old;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(&old, sizeof(old)));
  PetscCall(CreateTree(s, r, dim, &t));
  for (PetscInt level = 1; level <= last; level++) {
    PetscCall(RefineTree(&t));
    if (level < first) continue;
    m = t.full;
    PetscCall(AddCutCells(&t, &m));
    PetscCheck(m.v > 0 || level < last, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "A shape has no inside: its distance is nowhere negative within its bounding radius %g, or it is thinner than %g", (double)r,
               (double)CellWidth(&t));
    if (m.v <= 0) continue;
    ConvertMoments(dim, &m, mass);
    if (PetscAbsReal(mass->volume - old.volume) <= tolerance * mass->volume &&
        PetscAbsReal(mass->inertia[2] - old.inertia[2]) <= tolerance * mass->inertia[2])
      break;
    old = *mass;
  }
  PetscCall(DestroyTree(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- bounding radius about the centroid ---- */

/* Keep the cells that may hold a point farther from c than *lower, raise *lower by what is known to be inside, return the upper bound. */
static PetscErrorCode PruneFar(Tree *t, const PetscReal c[], PetscReal *lower, PetscReal *upper)
{
  const PetscInt  dim   = t->dim;
  const PetscReal reach = HalfDiagonal(t);
  PetscReal      *far;
  PetscInt        n = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(t->n, &far));
  *upper = 0;
  for (PetscInt i = 0; i < t->n; i++) {
    PetscReal x[3], d, rel[3];

    CellCentre(t, t->cell + i * dim, x);
    for (PetscInt a = 0; a < dim; a++) rel[a] = x[a] - c[a];
    far[i] = Length(dim, rel);
    PetscCall(ShapeDistance(t->shape, 1, x, &d));
    if (d <= 0) *lower = PetscMax(*lower, far[i] - d); /* a ball of radius -d around x is inside */
  }
  for (PetscInt i = 0; i < t->n; i++) {
    if (far[i] + reach < *lower * (1.0 - 1e-12)) continue;
    *upper = PetscMax(*upper, far[i] + reach);
    for (PetscInt a = 0; a < dim; a++) t->cell[n * dim + a] = t->cell[i * dim + a];
    n++;
  }
  t->n = n;
  PetscCall(PetscFree(far));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDefaultRadius(Shape s, PetscReal r, PetscInt dim, const PetscReal c[3], PetscReal *radius)
{
  Tree      t;
  PetscReal lower = 0, upper = 0;

  PetscFunctionBeginUser;
  PetscCall(CreateTree(s, r, dim, &t));
  for (PetscInt level = 1; level <= 20; level++) {
    PetscCall(RefineTree(&t));
    PetscCall(PruneFar(&t, c, &lower, &upper));
    if (upper - lower <= 1e-4 * r || t.n > 100000) break;
  }
  PetscCall(DestroyTree(&t));
  *radius = upper > 0 ? upper : r + Length(dim, c); /* nothing left: the distance is not 1-Lipschitz, so only the plugin's own bound holds */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- outline, 2D ---- */

/* A grid edge of the triangulation: its lower vertex and direction (along x, along y, diagonal). */
static PetscInt EdgeKey(const Tree *t, const PetscInt cell[], int a, int b)
{
  const int low = a & b, dir = a ^ b; /* corner bits are nested along every edge */

  return (((cell[1] + (low >> 1 & 1)) * (((PetscInt)1 << t->level) + 1)) + cell[0] + (low & 1)) * 3 + (dir - 1);
}

static PetscErrorCode AppendSegment(Outline *o, const Segment *seg)
{
  PetscFunctionBeginUser;
  if (o->n == o->room) {
    Segment *bigger;

    o->room = 2 * o->room + 1024;
    PetscCall(PetscMalloc1(o->room, &bigger));
    PetscCall(PetscArraycpy(bigger, o->seg, o->n));
    PetscCall(PetscFree(o->seg));
    o->seg = bigger;
  }
  o->seg[o->n++] = *seg;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Triangle k of a cell: the segment that cuts it, with the inside on its left (corners are counter-clockwise). */
static PetscErrorCode CutTriangle(const Tree *t, const PetscInt cell[], PetscInt k, const PetscReal x[], const PetscReal d[], Outline *o)
{
  const int *c = triangle[k];
  Segment    seg;
  int        nends = 0;

  PetscFunctionBeginUser;
  for (int i = 0; i < 3; i++) {
    const int       a = c[i], b = c[(i + 1) % 3], low = PetscMin(a, b), high = PetscMax(a, b);
    const PetscBool a_in = d[a] < 0 ? PETSC_TRUE : PETSC_FALSE, b_in = d[b] < 0 ? PETSC_TRUE : PETSC_FALSE;
    PetscReal       s, *p                                            = a_in ? seg.a : seg.b;

    if (a_in == b_in) continue;
    s = d[low] / (d[low] - d[high]); /* always from the lower vertex: bitwise the same point in both triangles */
    for (int e = 0; e < 2; e++) p[e] = x[low * 2 + e] + s * (x[high * 2 + e] - x[low * 2 + e]);
    if (a_in) seg.from = EdgeKey(t, cell, a, b);
    else seg.to = EdgeKey(t, cell, a, b);
    nends++;
  }
  if (nends == 2) PetscCall(AppendSegment(o, &seg));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode TraceCells(const Tree *t, Outline *o)
{
  PetscReal x[CHUNK * 4 * 2], d[CHUNK * 4];

  PetscFunctionBeginUser;
  o->n = 0;
  for (PetscInt start = 0; start < t->n; start += CHUNK) {
    const PetscInt n = PetscMin(CHUNK, t->n - start);

    PetscCall(EvaluateCorners(t, n, t->cell + start * 2, x, d));
    for (PetscInt i = 0; i < n; i++)
      for (PetscInt k = 0; k < 2; k++) PetscCall(CutTriangle(t, t->cell + (start + i) * 2, k, x + i * 8, d + i * 4, o));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal OutlineLength(const Outline *o)
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < o->n; i++) sum += PetscSqrtReal(PetscSqr(o->seg[i].b[0] - o->seg[i].a[0]) + PetscSqr(o->seg[i].b[1] - o->seg[i].a[1]));
  return sum;
}

/* Put the segments in order: each is followed by the one that starts on the edge where it ends; loops follow one another. */
static PetscErrorCode LinkOutline(Outline *o)
{
  PetscInt *key, *id, n = 0;
  Segment  *sorted;
  PetscBT   seen;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(o->n, &key, o->n, &id, o->n, &sorted));
  PetscCall(PetscBTCreate(o->n, &seen));
  for (PetscInt i = 0; i < o->n; i++) {
    key[i] = o->seg[i].from;
    id[i]  = i;
  }
  PetscCall(PetscSortIntWithArray(o->n, key, id));
  for (PetscInt first = 0; first < o->n; first++) {
    for (PetscInt i = first; !PetscBTLookupSet(seen, i);) {
      PetscInt at;

      sorted[n++] = o->seg[i];
      PetscCall(PetscFindInt(o->seg[i].to, o->n, key, &at));
      PetscCheck(at >= 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "The outline of a shape is broken at (%g, %g): its distance is not continuous or not 1-Lipschitz there; check the plugin with 'make test-shape'",
                 (double)o->seg[i].b[0], (double)o->seg[i].b[1]);
      i = id[at];
    }
  }
  PetscCall(PetscArraycpy(o->seg, sorted, o->n));
  PetscCall(PetscBTDestroy(&seen));
  PetscCall(PetscFree3(key, id, sorted));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Move both ends of all segments onto the surface. */
static PetscErrorCode ProjectOutline(Shape s, Outline *o)
{
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(4 * o->n, &x));
  for (PetscInt i = 0; i < o->n; i++) {
    PetscCall(PetscArraycpy(x + 4 * i, o->seg[i].a, 2));
    PetscCall(PetscArraycpy(x + 4 * i + 2, o->seg[i].b, 2));
  }
  PetscCall(ShapeProject(s, 2 * o->n, x, x));
  for (PetscInt i = 0; i < o->n; i++) {
    PetscCall(PetscArraycpy(o->seg[i].a, x + 4 * i, 2));
    PetscCall(PetscArraycpy(o->seg[i].b, x + 4 * i + 2, 2));
  }
  PetscCall(PetscFree(x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* n points at arc lengths (k + 1/2) L/n along the linked segments. */
static void SpreadAlong(const Outline *o, PetscInt n, PetscReal x[], PetscReal w[])
{
  const PetscReal total = OutlineLength(o);
  PetscReal       s     = 0; /* arc length at the start of segment i */
  PetscInt        k     = 0;

  for (PetscInt i = 0; i < o->n; i++) {
    const Segment  *g   = &o->seg[i];
    const PetscReal len = PetscSqrtReal(PetscSqr(g->b[0] - g->a[0]) + PetscSqr(g->b[1] - g->a[1]));

    for (; k < n; k++) {
      const PetscReal at = ((PetscReal)k + 0.5) * total / (PetscReal)n - s;

      if (at > len && i < o->n - 1) break;
      for (int a = 0; a < 2; a++) x[2 * k + a] = g->a[a] + (len > 0 ? PetscMin(at / len, 1.0) : 0.0) * (g->b[a] - g->a[a]);
      w[k] = total / (PetscReal)n;
    }
    s += len;
  }
}

static PetscErrorCode SpreadOnOutline(Shape s, PetscReal r, PetscInt n, PetscReal x[], PetscReal w[])
{
  const PetscInt first = 9, last = 12; /* keys of level 12 fit a 32-bit integer */
  Tree           t;
  Outline        o   = {0, 0, NULL};
  PetscReal      old = 0;

  PetscFunctionBeginUser;
  PetscCall(CreateTree(s, r, 2, &t));
  for (PetscInt level = 1; level <= last; level++) {
    PetscReal len;

    PetscCall(RefineTree(&t));
    if (level < first) continue;
    PetscCall(TraceCells(&t, &o));
    len = OutlineLength(&o);
    if (PetscAbsReal(len - old) <= 1e-5 * len && o.n) break;
    old = len;
  }
  PetscCheck(o.n > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "A shape has no outline: its distance does not change sign within its bounding radius %g, or it is thinner than %g", (double)r,
             (double)CellWidth(&t));
  PetscCall(LinkOutline(&o));
  PetscCall(ProjectOutline(s, &o));
  SpreadAlong(&o, n, x, w);
  PetscCall(ShapeProject(s, n, x, x));
  PetscCall(PetscFree(o.seg));
  PetscCall(DestroyTree(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surface points, 3D ---- */

/* One candidate point with its area for every cell that is really cut; returns their number in *n. */
static PetscErrorCode CollectCuts(const Tree *t, PetscInt *n, PetscReal x[], PetscReal area[])
{
  PetscReal c[CHUNK * 8 * 3], d[CHUNK * 8], v[4][3], dv[4];

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt start = 0; start < t->n; start += CHUNK) {
    const PetscInt m = PetscMin(CHUNK, t->n - start);

    PetscCall(EvaluateCorners(t, m, t->cell + start * 3, c, d));
    for (PetscInt i = 0; i < m; i++) {
      PetscReal sum = 0, centre[3] = {0, 0, 0};

      for (PetscInt k = 0; k < 6; k++) {
        TakeSimplex(3, k, c + i * 24, d + i * 8, v, dv);
        AddCut(v, dv, &sum, centre);
      }
      if (sum <= 0) continue;
      for (PetscInt a = 0; a < 3; a++) x[*n * 3 + a] = centre[a] / sum;
      area[(*n)++] = sum;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Choose n of m points, each as far as possible from those before it; weights are the areas of the points nearest to each. */
static PetscErrorCode SelectFarthest(PetscInt m, const PetscReal c[], const PetscReal area[], PetscInt n, PetscReal x[], PetscReal w[])
{
  PetscReal *gap;
  PetscInt  *owner, next = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(m, &gap, m, &owner));
  for (PetscInt j = 0; j < m; j++) gap[j] = PETSC_MAX_REAL;
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal *p = c + 3 * next;

    for (PetscInt a = 0; a < 3; a++) x[3 * k + a] = p[a];
    next = 0;
    for (PetscInt j = 0; j < m; j++) {
      const PetscReal r2 = PetscSqr(c[3 * j] - p[0]) + PetscSqr(c[3 * j + 1] - p[1]) + PetscSqr(c[3 * j + 2] - p[2]);

      if (r2 < gap[j]) {
        gap[j]   = r2;
        owner[j] = k;
      }
      if (gap[j] > gap[next]) next = j;
    }
    w[k] = 0;
  }
  for (PetscInt j = 0; j < m; j++) w[owner[j]] += area[j];
  PetscCall(PetscFree2(gap, owner));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode SpreadOnSurface(Shape s, PetscReal r, PetscInt n, PetscReal x[], PetscReal w[])
{
  Tree       t;
  PetscInt   m = 0;
  PetscReal *c = NULL, *area = NULL;

  PetscFunctionBeginUser;
  PetscCall(CreateTree(s, r, 3, &t));
  while (t.level < 5 || (t.level < 9 && t.n < 40 * n)) PetscCall(RefineTree(&t));
  PetscCall(PetscMalloc2(3 * t.n, &c, t.n, &area));
  PetscCall(CollectCuts(&t, &m, c, area));
  PetscCheck(m >= n, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "A shape gave %" PetscInt_FMT " surface points within its bounding radius %g, %" PetscInt_FMT
             " are wanted: it is too thin for the default, give the plugin the operation surface",
             m, (double)r, n);
  PetscCall(ShapeProject(s, m, c, c));
  PetscCall(SelectFarthest(m, c, area, n, x, w));
  PetscCall(PetscFree2(c, area));
  PetscCall(DestroyTree(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDefaultSurface(Shape s, PetscReal r, PetscInt dim, PetscInt n, PetscReal x[], PetscReal w[])
{
  PetscFunctionBeginUser;
  if (dim == 2) PetscCall(SpreadOnOutline(s, r, n, x, w));
  else PetscCall(SpreadOnSurface(s, r, n, x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}
