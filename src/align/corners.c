/* Align, corners: in the plane a wall vertex lies on every corner of a surface.

   Closest points alone cut a corner off, unless a vertex happens to have it as its closest point. So each corner takes
   the wall vertex whose closest point is nearest to it (ties: the vertex itself, then its place), and the next two
   along the wall on either side are spread between it and the others: more than one may have had the corner as closest
   point.
   Where the fluid turns round a corner its velocity goes as r^lambda, lambda .5 to .6 for fluid angles of 360 to 270
   degrees: middle nodes near a quarter of the edges from there, instead of half, have such functions in the space
   (Barsoum 1976, Henshell & Shaw 1975). Without, the lift of a beam is half a per cent off, and its sign is that of the
   mesh (runs/studies/aligned-corners).
   A corner is left as it is where no wall vertex is within a cell of it, another one of its surface is too close, or
   the wall is drawn back from another. In space: edges.c. */
#include "compat.h"
#include "impl.h"

#define REACH   1.0  /* farthest place of the vertex that a corner takes, cells */
#define APART   0.3  /* corners closer than that share a vertex, cells */
#define NROUND  4    /* corners that lost their vertex to another choose again */
#define NSLIDE  12   /* Jacobi sweeps along the wall */
#define NEXT    2    /* vertices on either side */
#define AROUND  32   /* points that tell the angle of a corner */
#define NEAREST 0.3  /* see above; 1/4 would make the Jacobian zero at the corner */
#define EXACT   1e-2 /* of a cell: a vertex that is held is on a corner */
#define BEND    0.2  /* a mid-edge node farther from the chord is on another side, lengths of the edge */

typedef enum {
  OPEN,
  TAKEN, /* a vertex lies on it */
  LEFT
} Outcome;

/* All corners of the surfaces that are followed, the same on all ranks that know the surface */
typedef struct {
  PetscInt   n, *first, *surface; /* those of surface k: first[k] to first[k + 1] */
  PetscInt   max;                 /* of a surface, on any rank */
  PetscReal *x;                   /* [n][2] in space */
  PetscReal *score;               /* [n] of the best vertex of all ranks, the least */
  PetscInt  *vertex;              /* [n] own vertex that has this score, -1: none */
  PetscInt  *outcome;             /* [n] */
} Corners;

