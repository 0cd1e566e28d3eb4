/* STL: a body bounded by triangles, from a file in the STL format (ASCII or binary). 3D only (in 2D: polygon).

   The surface must be closed, its triangles must face outwards and must not cross; a file that breaks this is refused
   with what is wrong and where. Corners that are equal in the file are one vertex; triangles without area between equal
   corners are dropped. Several closed parts are one body; a part inside of another that faces inwards is a hollow.

   Distance: closest point over all triangles by a tree of bounding boxes, exact; sign by the normal of the closest
   feature, which at edges and vertices is the sum of its triangles' normals, weighted by their angles (Baerentzen &
   Aanaes 2005). Volume, centroid and inertia are those of the polyhedron, exactly: sums over the tetrahedra between the
   origin and the triangles, which is the divergence theorem. The body frame has the axes of the file, times `scale`;
   its origin is at `origin` of the file, by default the middle of the bounding box. */
#include "shape.h"
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST     2000000 /* triangles */
#define LEAF     4       /* triangles in a leaf of the tree */
#define DEPTH    64      /* of the tree: halves, so more than enough */
#define SAMPLES  100     /* places where the sign is compared with the winding number */
#define SAY(...) PetscCall(PetscSNPrintf(error, WHY, __VA_ARGS__))
#define WHY      1024

typedef PetscReal Vec3[3];

typedef struct {
  Vec3     lower, upper;
  PetscInt first, count; /* triangles of a leaf; count 0: children are the next node and `first` */
} Node;

typedef struct {
  char      file[PETSC_MAX_PATH_LEN];
  PetscReal scale;
  Vec3      origin;
  PetscInt  n, nvertex, nnode; /* triangles, vertices, nodes of the tree */
  PetscInt (*triangle)[3];     /* [n] vertices, counter-clockwise seen from outside */
  PetscInt (*next)[3];         /* [n] the triangle beyond the edge from corner e to e + 1 */
  Vec3     *x;                 /* [nvertex] */
  Vec3     *face, *corner;     /* [n] unit normals, zero where there is no area; [nvertex] weighted by angles */
  Node     *node;
  PetscReal radius, area;
} Surface;

typedef struct { /* closest point of a triangle or the surface */
  PetscReal square;
  Vec3      y;
  PetscInt  triangle, feature; /* 0: face, 1..3: edge from corner f - 1, 4..6: corner f - 4 */
} Closest;

static inline PetscReal Dot(const Vec3 a, const Vec3 b)
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void Difference(const Vec3 a, const Vec3 b, Vec3 c)
{
  for (int i = 0; i < 3; i++) c[i] = a[i] - b[i];
}

