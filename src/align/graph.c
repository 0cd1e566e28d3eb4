/* Align, the graph of a surface: see graph.h. */
#include "compat.h"
#include "graph.h"

#define NSPREAD 8 /* averages along the path */

static int compare_corners(const void *a, const void *b)
{
  const Corner *p = (const Corner *)a, *r = (const Corner *)b;

  for (PetscInt i = 0; i < 2; i++)
    if (p->x[i] != r->x[i]) return p->x[i] < r->x[i] ? -1 : 1;
  return 0;
}

static int compare_edges(const void *a, const void *b)
{
  const Edge *p = (const Edge *)a, *r = (const Edge *)b;

  if (p->a != r->a) return p->a < r->a ? -1 : 1;
  return p->b < r->b ? -1 : p->b > r->b;
}

static PetscInt find_corner(const Graph *g, const PetscReal x[2])
{
  Corner        key = {.x = {x[0], x[1]}};
  const Corner *at  = (const Corner *)bsearch(&key, g->corner, (size_t)g->ncorner, sizeof(Corner), compare_corners);

  return (PetscInt)(at - g->corner);
}

static PetscReal corner_distance(const Corner *a, const Corner *b)
{
  return PetscSqrtReal(PetscSqr(a->x[0] - b->x[0]) + PetscSqr(a->x[1] - b->x[1]));
}

PetscErrorCode AlignGraphListCorners(Midline line, PetscInt k, PetscInt count, const PetscReal record[], Graph *g)
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  g->ncorner = 0;
  g->size    = PETSC_MAX_REAL;
  for (PetscInt e = 0; e < count; e++) {
    const PetscReal *r = record + ALIGN_RECORD * e;

    if ((PetscInt)r[0] != k) continue;
    g->size = PetscMin(g->size, r[1]);
    for (PetscInt v = 0; v < 4; v++)
      g->corner[n++] = (Corner){.x    = {r[3 + 4 * v], r[4 + 4 * v]},
                                .id   = (PetscInt)r[2 + 4 * v],
                                .kind = (CornerKind)r[5 + 4 * v]};
  }
  qsort(g->corner, (size_t)n, sizeof(Corner), compare_corners);
  for (PetscInt i = 0; i < n; i++) {
    if (g->ncorner && !compare_corners(&g->corner[g->ncorner - 1], &g->corner[i])) continue;
    g->corner[g->ncorner++] = g->corner[i];
  }
  for (PetscInt i = 0; i < g->ncorner; i++)
    PetscCall(MidlineProject(line, 1, g->corner[i].x, &g->corner[i].s, &g->corner[i].d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignGraphListEdges(PetscInt k, PetscInt count, const PetscReal record[], Graph *g)
{
  const PetscInt END[4][2] = {{0, 1}, {0, 2}, {1, 3}, {2, 3}};
  PetscInt       n = 0, unique = 0;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < count; e++) {
    const PetscReal *r = record + ALIGN_RECORD * e;

    for (PetscInt v = 0; v < 4 && (PetscInt)r[0] == k; v++) {
      const PetscInt a = find_corner(g, r + 3 + 4 * END[v][0]), b = find_corner(g, r + 3 + 4 * END[v][1]);

      if (g->corner[a].kind == CORNER_TAKEN || g->corner[b].kind == CORNER_TAKEN) continue;
      if (g->corner[a].kind == CORNER_SIDE && g->corner[b].kind == CORNER_SIDE) continue;
      g->edge[n++] = (Edge){a, b, 0};
      g->edge[n++] = (Edge){b, a, 0};
    }
  }
  qsort(g->edge, (size_t)n, sizeof(Edge), compare_edges);
  for (PetscInt i = 0; i < n; i++)
    if (!unique || compare_edges(&g->edge[unique - 1], &g->edge[i])) g->edge[unique++] = g->edge[i];
  g->nedge = unique;
  for (PetscInt i = 0; i < unique; i++) {
    const Corner   *a = g->corner + g->edge[i].a, *b = g->corner + g->edge[i].b;
    const PetscReal length = corner_distance(a, b);

    g->edge[i].cost = length + 2 * (PetscSqr(a->d) + PetscSqr(b->d)) / length;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What it costs to begin or end a path at a corner, tip at x */
static PetscReal tip_cost(const Graph *g, const Corner *c, const PetscReal x[2], CornerKind kind)
{
  const PetscReal d = PetscSqrtReal(PetscSqr(c->x[0] - x[0]) + PetscSqr(c->x[1] - x[1]));

  if (c->kind != kind || d >= ALIGN_NEAR * g->size) return PETSC_MAX_REAL;
  return kind == CORNER_SIDE ? 0 : 2 * d * d / g->size;
}

PetscErrorCode AlignGraphFindPath(const Graph *g, const PetscReal tip[], const CornerKind kind[], PetscInt from[],
                                  PetscReal cost[], PetscBool done[], PetscInt *last)
{
  PetscReal best = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  *last = -1;
  for (PetscInt i = 0; i < g->ncorner; i++) {
    cost[i] = tip_cost(g, g->corner + i, tip, kind[0]);
    from[i] = -1;
    done[i] = PETSC_FALSE;
  }
  while (1) {
    PetscInt  at = -1, low = 0, high = g->nedge;
    PetscReal end;

    for (PetscInt i = 0; i < g->ncorner; i++)
      if (!done[i] && cost[i] < PETSC_MAX_REAL && (at < 0 || cost[i] < cost[at])) at = i;
    if (at < 0) break;
    done[at] = PETSC_TRUE;
    end      = tip_cost(g, g->corner + at, tip + 2, kind[1]);
    if (end < PETSC_MAX_REAL && cost[at] + end < best) {
      best  = cost[at] + end;
      *last = at;
    }
    if (g->corner[at].kind == CORNER_SIDE && from[at] >= 0) continue; /* an end */
    while (low < high) {
      const PetscInt mid = (low + high) / 2;

      if (g->edge[mid].a < at) low = mid + 1;
      else high = mid;
    }
    for (PetscInt e = low; e < g->nedge && g->edge[e].a == at; e++) {
      const PetscInt b = g->edge[e].b;

      if (done[b] || cost[at] + g->edge[e].cost >= cost[b]) continue;
      cost[b] = cost[at] + g->edge[e].cost;
      from[b] = at;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignGraphSpread(PetscInt n, PetscReal length, PetscReal t[])
{
  PetscFunctionBeginUser;
  t[0]     = 0;
  t[n - 1] = length;
  for (PetscInt i = 1; i < n - 1; i++) t[i] = PetscMin(length, PetscMax(t[i - 1], t[i]));
  for (PetscInt sweep = 0; sweep < NSPREAD; sweep++) {
    PetscReal before = t[0];

    for (PetscInt i = 1; i < n - 1; i++) {
      const PetscReal now = t[i];

      t[i]   = 0.25 * before + 0.5 * now + 0.25 * t[i + 1];
      before = now;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
