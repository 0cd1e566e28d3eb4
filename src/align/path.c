/* Align, surfaces thinner than a cell: their mid-line (midline.h) becomes a path of edges, see align/align.h.

   The vertices and edges of the cells around such a surface are few; every rank gets all of them and finds the same
   path (graph.h), so that the path does not depend on the partition. The path of a tip that is beyond a side of the
   domain or close to it, as that of a flap hinged at a wall, ends at a vertex of that side, which stays where it is
   and belongs to the wall. Its last edge goes there from the mid-line, and nothing leaks (a squeezed cell between
   tip and wall does worse: runs/studies/boundary). All of this happens in the frame of the surface. */
#include "compat.h"
#include "graph.h"
#include "impl.h"
#include "base/sparse.h"

#define LONG    3   /* smallest length, cell sizes */
#define BAND    1.3 /* cells with their centre that close to the surface are searched, cell sizes */
#define AT_SIDE 0.4 /* that close to a side of the domain it ends there, cell sizes */
#define BESIDE  3   /* as far as that from the surface, cells have a side */

static Midline line_of(Align s, PetscInt k)
{
  return s->paths.line[k];
}

/* ---- frames ---- */

/* From the place of local node i, as the image that is nearest to the surface, into the frame of surface k: that of its
   shape, in true lengths */
