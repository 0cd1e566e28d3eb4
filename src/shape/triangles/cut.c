/* What bounds the body of a surface that crosses itself: triangles are cut where others go through them, and the pieces
   that have the inside on one side only are kept. A piece is a triangle. Two triangles that lie in one plane cut each
   other along their edges; of doubled pieces one stays. */
#include "compat.h"
#include "triangles.h"
#include "base/array.h"

#define TOUCH  1e-7 /* of the diameter: what lies closer touches and does not cross */
#define THIN   1e-9 /* of the diameter: height of pieces that are dropped */
#define SIDE   1e-6 /* of the diameter: how far beside a piece its sides are looked at; a third of its height at most */
#define MANY   6    /* times the triangles: more pieces than that are refused (at least PIECES) */
#define PIECES 200000

typedef struct {
  Vec3     x[3];
  PetscInt parent; /* triangle */
  char     whole, doubled, kept, turned;
} Piece;

typedef struct {
  PetscInt n, capacity;
  Piece   *p;
} Pieces;

typedef struct {
  Vec3      n;
  PetscReal c; /* n . x = c */
} Plane;

static inline PetscReal height_over(const Plane *p, const Vec3 x)
{
  return dot3(p->n, x) - p->c;
}

static PetscErrorCode add_piece(Pieces *s, const Piece *like, const Vec3 a, const Vec3 b, const Vec3 c)
{
  Piece q = *like;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(s->n + 1, &s->capacity, &s->p, sizeof(*s->p), NULL));
  for (int k = 0; k < 3; k++) {
    q.x[0][k] = a[k];
    q.x[1][k] = b[k];
    q.x[2][k] = c[k];
  }
  q.whole      = 0;
  s->p[s->n++] = q;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cuts piece i by a plane: it becomes the first part, the others are appended. */
