/* Holes of a surface, closed; polygons, cut into triangles.

   Where an edge is run along more often one way than the other, the surface has a border there. Borders are walked
   along into loops, and each loop is closed by the triangles of least area between its corners. The whole is then a
   cycle: it winds around every point a whole number of times. */
#include "compat.h"
#include "triangles.h"
#include "base/array.h"
#include <stdlib.h>

#define FILM 100  /* corners of a polygon from which on corners are cut off first (least area takes their cube) */
#define LONG 2000 /* corners of a loop from which on it gets a fan around its middle: clipping takes their square */

/* ---- polygons ---- */

/* Twice the area, as a vector */
static void polygon_normal(const Vec3 x[], PetscInt n, const PetscInt corner[], Vec3 normal)
{
  for (int a = 0; a < 3; a++) normal[a] = 0;
  for (PetscInt i = 2; i < n; i++) {
    Vec3 term;

    triangle_normal(x[corner[0]], x[corner[i - 1]], x[corner[i]], term);
    for (int a = 0; a < 3; a++) normal[a] += term[a];
  }
}

/* How good it is to cut off corner b between a and c: short chords first, corners that point inwards last */
static PetscReal rate_ear(const Vec3 x[], PetscInt a, PetscInt b, PetscInt c, const Vec3 normal, PetscReal far)
{
  Vec3 chord, n;

  subtract3(x[c], x[a], chord);
  triangle_normal(x[a], x[b], x[c], n);
  return dot3(chord, chord) + (dot3(n, normal) < 0 ? far : 0);
}

