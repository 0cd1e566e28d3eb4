/* A surface that does not bound a body, made into one that does: corners welded, doubled triangles dropped, neighbours
   turned alike, parts turned outwards, inner sheets dropped, holes closed (close.c). */
#include "compat.h"
#include "triangles.h"
#include <stdlib.h>

#define SAMPLES        400  /* places where the closed surface is compared with the winding number of the open one */
#define AGREE          0.02 /* of the places inside, where they may differ */
#define DIFFER         0.5  /* where they differ by more the surface is refused */
#define COMPACT        0.02 /* volume of a component over that of a ball of its area, below which it has no inside */
#define SHEET          0.15 /* winding number of the others, from 0 or 1, where a component bounds no inside */
#define MAX_COMPONENTS 256  /* of them are looked at: each costs a sum over all triangles */

/* Triangles that are connected by edges of two triangles */
typedef struct {
  PetscInt   n, *of; /* parts; [triangles] */
  PetscReal *volume, *area;
  PetscInt  *border, *crowded, *count; /* [n] edges run along unevenly; edges with other parts; triangles */
} Components;

static void turn_triangle(Surface *f, PetscInt t)
{
  const PetscInt v = f->triangle[t][1];

  f->triangle[t][1] = f->triangle[t][2];
  f->triangle[t][2] = v;
}

/* ---- corners ---- */

typedef struct {
  PetscReal key;
  PetscInt  vertex;
} Along;

static int compare_along(const void *a, const void *b)
{
  const Along *p = (const Along *)a, *q = (const Along *)b;

  return p->key != q->key ? (p->key < q->key ? -1 : 1) : p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static PetscInt find_root(PetscInt parent[], PetscInt i)
{
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i         = parent[i];
  }
  return i;
}

/* Vertices at edges that have not two triangles, sorted along a direction that no plane of a usual body is normal to */
static PetscErrorCode list_loose(const Surface *f, PetscInt *n, Along **loose)
{
  const PetscReal along[3] = {0.5377, 0.6543, 0.5321};
  TriEdge        *e;
  Along          *a;
  char           *bad;

  PetscFunctionBeginUser;
  PetscCall(SurfaceGetEdges(f, &e));
  PetscCall(PetscCalloc1(f->nvertex, &bad));
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    if (j - i != 2) bad[e[i].low] = bad[e[i].high] = 1;
  }
  PetscCall(PetscMalloc1(f->nvertex, &a));
  *n = 0;
  for (PetscInt v = 0; v < f->nvertex; v++)
    if (bad[v]) a[(*n)++] = (Along){dot3(along, f->x[v]), v};
  qsort(a, (size_t)*n, sizeof(*a), compare_along);
  PetscCall(PetscFree(bad));
  PetscCall(PetscFree(e));
  *loose = a;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void drop_flat(Surface *f)
{
  PetscInt kept = 0;

  for (PetscInt t = 0; t < f->n; t++) {
    const PetscInt v[3] = {f->triangle[t][0], f->triangle[t][1], f->triangle[t][2]};

    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    for (int i = 0; i < 3; i++) f->triangle[kept][i] = v[i];
    kept++;
  }
  f->n = kept;
}

