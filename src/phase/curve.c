/* PhaseCurve: see phase/curve.h. Edges are handed round as they are (13 numbers each), sorted by the key of their
   middle, and linked by those of their ends. */
#include "compat.h"
#include "impl.h"
#include "base/sparse.h"
#include "fem/edge.h"

#define AGAINST -0.2 /* cosine: such an edge faces the other way */
#define NEAR    0.25 /* of half an edge: where so near, its normal tells the sides */
#define FLAT    0.25 /* sine of the angle to a wall that a shift reckons with */

/* ---- life cycle ---- */

PetscErrorCode PhaseCurveCreate(PetscInt n, PhaseCurve *c)
{
  PetscFunctionBeginUser;
  *c = (PhaseCurve){.n = n};
  PetscCall(PetscMalloc7(n, &c->x, n, &c->ball, n, &c->drop, n, &c->next, n, &c->before, n, &c->loop, n, &c->edge));
  PetscCall(PetscCalloc3(n + 1, &c->first, n, &c->area, n, &c->wall));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseCurveDestroy(PhaseCurve *c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree7(c->x, c->ball, c->drop, c->next, c->before, c->loop, c->edge));
  PetscCall(PetscFree3(c->first, c->area, c->wall));
  *c = (PhaseCurve){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Loops of edges that know who comes next, in the order of their first edges; across a period they are put together */
static void find_loops(PhaseCurve *c, const PetscReal period[])
{
  PetscInt at = 0;

  for (PetscInt e = 0; e < c->n; e++) c->loop[e] = -1;
  c->nloop = 0;
  for (PetscInt e = 0; e < c->n; e++) {
    if (c->loop[e] >= 0) continue;
    c->first[c->nloop] = at;
    for (PetscInt i = e; c->loop[i] < 0; i = c->next[i]) {
      c->loop[i]    = c->nloop;
      c->edge[at++] = i;
      for (PetscInt a = 0; a < 2 && period && i != e; a++) {
        const PetscReal *last = c->x[c->before[i]][2];
        const PetscReal  way  = period[a] > 0 ? period[a] * PetscFloorReal((last[a] - c->x[i][0][a]) / period[a] + 0.5)
                                              : 0;

        for (PetscInt j = 0; j < 3 && way != 0; j++) c->x[i][j][a] += way;
      }
    }
    c->nloop++;
  }
  c->first[c->nloop] = at;
}

static PetscReal area_of(PetscReal (*const p)[2], const PetscReal o[2])
{
  PetscReal sum = 0;

  for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
    PetscReal y[2], d[2];

    EdgeEvaluate(p, EDGE_GAUSS[g], y, d);
    sum += 0.5 * EDGE_WEIGHT[g] * ((y[0] - o[0]) * d[1] - (y[1] - o[1]) * d[0]);
  }
  return sum;
}

void PhaseCurveUpdate(PhaseCurve *c)
{
  for (PetscInt e = 0; e < c->n; e++) {
    PetscReal *ball = c->ball[e];

    ball[0] = c->x[e][1][0];
    ball[1] = c->x[e][1][1];
    ball[2] = EdgeRadius(c->x[e]);
  }
  PhaseBoundBalls(2, c->n, 3, (const PetscReal *)c->ball, c->whole);
  for (PetscInt l = 0; l < c->nloop; l++) {
    c->area[l] = 0;
    for (PetscInt i = c->first[l]; i < c->first[l + 1]; i++)
      c->area[l] += area_of(c->x[c->edge[i]], c->x[c->edge[c->first[l]]][0]);
  }
}

void PhaseCurveLink(PhaseCurve *c)
{
  find_loops(c, NULL);
  PhaseCurveUpdate(c);
}

/* ---- from all ranks ---- */

static int compare_keys(const PetscReal a[2], const PetscReal b[2])
{
  if (a[0] != b[0]) return a[0] < b[0] ? -1 : 1;
  if (a[1] != b[1]) return a[1] < b[1] ? -1 : 1;
  return 0;
}

static int by_middle(const void *a, const void *b)
{
  return compare_keys(((const PhaseEdge *)a)->key[1], ((const PhaseEdge *)b)->key[1]);
}

typedef struct {
  PetscReal key[2];
  PetscInt  edge;
} Start;

static int by_start(const void *a, const void *b)
{
  const Start *s = a, *t = b;
  const int    order = compare_keys(s->key, t->key);

  return order ? order : (s->edge > t->edge) - (s->edge < t->edge);
}

/* The edge that begins where e ends, and that follows none yet; of two (drops that touch at a vertex) the one that
   turns left most, along the same drop */
static PetscInt find_next(const PhaseEdge edge[], PetscInt e, PetscInt n, const Start start[], const PetscInt before[])
{
  PetscInt  low = 0, high = n, best = -1;
  PetscReal most = -PETSC_MAX_REAL, d[2], b[2], y[2];

  while (low < high) {
    const PetscInt middle = (low + high) / 2;

    if (compare_keys(start[middle].key, edge[e].key[2]) < 0) low = middle + 1;
    else high = middle;
  }
  EdgeEvaluate((PetscReal(*)[2])edge[e].x, 1, y, d);
  for (; low < n && !compare_keys(start[low].key, edge[e].key[2]); low++) {
    PetscReal turn;

    if (before[start[low].edge] >= 0) continue;
    EdgeEvaluate((PetscReal(*)[2])edge[start[low].edge].x, -1, y, b);
    turn = PetscAtan2Real(d[0] * b[1] - d[1] * b[0], d[0] * b[0] + d[1] * b[1]);
    if (edge[start[low].edge].drop != edge[e].drop) turn -= 10;
    if (turn <= most) continue;
    most = turn;
    best = start[low].edge;
  }
  return best;
}

static PetscErrorCode link(MPI_Comm comm, const PhaseEdge edge[], PhaseCurve *c)
{
  Start *start;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->n, &start));
  for (PetscInt e = 0; e < c->n; e++) {
    start[e] = (Start){.edge = e};
    PetscCall(PetscArraycpy(start[e].key, edge[e].key[0], 2));
    c->next[e] = c->before[e] = -1;
  }
  qsort(start, (size_t)c->n, sizeof(*start), by_start);
  for (PetscInt e = 0; e < c->n; e++) {
    const PetscInt to = find_next(edge, e, c->n, start, c->before);

    PetscCheck(to >= 0, comm, PETSC_ERR_PLIB, "The interface of a drop is not closed at (%g, %g)",
               (double)edge[e].x[2][0], (double)edge[e].x[2][1]);
    c->next[e]    = to;
    c->before[to] = e;
  }
  PetscCall(PetscFree(start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseCurveGather(MPI_Comm comm, PetscInt n, const PhaseEdge edge[], const PetscReal period[],
                                PhaseCurve *c)
{
  PetscInt   total;
  PhaseEdge *all;

  PetscFunctionBeginUser;
  PetscCall(SparseGather(comm, n, sizeof(*edge), edge, &total, &all, NULL));
  PetscCall(PhaseCurveCreate(total, c));
  qsort(all, (size_t)c->n, sizeof(*all), by_middle);
  for (PetscInt e = 0; e < c->n; e++) {
    PetscCall(PetscArraycpy((PetscReal *)c->x[e], (const PetscReal *)all[e].x, 6));
    c->drop[e] = (PetscInt)all[e].drop;
    c->wall[e] = (PetscBool)(all[e].wall != 0);
  }
  PetscCall(link(comm, all, c));
  find_loops(c, period);
  PhaseCurveUpdate(c);
  PetscCall(PetscFree(all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

/* n becomes the normal at end t of edge e, of length 1 where the curve goes on smoothly: mean of both edges that meet
   there; where one of them is along a wall, that of the other without its part across the wall */
static void normal_at_end(const PhaseCurve *c, PetscInt e, PetscReal t, PetscReal n[2])
{
  const PetscInt other = t < 0 ? c->before[e] : c->next[e];
  PetscReal      more[2];

  EdgeNormal(c->x[e], t, n);
  EdgeNormal(c->x[other], -t, more);
  if (c->wall[other] != c->wall[e]) {
    const PetscReal *own = c->wall[e] ? more : n, *wall = c->wall[e] ? n : more;
    const PetscReal  across  = own[0] * wall[0] + own[1] * wall[1];
    const PetscReal  left[2] = {own[0] - across * wall[0], own[1] - across * wall[1]};

    n[0] = left[0];
    n[1] = left[1];
  } else {
    n[0] = 0.5 * (n[0] + more[0]);
    n[1] = 0.5 * (n[1] + more[1]);
  }
}

/* Does the loop close, or go over a period? */
static PetscBool closes(const PhaseCurve *c, PetscInt loop)
{
  const PetscInt first = c->edge[c->first[loop]], last = c->edge[c->first[loop + 1] - 1];

  return (PetscBool)(EdgeDistance2(c->x[first][0], c->x[last][2]) <= PetscSqr(c->ball[first][2]));
}

/* How often a loop goes round x, counter-clockwise, by the chords of the halves of its edges */
static PetscInt count_turns(const PhaseCurve *c, PetscInt loop, const PetscReal x[2])
{
  PetscInt turns = 0;

  for (PetscInt i = c->first[loop]; i < c->first[loop + 1]; i++)
    for (PetscInt j = 0; j < 2; j++) {
      const PetscReal *p = c->x[c->edge[i]][j], *q = c->x[c->edge[i]][j + 1];
      const PetscReal  left = (q[0] - p[0]) * (x[1] - p[1]) - (x[0] - p[0]) * (q[1] - p[1]);

      if (p[1] <= x[1] && q[1] > x[1] && left > 0) turns++;
      if (p[1] > x[1] && q[1] <= x[1] && left < 0) turns--;
    }
  return turns;
}

/* Of one loop, nearer than p->d says (a size). Next to it the normal tells the sides, at an end that of both edges;
   farther off that would be wrong where a loop is folded, as filaments and drops are that are about to vanish: what a
   loop goes round is inside of it, of a hole it is not. */
static PetscBool search_loop(const PhaseCurve *c, PetscInt loop, const PetscReal x[2], PetscReal reach, PhasePoint *p)
{
  PetscReal best = reach, at = 0, n[2];
  PetscInt  which = -1;

  for (PetscInt i = c->first[loop]; i < c->first[loop + 1]; i++) {
    const PetscInt  e    = c->edge[i];
    const PetscReal far2 = EdgeDistance2(x, c->ball[e]);
    PetscReal       t, y[2], d[2], far;

    if (c->wall[e] || far2 > PetscSqr(best + c->ball[e][2])) continue;
    t = EdgeClosest(c->x[e], x);
    EdgeEvaluate(c->x[e], t, y, d);
    far = PetscSqrtReal(EdgeDistance2(x, y));
    if (far >= best) continue;
    best    = far;
    which   = e;
    at      = t;
    p->y[0] = y[0];
    p->y[1] = y[1];
  }
  if (which < 0) return PETSC_FALSE;
  if (PetscAbsReal(at) == 1) normal_at_end(c, which, at, n);
  else EdgeNormal(c->x[which], at, n);
  p->edge = which;
  p->d    = (x[0] - p->y[0]) * n[0] + (x[1] - p->y[1]) * n[1] < 0 ? -best : best;
  if (best > NEAR * c->ball[which][2] && closes(c, loop)) {
    const PetscInt turns = count_turns(c, loop, x);

    p->d = (c->area[loop] < 0 ? turns >= 0 : turns > 0) ? -best : best;
  }
  return PETSC_TRUE;
}

void PhaseCurveClosest(const PhaseCurve *c, const PetscReal x[2], PetscReal reach, PhasePoint *p)
{
  PhasePoint is;

  *p = (PhasePoint){.d = reach, .edge = -1};
  if (EdgeDistance2(x, c->whole) > PetscSqr(reach + c->whole[2])) return;
  for (PetscInt hole = 0; hole < 2; hole++)
    for (PetscInt l = 0; l < c->nloop; l++) {
      if ((c->area[l] < 0) != hole || !search_loop(c, l, x, reach, &is)) continue;
      if (p->edge < 0 || (hole ? is.d > p->d : is.d < p->d)) *p = is;
    }
}

/* Cosine between the edge's normal and a direction */
static PetscReal faces(PetscReal (*const p)[2], const PetscReal out[2])
{
  const PetscReal n[2] = {p[2][1] - p[0][1], p[0][0] - p[2][0]};
  const PetscReal size = PetscHypotReal(n[0], n[1]) * PetscHypotReal(out[0], out[1]);

  return size > 0 ? (n[0] * out[0] + n[1] * out[1]) / size : 0;
}

void PhaseCurveApproach(const PhaseCurve *c, const PetscReal x[2], const PetscReal out[2], PhasePoint *p)
{
  *p = (PhasePoint){.d = PETSC_MAX_REAL / 4, .edge = -1};
  for (PetscInt e = 0; e < c->n; e++) {
    PetscReal y[2], d[2], far;

    if (c->wall[e] || EdgeDistance2(x, c->ball[e]) > PetscSqr(p->d + c->ball[e][2])) continue;
    if (out && faces(c->x[e], out) < AGAINST) continue;
    EdgeEvaluate(c->x[e], EdgeClosest(c->x[e], x), y, d);
    far = PetscSqrtReal(EdgeDistance2(x, y));
    if (far >= p->d) continue;
    *p = (PhasePoint){.d = far, .y = {y[0], y[1]}, .edge = e};
  }
  if (p->edge < 0 && out) PhaseCurveApproach(c, x, NULL, p);
}

void PhaseCurveMeasure(const PhaseCurve *c, PetscInt drop, PhaseSums *s)
{
  PetscReal o[2] = {0, 0}, first[2] = {0, 0}, second[3] = {0, 0, 0};
  PetscBool found = PETSC_FALSE;

  *s = (PhaseSums){0};
  for (PetscInt e = 0; e < c->n; e++) {
    if (c->drop[e] != drop) continue;
    for (PetscInt a = 0; a < 2 && !found; a++) o[a] = c->x[e][0][a];
    found = PETSC_TRUE;
    for (PetscInt g = 0; g < EDGE_NGAUSS; g++) {
      PetscReal y[2], d[2], n[2];

      EdgeEvaluate(c->x[e], EDGE_GAUSS[g], y, d);
      for (PetscInt a = 0; a < 2; a++) y[a] -= o[a];
      n[0] = EDGE_WEIGHT[g] * d[1];
      n[1] = -EDGE_WEIGHT[g] * d[0];
      s->area += 0.5 * (y[0] * n[0] + y[1] * n[1]);
      *(c->wall[e] ? &s->wet : &s->length) += EDGE_WEIGHT[g] * PetscHypotReal(d[0], d[1]);
      for (PetscInt a = 0; a < 2; a++) first[a] += 0.5 * y[a] * y[a] * n[a];
      for (PetscInt a = 0; a < 2; a++) second[a] += y[a] * y[a] * y[a] / 3 * n[a];
      second[2] += 0.25 * y[0] * y[1] * (y[0] * n[0] + y[1] * n[1]);
    }
  }
  if (s->area == 0) return;
  for (PetscInt a = 0; a < 2; a++) first[a] /= s->area;
  for (PetscInt a = 0; a < 2; a++) s->centre[a] = o[a] + first[a];
  for (PetscInt a = 0; a < 3; a++)
    s->second[a] = second[a] / s->area - (a < 2 ? first[a] * first[a] : first[0] * first[1]);
}

/* By what node j of edge e moves if the curve is shifted by 1 */
static void shift_of_node(const PhaseCurve *c, PetscInt e, PetscInt j, PetscReal n[2])
{
  const PetscInt other = j == 0 ? c->before[e] : c->next[e];
  PetscReal      size;

  if (j == 1 && !c->wall[e]) {
    EdgeNormal(c->x[e], 0, n);
    return;
  }
  n[0] = n[1] = 0;
  if (c->wall[e] && (j == 1 || c->wall[other])) return; /* stays */
  normal_at_end(c, e, (PetscReal)(j - 1), n);
  size = PetscHypotReal(n[0], n[1]);
  if (size == 0) return;
  /* along a wall farther, as the curve meets it at an angle */
  if (c->wall[other] != c->wall[e]) size *= PetscMax(FLAT, size);
  n[0] /= size;
  n[1] /= size;
}

PetscErrorCode PhaseCurveKeep(const PhaseCurve *from, const PetscBool stays[], PhaseCurve *to)
{
  PetscInt *left, n = 0; /* [n] number of what stays */

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(from->n, &left));
  for (PetscInt e = 0; e < from->n; e++) left[e] = !stays || stays[e] ? n++ : -1;
  PetscCall(PhaseCurveCreate(n, to));
  for (PetscInt e = 0; e < from->n; e++) {
    PetscInt next = from->next[e];

    if (left[e] < 0) continue;
    while (left[next] < 0) next = from->next[next];
    PetscCall(PetscArraycpy(&to->x[left[e]], &from->x[e], 1));
    to->drop[left[e]]      = from->drop[e];
    to->wall[left[e]]      = from->wall[e];
    to->next[left[e]]      = left[next];
    to->before[left[next]] = left[e];
  }
  PhaseCurveLink(to);
  PetscCall(PetscFree(left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseCurveRemove(PhaseCurve *c, PetscInt drop)
{
  PhaseCurve left;
  PetscBool *stays;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->n, &stays));
  for (PetscInt e = 0; e < c->n; e++) stays[e] = (PetscBool)(c->drop[c->edge[c->first[c->loop[e]]]] != drop);
  PetscCall(PhaseCurveKeep(c, stays, &left));
  PetscCall(PetscFree(stays));
  PetscCall(PhaseCurveDestroy(c));
  *c = left;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PhaseCurveShift(PhaseCurve *c, PetscInt drop, PetscReal way)
{
  PetscReal(*n)[3][2];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->n, &n));
  for (PetscInt e = 0; e < c->n; e++) {
    for (PetscInt j = 0; j < 3; j++) shift_of_node(c, e, j, n[e][j]);
    for (PetscInt a = 0; a < 2 && c->wall[e]; a++) n[e][1][a] = 0.5 * (n[e][0][a] + n[e][2][a]);
  }
  for (PetscInt e = 0; e < c->n; e++)
    for (PetscInt i = 0; i < 6 && c->drop[e] == drop; i++) c->x[e][i / 2][i % 2] += way * n[e][i / 2][i % 2];
  PetscCall(PetscFree(n));
  PetscFunctionReturn(PETSC_SUCCESS);
}
