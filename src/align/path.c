/* Snap, bodies thinner than a cell: their mid-line (midline.h) becomes a path of edges, see align/align.h.

   The vertices and edges of the cells around such a body are few; every rank gets all of them and finds the same
   path (graph.h), so that the path does not depend on the partition. The path of a tip that is beyond a side of the
   domain or close to it, as that of a flap hinged at a wall, ends at a vertex of that side, which stays where it is
   and belongs to the wall. Its last edge goes there from the mid-line, and nothing leaks (a squeezed cell between
   tip and wall does worse: runs/studies/boundary). All of this happens in the frame of the body. */
#include "compat.h"
#include "graph.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/parcels.h"

#define LONG    3   /* smallest length, cell sizes */
#define BAND    1.3 /* cells with their centre that close to the body are searched, cell sizes */
#define AT_SIDE 0.4 /* that close to a side of the domain it ends there, cell sizes */
#define BESIDE  3   /* as far as that from the body, cells have a side */

static Midline line_of(Snap s, PetscInt k)
{
  return s->line[k];
}

/* ---- frames ---- */

/* From the place of local node i, as the image that is nearest to the body, into the frame of body k: that of its
   shape, in true lengths */
static PetscErrorCode into_body(Snap s, PetscInt k, PetscInt i, PetscReal y[2])
{
  const MeshLocal *l = s->loc;
  PetscReal        R[9], centre[2], r[2];

  PetscFunctionBeginUser;
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (PetscInt a = 0; a < 2; a++) r[a] = MeshNearest(l, a, l->x_start[2 * i + a] - SnapCentreOf(s, k)[a]);
  for (PetscInt a = 0; a < 2; a++) y[a] = R[a] * r[0] + R[3 + a] * r[1] + centre[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the frame of body k to the place beside the body as it is drawn */
static PetscErrorCode out_of_body(Snap s, PetscInt k, const PetscReal y[2], PetscReal x[2])
{
  PetscReal R[9], centre[2];

  PetscFunctionBeginUser;
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (PetscInt a = 0; a < 2; a++) x[a] = SnapCentreOf(s, k)[a] + R[3 * a] * (y[0] - centre[0]) + R[3 * a + 1] * (y[1] - centre[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Displacement of node i to the point at length t of the mid-line of body k; x: that place beside the drawn body */
static PetscErrorCode way_to_line(Snap s, PetscInt k, PetscInt i, PetscReal t, PetscReal d[2], PetscReal x[2])
{
  PetscReal R[9], centre[2], to[2], from[2];

  PetscFunctionBeginUser;
  PetscCall(MidlinePoint(line_of(s, k), 1, &t, to));
  PetscCall(into_body(s, k, i, from));
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (PetscInt a = 0; a < 2; a++) d[a] = R[3 * a] * (to[0] - from[0]) + R[3 * a + 1] * (to[1] - from[1]);
  PetscCall(out_of_body(s, k, to, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bounding radius of body k and a margin around it */
static PetscReal radius_with(Snap s, PetscInt k, PetscReal margin)
{
  return s->surfaces->radius[k] + margin;
}

/* ---- which bodies ---- */

/* Smallest cell along body k as far as this rank knows it */
static PetscErrorCode smallest_cell(Snap s, PetscInt k, PetscReal *size)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = radius_with(s, k, s->coarsest);

  PetscFunctionBeginUser;
  for (DomainImages image = {0}; MeshNextImage(l, SnapCentreOf(s, k), radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      PetscReal d;

      if (s->kind[list[e]] != NODE_CENTRE || list[e] >= l->nnode || s->size[list[e]] >= *size) continue;
      PetscCall(SnapDistance(s, k, image.at, 1, l->x_start + 2 * list[e], &d));
      if (d < 0.5 * s->size[list[e]]) *size = s->size[list[e]];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathChoose(Snap s, const PetscBool wanted[])
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    s->is_path[k] = PETSC_FALSE;
    if (!wanted[k] || !line_of(s, k)) continue;
    if (!any) {
      for (PetscInt j = 0; j < s->nbodies; j++) s->smallest[j] = PETSC_MAX_REAL;
    }
    any = PETSC_TRUE;
    PetscCall(smallest_cell(s, k, &s->smallest[k]));
  }
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->nbodies; k++) s->smallest[k] = -s->smallest[k];
  PetscCall(SnapMaxKnown(s, 1, s->smallest));
  for (PetscInt k = 0; k < s->nbodies; k++) {
    PetscReal length, thickness;

    s->smallest[k] = -s->smallest[k];

    if (!wanted[k] || !line_of(s, k) || s->smallest[k] == PETSC_MAX_REAL) continue;
    PetscCall(MidlineGetSize(line_of(s, k), &length, &thickness));
    s->is_path[k] = (PetscBool)(thickness < ALIGN_THIN * s->smallest[k] && length > LONG * s->smallest[k]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the cells around a body, on all ranks ---- */

static PetscErrorCode add_record(Snap s, PetscInt k, PetscInt c, PetscInt *n, PetscInt *room, PetscReal **record)
{
  const PetscInt *node = SnapCellNodes(s, c);
  PetscReal      *r;

  PetscFunctionBeginUser;
  PetscCall(RoomFor(*n + 1, room, record, SNAP_RECORD * sizeof(**record), NULL));
  r    = *record + SNAP_RECORD * (*n)++;
  r[0] = (PetscReal)s->surfaces->number[k];
  r[1] = s->size[node[4]];
  for (PetscInt v = 0; v < 4; v++) {
    const PetscInt i = node[CORNER[v]];

    r[2 + 4 * v] = (PetscReal)s->loc->node_global[i];
    PetscCall(into_body(s, k, i, r + 3 + 4 * v));
    r[5 + 4 * v] = s->code[i] ? CORNER_TAKEN : s->side[i] ? CORNER_SIDE : CORNER_FREE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own cells around the bodies that are to be paths */
static PetscErrorCode collect_records(Snap s, PetscInt *count, PetscReal **record)
{
  const MeshLocal *l    = s->loc;
  PetscInt         room = 0;

  PetscFunctionBeginUser;
  *count  = 0;
  *record = NULL;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    const PetscReal radius = radius_with(s, k, BAND * s->coarsest);

    if (!s->fitted[k] || !s->is_path[k]) continue;
    for (DomainImages image = {0}; MeshNextImage(l, SnapCentreOf(s, k), radius, &image);) {
      const PetscInt *list;
      PetscInt        n;

      PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
      for (PetscInt e = 0; e < n; e++) {
        PetscReal d;

        if (s->kind[list[e]] != NODE_CENTRE || list[e] >= l->nnode) continue;
        PetscCall(SnapDistance(s, k, image.at, 1, l->x_start + 2 * list[e], &d));
        if (d < BAND * s->size[list[e]]) PetscCall(add_record(s, k, l->centre_cell[list[e]], count, &room, record));
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Replace the records of this rank by those of all ranks */
static PetscErrorCode share_records(Snap s, PetscInt *count, PetscReal **record)
{
  PetscReal *own = *record;

  PetscFunctionBeginUser;
  PetscCall(ParcelsGather(s->comm, *count, SNAP_RECORD * sizeof(*own), own, count, record, NULL));
  PetscCall(PetscFree(own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the path ---- */

/* Corners that the path of another body has taken */
static PetscErrorCode block_paths(Snap s, PetscInt k, Graph *g)
{
  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < k; j++) {
    const SnapPath *p     = s->path + j;
    const PetscReal reach = s->surfaces->radius[j] + s->surfaces->radius[k] + 2 * SNAP_NEAR * s->coarsest;
    PetscReal       d2    = 0;

    if (!p->n) continue;
    for (PetscInt a = 0; a < 2; a++) {
      const PetscReal r = MeshNearest(s->loc, a, SnapCentreOf(s, j)[a] - SnapCentreOf(s, k)[a]);

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

/* On what corners the path of body k ends, one tip at y in the body frame */
static PetscErrorCode choose_end(Snap s, PetscInt k, const PetscReal y[2], PetscReal size, CornerKind *kind)
{
  PetscReal x[2], gap[2];

  PetscFunctionBeginUser;
  PetscCall(out_of_body(s, k, y, x));
  PetscCall(ClearanceMeasure(s->clearance, s->fitted, k, x, gap));
  *kind = gap[1] < AT_SIDE * size ? CORNER_SIDE : CORNER_FREE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The path of body k from the records of all ranks, or none */
static PetscErrorCode choose_path(Snap s, PetscInt k, PetscInt count, const PetscReal record[], Graph *g)
{
  SnapPath  *p = s->path + k;
  PetscInt  *from, last, n = 0;
  PetscReal *cost, length, end[2], tip[4];
  PetscBool *done;
  CornerKind kind[2];

  PetscFunctionBeginUser;
  PetscCall(MidlineGetSize(line_of(s, k), &length, NULL));
  end[0] = 0;
  end[1] = length;
  PetscCall(MidlinePoint(line_of(s, k), 2, end, tip));
  PetscCall(SnapGraphListCorners(line_of(s, k), s->surfaces->number[k], count, record, g));
  PetscCall(block_paths(s, k, g));
  PetscCall(SnapGraphListEdges(s->surfaces->number[k], count, record, g));
  PetscCall(PetscMalloc3(g->ncorner, &from, g->ncorner, &cost, g->ncorner, &done));
  for (PetscInt e = 0; e < 2; e++) PetscCall(choose_end(s, k, tip + 2 * e, g->size, &kind[e]));
  PetscCall(SnapGraphFindPath(g, tip, kind, from, cost, done, &last));
  for (PetscInt i = last; i >= 0; i = from[i]) n++;
  if (n >= LONG) {
    PetscReal *t;

    PetscCall(PetscMalloc3(n, &p->id, n, &p->place, n, &t));
    p->t = t;
    p->n = n;
    for (PetscInt i = last, j = n - 1; i >= 0; i = from[i], j--) {
      p->id[j]    = g->corner[i].id;
      p->place[j] = j;
      t[j]        = g->corner[i].s;
    }
    PetscCall(SnapGraphSpread(n, length, t));
    PetscCall(PetscSortIntWithArray(n, p->id, p->place));
  }
  PetscCall(PetscFree3(from, cost, done));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode clear_paths(Snap s)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    if (s->path[k].n) PetscCall(PetscFree3(s->path[k].id, s->path[k].place, s->path[k].t));
    s->path[k].n = 0;
  }
  s->path_edge.n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- local nodes of the paths ---- */

/* Number of local vertex i along path p, or -1 */
static PetscErrorCode find_on_path(Snap s, const SnapPath *p, PetscInt i, PetscInt *at)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFindInt(s->loc->node_global[i], p->n, p->id, at));
  *at = *at >= 0 ? p->place[*at] : -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Length along the mid-line where local node i belongs on path p, -1: it is not on it */
static PetscErrorCode place_on_path(Snap s, const SnapPath *p, PetscInt i, PetscReal *t)
{
  PetscInt end[2], at[2];

  PetscFunctionBeginUser;
  *t = -1;
  if (s->kind[i] == NODE_CENTRE) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->kind[i] == NODE_VERTEX) {
    PetscCall(find_on_path(s, p, i, at));
    if (at[0] >= 0) *t = p->t[at[0]];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  SnapEdgeEnds(s, i, end);
  for (PetscInt v = 0; v < 2; v++) PetscCall(find_on_path(s, p, end[v], &at[v]));
  if (at[0] >= 0 && at[1] >= 0 && PetscAbsInt(at[0] - at[1]) == 1) *t = 0.5 * (p->t[at[0]] + p->t[at[1]]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Away from other walls in narrow gaps, as draw_back() with walls: changes d for node i at place x of the line */
static PetscErrorCode draw_aside(Snap s, PetscInt k, PetscInt i, const PetscReal x[2], PetscReal d[2])
{
  const PetscReal h = s->size[i], step = 0.01 * h;
  PetscReal       gap[2];

  PetscFunctionBeginUser;
  PetscCall(ClearanceMeasure(s->clearance, s->fitted, k, x, gap));
  for (PetscInt w = 0; w < 2; w++) {
    const PetscReal back = (w ? 1 : 0.5) * SnapWidening(gap[w], CLEAR * h);
    PetscReal       slope[2], size;

    if (back == 0) continue;
    for (PetscInt a = 0; a < 2; a++) {
      PetscReal y[2] = {x[0], x[1]}, g[2][2];

      for (PetscInt e = 0; e < 2; e++) {
        y[a] = x[a] + (e ? step : -step);
        PetscCall(ClearanceMeasure(s->clearance, s->fitted, k, y, g[e]));
      }
      slope[a] = g[1][w] - g[0][w];
    }
    size = PetscMax(PetscSqrtReal(PetscSqr(slope[0]) + PetscSqr(slope[1])), 0.1 * step);
    for (PetscInt a = 0; a < 2; a++) d[a] += back * slope[a] / size;
    if (i < s->loc->nnode) s->lost[k] += back * h;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the edge of mid-edge node i end on a side of the domain? */
static PetscBool ends_on_side(Snap s, PetscInt i)
{
  PetscInt end[2];

  SnapEdgeEnds(s, i, end);
  return (PetscBool)(s->side[end[0]] || s->side[end[1]]);
}

/* Nodes of the path of body k, which belong to it from now on; its vertices are ring 0 and get their displacement.
   Those on a side of the domain belong to that. */
static PetscErrorCode mark_path(Snap s, PetscInt k)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = radius_with(s, k, 2 * SNAP_NEAR * s->coarsest);

  PetscFunctionBeginUser;
  for (DomainImages image = {0}; MeshNextImage(l, SnapCentreOf(s, k), radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt i = list[e];
      PetscReal      t, x[2];

      if (s->code[i] || s->side[i]) continue;
      PetscCall(place_on_path(s, s->path + k, i, &t));
      if (t < 0) continue;
      s->code[i] = 2 * k + 1;
      PetscCall(SnapListAdd(&s->marked, i));
      if (s->kind[i] != NODE_VERTEX) {
        if (!ends_on_side(s, i)) PetscCall(SnapListAdd(&s->path_edge, i));
        continue;
      }
      s->level[i] = 8 * k + 1;
      PetscCall(SnapListAdd(&s->ring, i));
      PetscCall(way_to_line(s, k, i, t, s->d + 2 * i, x));
      PetscCall(draw_aside(s, k, i, x, s->d + 2 * i));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathPlaceVertices(Snap s)
{
  PetscReal *record;
  PetscInt   count;
  PetscBool  any = PETSC_FALSE;
  Graph      g;

  PetscFunctionBeginUser;
  PetscCall(clear_paths(s));
  for (PetscInt k = 0; k < s->nbodies; k++) any = (PetscBool)(any || (s->fitted[k] && s->is_path[k]));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(collect_records(s, &count, &record));
  PetscCall(share_records(s, &count, &record));
  PetscCall(PetscMalloc2(4 * count, &g.corner, 8 * count, &g.edge));
  for (PetscInt k = 0; k < s->nbodies; k++) {
    if (!s->fitted[k] || !s->is_path[k]) continue;
    PetscCall(choose_path(s, k, count, record, &g));
    if (s->path[k].n) PetscCall(mark_path(s, k));
  }
  PetscCall(PetscFree2(g.corner, g.edge));
  PetscCall(PetscFree(record));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathPlaceEdges(Snap s)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->path_edge.n; e++) {
    const PetscInt i = s->path_edge.i[e], k = (s->code[i] - 1) / 2;
    PetscReal      t = 0, x[2];

    PetscCall(place_on_path(s, s->path + k, i, &t));
    PetscCall(way_to_line(s, k, i, t, s->d + 2 * i, x));
    PetscCall(draw_aside(s, k, i, x, s->d + 2 * i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sides ---- */

static PetscErrorCode find_sides(Snap s, PetscInt k, PetscReal length)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = radius_with(s, k, (BESIDE + 1) * s->coarsest);
  PetscReal        R[9], centre[2];

  PetscFunctionBeginUser;
  PetscCall(s->surfaces->frame(s->surfaces->ctx, k, R, centre));
  for (DomainImages image = {0}; MeshNextImage(l, SnapCentreOf(s, k), radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt  i    = list[e];
      const PetscReal x[2] = {l->x_start[2 * i] + s->d[2 * i], l->x_start[2 * i + 1] + s->d[2 * i + 1]};
      PetscReal       y[2], t, d;

      PetscCall(SnapDistance(s, k, image.at, 1, x, &d));
      if (d > BESIDE * s->size[i] || s->node_side[i] || (s->code[i] && (s->code[i] - 1) / 2 == k)) continue;
      PetscCall(into_body(s, k, i, y));
      for (PetscInt a = 0; a < 2; a++) y[a] += R[a] * s->d[2 * i] + R[3 + a] * s->d[2 * i + 1];
      PetscCall(MidlineProject(line_of(s, k), 1, y, &t, &d));
      if (t <= 0 || t >= length) continue;
      s->node_side[i] = (d > 0 ? 1 : -1) * (s->surfaces->number[k] + 1);
      PetscCall(SnapListAdd(&s->side_node, i));
      if (l->centre_cell[i] < 0) continue;
      s->cell_side[0][l->centre_cell[i]] = s->node_side[i];
      PetscCall(SnapListAdd(&s->side_cell[0], l->centre_cell[i]));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathFindSides(Snap s)
{
  const List older = s->side_cell[1];
  PetscInt  *side  = s->cell_side[1];

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < older.n; e++) side[older.i[e]] = 0;
  s->cell_side[1]   = s->cell_side[0];
  s->side_cell[1]   = s->side_cell[0];
  s->cell_side[0]   = side;
  s->side_cell[0]   = older;
  s->side_cell[0].n = 0;
  for (PetscInt e = 0; e < s->side_node.n; e++) s->node_side[s->side_node.i[e]] = 0;
  s->side_node.n = 0;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    PetscReal length;

    if (!s->fitted[k] || !s->path[k].n) continue;
    PetscCall(MidlineGetSize(line_of(s, k), &length, NULL));
    PetscCall(find_sides(s, k, length));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode SnapPathMeetBodies(Snap s)
{
  const AlignSurfaces *f = s->surfaces;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(s->line, s->nbodies));
  PetscCall(PetscArrayzero(s->is_path, s->nbodies));
  PetscCall(PetscArrayzero(s->path, s->nbodies));
  for (PetscInt k = 0; k < s->nbodies && f->midline && s->loc->dim == 2; k++) PetscCall(f->midline(f->ctx, k, ALIGN_THIN * s->coarsest, &s->line[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathPartBodies(Snap s)
{
  PetscFunctionBeginUser;
  PetscCall(clear_paths(s));
  for (PetscInt k = 0; k < s->nbodies; k++) PetscCall(MidlineDestroy(&s->line[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathSetUp(Snap s)
{
  PetscFunctionBeginUser;
  s->coarsest = 0;
  for (PetscInt i = 0; i < s->loc->nnode; i++) s->coarsest = PetscMax(s->coarsest, s->size[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &s->coarsest, 1, MPIU_REAL, MPIU_MAX, s->comm));
  PetscCall(PetscCalloc1(s->loc->nnode_all, &s->node_side));
  for (PetscInt j = 0; j < 2; j++) PetscCall(PetscCalloc1(s->loc->ncell_all, &s->cell_side[j]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPathTearDown(Snap s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->node_side));
  for (PetscInt j = 0; j < 2; j++) PetscCall(PetscFree(s->cell_side[j]));
  PetscFunctionReturn(PETSC_SUCCESS);
}