static PetscErrorCode weld_corners(Surface *f, PetscReal tolerance, PetscInt *welded)
{
  PetscInt n = 0, *parent;
  Along   *a = NULL;

  PetscFunctionBeginUser;
  *welded = 0;
  PetscCall(list_loose(f, &n, &a));
  PetscCall(PetscMalloc1(f->nvertex, &parent));
  for (PetscInt v = 0; v < f->nvertex; v++) parent[v] = v;
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt j = i + 1; j < n && a[j].key - a[i].key <= tolerance; j++) {
      const PetscInt p = find_root(parent, a[i].vertex), q = find_root(parent, a[j].vertex);
      Vec3           d;

      subtract3(f->x[a[i].vertex], f->x[a[j].vertex], d);
      if (p == q || dot3(d, d) > tolerance * tolerance) continue;
      parent[PetscMax(p, q)] = PetscMin(p, q);
      (*welded)++;
    }
  for (PetscInt i = 0; i < 3 * f->n; i++) f->triangle[i / 3][i % 3] = find_root(parent, f->triangle[i / 3][i % 3]);
  drop_flat(f);
  PetscCall(PetscFree(parent));
  PetscCall(PetscFree(a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- doubled triangles ---- */

typedef struct {
  PetscInt v[3], t;
} Corners;

static int compare_corners(const void *a, const void *b)
{
  const Corners *p = (const Corners *)a, *q = (const Corners *)b;

  for (int i = 0; i < 3; i++)
    if (p->v[i] != q->v[i]) return p->v[i] < q->v[i] ? -1 : 1;
  return p->t < q->t ? -1 : p->t > q->t;
}

/* Of triangles with the same corners, whichever way they face, the first stays. */
static PetscErrorCode drop_doubled(Surface *f, PetscInt *doubled)
{
  Corners *c;

  PetscFunctionBeginUser;
  *doubled = 0;
  PetscCall(PetscMalloc1(f->n, &c));
  for (PetscInt t = 0; t < f->n; t++) {
    const PetscInt *v   = f->triangle[t];
    const PetscInt  low = PetscMin(v[0], PetscMin(v[1], v[2])), high = PetscMax(v[0], PetscMax(v[1], v[2]));

    c[t] = (Corners){{low, v[0] + v[1] + v[2] - low - high, high}, t};
  }
  qsort(c, (size_t)f->n, sizeof(*c), compare_corners);
  for (PetscInt i = 1, first = 0; i < f->n; i++) {
    if (c[i].v[0] != c[first].v[0] || c[i].v[1] != c[first].v[1] || c[i].v[2] != c[first].v[2]) {
      first = i;
      continue;
    }
    f->triangle[c[i].t][1] = f->triangle[c[i].t][0];
    (*doubled)++;
  }
  drop_flat(f);
  PetscCall(PetscFree(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- parts ---- */

/* Beyond the edge of each triangle: twice the neighbour, plus 1 if both run along it the same way; -1: not one */
static PetscErrorCode find_neighbours(const Surface *f, PetscInt **beyond)
{
  TriEdge *e;

  PetscFunctionBeginUser;
  PetscCall(SurfaceGetEdges(f, &e));
  PetscCall(PetscMalloc1(3 * f->n, beyond));
  for (PetscInt i = 0; i < 3 * f->n; i++) (*beyond)[i] = -1;
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    if (j - i != 2) continue;
    const PetscInt same = TriEdgeIsUp(f, e + i) == TriEdgeIsUp(f, e + i + 1);

    (*beyond)[e[i].side]     = 2 * (e[i + 1].side / 3) + same;
    (*beyond)[e[i + 1].side] = 2 * (e[i].side / 3) + same;
  }
  PetscCall(PetscFree(e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The triangles of each part face the way that most of its area faced in the file. */
static PetscErrorCode turn_alike(Surface *f, Components *p, PetscInt *turned)
{
  PetscInt *beyond, *stack;
  char     *flip;

  PetscFunctionBeginUser;
  PetscCall(find_neighbours(f, &beyond));
  PetscCall(PetscMalloc2(f->n, &stack, f->n, &flip));
  PetscCall(PetscMalloc1(f->n, &p->of));
  for (PetscInt t = 0; t < f->n; t++) p->of[t] = -1;
  p->n = 0;
  for (PetscInt start = 0; start < f->n; start++) {
    PetscInt  top = 0, end = 1; /* the stack keeps what was on it: the triangles of the part */
    PetscReal area[2] = {0, 0};

    if (p->of[start] >= 0) continue;
    stack[0]     = start;
    p->of[start] = p->n;
    flip[start]  = 0;
    for (; top < end; top++) {
      const PetscInt  t = stack[top];
      const PetscInt *v = f->triangle[t];
      Vec3            n;

      triangle_normal(f->x[v[0]], f->x[v[1]], f->x[v[2]], n);
      area[(int)flip[t]] += PetscSqrtReal(dot3(n, n));
      for (int e = 0; e < 3; e++) {
        const PetscInt b = beyond[3 * t + e];

        if (b < 0 || p->of[b / 2] >= 0) continue;
        p->of[b / 2] = p->n;
        flip[b / 2]  = (char)(flip[t] ^ (b & 1));
        stack[end++] = b / 2;
      }
    }
    for (PetscInt i = 0; i < end; i++) {
      if (flip[stack[i]] != (area[1] > area[0])) {
        turn_triangle(f, stack[i]);
        (*turned)++;
      }
    }
    p->n++;
  }
  PetscCall(PetscFree2(stack, flip));
  PetscCall(PetscFree(beyond));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volumes are those of the cones over the triangles of a part from the middle of its corners: of an open one, too. */
static PetscErrorCode measure_components(const Surface *f, Components *p)
{
  TriEdge *e;
  Vec3    *middle;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc5(p->n, &p->volume, p->n, &p->area, p->n, &p->border, p->n, &p->crowded, p->n, &p->count));
  PetscCall(PetscCalloc1(p->n, &middle));
  for (PetscInt t = 0; t < f->n; t++) p->count[p->of[t]]++;
  for (PetscInt i = 0; i < 9 * f->n; i++)
    middle[p->of[i / 9]][i % 3] += f->x[f->triangle[i / 9][i / 3 % 3]][i % 3] / (3 * (PetscReal)p->count[p->of[i / 9]]);
  for (PetscInt t = 0; t < f->n; t++) {
    Vec3 v[3], n;

    for (int i = 0; i < 3; i++) subtract3(f->x[f->triangle[t][i]], middle[p->of[t]], v[i]);
    triangle_normal(v[0], v[1], v[2], n);
    p->area[p->of[t]] += 0.5 * PetscSqrtReal(dot3(n, n));
    p->volume[p->of[t]] += dot3(v[0], n) / 6;
  }
  PetscCall(SurfaceGetEdges(f, &e));
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    for (PetscInt k = i; k < j; k++) {
      const PetscInt component = p->of[e[k].side / 3];
      PetscInt       sum       = 0;

      for (PetscInt l = i; l < j; l++) sum += p->of[e[l].side / 3] != component ? 0 : TriEdgeIsUp(f, e + l) ? 1 : -1;
      p->border[component] += sum != 0;
      p->crowded[component] += j - i > 2;
    }
  }
  PetscCall(PetscFree(e));
  PetscCall(PetscFree(middle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_components(Components *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(p->of));
  PetscCall(PetscFree5(p->volume, p->area, p->border, p->crowded, p->count));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_compact(const Components *p, PetscInt k)
{
  return (PetscBool)(PetscAbsReal(p->volume[k]) >
                     COMPACT * PetscPowReal(p->area[k], 1.5) / (6 * PetscSqrtReal(PETSC_PI)));
}

/* Of the parts that have more volume than this one (of: NULL), or of all others, around the middle of triangle t */
static PetscReal winding_of_others(const Surface *f, const Components *p, PetscInt t, PetscBool larger)
{
  const PetscInt component = p->of[t];
  PetscReal      sum       = 0;
  Vec3           x         = {0, 0, 0};

  for (int i = 0; i < 9; i++) x[i % 3] += f->x[f->triangle[t][i / 3]][i % 3] / 3;
  for (PetscInt s = 0; s < f->n; s++) {
    const PetscInt *v = f->triangle[s], k = p->of[s];

    if (k == component || (larger && PetscAbsReal(p->volume[k]) <= PetscAbsReal(p->volume[component]))) continue;
    sum += TriangleWinding(f->x[v[0]], f->x[v[1]], f->x[v[2]], x);
  }
  return sum;
}

static void turn_component(Surface *f, Components *p, PetscInt component, PetscInt *turned)
{
  for (PetscInt t = 0; t < f->n; t++)
    if (component < 0 || p->of[t] == component) {
      turn_triangle(f, t);
      (*turned)++;
    }
  for (PetscInt k = 0; k < p->n; k++)
    if (component < 0 || k == component) p->volume[k] = -p->volume[k];
}

/* Parts that face inwards are turned, the largest first, unless they lie within others: there they are hollows. */
static PetscErrorCode turn_outwards(Surface *f, Components *p, PetscInt *turned)
{
  PetscReal total = 0, bound = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < p->n; k++) total += p->volume[k];
  if (total < 0) turn_component(f, p, -1, turned);
  for (PetscInt pass = 0; pass < MAX_COMPONENTS; pass++) {
    PetscInt largest = -1, t = 0;

    for (PetscInt k = 0; k < p->n; k++)
      if (p->volume[k] < 0 && -p->volume[k] < bound && is_compact(p, k) &&
          (largest < 0 || p->volume[k] < p->volume[largest]))
        largest = k;
    if (largest < 0) break;
    bound = -p->volume[largest];
    while (p->of[t] != largest) t++;
    if (winding_of_others(f, p, t, PETSC_TRUE) < 0.5) turn_component(f, p, largest, turned);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Winding number of the others around some of its triangles, on average */
static PetscReal winding_inside(const Surface *f, const Components *p, PetscInt component)
{
  const PetscInt stride = PetscMax(1, p->count[component] / 8);
  PetscReal      sum    = 0;
  PetscInt       n      = 0;

  for (PetscInt t = 0, i = 0; t < f->n; t++)
    if (p->of[t] == component && i++ % stride == 0) {
      sum += winding_of_others(f, p, t, PETSC_FALSE);
      n++;
    }
  return sum / (PetscReal)n;
}

static void drop_component(Surface *f, Components *p, PetscInt component)
{
  PetscInt kept = 0;

  for (PetscInt t = 0; t < f->n; t++) {
    if (p->of[t] == component) continue;
    for (int i = 0; i < 3; i++) f->triangle[kept][i] = f->triangle[t][i];
    p->of[kept++] = p->of[t];
  }
  f->n = kept;
}

/* A part with a border on edges of three and more triangles is a sheet if it has the inside on both sides, or the
   outside and next to no volume of its own. One after the other, those inside first and small ones first: what was a
   border on it is then none. */
static PetscErrorCode drop_sheets(Surface *f, Components *p, PetscInt *sheets)
{
  PetscFunctionBeginUser;
  for (PetscInt looks = 0; looks < MAX_COMPONENTS;) {
    PetscInt  worst   = -1;
    PetscBool outside = PETSC_TRUE;

    for (PetscInt k = 0; k < p->n && looks < MAX_COMPONENTS; k++) {
      if (!p->crowded[k] || !p->border[k] || !p->count[k]) continue;
      const PetscReal winding = winding_inside(f, p, k);
      const PetscBool out     = (PetscBool)(winding < 0.5);

      looks++;
      if ((winding > SHEET && winding < 1 - SHEET) || (out && is_compact(p, k))) continue;
      if (worst >= 0 && (out > outside || (out == outside && p->area[k] >= p->area[worst]))) continue;
      worst   = k;
      outside = out;
    }
    if (worst < 0) break;
    drop_component(f, p, worst);
    (*sheets)++;
    PetscCall(PetscFree5(p->volume, p->area, p->border, p->crowded, p->count));
    PetscCall(measure_components(f, p));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- all of it ---- */

static PetscErrorCode copy_surface(const Surface *f, Surface *g)
{
  PetscFunctionBeginUser;
  PetscCall(SurfaceDestroy(g));
  g->n       = f->n;
  g->nvertex = f->nvertex;
  PetscCall(PetscMalloc1(f->nvertex, &g->x));
  PetscCall(PetscMalloc1(f->n, &g->triangle));
  PetscCall(PetscArraycpy(&g->x[0][0], &f->x[0][0], 3 * f->nvertex));
  PetscCall(PetscArraycpy(&g->triangle[0][0], &f->triangle[0][0], 3 * f->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the closed surface and the one with holes say different things, of all places inside. Makes the tree. */
static PetscErrorCode compare_closed(Triangles t, PetscInt nopen, PetscReal *differ)
{
  Surface *f = &t->all, patch = {.n = f->n - nopen, .x = f->x};
  PetscInt inside = 0, wrong = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(patch.n, &patch.triangle));
  if (patch.n) PetscCall(PetscArraycpy(&patch.triangle[0][0], &f->triangle[nopen][0], 3 * patch.n));
  PetscCall(SurfaceBuildTree(f));
  PetscCall(SurfaceMakeNormals(f, PETSC_FALSE));
  PetscCall(PetscFree(t->moment));
  PetscCall(SurfaceMakeMoments(f, &t->moment));
  for (PetscInt i = 1; i <= SAMPLES && patch.n; i++) {
    Vec3 x;

    for (int a = 0; a < 3; a++) { /* as in check.c */
      const PetscReal u = (PetscReal)i * PetscPowReal(1.220744084605760, -(PetscReal)(a + 1));

      x[a] = f->node[0].lower[a] + (u - PetscFloorReal(u)) * (f->node[0].upper[a] - f->node[0].lower[a]);
    }
    const PetscReal closed = SurfaceWindingFast(f, t->moment, x), open = closed - SurfaceWinding(&patch, x);

    inside += closed > 0.5 || open > 0.5;
    wrong += (closed > 0.5) != (open > 0.5);
  }
  *differ = wrong > 1 ? (PetscReal)wrong / (PetscReal)inside : 0;
  PetscCall(PetscFree(patch.triangle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode repair_with(Triangles t, PetscReal tolerance, PetscReal *differ)
{
  Surface   *f = &t->all;
  Faults    *k = &t->fault;
  Components components;
  PetscInt   nopen, uneven;

  PetscFunctionBeginUser;
  k->turned = k->sheets = 0;
  PetscCall(copy_surface(&t->f, f));
  PetscCall(weld_corners(f, tolerance, &k->welded));
  PetscCall(drop_doubled(f, &k->duplicate));
  PetscCall(turn_alike(f, &components, &k->turned));
  PetscCall(measure_components(f, &components));
  PetscCall(turn_outwards(f, &components, &k->turned));
  PetscCall(drop_sheets(f, &components, &k->sheets));
  PetscCall(destroy_components(&components));
  nopen   = f->n;
  *differ = 0;
  if (!f->n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SurfaceCloseHoles(f, &k->holes, &uneven));
  PetscCall(compare_closed(t, nopen, differ));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode count_edges(const Surface *f, Faults *k)
{
  TriEdge *e;

  PetscFunctionBeginUser;
  PetscCall(SurfaceGetEdges(f, &e));
  for (PetscInt i = 0, j; i < 3 * f->n; i = j) {
    for (j = i; j < 3 * f->n && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    k->open += j - i == 1;
    k->crowded += j - i > 2;
  }
  PetscCall(PetscFree(e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TrianglesRepair(Triangles t, char error[])
{
  const PetscReal tolerance[] = {1e-6, 1e-5, 1e-4, 1e-3, 4e-3};
  const PetscInt  n           = (PetscInt)(sizeof(tolerance) / sizeof(tolerance[0]));
  PetscReal       differ, min = PETSC_MAX_REAL;
  PetscInt        best = 0, i;

  PetscFunctionBeginUser;
  PetscCall(count_edges(&t->f, &t->fault));
  for (i = 0; i < n; i++) {
    PetscCall(repair_with(t, 2 * t->f.radius * tolerance[i], &differ));
    if (differ < min) best = i;
    min = PetscMin(min, differ);
    if (min <= AGREE) break;
  }
  if (i == n && best < n - 1) PetscCall(repair_with(t, 2 * t->f.radius * tolerance[best], &differ));
  t->fault.differ = min > AGREE ? min : 0;
  if (!t->all.n || min > DIFFER)
    TRI_SAY(min > 0.99
              ? "The surface in '%s' encloses nothing: at %.0f %% of the places that its winding number says are inside, this is not so "
                "when its %" PetscInt_FMT " holes are closed. A body needs an inside"
              : "The surface in '%s' falls apart: of the places that its winding number says are inside, %.0f %% are outside when its %" PetscInt_FMT
                " holes are closed. Join its parts with a mesh program",
            t->file, (double)(100 * PetscMin(1, min)), t->fault.holes);
  PetscFunctionReturn(PETSC_SUCCESS);
}