static PetscErrorCode split_piece(Pieces *s, PetscInt i, const Plane *plane, PetscReal touch, PetscBool *cut)
{
  const Piece p = s->p[i];
  PetscReal   d[3];
  int         side[3], up = 0, down = 0, first = 0;
  Vec3        y[2];

  PetscFunctionBeginUser;
  for (int k = 0; k < 3; k++) {
    d[k]    = height_over(plane, p.x[k]);
    side[k] = d[k] > touch ? 1 : d[k] < -touch ? -1 : 0;
    up += side[k] > 0;
    down += side[k] < 0;
  }
  *cut = (PetscBool)(up && down);
  if (!*cut) PetscFunctionReturn(PETSC_SUCCESS);
  while (up + down == 2 ? side[first] != 0 : side[first] != (up == 1 ? 1 : -1)) first++; /* on the plane, or alone */
  const int b = (first + 1) % 3, c = (first + 2) % 3;

  s->n--; /* replaced by the last one, which is put back below */
  s->p[i] = s->p[s->n];
  if (up + down == 2) {
    for (int k = 0; k < 3; k++) y[0][k] = p.x[b][k] + d[b] / (d[b] - d[c]) * (p.x[c][k] - p.x[b][k]);
    PetscCall(add_piece(s, &p, p.x[first], p.x[b], y[0]));
    PetscCall(add_piece(s, &p, p.x[first], y[0], p.x[c]));
  } else {
    for (int k = 0; k < 3; k++) {
      y[0][k] = p.x[first][k] + d[first] / (d[first] - d[b]) * (p.x[b][k] - p.x[first][k]);
      y[1][k] = p.x[first][k] + d[first] / (d[first] - d[c]) * (p.x[c][k] - p.x[first][k]);
    }
    PetscCall(add_piece(s, &p, p.x[first], y[0], y[1]));
    PetscCall(add_piece(s, &p, y[0], p.x[b], p.x[c]));
    PetscCall(add_piece(s, &p, y[0], p.x[c], y[1]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- do two triangles meet? ---- */

static PetscBool make_plane(const Vec3 x[3], Plane *p)
{
  PetscReal size;

  triangle_normal(x[0], x[1], x[2], p->n);
  size = PetscSqrtReal(dot3(p->n, p->n));
  if (!(size > 0)) return PETSC_FALSE;
  for (int a = 0; a < 3; a++) p->n[a] /= size;
  p->c = dot3(p->n, x[0]);
  return PETSC_TRUE;
}

/* Where the plane cuts the triangle, as a range along `direction` */
static PetscBool find_range(const Vec3 x[3], const Plane *plane, const Vec3 direction, PetscReal touch,
                            PetscReal range[2])
{
  PetscReal d[3];

  range[0] = PETSC_MAX_REAL;
  range[1] = -PETSC_MAX_REAL;
  for (int k = 0; k < 3; k++) d[k] = height_over(plane, x[k]);
  for (int k = 0; k < 3; k++) {
    const int       m = (k + 1) % 3;
    const PetscReal s = dot3(direction, x[k]), e = dot3(direction, x[m]);
    PetscReal       at;

    if (PetscAbsReal(d[k]) <= touch) at = s;
    else if (d[k] * d[m] < 0) at = s + d[k] / (d[k] - d[m]) * (e - s);
    else continue;
    range[0] = PetscMin(range[0], at);
    range[1] = PetscMax(range[1], at);
  }
  return (PetscBool)(range[0] <= range[1]);
}

static PetscBool is_crossed(const Vec3 x[3], const Plane *px, const Vec3 y[3], const Plane *py, PetscReal touch)
{
  Vec3      along;
  PetscReal r[2], q[2], size;

  cross(px->n, py->n, along);
  size = PetscSqrtReal(dot3(along, along));
  if (!(size > 0)) return PETSC_FALSE;
  for (int a = 0; a < 3; a++) along[a] /= size;
  if (!find_range(x, py, along, touch, r) || !find_range(y, px, along, touch, q)) return PETSC_FALSE;
  return (PetscBool)(PetscMin(r[1], q[1]) - PetscMax(r[0], q[0]) > touch);
}

static PetscBool is_in_plane(const Vec3 x[3], const Plane *p, PetscReal touch)
{
  return (PetscBool)(PetscAbsReal(height_over(p, x[0])) <= touch && PetscAbsReal(height_over(p, x[1])) <= touch &&
                     PetscAbsReal(height_over(p, x[2])) <= touch);
}

/* The plane through edge e of a triangle, across it, facing away from it */
static PetscBool make_side(const Vec3 x[3], const Plane *p, int e, Plane *side)
{
  Vec3      d;
  PetscReal size;

  subtract3(x[(e + 1) % 3], x[e], d);
  cross(d, p->n, side->n);
  size = PetscSqrtReal(dot3(side->n, side->n));
  if (!(size > 0)) return PETSC_FALSE;
  for (int a = 0; a < 3; a++) side->n[a] /= size;
  side->c = dot3(side->n, x[e]);
  return PETSC_TRUE;
}

/* Of two triangles in one plane: does no edge of x have y beyond it? */
static PetscBool is_beyond_none(const Vec3 x[3], const Plane *px, const Vec3 y[3], PetscReal touch)
{
  Plane side;

  for (int e = 0; e < 3; e++)
    if (!make_side(x, px, e, &side) || (height_over(&side, y[0]) >= -touch && height_over(&side, y[1]) >= -touch &&
                                        height_over(&side, y[2]) >= -touch))
      return PETSC_FALSE;
  return PETSC_TRUE;
}

/* ---- cutting ---- */

typedef struct {
  const Surface *f;
  PetscReal      touch, diameter;
  PetscInt       ncut;
  Pieces         all;
} Cutter;

static void take_corners(const Surface *f, PetscInt t, Vec3 x[3])
{
  for (int k = 0; k < 9; k++) x[k / 3][k % 3] = f->x[f->triangle[t][k / 3]][k % 3];
}

/* Cuts the pieces [first, end) of triangle a by triangle b. */
static PetscErrorCode cut_by(Cutter *c, PetscInt first, const Plane *pa, PetscInt b, PetscBool *crossed)
{
  Pieces   *s = &c->all;
  Vec3      y[3];
  Plane     pb, side;
  PetscBool cut;

  PetscFunctionBeginUser;
  take_corners(c->f, b, y);
  if (!make_plane(y, &pb)) PetscFunctionReturn(PETSC_SUCCESS);
  const PetscBool flat = is_in_plane(y, pa, c->touch);

  for (PetscInt i = first; i < s->n;) {
    PetscBool again = PETSC_FALSE;

    if (flat) {
      if (is_beyond_none((const Vec3 *)s->p[i].x, pa, (const Vec3 *)y, c->touch) &&
          is_beyond_none((const Vec3 *)y, &pb, (const Vec3 *)s->p[i].x, c->touch)) {
        for (int e = 0; e < 3 && !again; e++)
          if (make_side((const Vec3 *)y, &pb, e, &side)) PetscCall(split_piece(s, i, &side, c->touch, &again));
        if (!again && b < s->p[i].parent && dot3(pa->n, pb.n) > 0) s->p[i].doubled = 1;
      }
    } else if (is_crossed((const Vec3 *)s->p[i].x, pa, (const Vec3 *)y, &pb, c->touch)) {
      PetscCall(split_piece(s, i, &pb, c->touch, &cut));
      again    = cut;
      *crossed = (PetscBool)(*crossed || cut);
    }
    if (!again) i++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cuts triangle a by all that meet it. */
static PetscErrorCode cut_triangle(Cutter *c, PetscInt a)
{
  const Surface *f     = c->f;
  const PetscInt first = c->all.n;
  Piece          p     = {.parent = a};
  PetscInt       stack[TRI_DEPTH], top = 0;
  PetscBool      crossed = PETSC_FALSE;
  Plane          pa;
  Vec3           lower, upper;

  PetscFunctionBeginUser;
  take_corners(f, a, p.x);
  if (!make_plane((const Vec3 *)p.x, &pa)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_piece(&c->all, &p, p.x[0], p.x[1], p.x[2]));
  c->all.p[first].whole = 1;
  for (int k = 0; k < 3; k++) {
    lower[k] = PetscMin(p.x[0][k], PetscMin(p.x[1][k], p.x[2][k])) - c->touch;
    upper[k] = PetscMax(p.x[0][k], PetscMax(p.x[1][k], p.x[2][k])) + c->touch;
  }
  stack[top++] = 0;
  while (top) {
    const TriNode *b     = &f->node[stack[--top]];
    PetscBool      apart = PETSC_FALSE;

    for (int k = 0; k < 3; k++)
      if (lower[k] > b->upper[k] || upper[k] < b->lower[k]) apart = PETSC_TRUE;
    if (apart) continue;
    for (PetscInt t = b->first; t < b->first + b->count; t++)
      if (t != a) PetscCall(cut_by(c, first, &pa, t, &crossed));
    if (b->count) continue;
    stack[top++] = (PetscInt)(b - f->node) + 1;
    stack[top++] = b->first;
  }
  c->ncut += crossed;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- which pieces bound the body ---- */

/* 1: the inside is behind it, 2: in front of it */
static char classify_piece(Triangles t, const Cutter *c, const Piece *p)
{
  Vec3      n, e, middle, x;
  PetscReal twice, longest = 0, height, step;
  PetscBool inside[2];

  triangle_normal(p->x[0], p->x[1], p->x[2], n);
  twice = PetscSqrtReal(dot3(n, n));
  for (int k = 0; k < 3; k++) {
    subtract3(p->x[(k + 1) % 3], p->x[k], e);
    longest   = PetscMax(longest, PetscSqrtReal(dot3(e, e)));
    middle[k] = (p->x[0][k] + p->x[1][k] + p->x[2][k]) / 3;
  }
  height = longest > 0 ? twice / longest : 0;
  if (p->doubled || height < THIN * c->diameter) return 0;
  step = PetscMin(0.3 * height, SIDE * c->diameter);
  for (int k = 0; k < 2; k++) {
    for (int a = 0; a < 3; a++) x[a] = middle[a] + (k ? 1 : -1) * step * n[a] / twice;
    inside[k] = (PetscBool)(SurfaceWindingFast(c->f, t->moment, x) > 0.5);
  }
  return inside[0] == inside[1] ? 0 : inside[0] ? 1 : 2;
}

/* Each rank judges its share. */
static PetscErrorCode classify_pieces(Triangles t, Cutter *c)
{
  PetscMPIInt rank, size;
  char       *kind;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(ShapeComm(), &rank));
  PetscCallMPI(MPI_Comm_size(ShapeComm(), &size));
  PetscCall(PetscCalloc1(c->all.n + 1, &kind));
  for (PetscInt i = rank; i < c->all.n; i += size) kind[i] = classify_piece(t, c, c->all.p + i);
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, kind, (PetscMPIInt)c->all.n, MPI_BYTE, MPI_BOR, ShapeComm()));
  for (PetscInt i = 0; i < c->all.n; i++) {
    c->all.p[i].kept   = kind[i] > 0;
    c->all.p[i].turned = kind[i] == 2;
  }
  PetscCall(PetscFree(kind));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The surface of the pieces that are kept; whole ones have the corners of their triangle. */
static PetscErrorCode gather_pieces(const Surface *f, const Pieces *s, Surface *g)
{
  PetscInt n = 0, cut = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < s->n; i++) {
    n += s->p[i].kept;
    cut += s->p[i].kept && !s->p[i].whole;
  }
  PetscCall(SurfaceDestroy(g));
  PetscCall(PetscMalloc1(f->nvertex + 3 * cut, &g->x));
  PetscCall(PetscMalloc1(n, &g->triangle));
  PetscCall(PetscArraycpy(&g->x[0][0], &f->x[0][0], 3 * f->nvertex));
  g->nvertex = f->nvertex;
  for (PetscInt i = 0; i < s->n; i++) {
    const Piece *p = s->p + i;
    PetscInt    *v = g->triangle[g->n];

    if (!p->kept) continue;
    for (int k = 0; k < 3; k++) {
      v[k] = p->whole ? f->triangle[p->parent][k] : g->nvertex;
      if (!p->whole) PetscCall(PetscArraycpy(g->x[g->nvertex++], p->x[k], 3));
    }
    if (p->turned) {
      const PetscInt w = v[1];

      v[1] = v[2];
      v[2] = w;
    }
    g->n++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesCut(Triangles t, char error[])
{
  const PetscReal diameter = 2 * t->f.radius;
  Cutter          c        = {.f = &t->all, .touch = TOUCH * diameter, .diameter = diameter};

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < t->all.n && c.all.n < MANY * t->all.n + PIECES; a++) PetscCall(cut_triangle(&c, a));
  t->fault.crossings = c.ncut;
  if (c.all.n >= MANY * t->all.n + PIECES)
    TRI_SAY("The surface in '%s' crosses itself too often: its %" PetscInt_FMT
            " triangles fall into more than %" PetscInt_FMT " pieces. Join its parts with a mesh program",
            t->file, t->all.n, c.all.n);
  if (!error[0]) {
    PetscCall(classify_pieces(t, &c));
    PetscCall(gather_pieces(&t->all, &c.all, &t->f));
  }
  if (!error[0] && t->f.n < 4)
    TRI_SAY("The surface in '%s' encloses nothing, even with its %" PetscInt_FMT
            " holes closed: a body needs an inside",
            t->file, t->fault.holes);
  PetscCall(PetscFree(c.all.p));
  PetscFunctionReturn(PETSC_SUCCESS);
}