/* Is a corner of the polygon inside the ear a b c? By the side of its edges, seen along the normal */
static PetscBool is_filled(const Vec3 x[], const PetscInt next[], const PetscInt corner[], PetscInt a, PetscInt b,
                           PetscInt c, const Vec3 normal)
{
  const PetscInt v[3] = {corner[a], corner[b], corner[c]};

  for (PetscInt k = next[c]; k != a; k = next[k]) {
    const PetscInt p      = corner[k];
    int            inside = 0;

    for (int e = 0; e < 3; e++) {
      Vec3 n;

      if (p == v[e]) break;
      triangle_normal(x[v[e]], x[v[(e + 1) % 3]], x[p], n);
      inside += dot3(n, normal) > 0;
    }
    if (inside == 3) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

/* Cost of a triangle in a film: its area; of films of the same area the one with short edges */
static PetscReal triangle_weight(const Vec3 p, const Vec3 q, const Vec3 r)
{
  Vec3 n, d, e;

  triangle_normal(p, q, r, n);
  subtract3(q, p, d);
  subtract3(r, q, e);
  return PetscSqrtReal(dot3(n, n)) + 1e-4 * (dot3(d, d) + dot3(e, e));
}

/* The triangles of least area between the corners, by those between all runs of corners (Barequet & Sharir 1995) */
static PetscErrorCode span_film(const Vec3 x[], PetscInt n, const PetscInt corner[], Int3 triangle[])
{
  PetscReal *cost;
  PetscInt  *middle, (*stack)[2], top = 0, made = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc3(n * n, &cost, n * n, &middle, n, &stack));
  for (PetscInt length = 2; length < n; length++)
    for (PetscInt i = 0; i + length < n; i++) {
      const PetscInt k = i + length;

      cost[n * i + k] = PETSC_MAX_REAL;
      for (PetscInt j = i + 1; j < k; j++) {
        const PetscReal c = cost[n * i + j] + cost[n * j + k] +
                            triangle_weight(x[corner[i]], x[corner[j]], x[corner[k]]);

        if (c >= cost[n * i + k]) continue;
        cost[n * i + k]   = c;
        middle[n * i + k] = j;
      }
    }
  stack[top][0]   = 0;
  stack[top++][1] = n - 1;
  while (top) {
    const PetscInt i = stack[--top][0], k = stack[top][1], j = middle[n * i + k];

    if (k - i < 2) continue;
    triangle[made][0]   = corner[i];
    triangle[made][1]   = corner[j];
    triangle[made++][2] = corner[k];
    stack[top][0]       = i;
    stack[top++][1]     = j;
    stack[top][0]       = j;
    stack[top++][1]     = k;
  }
  PetscCall(PetscFree3(cost, middle, stack));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A film; of a long polygon corners are cut off first until it is short enough for one. */
PetscErrorCode PolygonSplit(const Vec3 x[], PetscInt n, const PetscInt corner[], Int3 triangle[])
{
  PetscInt  *next, *before, *film, made = 0, left = n, start = 0;
  PetscReal *worth, far = 0;
  Vec3       normal;

  PetscFunctionBeginUser;
  if (n <= FILM) {
    PetscCall(span_film(x, n, corner, triangle));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  polygon_normal(x, n, corner, normal);
  PetscCall(PetscMalloc4(n, &next, n, &before, n, &worth, FILM, &film));
  for (PetscInt i = 0; i < n; i++) {
    Vec3 d;

    next[i]   = (i + 1) % n;
    before[i] = (i + n - 1) % n;
    subtract3(x[corner[i]], x[corner[0]], d);
    far = PetscMax(far, 16 * dot3(d, d));
  }
  for (PetscInt i = 0; i < n; i++) worth[i] = rate_ear(x, corner[before[i]], corner[i], corner[next[i]], normal, far);
  for (; left > FILM; left--) {
    PetscInt best = -1, any = start;

    for (PetscInt i = start, k = 0; k < left; k++, i = next[i]) {
      if (worth[i] < worth[any]) any = i;
      if ((best < 0 || worth[i] < worth[best]) && !is_filled(x, next, corner, before[i], i, next[i], normal)) best = i;
    }
    if (best < 0) best = any; /* one that folds over itself */
    const PetscInt a = before[best], c = next[best];
    const PetscInt ear[3] = {corner[a], corner[best], corner[c]};

    PetscCall(PetscArraycpy(triangle[made++], ear, 3));
    next[a]   = c;
    before[c] = a;
    start     = a;
    worth[a]  = rate_ear(x, corner[before[a]], corner[a], corner[c], normal, far);
    worth[c]  = rate_ear(x, corner[a], corner[c], corner[next[c]], normal, far);
  }
  for (PetscInt k = 0, i = start; k < FILM; k++, i = next[i]) film[k] = corner[i];
  PetscCall(span_film(x, FILM, film, triangle + made));
  PetscCall(PetscFree4(next, before, worth, film));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- loops ---- */

typedef struct {
  PetscInt from, to, used;
} Half;

static int compare_halves(const void *a, const void *b)
{
  const Half *p = (const Half *)a, *q = (const Half *)b;

  return p->from != q->from ? (p->from < q->from ? -1 : 1) : p->to < q->to ? -1 : p->to > q->to;
}

/* The borders of the surface, turned: what the triangles that close it run along, sorted by where they start */
static PetscErrorCode find_borders(const Surface *f, PetscInt *n, Half **halves, PetscInt *edges)
{
  TriEdge *e;
  Half    *h        = NULL;
  PetscInt capacity = 0;

  PetscFunctionBeginUser;
  *n     = 0;
  *edges = 0;
  PetscCall(SurfaceGetEdges(f, &e));
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    PetscInt sum = 0;

    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      sum += TriEdgeIsUp(f, e + j) ? 1 : -1;
    *edges += sum != 0;
    for (; sum; sum += sum > 0 ? -1 : 1) {
      PetscCall(ArrayReserve(*n + 1, &capacity, &h, sizeof(*h), NULL));
      h[(*n)++] = sum > 0 ? (Half){e[i].high, e[i].low, 0} : (Half){e[i].low, e[i].high, 0};
    }
  }
  qsort(h, (size_t)*n, sizeof(*h), compare_halves);
  PetscCall(PetscFree(e));
  *halves = h;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The first border from vertex v that is not used yet, or -1: as many end in a vertex as start there */
static PetscInt leave_vertex(PetscInt n, Half h[], const PetscInt first[], PetscInt v)
{
  for (PetscInt i = first[v]; i < n && h[i].from == v; i++)
    if (!h[i].used) return i;
  return -1;
}

static PetscErrorCode append_triangle(Surface *f, PetscInt *capacity, const PetscInt v[3])
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(f->n + 1, capacity, &f->triangle, sizeof(*f->triangle), NULL));
  PetscCall(PetscArraycpy(f->triangle[f->n++], v, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Triangles between the corners of a loop; a long one gets a vertex in its middle */
static PetscErrorCode close_loop(Surface *f, PetscInt *capacity, PetscInt n, const PetscInt loop[])
{
  Int3 *t;

  PetscFunctionBeginUser;
  if (n < 3) PetscFunctionReturn(PETSC_SUCCESS);
  if (n > LONG) {
    PetscReal *middle;

    PetscCall(PetscRealloc((size_t)(f->nvertex + 1) * sizeof(*f->x), &f->x));
    middle = f->x[f->nvertex++];
    for (int a = 0; a < 3; a++) middle[a] = 0;
    for (PetscInt i = 0; i < 3 * n; i++) middle[i % 3] += f->x[loop[i / 3]][i % 3] / (PetscReal)n;
    for (PetscInt i = 0; i < n; i++) {
      const PetscInt v[3] = {loop[i], loop[(i + 1) % n], f->nvertex - 1};

      PetscCall(append_triangle(f, capacity, v));
    }
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(n, &t));
  PetscCall(PolygonSplit((const Vec3 *)f->x, n, loop, t));
  for (PetscInt i = 0; i < n - 2; i++) PetscCall(append_triangle(f, capacity, t[i]));
  PetscCall(PetscFree(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where a walk comes to a vertex a second time, what it walked since is a loop of its own */
PetscErrorCode SurfaceCloseHoles(Surface *f, PetscInt *loops, PetscInt *edges)
{
  const PetscInt nvertex = f->nvertex;
  PetscInt       n, capacity = f->n, *first, *path, *at_step;
  Half          *h = NULL;

  PetscFunctionBeginUser;
  *loops = 0;
  PetscCall(find_borders(f, &n, &h, edges));
  PetscCall(PetscMalloc3(nvertex, &first, n + 1, &path, nvertex, &at_step));
  for (PetscInt v = 0; v < nvertex; v++) first[v] = at_step[v] = -1;
  for (PetscInt i = n - 1; i >= 0; i--) first[h[i].from] = i;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt length = 0, v = h[i].from;

    if (h[i].used) continue;
    path[length] = v;
    at_step[v]   = length++;
    for (PetscInt k; (k = leave_vertex(n, h, first, v)) >= 0;) {
      h[k].used = 1;
      v         = h[k].to;
      if (at_step[v] >= 0) {
        PetscCall(close_loop(f, &capacity, length - at_step[v], path + at_step[v]));
        *loops += length - at_step[v] > 2;
        while (length > at_step[v] + 1) at_step[path[--length]] = -1;
      } else {
        path[length] = v;
        at_step[v]   = length++;
      }
    }
    while (length) at_step[path[--length]] = -1;
  }
  PetscCall(PetscFree3(first, path, at_step));
  PetscCall(PetscFree(h));
  PetscFunctionReturn(PETSC_SUCCESS);
}