static PetscErrorCode list_corners(Align s, Corners *c)
{
  const AlignSurfaces *f   = s->surfaces;
  PetscReal            max = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(s->n + 1, &c->first));
  c->first[0] = 0;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscInt n = 0;

    s->corners.count[k] = s->corners.taken[k] = 0;
    if (s->aligned[k] && !s->paths.is[k] && f->corners) PetscCall(f->corners(f->ctx, k, 0, &n, NULL));
    s->corners.count[k] = n;
    c->first[k + 1]     = c->first[k] + (s->corners.wanted[k] ? n : 0);
  }
  for (PetscInt k = 0; k < s->n; k++) max = PetscMax(max, (PetscReal)(c->first[k + 1] - c->first[k]));
  PetscCall(AlignMax(s, &max));
  c->max = (PetscInt)max;
  c->n   = c->first[s->n];
  PetscCall(PetscMalloc5(2 * c->n, &c->x, c->n, &c->score, c->n, &c->vertex, c->n, &c->surface, c->n, &c->outcome));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscInt n;

    if (c->first[k + 1] > c->first[k])
      PetscCall(f->corners(f->ctx, k, s->corners.count[k], &n, c->x + 2 * c->first[k]));
    for (PetscInt i = c->first[k]; i < c->first[k + 1]; i++) {
      c->surface[i] = k;
      c->outcome[i] = OPEN;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The vertices before and after own vertex i on the wall; false: there are not two */
static PetscBool next_on_wall(Align s, PetscInt i, PetscInt next[2])
{
  PetscInt       ends[3] = {i, i, i};
  const PetscInt n       = AlignEdgesAt(s, i, PETSC_FALSE, 3, ends);

  next[0] = ends[0];
  next[1] = ends[1];
  return (PetscBool)(n == 2);
}

/* Distance of wall vertex i, displaced or not, from point x of its surface */
static PetscReal separation(Align s, PetscInt i, PetscBool displaced, const PetscReal x[])
{
  PetscReal r[2];

  AlignOffset(s, (s->code[i] - 1) / 2, x, i, PETSC_FALSE, r);
  for (PetscInt a = 0; a < 2; a++) r[a] += displaced ? s->d[2 * i + a] : 0;
  return PetscSqrtReal(r[0] * r[0] + r[1] * r[1]);
}

/* How well does vertex i suit a corner? In steps far coarser than round-off; a share of one step by its place, so that
   no two vertices are alike and all partitions decide alike. */
static PetscReal rate_vertex(Align s, PetscInt i, const PetscReal corner[])
{
  const MeshLocal *l = s->loc;
  const PetscReal  h = s->grid.size[i], at = separation(s, i, PETSC_TRUE, corner) / h,
                  from = separation(s, i, PETSC_FALSE, corner) / h;
  PetscReal tie        = 0;

  if (at > (s->grid.held[i] ? EXACT : REACH)) return PETSC_MAX_REAL;
  for (PetscInt a = 0; a < 2; a++)
    tie += (a ? 0.191 : 0.309) * (l->x_start[2 * i + a] - l->lower[a]) / (l->upper[a] - l->lower[a]);
  return PetscFloorReal(1e4 * (at + 0.1 * from) + 0.5) + tie;
}

static void rate_vertices(Align s, PetscInt n, const PetscInt own[], Corners *c)
{
  for (PetscInt i = 0; i < c->n; i++) {
    c->score[i]  = PETSC_MAX_REAL;
    c->vertex[i] = -1;
  }
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt k = (s->code[own[e]] - 1) / 2;
    PetscInt       next[2];

    if (c->first[k + 1] == c->first[k] || s->corners.at[own[e]] > 0 || !next_on_wall(s, own[e], next)) continue;
    for (PetscInt i = c->first[k]; i < c->first[k + 1]; i++) {
      const PetscReal score = c->outcome[i] == OPEN ? rate_vertex(s, own[e], c->x + 2 * i) : PETSC_MAX_REAL;

      if (score >= c->score[i]) continue;
      c->score[i]  = score;
      c->vertex[i] = own[e];
    }
  }
}

