/* Shape, surface points: where the plugin gives none (see impl.h). The cuts of the cells of the tree, linked edge by
   edge, are the outline (marching triangles: Allgower & Georg, Numerical Continuation Methods, ch. 15). */
#include "compat.h"
#include "guard.h"
#include "tree.h"
#include "base/array.h"
#include <petscbt.h>

#define ALIKE 1e-9 /* what round-off makes of equal squares of distances, and of no area in those of a cell */

/* One straight piece of a 2D outline, with the inside on its left. */
typedef struct {
  PetscInt  from, to; /* keys of the grid edges the ends lie on */
  PetscReal a[2], b[2];
} Segment;

typedef struct {
  PetscInt n, capacity;
  Segment *seg;
} Outline;

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
  PetscCall(ArrayReserve(o->n + 1, &o->capacity, &o->seg, sizeof(*o->seg), NULL));
  o->seg[o->n++] = *seg;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Triangle k of a cell: the segment that cuts it, with the inside on its left (corners are counter-clockwise). */
static PetscErrorCode CutTriangle(const Tree *t, const PetscInt cell[], PetscInt k, const PetscReal x[],
                                  const PetscReal d[], Outline *o)
{
  const int *c = TREE_TRIANGLE[k];
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
  PetscReal x[SHAPE_CHUNK * 4 * 2], d[SHAPE_CHUNK * 4];

  PetscFunctionBeginUser;
  o->n = 0;
  for (PetscInt start = 0; start < t->n; start += SHAPE_CHUNK) {
    const PetscInt n = PetscMin(SHAPE_CHUNK, t->n - start);

    PetscCall(TreeEvaluateCorners(t, n, t->cell + start * 2, x, d));
    for (PetscInt i = 0; i < n; i++)
      for (PetscInt k = 0; k < 2; k++) PetscCall(CutTriangle(t, t->cell + (start + i) * 2, k, x + i * 8, d + i * 4, o));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal OutlineLength(const Outline *o)
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < o->n; i++)
    sum += PetscSqrtReal(PetscSqr(o->seg[i].b[0] - o->seg[i].a[0]) + PetscSqr(o->seg[i].b[1] - o->seg[i].a[1]));
  return sum;
}