static inline void Cross(const Vec3 a, const Vec3 b, Vec3 c)
{
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

/* ---- reading, on rank 0 only; errors are text for all ranks ---- */

static PetscErrorCode ReadFile(const char file[], char **text, size_t *size, char error[])
{
  FILE *f = fopen(file, "rb");
  long  n = -1;

  PetscFunctionBeginUser;
  *text = NULL;
  if (f && !fseek(f, 0, SEEK_END)) n = ftell(f);
  if (n >= 0) {
    rewind(f);
    PetscCall(PetscMalloc1((size_t)n + 1, text));
    if (fread(*text, 1, (size_t)n, f) != (size_t)n) n = -1;
    else (*text)[n] = 0;
  }
  if (f) fclose(f);
  *size = n < 0 ? 0 : (size_t)n;
  if (n < 0)
    SAY("STL file '%s' cannot be read: set the option file of shape 'stl' to the path of a file, in a scene relative to the scene file", file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Three corners of 3 floats after the 3 of a normal, in 50 bytes a triangle */
static void ReadBinary(const char text[], PetscInt n, PetscReal xyz[])
{
  for (PetscInt t = 0; t < n; t++) {
    float v[12];

    memcpy(v, text + 84 + 50 * t, sizeof(v));
    for (int i = 0; i < 9; i++) xyz[9 * t + i] = v[3 + i];
  }
}

/* The numbers after every word "vertex"; *n: triangles */
static PetscErrorCode ReadText(const char file[], char text[], PetscInt *n, PetscReal xyz[], char error[])
{
  PetscInt corners = 0, line = 1;

  PetscFunctionBeginUser;
  for (char *c = text; *c && !error[0]; c++) {
    if (*c == '\n') line++;
    if (strncmp(c, "vertex", 6) || (c > text && !isspace((unsigned char)c[-1]))) continue;
    c += 6;
    for (int a = 0; a < 3 && !error[0]; a++) {
      char        *end;
      const double value = strtod(c, &end);

      if (end == c || PetscIsInfOrNanReal((PetscReal)value)) SAY("%s:%" PetscInt_FMT ": expected three finite numbers after 'vertex'", file, line);
      else if (corners < 3 * MOST) xyz[3 * corners + a] = (PetscReal)value;
      c = end;
    }
    corners++;
    c--;
  }
  if (!error[0] && corners % 3)
    SAY("STL file '%s' has %" PetscInt_FMT " corners, which is no multiple of three: it is cut off or damaged", file, corners);
  *n = corners / 3;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* All corners [n][3][3] of a file. Binary files are known by their size. */
static PetscErrorCode ReadTriangles(const char file[], PetscInt *n, PetscReal **xyz, char error[])
{
  char    *text;
  size_t   size;
  unsigned count = 0;

  PetscFunctionBeginUser;
  *n   = 0;
  *xyz = NULL;
  PetscCall(ReadFile(file, &text, &size, error));
  if (size >= 84) memcpy(&count, text + 80, 4);
  if (error[0]) { /* nothing to read */
  } else if (size >= 84 && size == 84 + 50 * (size_t)count && count <= MOST) {
    *n = (PetscInt)count;
    PetscCall(PetscMalloc1(9 * (size_t)*n + 1, xyz));
    ReadBinary(text, *n, *xyz);
    for (PetscInt i = 0; i < 9 * *n && !error[0]; i++)
      if (PetscIsInfOrNanReal((*xyz)[i])) SAY("STL file '%s': a corner of triangle %" PetscInt_FMT " is not finite", file, i / 9);
  } else if (size > 5 && !strncmp(text, "solid", 5)) {
    /* a corner takes more characters than numbers */
    PetscCall(PetscMalloc1(PetscMin(size, (size_t)9 * MOST) + 9, xyz));
    PetscCall(ReadText(file, text, n, *xyz, error));
  } else
    SAY("'%s' is no STL file: a text file begins with 'solid', a binary one of %u triangles has %.0f bytes, this one has %.0f", file, count,
        84 + 50 * (double)count, (double)size);
  if (!error[0] && (*n < 4 || *n > MOST)) SAY("STL file '%s' has %" PetscInt_FMT " triangles: a body needs 4, and %d are the most", file, *n, MOST);
  PetscCall(PetscFree(text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- vertices and edges ---- */

typedef struct {
  Vec3     x;
  PetscInt id;
} Point;

static int ComparePoints(const void *a, const void *b)
{
  const Point *p = (const Point *)a, *q = (const Point *)b;

  for (int i = 0; i < 3; i++)
    if (p->x[i] != q->x[i]) return p->x[i] < q->x[i] ? -1 : 1;
  return p->id < q->id ? -1 : p->id > q->id;
}

/* Vertices and triangles from the corners: equal corners are one vertex, triangles that lose a corner are dropped. */
static PetscErrorCode JoinCorners(Surface *f, PetscInt n, const PetscReal xyz[])
{
  Point    *p;
  PetscInt *vertex, kept = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(3 * n, &p, 3 * n, &vertex));
  for (PetscInt i = 0; i < 3 * n; i++) {
    p[i].id = i;
    for (int a = 0; a < 3; a++) p[i].x[a] = xyz[3 * i + a] * f->scale;
  }
  qsort(p, (size_t)(3 * n), sizeof(*p), ComparePoints);
  PetscCall(PetscMalloc3(3 * n, &f->x, n, &f->triangle, n, &f->next));
  for (PetscInt i = 0; i < 3 * n; i++) {
    if (!i || p[i].x[0] != p[i - 1].x[0] || p[i].x[1] != p[i - 1].x[1] || p[i].x[2] != p[i - 1].x[2])
      PetscCall(PetscArraycpy(f->x[f->nvertex++], p[i].x, 3));
    vertex[p[i].id] = f->nvertex - 1;
  }
  for (PetscInt t = 0; t < n; t++) {
    const PetscInt *v = vertex + 3 * t;

    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    PetscCall(PetscArraycpy(f->triangle[kept++], v, 3));
  }
  f->n = kept;
  PetscCall(PetscFree2(p, vertex));
  PetscFunctionReturn(PETSC_SUCCESS);
}

typedef struct {
  PetscInt low, high, side; /* vertices; 3 triangle + edge */
} Edge;

static int CompareEdges(const void *a, const void *b)
{
  const Edge *p = (const Edge *)a, *q = (const Edge *)b;

  if (p->low != q->low) return p->low < q->low ? -1 : 1;
  if (p->high != q->high) return p->high < q->high ? -1 : 1;
  return p->side < q->side ? -1 : p->side > q->side;
}

/* Two triangles on every edge, which run along it in opposite directions; else what is wrong, in `error` */
static PetscErrorCode JoinEdges(Surface *f, char error[])
{
  Edge    *e;
  PetscInt wrong[3] = {0, 0, 0}, at = -1; /* open, crowded, turned; first place */

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * f->n, &e));
  for (PetscInt i = 0; i < 3 * f->n; i++) {
    const PetscInt a = f->triangle[i / 3][i % 3], b = f->triangle[i / 3][(i + 1) % 3];

    e[i] = (Edge){PetscMin(a, b), PetscMax(a, b), i};
  }
  qsort(e, (size_t)(3 * f->n), sizeof(*e), CompareEdges);
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    PetscInt kind = -1;

    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    if (j - i == 1) kind = 0;
    else if (j - i > 2) kind = 1;
    else if (f->triangle[e[i].side / 3][e[i].side % 3] == f->triangle[e[i + 1].side / 3][e[i + 1].side % 3]) kind = 2;
    else {
      f->next[e[i].side / 3][e[i].side % 3]         = e[i + 1].side / 3;
      f->next[e[i + 1].side / 3][e[i + 1].side % 3] = e[i].side / 3;
    }
    if (kind < 0) continue;
    wrong[kind]++;
    if (at < 0) at = e[i].low;
  }
  if (at >= 0)
    SAY("The surface in '%s' does not bound a body: of its edges, %" PetscInt_FMT " have a triangle on one side only (holes), %" PetscInt_FMT
        " have more than two, at %" PetscInt_FMT " the triangles face to opposite sides (turned normals); the first at (%g, %g, %g) of the file. "
        "Repair it with a mesh program",
        f->file, wrong[0], wrong[1], wrong[2], (double)(f->x[at][0] / f->scale), (double)(f->x[at][1] / f->scale), (double)(f->x[at][2] / f->scale));
  PetscCall(PetscFree(e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- normals and moments ---- */

static PetscErrorCode MakeNormals(Surface *f)
{
  PetscFunctionBeginUser;
  PetscCall(PetscCalloc2(f->n, &f->face, f->nvertex, &f->corner));
  f->area = 0;
  for (PetscInt t = 0; t < f->n; t++) {
    Vec3      e[3], n;
    PetscReal twice;

    for (int i = 0; i < 3; i++) Difference(f->x[f->triangle[t][(i + 1) % 3]], f->x[f->triangle[t][i]], e[i]);
    Cross(e[0], e[1], n);
    twice = PetscSqrtReal(Dot(n, n));
    f->area += 0.5 * twice;
    if (twice <= 0) continue;
    for (int a = 0; a < 3; a++) f->face[t][a] = n[a] / twice;
    for (int i = 0; i < 3; i++) {
      const PetscReal angle = PetscAtan2Real(twice, -Dot(e[i], e[(i + 2) % 3]));

      for (int a = 0; a < 3; a++) f->corner[f->triangle[t][i]][a] += angle * f->face[t][a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Integrals of 1, x_a and x_a x_b (xx yy zz xy xz yz) over the tetrahedra between the origin and the triangles */
static void AddMoments(const Surface *f, PetscReal *volume, Vec3 first, PetscReal second[6])
{
  const int row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};

  for (PetscInt t = 0; t < f->n; t++) {
    const PetscReal *p = f->x[f->triangle[t][0]], *q = f->x[f->triangle[t][1]], *r = f->x[f->triangle[t][2]];
    Vec3             n, sum;
    PetscReal        det;

    Cross(q, r, n);
    det = Dot(p, n);
    *volume += det / 6;
    for (int a = 0; a < 3; a++) {
      sum[a] = p[a] + q[a] + r[a];
      first[a] += det / 24 * sum[a];
    }
    for (int k = 0; k < 6; k++) {
      const int a = row[k], b = col[k];

      second[k] += det / 120 * (sum[a] * sum[b] + p[a] * p[b] + q[a] * q[b] + r[a] * r[b]);
    }
  }
}

static PetscErrorCode ShapeMass_Stl(Shape s, ShapeMass *m)
{
  const int row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  Surface  *f;
  PetscReal second[6] = {0, 0, 0, 0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  AddMoments(f, &m->volume, m->centroid, second);
  for (int a = 0; a < 3; a++) m->centroid[a] /= m->volume;
  for (int k = 0; k < 6; k++) second[k] -= m->volume * m->centroid[row[k]] * m->centroid[col[k]];
  for (int k = 0; k < 6; k++) m->inertia[k] = k < 3 ? second[0] + second[1] + second[2] - second[k] : -second[k];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- tree of bounding boxes ---- */

typedef struct {
  PetscReal key;
  PetscInt  triangle;
} Key;

static int CompareKeys(const void *a, const void *b)
{
  const Key *p = (const Key *)a, *q = (const Key *)b;

  return p->key != q->key ? (p->key < q->key ? -1 : 1) : p->triangle < q->triangle ? -1 : p->triangle > q->triangle;
}

/* The node over triangles [first, first + count) of key, which are sorted along the longest side of their box and
   halved. The triangles of leaves end up in `order`. */
static PetscErrorCode BuildNode(Surface *f, PetscInt first, PetscInt count, Key key[])
{
  Node    *b    = &f->node[f->nnode++];
  PetscInt axis = 0, half = count / 2;

  PetscFunctionBeginUser;
  for (int a = 0; a < 3; a++) {
    b->lower[a] = PETSC_MAX_REAL;
    b->upper[a] = -PETSC_MAX_REAL;
  }
  for (PetscInt i = 3 * first; i < 3 * (first + count); i++)
    for (int a = 0; a < 3; a++) {
      const PetscReal x = f->x[f->triangle[key[i / 3].triangle][i % 3]][a];

      b->lower[a] = PetscMin(b->lower[a], x);
      b->upper[a] = PetscMax(b->upper[a], x);
    }
  b->first = first;
  b->count = count;
  if (count <= LEAF) PetscFunctionReturn(PETSC_SUCCESS);
  for (int a = 1; a < 3; a++)
    if (b->upper[a] - b->lower[a] > b->upper[axis] - b->lower[axis]) axis = a;
  for (PetscInt i = first; i < first + count; i++) {
    const PetscInt *v = f->triangle[key[i].triangle];

    key[i].key = f->x[v[0]][axis] + f->x[v[1]][axis] + f->x[v[2]][axis];
  }
  qsort(key + first, (size_t)count, sizeof(*key), CompareKeys);
  b->count = 0;
  PetscCall(BuildNode(f, first, half, key));
  b->first = f->nnode;
  PetscCall(BuildNode(f, first + half, count - half, key));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Also puts the triangles into the order of the leaves. */
static PetscErrorCode BuildTree(Surface *f)
{
  Key *key;
  PetscInt(*triangle)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * f->n, &f->node));
  PetscCall(PetscMalloc2(f->n, &key, f->n, &triangle));
  for (PetscInt t = 0; t < f->n; t++) key[t].triangle = t;
  PetscCall(BuildNode(f, 0, f->n, key));
  for (PetscInt t = 0; t < f->n; t++) PetscCall(PetscArraycpy(triangle[t], f->triangle[key[t].triangle], 3));
  PetscCall(PetscArraycpy((PetscInt *)f->triangle, (PetscInt *)triangle, 3 * f->n));
  PetscCall(PetscFree2(key, triangle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal BoxSquare(const Node *b, const Vec3 x)
{
  PetscReal sum = 0;

  for (int a = 0; a < 3; a++) sum += PetscSqr(PetscMax(PetscMax(b->lower[a] - x[a], x[a] - b->upper[a]), 0.0));
  return sum;
}

/* ---- closest point ---- */

static void ClosestOnEdge(const Surface *f, PetscInt t, int e, const Vec3 x, Closest *best)
{
  const PetscReal *p = f->x[f->triangle[t][e]], *q = f->x[f->triangle[t][(e + 1) % 3]];
  Vec3             d, r, y, gap;
  PetscReal        s;

  Difference(q, p, d);
  Difference(x, p, r);
  s = PetscMin(PetscMax(Dot(r, d) / Dot(d, d), 0.0), 1.0);
  for (int a = 0; a < 3; a++) y[a] = s < 1 ? p[a] + s * d[a] : q[a];
  Difference(x, y, gap);
  if (Dot(gap, gap) >= best->square) return;
  *best = (Closest){Dot(gap, gap), {y[0], y[1], y[2]}, t, s <= 0 ? 4 + e : s >= 1 ? 4 + (e + 1) % 3 : 1 + e};
}

/* Where x lies above the triangle the foot is in it, otherwise on one of the edges that it lies beyond. */
static void ClosestOnTriangle(const Surface *f, PetscInt t, const Vec3 x, Closest *best)
{
  const PetscReal *n = f->face[t], *p = f->x[f->triangle[t][0]];
  PetscBool        beyond = Dot(n, n) > 0 ? PETSC_FALSE : PETSC_TRUE;
  Vec3             r;
  PetscReal        height;

  Difference(x, p, r);
  height = Dot(r, n);
  if (height * height >= best->square) return;
  for (int e = 0; e < 3; e++) {
    Vec3 d, out;

    Difference(f->x[f->triangle[t][(e + 1) % 3]], f->x[f->triangle[t][e]], d);
    Difference(x, f->x[f->triangle[t][e]], r);
    Cross(d, n, out);
    if (Dot(n, n) > 0 && Dot(r, out) <= 0) continue;
    beyond = PETSC_TRUE;
    ClosestOnEdge(f, t, e, x, best);
  }
  if (beyond) return;
  *best = (Closest){height * height, {x[0] - height * n[0], x[1] - height * n[1], x[2] - height * n[2]}, t, 0};
}

/* best->square: only what is closer counts */
static void ClosestOnSurface(const Surface *f, const Vec3 x, Closest *best)
{
  PetscInt  stack[DEPTH], top = 0;
  PetscReal square[DEPTH];

  stack[top]    = 0;
  square[top++] = 0;
  while (top) {
    const Node *b = &f->node[stack[--top]];
    PetscInt    child[2];
    PetscReal   d[2];
    int         far;

    if (square[top] >= best->square) continue;
    for (PetscInt t = b->first; t < b->first + b->count; t++) ClosestOnTriangle(f, t, x, best);
    if (b->count) continue;
    child[0] = (PetscInt)(b - f->node) + 1;
    child[1] = b->first;
    for (int c = 0; c < 2; c++) d[c] = BoxSquare(&f->node[child[c]], x);
    far = d[0] > d[1] ? 0 : 1;
    for (int c = 0; c < 2; c++) { /* the closer one on top */
      const int which = c ? 1 - far : far;

      if (d[which] >= best->square) continue;
      stack[top]    = child[which];
      square[top++] = d[which];
    }
  }
}

/* Not of unit length */
static void FeatureNormal(const Surface *f, const Closest *c, Vec3 n)
{
  const PetscReal *face = f->face[c->triangle], *other = face;

  if (c->feature > 3) other = face = f->corner[f->triangle[c->triangle][c->feature - 4]];
  else if (c->feature > 0) other = f->face[f->next[c->triangle][c->feature - 1]];
  for (int a = 0; a < 3; a++) n[a] = face[a] + other[a];
}

/* Signed distance of one point. The closest triangle of the point before is a good first guess; g: gradient, or NULL */
static PetscReal MeasurePoint(const Surface *f, const Vec3 x, PetscInt *guess, PetscReal g[])
{
  Closest   c = {.square = PETSC_MAX_REAL};
  Vec3      r, n;
  PetscReal d, size;

  ClosestOnTriangle(f, *guess, x, &c);
  ClosestOnSurface(f, x, &c);
  *guess = c.triangle;
  FeatureNormal(f, &c, n);
  Difference(x, c.y, r);
  d = Dot(r, n) < 0 ? -PetscSqrtReal(c.square) : PetscSqrtReal(c.square);
  if (!g) return d;
  size = PetscSqrtReal(Dot(n, n));
  for (int a = 0; a < 3; a++) g[a] = PetscAbsReal(d) > 1e-9 * f->radius ? r[a] / d : size > 0 ? n[a] / size : a == 0;
  return d;
}

static PetscErrorCode ShapeDistance_Stl(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Surface *f;
  PetscInt guess = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i < n; i++) d[i] = MeasurePoint(f, x + 3 * i, &guess, NULL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Stl(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Surface *f;
  PetscInt guess = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i < n; i++) (void)MeasurePoint(f, x + 3 * i, &guess, normal + 3 * i);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- does the surface cross itself? ---- */

/* Does the segment from p to q pass through the inside of triangle t? (Moeller & Trumbore 1997) */
static PetscBool Passes(const Surface *f, PetscInt t, const Vec3 p, const Vec3 q)
{
  const PetscReal small = 1e-9, *a = f->x[f->triangle[t][0]];
  Vec3            e1, e2, d, h, s, k;
  PetscReal       det, u, v, w;

  Difference(f->x[f->triangle[t][1]], a, e1);
  Difference(f->x[f->triangle[t][2]], a, e2);
  Difference(q, p, d);
  Cross(d, e2, h);
  det = Dot(e1, h);
  if (PetscAbsReal(det) <= small * PetscSqrtReal(Dot(e1, e1) * Dot(e2, e2) * Dot(d, d))) return PETSC_FALSE;
  Difference(p, a, s);
  u = Dot(s, h) / det;
  Cross(s, e1, k);
  v = Dot(d, k) / det;
  w = Dot(e2, k) / det;
  return u > small && v > small && u + v < 1 - small && w > small && w < 1 - small ? PETSC_TRUE : PETSC_FALSE;
}

/* Some triangle that edge e of triangle t passes through, or -1 */
static PetscInt FindCrossed(const Surface *f, PetscInt t, int e)
{
  const PetscInt   v = f->triangle[t][e], w = f->triangle[t][(e + 1) % 3];
  const PetscReal *p = f->x[v], *q   = f->x[w];
  PetscInt         stack[DEPTH], top = 0;

  stack[top++] = 0;
  while (top) {
    const Node *b     = &f->node[stack[--top]];
    PetscBool   apart = PETSC_FALSE;

    for (int a = 0; a < 3; a++)
      if (PetscMax(p[a], q[a]) < b->lower[a] || PetscMin(p[a], q[a]) > b->upper[a]) apart = PETSC_TRUE;
    if (apart) continue;
    for (PetscInt i = b->first; i < b->first + b->count; i++) {
      PetscBool shared = PETSC_FALSE;

      for (int c = 0; c < 3; c++)
        if (f->triangle[i][c] == v || f->triangle[i][c] == w) shared = PETSC_TRUE;
      if (!shared && Passes(f, i, p, q)) return i;
    }
    if (b->count) continue;
    stack[top++] = (PetscInt)(b - f->node) + 1;
    stack[top++] = b->first;
  }
  return -1;
}

/* How often the surface winds around x: the solid angles of its triangles (van Oosterom & Strackee 1983) */
static PetscReal WindingNumber(const Surface *f, const Vec3 x)
{
  PetscReal sum = 0;

  for (PetscInt t = 0; t < f->n; t++) {
    Vec3      r[3], c;
    PetscReal l[3];

    for (int i = 0; i < 3; i++) {
      Difference(f->x[f->triangle[t][i]], x, r[i]);
      l[i] = PetscSqrtReal(Dot(r[i], r[i]));
    }
    Cross(r[1], r[2], c);
    sum += PetscAtan2Real(Dot(r[0], c), l[0] * l[1] * l[2] + Dot(r[0], r[1]) * l[2] + Dot(r[1], r[2]) * l[0] + Dot(r[2], r[0]) * l[1]);
  }
  return sum / (2 * PETSC_PI);
}

/* Faces outwards, crosses itself nowhere, and the sign of the distance is that of the winding number at a sample of
   places, which finds parts that lie in one another the wrong way */
static PetscErrorCode CheckSurface(const Surface *f, char error[])
{
  PetscReal volume = 0, second[6] = {0, 0, 0, 0, 0, 0};
  Vec3      first = {0, 0, 0};
  PetscInt  guess = 0;

  PetscFunctionBeginUser;
  AddMoments(f, &volume, first, second);
  if (!(volume > 0)) SAY("The surface in '%s' faces inwards (its volume is %g): turn all normals with a mesh program", f->file, (double)volume);
  for (PetscInt i = 0; i < 3 * f->n && !error[0]; i++) {
    const PetscInt   hit = FindCrossed(f, i / 3, (int)(i % 3));
    const PetscReal *x   = f->x[f->triangle[i / 3][i % 3]];

    if (hit >= 0)
      SAY("The surface in '%s' crosses itself, at (%g, %g, %g) of the file or close to it: join its parts with a mesh program", f->file,
          (double)((x[0]) / f->scale + f->origin[0]), (double)((x[1]) / f->scale + f->origin[1]), (double)((x[2]) / f->scale + f->origin[2]));
  }
  for (PetscInt i = 1; i <= SAMPLES && !error[0]; i++) {
    Vec3 x;

    for (int a = 0; a < 3; a++) { /* an even spread: powers of the root of g^4 = g + 1 */
      const PetscReal u = (PetscReal)i * PetscPowReal(1.220744084605760, -(PetscReal)(a + 1));

      x[a] = f->node[0].lower[a] + (u - PetscFloorReal(u)) * (f->node[0].upper[a] - f->node[0].lower[a]);
    }
    const PetscReal d = MeasurePoint(f, x, &guess, NULL), winding = WindingNumber(f, x);

    if (PetscAbsReal(d) > 1e-6 * f->radius && PetscAbsReal(winding - (d < 0)) > 0.01)
      SAY("The surface in '%s' winds %.2g times around (%g, %g, %g) of the file, where its closest triangle says %s: a part lies inside of another, "
          "or faces inwards. Repair it with a mesh program",
          f->file, (double)winding, (double)(x[0] / f->scale + f->origin[0]), (double)(x[1] / f->scale + f->origin[1]),
          (double)(x[2] / f->scale + f->origin[2]), d < 0 ? "inside" : "outside");
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- operations ---- */

static PetscErrorCode ShapeCreate_Stl(Shape s)
{
  Surface *f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  PetscCall(ShapeSetData(s, f));
  f->scale = 1.0;
  for (int a = 0; a < 3; a++) f->origin[a] = PETSC_MAX_REAL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Stl(Shape s)
{
  Surface *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(ShapeOptionPath(s, "file", "STL file of a closed surface, ASCII or binary", f->file, sizeof(f->file)));
  PetscCall(ShapeOptionReal(s, "scale", "Factor on the coordinates of the file", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &f->scale));
  PetscCall(ShapeOptionRealArray(s, "origin", "Body origin in coordinates of the file; default: the middle of its box", "", PETSC_MIN_REAL,
                                 PETSC_MAX_REAL, 3, f->origin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Move the origin to its place; the radius about it */
static void PutOrigin(Surface *f)
{
  Vec3 lower, upper;

  for (int a = 0; a < 3; a++) {
    lower[a] = upper[a] = f->x[0][a];
    for (PetscInt v = 1; v < f->nvertex; v++) {
      lower[a] = PetscMin(lower[a], f->x[v][a]);
      upper[a] = PetscMax(upper[a], f->x[v][a]);
    }
    if (f->origin[a] == PETSC_MAX_REAL) f->origin[a] = 0.5 * (lower[a] + upper[a]) / f->scale;
  }
  for (PetscInt v = 0; v < f->nvertex; v++) {
    for (int a = 0; a < 3; a++) f->x[v][a] -= f->scale * f->origin[a];
    f->radius = PetscMax(f->radius, PetscSqrtReal(Dot(f->x[v], f->x[v])));
  }
}

/* All that follows from the corners; every rank does the same */
static PetscErrorCode MakeSurface(Surface *f, PetscInt n, const PetscReal xyz[], char error[])
{
  PetscFunctionBeginUser;
  PetscCall(JoinCorners(f, n, xyz));
  if (f->n < 4) SAY("STL file '%s' has %" PetscInt_FMT " triangles with three different corners: a body needs 4", f->file, f->n);
  else PetscCall(JoinEdges(f, error));
  if (error[0]) PetscFunctionReturn(PETSC_SUCCESS);
  PutOrigin(f);
  PetscCall(BuildTree(f));
  PetscCall(JoinEdges(f, error)); /* again: the tree has changed their order */
  PetscCall(MakeNormals(f));
  PetscCall(CheckSurface(f, error));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Stl(Shape s)
{
  Surface    *f;
  char        error[WHY] = "";
  PetscReal  *xyz        = NULL;
  PetscInt    n          = 0;
  PetscMPIInt rank;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCheck(f->file[0], PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "Shape 'stl' has no surface: set its option file to an STL file");
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (!rank) PetscCall(ReadTriangles(f->file, &n, &xyz, error));
  PetscCallMPI(MPI_Bcast(error, (int)sizeof(error), MPI_CHAR, 0, PETSC_COMM_WORLD));
  if (!error[0]) {
    PetscCallMPI(MPI_Bcast(&n, 1, MPIU_INT, 0, PETSC_COMM_WORLD));
    if (rank) PetscCall(PetscMalloc1(9 * n, &xyz));
    PetscCallMPI(MPI_Bcast(xyz, (int)(9 * n), MPIU_REAL, 0, PETSC_COMM_WORLD));
    PetscCall(MakeSurface(f, n, xyz, error));
  }
  PetscCall(PetscFree(xyz));
  PetscCheck(!error[0], PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT, "%s", error);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Stl(Shape s, PetscReal *r)
{
  Surface *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  *r = f->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Equal areas in the order of the triangles, which is that of the tree; in a triangle by an even spread */
static PetscErrorCode ShapeSurface_Stl(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Surface  *f;
  PetscReal before = 0, here = 0;
  PetscInt  t = -1;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt k = 0; k < n; k++) {
    PetscReal u = (k + 1) * 0.7548776662466927, v = (k + 1) * 0.5698402909980532;

    w[k] = f->area / (PetscReal)n;
    while (t < f->n - 1 && (t < 0 || before + here < (k + 0.5) * w[k])) {
      Vec3 e1, e2, c;

      before += here;
      t++;
      Difference(f->x[f->triangle[t][1]], f->x[f->triangle[t][0]], e1);
      Difference(f->x[f->triangle[t][2]], f->x[f->triangle[t][0]], e2);
      Cross(e1, e2, c);
      here = 0.5 * PetscSqrtReal(Dot(c, c));
    }
    u -= PetscFloorReal(u);
    v -= PetscFloorReal(v);
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    for (int a = 0; a < 3; a++)
      x[3 * k + a] = (1 - u - v) * f->x[f->triangle[t][0]][a] + u * f->x[f->triangle[t][1]][a] + v * f->x[f->triangle[t][2]][a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Stl(Shape s, PetscViewer viewer)
{
  Surface *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "%s: %" PetscInt_FMT " triangles, %" PetscInt_FMT " vertices, area %g m^2, origin at (%g, %g, %g) of the file\n",
                                   f->file, f->n, f->nvertex, (double)f->area, (double)f->origin[0], (double)f->origin[1], (double)f->origin[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Stl(Shape s)
{
  Surface *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(PetscFree3(f->x, f->triangle, f->next));
  PetscCall(PetscFree2(f->face, f->corner));
  PetscCall(PetscFree(f->node));
  PetscCall(PetscFree(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "stl",
  .description = "body bounded by the triangles of an STL file",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 2,
  .ops         = {.create   = ShapeCreate_Stl,
                  .options  = ShapeOptions_Stl,
                  .setup    = ShapeSetUp_Stl,
                  .distance = ShapeDistance_Stl,
                  .radius   = ShapeRadius_Stl,
                  .normal   = ShapeNormal_Stl,
                  .mass     = ShapeMass_Stl,
                  .surface  = ShapeSurface_Stl,
                  .view     = ShapeView_Stl,
                  .destroy  = ShapeDestroy_Stl},
};