/* Own vertex i is the best one for a corner: can it go there? */
static PetscErrorCode check_vertex(Align s, const Corners *c, PetscInt corner, PetscInt *outcome)
{
  const PetscInt  i = c->vertex[corner], k = c->surface[corner];
  const PetscReal h = s->grid.size[i];
  PetscReal       gap[2];

  PetscFunctionBeginUser;
  *outcome = TAKEN;
  for (PetscInt j = c->first[k]; j < c->first[k + 1]; j++) {
    if (c->vertex[j] == i && c->score[j] < c->score[corner]) *outcome = OPEN;
    if (j < corner &&
        PetscHypotReal(c->x[2 * j] - c->x[2 * corner], c->x[2 * j + 1] - c->x[2 * corner + 1]) < APART * h)
      *outcome = LEFT;
    if (*outcome == LEFT) PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ClearanceMeasure(s->clearance, s->aligned, k, c->x + 2 * corner, gap));
  if (AlignFilmGapOffset(gap[0], CLEAR * h) > 0 || AlignFilmGapOffset(gap[1], CLEAR * h) > 0) *outcome = LEFT;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where on the edges from a corner of surface k their middle nodes go: towards it where the fluid turns round it, see
   above; *at as a share of the edge */
static PetscErrorCode place_middles(Align s, PetscInt k, const PetscReal corner[], PetscReal h, PetscReal *at)
{
  PetscReal x[2 * AROUND], d[AROUND];
  PetscInt  inside = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < AROUND; i++) {
    x[2 * i]     = corner[0] + 0.05 * h * PetscCosReal(2 * PETSC_PI * (PetscReal)i / AROUND);
    x[2 * i + 1] = corner[1] + 0.05 * h * PetscSinReal(2 * PETSC_PI * (PetscReal)i / AROUND);
  }
  PetscCall(AlignDistance(s, k, AlignCentreOf(s, k), AROUND, x, d));
  for (PetscInt i = 0; i < AROUND; i++) inside += d[i] < 0;
  *at = 0.5 - (0.5 - NEAREST) * PetscMax(0, PetscMin(1, 2 - 4 * (PetscReal)inside / AROUND));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* v [n] becomes the largest of all ranks */
static PetscErrorCode take_largest(Align s, const Corners *c, PetscReal v[])
{
  PetscReal *row;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(s->n * c->max, &row));
  for (PetscInt i = 0; i < c->n; i++) row[c->surface[i] * c->max + i - c->first[c->surface[i]]] = v[i];
  PetscCall(AlignMaxLocal(s, c->max, row));
  for (PetscInt i = 0; i < c->n; i++) v[i] = row[c->surface[i] * c->max + i - c->first[c->surface[i]]];
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One round: open corners choose among the n own wall vertices; *any: is one still open? */
static PetscErrorCode choose_vertices(Align s, PetscInt n, const PetscInt own[], Corners *c, PetscBool *any)
{
  PetscReal *v;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(c->n, &v));
  rate_vertices(s, n, own, c);
  for (PetscInt i = 0; i < c->n; i++) v[i] = -c->score[i];
  PetscCall(take_largest(s, c, v));
  for (PetscInt i = 0; i < c->n; i++) {
    if (c->score[i] == PETSC_MAX_REAL || c->score[i] != -v[i]) c->vertex[i] = -1;
    c->score[i] = -v[i];
  }
  *any = PETSC_FALSE;
  for (PetscInt i = 0; i < c->n; i++) {
    if (c->outcome[i] != OPEN) continue;
    if (c->score[i] == PETSC_MAX_REAL) c->outcome[i] = LEFT;
    else if (c->vertex[i] >= 0) PetscCall(check_vertex(s, c, i, &c->outcome[i]));
  }
  for (PetscInt i = 0; i < c->n; i++) v[i] = (PetscReal)c->outcome[i];
  PetscCall(take_largest(s, c, v));
  for (PetscInt i = 0; i < c->n; i++) {
    c->outcome[i] = (PetscInt)v[i];
    *any          = (PetscBool)(*any || c->outcome[i] == OPEN);
    if (c->outcome[i] != TAKEN || c->vertex[i] < 0) continue;
    s->corners.at[c->vertex[i]] = 0.5; /* of one that is held: the fluid does not turn round it */
    if (!s->grid.held[c->vertex[i]])
      PetscCall(
        place_middles(s, c->surface[i], c->x + 2 * i, s->grid.size[c->vertex[i]], &s->corners.at[c->vertex[i]]));
    PetscCall(AlignListAdd(&s->corners.node, c->vertex[i]));
    AlignOffset(s, c->surface[i], c->x + 2 * i, c->vertex[i], PETSC_FALSE, s->d + 2 * c->vertex[i]);
    for (PetscInt a = 0; a < 2; a++) s->d[2 * c->vertex[i] + a] *= s->grid.held[c->vertex[i]] ? 0 : -1;
  }
  PetscCall(PetscFree(v));
  PetscCall(AlignAny(s, any));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Tell the ghosts which vertices are on corners, and list the n own wall vertices that are at most NEXT away: their
   number on the way is in s->work meanwhile */
static PetscErrorCode list_neighbours(Align s, PetscInt n, const PetscInt own[], List *near)
{
  const MeshLocal *l       = s->loc;
  List             reached = {0, 0, NULL};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->corners.node.n; e++) s->work[s->corners.node.i[e]] = 1;
  PetscCall(MeshSyncNodes(s->mesh, 1, s->corners.at));
  for (PetscInt step = 1; step <= NEXT + 1; step++) {
    PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
    for (PetscInt e = 0; e < n && step <= NEXT; e++) {
      PetscInt next[2];

      if (s->work[own[e]] != 0 || !next_on_wall(s, own[e], next)) continue;
      if (s->work[next[0]] == step || s->work[next[1]] == step) PetscCall(AlignListAdd(&reached, own[e]));
    }
    for (PetscInt e = near->n; e < reached.n; e++) {
      s->work[reached.i[e]] = step + 1;
      PetscCall(AlignListAdd(near, reached.i[e]));
    }
  }
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];

    if (i >= l->nnode && s->corners.at[i] > 0) PetscCall(AlignListAdd(&s->corners.node, i));
    s->work[i] = 0;
  }
  PetscCall(PetscFree(reached.i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own wall vertices beside corners: again and again half way between their neighbours, then to the closest point */
static PetscErrorCode slide(Align s, const List *near)
{
  const MeshLocal *l = s->loc;
  PetscReal       *mean;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * near->n, &mean));
  for (PetscInt sweep = 0; sweep < NSLIDE; sweep++) {
    PetscCall(MeshSyncNodes(s->mesh, 2, s->d));
    for (PetscInt e = 0; e < near->n; e++) {
      const PetscInt i = near->i[e];
      PetscInt       next[2];

      (void)next_on_wall(s, i, next);
      for (PetscInt a = 0; a < 2; a++) {
        mean[2 * e + a] = 0;
        for (PetscInt v = 0; v < 2; v++)
          mean[2 * e + a] += 0.5 * (MeshNearest(l, a, l->x_start[2 * next[v] + a] - l->x_start[2 * i + a]) +
                                    s->d[2 * next[v] + a]);
      }
    }
    for (PetscInt e = 0; e < 2 * near->n; e++) s->d[2 * near->i[e / 2] + e % 2] = mean[e];
    PetscCall(AlignProjectNodes(s, near->n, near->i, PETSC_FALSE));
  }
  PetscCall(PetscFree(mean));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPlaceCorners(Align s, PetscInt n, const PetscInt own[])
{
  Corners   c;
  List      near = {0, 0, NULL};
  PetscBool any;

  PetscFunctionBeginUser;
  PetscCall(list_corners(s, &c));
  any = (PetscBool)(c.max > 0);
  for (PetscInt round = 0; any && round < NROUND; round++) PetscCall(choose_vertices(s, n, own, &c, &any));
  for (PetscInt i = 0; i < c.n; i++) s->corners.taken[c.surface[i]] += c.outcome[i] == TAKEN;
  if (c.max) {
    PetscCall(list_neighbours(s, n, own, &near));
    PetscCall(slide(s, &near));
  }
  PetscCall(PetscFree(near.i));
  PetscCall(PetscFree(c.first));
  PetscCall(PetscFree5(c.x, c.score, c.vertex, c.surface, c.outcome));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void AlignPlaceOnChord(Align s, PetscInt a, PetscInt b, PetscReal d[])
{
  const PetscInt  dim = s->loc->dim;
  const PetscReal at  = s->corners.at[a] > 0 ? s->corners.at[a] : s->corners.at[b];

  for (PetscInt e = 0; e < dim; e++) d[e] = 0.5 * (s->d[dim * a + e] + s->d[dim * b + e]);
  if (at == 0 || (s->corners.at[a] > 0 && s->corners.at[b] > 0)) return;
  for (PetscInt e = 0; e < dim; e++) {
    const PetscReal edge = MeshNearest(s->loc, e, s->loc->x_start[dim * b + e] - s->loc->x_start[dim * a + e]) +
                           s->d[dim * b + e] - s->d[dim * a + e];

    d[e] += (0.5 - at) * (s->corners.at[b] > 0 ? edge : -edge);
  }
}

void AlignKeepSides(Align s, PetscInt n, const PetscInt list[])
{
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt i = list[e];
    PetscInt       end[2];
    PetscReal      chord[2], off[2], edge[2];

    if (s->grid.kind[i] != NODE_EDGE) continue;
    AlignEdgeEnds(s, i, end);
    if (s->corners.at[end[0]] == 0 && s->corners.at[end[1]] == 0) continue;
    AlignPlaceOnChord(s, end[0], end[1], chord);
    for (PetscInt a = 0; a < 2; a++) {
      off[a]  = s->d[2 * i + a] - chord[a];
      edge[a] = MeshNearest(s->loc, a, s->loc->x_start[2 * end[1] + a] - s->loc->x_start[2 * end[0] + a]) +
                s->d[2 * end[1] + a] - s->d[2 * end[0] + a];
    }
    if (PetscHypotReal(off[0], off[1]) <= BEND * PetscHypotReal(edge[0], edge[1])) continue;
    for (PetscInt a = 0; a < 2; a++) s->d[2 * i + a] = chord[a];
  }
}