/* Put the segments in order: each is followed by the one that starts where it ends; loops follow one another. */
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
                 "The outline of a shape is broken at (%g, %g): its distance is not continuous or not 1-Lipschitz there; check the plugin with the conformance suite (tumble-test-shape)",
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
      for (int a = 0; a < 2; a++)
        x[2 * k + a] = g->a[a] + (len > 0 ? PetscMin(at / len, 1.0) : 0.0) * (g->b[a] - g->a[a]);
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
  PetscCall(TreeCreate(s, r, 2, &t));
  for (PetscInt level = 1; level <= last; level++) {
    PetscReal len;

    PetscCall(TreeRefine(&t));
    if (level < first) continue;
    PetscCall(TraceCells(&t, &o));
    len = OutlineLength(&o);
    if (PetscAbsReal(len - old) <= 1e-5 * len && o.n) break;
    old = len;
  }
  PetscCheck(o.n > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "A shape has no outline: its distance does not change sign within its bounding radius %g, or it is thinner than %g",
             (double)r, (double)TreeCellWidth(&t));
  PetscCall(LinkOutline(&o));
  PetscCall(ProjectOutline(s, &o));
  SpreadAlong(&o, n, x, w);
  PetscCall(ShapeProject(s, n, x, x));
  PetscCall(PetscFree(o.seg));
  PetscCall(TreeDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- surface points, 3D ---- */

/* One candidate point with its area for every cell that is really cut; returns their number in *n. */
static PetscErrorCode CollectCuts(const Tree *t, PetscInt *n, PetscReal x[], PetscReal area[])
{
  PetscReal c[SHAPE_CHUNK * 8 * 3], d[SHAPE_CHUNK * 8], v[4][3], dv[4];

  PetscFunctionBeginUser;
  *n = 0;
  for (PetscInt start = 0; start < t->n; start += SHAPE_CHUNK) {
    const PetscInt m = PetscMin(SHAPE_CHUNK, t->n - start);

    PetscCall(TreeEvaluateCorners(t, m, t->cell + start * 3, c, d));
    for (PetscInt i = 0; i < m; i++) {
      PetscReal sum = 0, centre[3] = {0, 0, 0};

      for (PetscInt k = 0; k < 6; k++) {
        TreeTakeSimplex(3, k, c + i * 24, d + i * 8, v, dv);
        TreeAddCut(v, dv, &sum, centre);
      }
      if (sum <= ALIKE * PetscSqr(TreeCellWidth(t))) continue;
      for (PetscInt a = 0; a < 3; a++) x[*n * 3 + a] = centre[a] / sum;
      area[(*n)++] = sum;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Choose n of m points, each far from those before it; weights are the areas of the points nearest to each. Of
   points as far but for round-off, as symmetric shapes have them, the first: the choice must not depend on the unit of
   length. */
static PetscErrorCode SelectFarthest(PetscInt m, const PetscReal c[], const PetscReal area[], PetscInt n, PetscReal x[],
                                     PetscReal w[])
{
  PetscReal *gap, *at[3];
  PetscInt  *owner, next = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc5(m, &gap, m, &owner, m, &at[0], m, &at[1], m, &at[2]));
  for (PetscInt j = 0; j < m; j++) {
    gap[j]   = PETSC_MAX_REAL;
    owner[j] = 0;
    for (PetscInt a = 0; a < 3; a++) at[a][j] = c[3 * j + a];
  }
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal *p = c + 3 * next;

    for (PetscInt a = 0; a < 3; a++) x[3 * k + a] = p[a];
    for (PetscInt j = 0; j < m; j++) { /* without branches: in vectors */
      const PetscReal r2     = PetscSqr(at[0][j] - p[0]) + PetscSqr(at[1][j] - p[1]) + PetscSqr(at[2][j] - p[2]);
      const int       nearer = r2 < (1 - ALIKE) * gap[j];

      gap[j]   = nearer ? r2 : gap[j];
      owner[j] = nearer ? k : owner[j];
    }
    next = 0;
    for (PetscInt j = 0; j < m; j++)
      if (gap[j] > (1 + ALIKE) * gap[next]) next = j;
    w[k] = 0;
  }
  for (PetscInt j = 0; j < m; j++) w[owner[j]] += area[j];
  PetscCall(PetscFree5(gap, owner, at[0], at[1], at[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode SpreadOnSurface(Shape s, PetscReal r, PetscInt n, PetscReal x[], PetscReal w[])
{
  Tree       t;
  PetscInt   m = 0;
  PetscReal *c = NULL, *area = NULL;

  PetscFunctionBeginUser;
  PetscCall(TreeCreate(s, r, 3, &t));
  while (t.level < 5 || (t.level < 9 && t.n < 40 * n)) PetscCall(TreeRefine(&t));
  PetscCall(PetscMalloc2(3 * t.n, &c, t.n, &area));
  PetscCall(CollectCuts(&t, &m, c, area));
  PetscCheck(m >= n, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "A shape gave %" PetscInt_FMT " surface points within its bounding radius %g, %" PetscInt_FMT
             " are wanted: it is too thin for the default, give the plugin the operation surface",
             m, (double)r, n);
  PetscCall(ShapeProject(s, m, c, c));
  PetscCall(SelectFarthest(m, c, area, n, x, w));
  PetscCall(PetscFree2(c, area));
  PetscCall(TreeDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDefaultSurface(Shape s, PetscReal r, PetscInt dim, PetscInt n, PetscReal x[], PetscReal w[])
{
  PetscFunctionBeginUser;
  if (dim == 2) PetscCall(SpreadOnOutline(s, r, n, x, w));
  else PetscCall(SpreadOnSurface(s, r, n, x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeSurface(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  PetscFunctionBeginUser;
  if (s->ops.surface) GUARDED(s, surface, (s, n, x, w));
  else if (n > 0) PetscCall(ShapeDefaultSurface(s, s->radius, s->dim, n, x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}