static PetscErrorCode into_frame(Align s, PetscInt k, PetscInt i, PetscReal y[2])
{
  const MeshLocal *l = s->loc;
  PetscReal        R[9], centre[2], r[2];

  PetscFunctionBeginUser;
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (PetscInt a = 0; a < 2; a++) r[a] = MeshNearest(l, a, l->x_start[2 * i + a] - AlignCentreOf(s, k)[a]);
  for (PetscInt a = 0; a < 2; a++) y[a] = R[a] * r[0] + R[3 + a] * r[1] + centre[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the frame of surface k to the place beside the surface as it is drawn */
static PetscErrorCode out_of_frame(Align s, PetscInt k, const PetscReal y[2], PetscReal x[2])
{
  PetscReal R[9], centre[2];

  PetscFunctionBeginUser;
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (PetscInt a = 0; a < 2; a++)
    x[a] = AlignCentreOf(s, k)[a] + R[3 * a] * (y[0] - centre[0]) + R[3 * a + 1] * (y[1] - centre[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Displacement of node i to the point at length t of the mid-line of surface k; x: that place beside the drawn
   surface */
static PetscErrorCode offset_to_line(Align s, PetscInt k, PetscInt i, PetscReal t, PetscReal d[2], PetscReal x[2])
{
  PetscReal R[9], centre[2], to[2], from[2];

  PetscFunctionBeginUser;
  PetscCall(MidlinePoint(line_of(s, k), 1, &t, to));
  PetscCall(into_frame(s, k, i, from));
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (PetscInt a = 0; a < 2; a++) d[a] = R[3 * a] * (to[0] - from[0]) + R[3 * a + 1] * (to[1] - from[1]);
  PetscCall(out_of_frame(s, k, to, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bounding radius of surface k and a margin around it */
static PetscReal radius_with(Align s, PetscInt k, PetscReal margin)
{
  return s->surfaces->radius[k] + margin;
}

/* ---- which surfaces ---- */

/* Smallest cell along surface k as far as this rank knows it */
static PetscErrorCode smallest_cell(Align s, PetscInt k, PetscReal *size)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = radius_with(s, k, s->paths.coarsest);

  PetscFunctionBeginUser;
  for (DomainImages image = {0}; MeshNextImage(l, AlignCentreOf(s, k), radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      PetscReal d;

      if (s->grid.kind[list[e]] != NODE_CENTRE || list[e] >= l->nnode || s->grid.size[list[e]] >= *size) continue;
      PetscCall(AlignDistance(s, k, image.at, 1, l->x_start + 2 * list[e], &d));
      if (d < 0.5 * s->grid.size[list[e]]) *size = s->grid.size[list[e]];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathChoose(Align s, const PetscBool wanted[])
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    s->paths.is[k] = PETSC_FALSE;
    if (!wanted[k] || !line_of(s, k)) continue;
    if (!any) {
      for (PetscInt j = 0; j < s->n; j++) s->paths.smallest[j] = PETSC_MAX_REAL;
    }
    any = PETSC_TRUE;
    PetscCall(smallest_cell(s, k, &s->paths.smallest[k]));
  }
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) s->paths.smallest[k] = -s->paths.smallest[k];
  PetscCall(AlignMaxLocal(s, 1, s->paths.smallest));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal length, thickness;

    s->paths.smallest[k] = -s->paths.smallest[k];

    if (!wanted[k] || !line_of(s, k) || s->paths.smallest[k] == PETSC_MAX_REAL) continue;
    PetscCall(MidlineGetSize(line_of(s, k), &length, &thickness));
    s->paths.is[k] = (PetscBool)(thickness < ALIGN_THIN * s->paths.smallest[k] && length > LONG * s->paths.smallest[k]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the cells around a surface, on all ranks ---- */

static PetscErrorCode add_record(Align s, PetscInt k, PetscInt c, PetscInt *n, PetscInt *capacity, PetscReal **record)
{
  const PetscInt *node = AlignCellNodes(s, c);
  PetscReal      *r;

  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(*n + 1, capacity, record, ALIGN_RECORD * sizeof(**record), NULL));
  r    = *record + ALIGN_RECORD * (*n)++;
  r[0] = (PetscReal)s->surfaces->number[k];
  r[1] = s->grid.size[node[4]];
  for (PetscInt v = 0; v < 4; v++) {
    const PetscInt i = node[CORNER[v]];

    r[2 + 4 * v] = (PetscReal)s->loc->node_global[i];
    PetscCall(into_frame(s, k, i, r + 3 + 4 * v));
    r[5 + 4 * v] = s->code[i] ? CORNER_TAKEN : s->grid.side[i] ? CORNER_SIDE : CORNER_FREE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells around the surfaces that are to be paths */
static PetscErrorCode collect_records(Align s, PetscInt *count, PetscReal **record)
{
  const MeshLocal *l        = s->loc;
  PetscInt         capacity = 0;

  PetscFunctionBeginUser;
  *count  = 0;
  *record = NULL;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal radius = radius_with(s, k, BAND * s->paths.coarsest);

    if (!s->aligned[k] || !s->paths.is[k]) continue;
    for (DomainImages image = {0}; MeshNextImage(l, AlignCentreOf(s, k), radius, &image);) {
      const PetscInt *list;
      PetscInt        n;

      PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
      for (PetscInt e = 0; e < n; e++) {
        PetscReal d;

        if (s->grid.kind[list[e]] != NODE_CENTRE || list[e] >= l->nnode) continue;
        PetscCall(AlignDistance(s, k, image.at, 1, l->x_start + 2 * list[e], &d));
        if (d < BAND * s->grid.size[list[e]])
          PetscCall(add_record(s, k, l->centre_cell[list[e]], count, &capacity, record));
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Replace the records of this rank by those of all ranks */
static PetscErrorCode share_records(Align s, PetscInt *count, PetscReal **record)
{
  PetscReal *own = *record;

  PetscFunctionBeginUser;
  PetscCall(SparseGather(s->comm, *count, ALIGN_RECORD * sizeof(*own), own, count, record, NULL));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the path ---- */

/* Corners that the path of another surface has taken */
static PetscErrorCode block_paths(Align s, PetscInt k, Graph *g)
{
  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < k; j++) {
    const AlignPath *p     = s->paths.of + j;
    const PetscReal  reach = s->surfaces->radius[j] + s->surfaces->radius[k] + 2 * ALIGN_NEAR * s->paths.coarsest;
    PetscReal        d2    = 0;

    if (!p->n) continue;
    for (PetscInt a = 0; a < 2; a++) {
      const PetscReal r = MeshNearest(s->loc, a, AlignCentreOf(s, j)[a] - AlignCentreOf(s, k)[a]);

      d2 += r * r;
    }
    for (PetscInt i = 0; i < g->ncorner && d2 < reach * reach; i++) {
      PetscInt at;

      PetscCall(PetscFindInt(g->corner[i].id, p->n, p->id, &at));
      if (at >= 0) g->corner[i].kind = CORNER_TAKEN;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* On what corners the path of surface k ends, one tip at y in the surface frame */
static PetscErrorCode choose_end(Align s, PetscInt k, const PetscReal y[2], PetscReal size, CornerKind *kind)
{
  PetscReal x[2], gap[2];

  PetscFunctionBeginUser;
  PetscCall(out_of_frame(s, k, y, x));
  PetscCall(ClearanceMeasure(s->clearance, s->aligned, k, x, gap));
  *kind = gap[1] < AT_SIDE * size ? CORNER_SIDE : CORNER_FREE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The path of surface k from the records of all ranks, or none */
static PetscErrorCode choose_path(Align s, PetscInt k, PetscInt count, const PetscReal record[], Graph *g)
{
  AlignPath *p = s->paths.of + k;
  PetscInt  *from, last, n = 0;
  PetscReal *cost, length, end[2], tip[4];
  PetscBool *done;
  CornerKind kind[2];

  PetscFunctionBeginUser;
  PetscCall(MidlineGetSize(line_of(s, k), &length, NULL));
  end[0] = 0;
  end[1] = length;
  PetscCall(MidlinePoint(line_of(s, k), 2, end, tip));
  PetscCall(AlignGraphListCorners(line_of(s, k), s->surfaces->number[k], count, record, g));
  PetscCall(block_paths(s, k, g));
  PetscCall(AlignGraphListEdges(s->surfaces->number[k], count, record, g));
  PetscCall(PetscMalloc3(g->ncorner, &from, g->ncorner, &cost, g->ncorner, &done));
  for (PetscInt e = 0; e < 2; e++) PetscCall(choose_end(s, k, tip + 2 * e, g->size, &kind[e]));
  PetscCall(AlignGraphFindPath(g, tip, kind, from, cost, done, &last));
  for (PetscInt i = last; i >= 0; i = from[i]) n++;
  if (n >= LONG) {
    PetscReal *t;

    PetscCall(PetscMalloc3(n, &p->id, n, &p->index, n, &t));
    p->t = t;
    p->n = n;
    for (PetscInt i = last, j = n - 1; i >= 0; i = from[i], j--) {
      p->id[j]    = g->corner[i].id;
      p->index[j] = j;
      t[j]        = g->corner[i].s;
    }
    PetscCall(AlignGraphSpread(n, length, t));
    PetscCall(PetscSortIntWithArray(n, p->id, p->index));
  }
  PetscCall(PetscFree3(from, cost, done));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode clear_paths(Align s)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    if (s->paths.of[k].n) PetscCall(PetscFree3(s->paths.of[k].id, s->paths.of[k].index, s->paths.of[k].t));
    s->paths.of[k].n = 0;
  }
  s->paths.edge.n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- local nodes of the paths ---- */

/* Number of local vertex i along path p, or -1 */
static PetscErrorCode find_on_path(Align s, const AlignPath *p, PetscInt i, PetscInt *at)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFindInt(s->loc->node_global[i], p->n, p->id, at));
  *at = *at >= 0 ? p->index[*at] : -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Length along the mid-line where local node i belongs on path p, -1: it is not on it */
static PetscErrorCode place_on_path(Align s, const AlignPath *p, PetscInt i, PetscReal *t)
{
  PetscInt end[2], at[2];

  PetscFunctionBeginUser;
  *t = -1;
  if (s->grid.kind[i] == NODE_CENTRE) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->grid.kind[i] == NODE_VERTEX) {
    PetscCall(find_on_path(s, p, i, at));
    if (at[0] >= 0) *t = p->t[at[0]];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  AlignEdgeEnds(s, i, end);
  for (PetscInt v = 0; v < 2; v++) PetscCall(find_on_path(s, p, end[v], &at[v]));
  if (at[0] >= 0 && at[1] >= 0 && PetscAbsInt(at[0] - at[1]) == 1) *t = 0.5 * (p->t[at[0]] + p->t[at[1]]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Away from other walls in narrow gaps, as draw_back() with walls: changes d for node i at place x of the line */
static PetscErrorCode draw_aside(Align s, PetscInt k, PetscInt i, const PetscReal x[2], PetscReal d[2])
{
  const PetscReal h = s->grid.size[i], step = 0.01 * h;
  PetscReal       gap[2];

  PetscFunctionBeginUser;
  PetscCall(ClearanceMeasure(s->clearance, s->aligned, k, x, gap));
  for (PetscInt w = 0; w < 2; w++) {
    const PetscReal back = (w ? 1 : 0.5) * AlignFilmGapOffset(gap[w], CLEAR * h);
    PetscReal       slope[2], size;

    if (back == 0) continue;
    for (PetscInt a = 0; a < 2; a++) {
      PetscReal y[2] = {x[0], x[1]}, g[2][2];

      for (PetscInt e = 0; e < 2; e++) {
        y[a] = x[a] + (e ? step : -step);
        PetscCall(ClearanceMeasure(s->clearance, s->aligned, k, y, g[e]));
      }
      slope[a] = g[1][w] - g[0][w];
    }
    size = PetscMax(PetscSqrtReal(PetscSqr(slope[0]) + PetscSqr(slope[1])), 0.1 * step);
    for (PetscInt a = 0; a < 2; a++) d[a] += back * slope[a] / size;
    if (i < s->loc->nnode) s->tally.lost[k] += back * h;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the edge of mid-edge node i end on a side of the domain? */
static PetscBool ends_on_side(Align s, PetscInt i)
{
  PetscInt end[2];

  AlignEdgeEnds(s, i, end);
  return (PetscBool)(s->grid.side[end[0]] || s->grid.side[end[1]]);
}

/* Nodes of the path of surface k, which belong to it from now on; its vertices are ring 0 and get their displacement.
   Those on a side of the domain belong to that. */
static PetscErrorCode mark_path(Align s, PetscInt k)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = radius_with(s, k, 2 * ALIGN_NEAR * s->paths.coarsest);

  PetscFunctionBeginUser;
  for (DomainImages image = {0}; MeshNextImage(l, AlignCentreOf(s, k), radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt i = list[e];
      PetscReal      t, x[2];

      if (s->code[i] || s->grid.side[i]) continue;
      PetscCall(place_on_path(s, s->paths.of + k, i, &t));
      if (t < 0) continue;
      s->code[i] = 2 * k + 1;
      PetscCall(AlignListAdd(&s->marked, i));
      if (s->grid.kind[i] != NODE_VERTEX) {
        if (!ends_on_side(s, i)) PetscCall(AlignListAdd(&s->paths.edge, i));
        continue;
      }
      s->level[i] = 8 * k + 1;
      PetscCall(AlignListAdd(&s->ring, i));
      PetscCall(offset_to_line(s, k, i, t, s->d + 2 * i, x));
      PetscCall(draw_aside(s, k, i, x, s->d + 2 * i));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathPlaceVertices(Align s)
{
  PetscReal *record;
  PetscInt   count;
  PetscBool  any = PETSC_FALSE;
  Graph      g;

  PetscFunctionBeginUser;
  PetscCall(clear_paths(s));
  for (PetscInt k = 0; k < s->n; k++) any = (PetscBool)(any || (s->aligned[k] && s->paths.is[k]));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(collect_records(s, &count, &record));
  PetscCall(share_records(s, &count, &record));
  PetscCall(PetscMalloc2(4 * count, &g.corner, 8 * count, &g.edge));
  for (PetscInt k = 0; k < s->n; k++) {
    if (!s->aligned[k] || !s->paths.is[k]) continue;
    PetscCall(choose_path(s, k, count, record, &g));
    if (s->paths.of[k].n) PetscCall(mark_path(s, k));
  }
  PetscCall(PetscFree2(g.corner, g.edge));
  PetscCall(PetscFree(record));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathPlaceEdges(Align s)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->paths.edge.n; e++) {
    const PetscInt i = s->paths.edge.i[e], k = (s->code[i] - 1) / 2;
    PetscReal      t = 0, x[2];

    PetscCall(place_on_path(s, s->paths.of + k, i, &t));
    PetscCall(offset_to_line(s, k, i, t, s->d + 2 * i, x));
    PetscCall(draw_aside(s, k, i, x, s->d + 2 * i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sides ---- */

static PetscErrorCode find_sides(Align s, PetscInt k, PetscReal length)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = radius_with(s, k, (BESIDE + 1) * s->paths.coarsest);
  PetscReal        R[9], centre[2];

  PetscFunctionBeginUser;
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (DomainImages image = {0}; MeshNextImage(l, AlignCentreOf(s, k), radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt  i    = list[e];
      const PetscReal x[2] = {l->x_start[2 * i] + s->d[2 * i], l->x_start[2 * i + 1] + s->d[2 * i + 1]};
      PetscReal       y[2], t, d;

      PetscCall(AlignDistance(s, k, image.at, 1, x, &d));
      if (d > BESIDE * s->grid.size[i] || s->paths.node_side[i] || (s->code[i] && (s->code[i] - 1) / 2 == k)) continue;
      PetscCall(into_frame(s, k, i, y));
      for (PetscInt a = 0; a < 2; a++) y[a] += R[a] * s->d[2 * i] + R[3 + a] * s->d[2 * i + 1];
      PetscCall(MidlineProject(line_of(s, k), 1, y, &t, &d));
      if (t <= 0 || t >= length) continue;
      s->paths.node_side[i] = (d > 0 ? 1 : -1) * (s->surfaces->number[k] + 1);
      PetscCall(AlignListAdd(&s->paths.side_node, i));
      if (l->centre_cell[i] < 0) continue;
      s->paths.cell_side[0][l->centre_cell[i]] = s->paths.node_side[i];
      PetscCall(AlignListAdd(&s->paths.side_cell[0], l->centre_cell[i]));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathFindSides(Align s)
{
  const List older = s->paths.side_cell[1];
  PetscInt  *side  = s->paths.cell_side[1];

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < older.n; e++) side[older.i[e]] = 0;
  s->paths.cell_side[1]   = s->paths.cell_side[0];
  s->paths.side_cell[1]   = s->paths.side_cell[0];
  s->paths.cell_side[0]   = side;
  s->paths.side_cell[0]   = older;
  s->paths.side_cell[0].n = 0;
  for (PetscInt e = 0; e < s->paths.side_node.n; e++) s->paths.node_side[s->paths.side_node.i[e]] = 0;
  s->paths.side_node.n = 0;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal length;

    if (!s->aligned[k] || !s->paths.of[k].n) continue;
    PetscCall(MidlineGetSize(line_of(s, k), &length, NULL));
    PetscCall(find_sides(s, k, length));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode AlignPathBegin(Align s)
{
  const AlignSurfaces *f = s->surfaces;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->paths.line, s->n));
  PetscCall(PetscArrayzero(s->paths.is, s->n));
  PetscCall(PetscArrayzero(s->paths.of, s->n));
  for (PetscInt k = 0; k < s->n && f->midline && s->loc->dim == 2; k++)
    PetscCall(f->midline(f->ctx, k, ALIGN_THIN * s->paths.coarsest, &s->paths.line[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathEnd(Align s)
{
  PetscFunctionBeginUser;
  PetscCall(clear_paths(s));
  for (PetscInt k = 0; k < s->n; k++) PetscCall(MidlineDestroy(&s->paths.line[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathSetUp(Align s)
{
  PetscFunctionBeginUser;
  s->paths.coarsest = 0;
  for (PetscInt i = 0; i < s->loc->nnode; i++) s->paths.coarsest = PetscMax(s->paths.coarsest, s->grid.size[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &s->paths.coarsest, 1, MPIU_REAL, MPIU_MAX, s->comm));
  PetscCall(PetscCalloc1(s->loc->nnode_all, &s->paths.node_side));
  for (PetscInt j = 0; j < 2; j++) PetscCall(PetscCalloc1(s->loc->ncell_all, &s->paths.cell_side[j]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPathTearDown(Align s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->paths.node_side));
  for (PetscInt j = 0; j < 2; j++) PetscCall(PetscFree(s->paths.cell_side[j]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
