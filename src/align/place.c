/* Snap, place: where the nodes go. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define NSWEEP 20

/* ---- slots ---- */

void SnapDescribeCell(PetscInt dim, SnapCell *cell)
{
  const PetscInt step[3] = {1, 3, 9}, nb = dim == 2 ? 9 : 27;

  cell->dim     = dim;
  cell->ncorner = 1 << dim;
  cell->centre  = nb / 2;
  cell->nedge = cell->nface = 0;
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt odd[3] = {j % 3 == 1, j / 3 % 3 == 1, dim == 3 && j / 9 == 1}, a = odd[0] ? 0 : odd[1] ? 1 : 2, b = odd[2] ? 2 : 1;

    if (odd[0] + odd[1] + odd[2] == 1) {
      cell->edge[cell->nedge] = j;
      for (PetscInt e = 0; e < 2; e++) cell->end[cell->nedge][e] = j + (e ? step[a] : -step[a]);
      cell->nedge++;
    }
    if (odd[0] + odd[1] + odd[2] != 2) continue;
    for (PetscInt i = 0; i < 9; i++) cell->face[cell->nface][i] = j + (i % 3 - 1) * step[a] + (i / 3 - 1) * step[b];
    cell->nface++;
  }
}

/* ---- narrow gaps ---- */

PetscReal SnapNodeSize(Snap s, PetscInt i)
{
  const MeshLocal *l       = s->loc;
  const PetscInt   step[3] = {1, 3, 9}, dim = l->dim, n = l->node_cell_ptr[i + 1] - l->node_cell_ptr[i], mid = s->cell_kind.centre;
  PetscReal        sum = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt *node = SnapCellNodes(s, l->node_cell[e]);
    PetscReal       axis[9];

    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt b = 0; b < dim; b++)
        axis[dim * b + a] = MeshNearest(l, a, l->x_start[dim * node[mid + step[b]] + a] - l->x_start[dim * node[mid - step[b]] + a]);
    sum += PetscAbsReal(DenseDeterminant(dim, axis));
  }
  return dim == 2 ? PetscSqrtReal(sum / PetscMax(1, n)) : PetscCbrtReal(sum / PetscMax(1, n));
}

PetscErrorCode SnapWallNormal(Snap s, PetscInt k, const PetscReal y[], PetscReal step, PetscReal normal[])
{
  const PetscInt dim   = s->loc->dim;
  PetscReal      x[18] = {0}, d[6], size = 0;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < 2 * dim; e++)
    for (PetscInt a = 0; a < dim; a++) x[dim * e + a] = y[a] + (e / 2 == a ? (e % 2 ? -step : step) : 0);
  PetscCall(SnapDistance(s, k, SnapCentreOf(s, k), 2 * dim, x, d));
  for (PetscInt a = 0; a < dim; a++) size += PetscSqr(d[2 * a] - d[2 * a + 1]);
  size = PetscMax(PetscSqrtReal(size), 0.1 * step); /* a sharp tip has none */
  for (PetscInt a = 0; a < dim; a++) normal[a] = (d[2 * a] - d[2 * a + 1]) / size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From displaced vertex i to displaced vertex j */
static void way_between(Snap s, PetscInt i, PetscInt j, PetscReal r[])
{
  const MeshLocal *l = s->loc;

  for (PetscInt a = 0; a < l->dim; a++)
    r[a] = MeshNearest(l, a, l->x_start[l->dim * j + a] - l->x_start[l->dim * i + a]) + s->d[l->dim * j + a] - s->d[l->dim * i + a];
}

/* Length of the wall edge, in space area of the wall face, with middle node i */
static PetscReal wall_share(Snap s, PetscInt i)
{
  const PetscInt *node = SnapCellNodes(s, s->loc->node_cell[s->loc->node_cell_ptr[i]]), *face;
  PetscInt        end[2], f = 0;
  PetscReal       r[3], t[3], n[3];

  if (s->loc->dim == 2) {
    SnapEdgeEnds(s, i, end);
    way_between(s, end[0], end[1], r);
    return PetscSqrtReal(r[0] * r[0] + r[1] * r[1]);
  }
  while (node[s->cell_kind.face[f][4]] != i) f++;
  face = s->cell_kind.face[f];
  way_between(s, node[face[0]], node[face[8]], r);
  way_between(s, node[face[2]], node[face[6]], t);
  cross(r, t, n);
  return 0.5 * PetscSqrtReal(dot3(n, n));
}

PetscReal SnapWidening(PetscReal gap, PetscReal width)
{
  if (gap >= 2 * width) return 0;
  return gap > 0 ? PetscSqr(2 * width - gap) / (4 * width) : width - gap;
}

/* Draw walls back in narrow gaps, half of the way each between two bodies: y [n] are the wall points of body k for
   the listed nodes */
static PetscErrorCode draw_back(Snap s, PetscInt k, PetscInt n, const PetscInt list[], PetscBool count, PetscReal y[])
{
  const PetscInt dim    = s->loc->dim;
  const NodeKind middle = dim == 2 ? NODE_EDGE : NODE_FACE;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  i      = list[e];
    const PetscReal h      = s->size[i];
    PetscReal       gap[2] = {0, 0}, back, normal[3] = {0, 0, 0};

    PetscCall(ClearanceMeasure(s->clearance, s->fitted, k, y + dim * e, gap));
    back = PetscMax(0.5 * SnapWidening(gap[0], CLEAR * h), SnapWidening(gap[1], CLEAR * h));
    if (back == 0) continue;
    PetscCall(SnapWallNormal(s, k, y + dim * e, 0.01 * h, normal));
    for (PetscInt a = 0; a < dim; a++) y[dim * e + a] -= back * normal[a];
    if (count && s->kind[i] == middle && i < s->loc->nnode) s->lost[k] += back * wall_share(s, i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where the nodes go ---- */

PetscErrorCode SnapProjectNodes(Snap s, PetscInt n, const PetscInt list[], PetscBool count)
{
  const PetscInt dim = s->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt begin = 0, m; begin < n; begin += m) {
    const PetscInt k = (s->code[list[begin]] - 1) / 2;
    PetscReal      x[3 * CHUNK], y[3 * CHUNK];

    for (m = 0; m < CHUNK && begin + m < n; m++) {
      const PetscInt i = list[begin + m];

      if ((s->code[i] - 1) / 2 != k) break;
      SnapWayTo(s, k, SnapCentreOf(s, k), i, PETSC_TRUE, x + dim * m);
      for (PetscInt a = 0; a < dim; a++) x[dim * m + a] += SnapCentreOf(s, k)[a];
    }
    PetscCall(SnapProject(s, k, m, x, y));
    for (PetscInt e = 0; e < m; e++)
      if (s->side[list[begin + e]]) PetscCall(SnapProjectOnSide(s, k, list[begin + e], x + dim * e, y + dim * e));
    PetscCall(draw_back(s, k, m, list + begin, count, y));
    for (PetscInt e = 0; e < m; e++) {
      for (PetscInt a = 0; a < dim; a++) s->d[dim * list[begin + e] + a] += y[dim * e + a] - x[dim * e + a];
      if (s->side[list[begin + e]]) SnapKeepOnSides(s, list[begin + e]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPlaceWallVertices(Snap s)
{
  const MeshLocal *l   = s->loc;
  List             own = {0, 0, NULL};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];

    if (s->kind[i] != NODE_VERTEX || !SnapIsOnWall(s, i)) continue;
    s->level[i] = 8 * ((s->code[i] - 1) / 2) + 1;
    PetscCall(SnapListAdd(&s->ring, i));
    if (i < l->nnode) PetscCall(SnapListAdd(&own, i));
  }
  PetscCall(SnapProjectNodes(s, own.n, own.i, PETSC_TRUE));
  PetscCall((l->dim == 2 ? SnapPlaceCorners : SnapPlaceEdges)(s, own.n, own.i));
  PetscCall(PetscFree(own.i));
  PetscCall(MeshSyncNodes(s->mesh, l->dim, s->d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Lowest body among the vertices of a ring in the cells around own vertex i, as level + 1 (0: none) */
static PetscInt ring_around(Snap s, PetscInt i, PetscInt ring)
{
  const MeshLocal *l    = s->loc;
  PetscInt         best = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    for (PetscInt v = 0; v < s->cell_kind.ncorner; v++) {
      const PetscInt t = s->level[SnapCellNodes(s, l->node_cell[e])[CORNER[v]]];

      if (t % 8 == ring + 1 && (!best || t < best)) best = t;
    }
  }
  return best ? best + 1 : 0;
}

/* Vertices that the outermost ring leaves where they are: those of cells with nodes of a larger one */
static PetscBool is_beside_jump(Snap s, PetscInt i)
{
  const MeshLocal *l = s->loc;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++)
    if (MeshCellHang(l, l->node_cell[e])) return PETSC_TRUE;
  return PETSC_FALSE;
}

PetscErrorCode SnapFindRings(Snap s)
{
  const MeshLocal *l     = s->loc;
  PetscInt         begin = 0;

  PetscFunctionBeginUser;
  for (PetscInt ring = 1; ring <= SNAP_RINGS; ring++) {
    const PetscInt end = s->ring.n;

    for (PetscInt f = begin; f < end; f++) {
      const PetscInt at = s->ring.i[f];

      for (PetscInt e = l->node_cell_ptr[at]; e < l->node_cell_ptr[at + 1]; e++) {
        for (PetscInt v = 0; v < s->cell_kind.ncorner; v++) {
          const PetscInt i = SnapCellNodes(s, l->node_cell[e])[CORNER[v]];

          if (i >= l->nnode || s->level[i] || s->code[i] || (ring == SNAP_RINGS && is_beside_jump(s, i))) continue;
          if (s->side[i] && SnapIsBarred(s, i, ring_around(s, i, ring - 1) / 8)) continue;
          s->level[i] = ring_around(s, i, ring - 1);
          PetscCall(SnapListAdd(&s->ring, i));
        }
      }
    }
    PetscCall(SnapSyncBodies(s, 8, s->level));
    for (PetscInt i = l->nnode; i < l->nnode_all; i++)
      if (s->level[i] % 8 == ring + 1) PetscCall(SnapListAdd(&s->ring, i));
    begin = end;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapSmoothRings(Snap s)
{
  const MeshLocal *l   = s->loc;
  const PetscInt   dim = l->dim;
  PetscInt         n = 0, *vertex, *start, *next, total = 0;
  PetscReal       *mean;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(s->ring.n, &vertex, s->ring.n + 1, &start));
  start[0] = 0;
  for (PetscInt e = 0; e < s->ring.n; e++) {
    const PetscInt i = s->ring.i[e];

    if (i >= l->nnode || s->level[i] % 8 == 1) continue;
    vertex[n++] = i;
    total += dim * (l->node_cell_ptr[i + 1] - l->node_cell_ptr[i]);
    start[n] = total;
  }
  PetscCall(PetscMalloc2(total, &next, dim * n, &mean));
  for (PetscInt e = 0; e < n; e++) {
    PetscInt at = start[e];

    for (PetscInt m = l->node_cell_ptr[vertex[e]]; m < l->node_cell_ptr[vertex[e] + 1]; m++) {
      const PetscInt *node = SnapCellNodes(s, l->node_cell[m]);
      PetscInt        v    = 0;

      while (node[CORNER[v]] != vertex[e]) v++;
      for (PetscInt a = 0; a < dim; a++) next[at++] = node[CORNER[v ^ (1 << a)]];
    }
  }
  for (PetscInt sweep = 0; sweep < NSWEEP; sweep++) {
    for (PetscInt e = 0; e < n; e++) {
      for (PetscInt a = 0; a < dim; a++) mean[dim * e + a] = 0;
      for (PetscInt m = start[e]; m < start[e + 1]; m++)
        for (PetscInt a = 0; a < dim; a++) mean[dim * e + a] += s->d[dim * next[m] + a] / (start[e + 1] - start[e]);
    }
    for (PetscInt e = 0; e < n; e++) {
      for (PetscInt a = 0; a < dim; a++) s->d[dim * vertex[e] + a] = mean[dim * e + a];
      if (s->side[vertex[e]]) SnapKeepOnSides(s, vertex[e]);
    }
    PetscCall(MeshSyncNodes(s->mesh, dim, s->d));
  }
  PetscCall(PetscFree2(next, mean));
  PetscCall(PetscFree2(vertex, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the other nodes ---- */

/* Is node i on a wall of cells, not on a path of edges? */
static PetscBool is_at_wall(Snap s, PetscInt i)
{
  return (PetscBool)(SnapIsOnWall(s, i) && !s->path[(s->code[i] - 1) / 2].n);
}

static PetscErrorCode place_edges(Snap s, PetscInt n, const PetscInt cells[], PetscBool count)
{
  const PetscInt dim  = s->loc->dim;
  List           wall = {0, 0, NULL};

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt *node = SnapCellNodes(s, cells[e]);

    for (PetscInt j = 0; j < s->cell_kind.nedge; j++) {
      const PetscInt i = node[s->cell_kind.edge[j]], *end = s->cell_kind.end[j];

      if (s->stamp[0][i] == s->now) continue;
      s->stamp[0][i] = s->now;
      SnapPlaceOnChord(s, node[end[0]], node[end[1]], s->d + dim * i);
      if (is_at_wall(s, i)) PetscCall(SnapListAdd(&wall, i));
    }
  }
  PetscCall(SnapProjectNodes(s, wall.n, wall.i, count));
  if (dim == 2) SnapKeepSides(s, wall.n, wall.i);
  PetscCall(PetscFree(wall.i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Transfinite interpolation over faces, in the plane over cells */
static PetscErrorCode place_faces(Snap s, PetscInt n, const PetscInt cells[], PetscBool count)
{
  const PetscInt dim  = s->loc->dim;
  List           wall = {0, 0, NULL};

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < n * s->cell_kind.nface; e++) {
    const PetscInt *node = SnapCellNodes(s, cells[e / s->cell_kind.nface]), *face = s->cell_kind.face[e % s->cell_kind.nface], i = node[face[4]];

    if (s->stamp[0][i] == s->now) continue;
    s->stamp[0][i] = s->now;
    for (PetscInt a = 0; a < dim; a++) {
      PetscReal sum = 0;

      for (PetscInt v = 0; v < 4; v++) sum += 0.5 * s->d[dim * node[face[EDGE[v]]] + a] - 0.25 * s->d[dim * node[face[CORNER[v]]] + a];
      s->d[dim * i + a] = sum;
    }
    if (dim == 3 && is_at_wall(s, i)) PetscCall(SnapListAdd(&wall, i));
  }
  PetscCall(SnapProjectNodes(s, wall.n, wall.i, count));
  PetscCall(PetscFree(wall.i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In space: the same over hexahedra */
static void place_centres(Snap s, PetscInt n, const PetscInt cells[])
{
  const SnapCell *kind = &s->cell_kind;

  for (PetscInt e = 0; e < n; e++) {
    const PetscInt *node = SnapCellNodes(s, cells[e]);

    for (PetscInt a = 0; a < 3; a++) {
      PetscReal sum = 0;

      for (PetscInt f = 0; f < kind->nface; f++) sum += 0.5 * s->d[3 * node[kind->face[f][4]] + a];
      for (PetscInt j = 0; j < kind->nedge; j++) sum -= 0.25 * s->d[3 * node[kind->edge[j]] + a];
      for (PetscInt v = 0; v < kind->ncorner; v++) sum += 0.125 * s->d[3 * node[CORNER[v]] + a];
      s->d[3 * node[kind->centre] + a] = sum;
    }
  }
}

static PetscErrorCode place_others(Snap s, PetscInt n, const PetscInt cells[], PetscBool count)
{
  PetscFunctionBeginUser;
  PetscCall(place_edges(s, n, cells, count));
  PetscCall(SnapPathPlaceEdges(s));
  PetscCall(place_faces(s, n, cells, count));
  if (s->loc->dim == 3) place_centres(s, n, cells);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPlaceAgain(Snap s, PetscInt n, const PetscInt cells[])
{
  PetscFunctionBeginUser;
  PetscCall(place_others(s, n, cells, PETSC_FALSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPlaceOtherNodes(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < s->ring.n; e++) {
    for (PetscInt m = l->node_cell_ptr[s->ring.i[e]]; m < l->node_cell_ptr[s->ring.i[e] + 1]; m++) {
      if (s->stamp[1][l->node_cell[m]] == s->now) continue;
      s->stamp[1][l->node_cell[m]] = s->now;
      PetscCall(SnapListAdd(&s->touched, l->node_cell[m]));
    }
  }
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt *node = SnapCellNodes(s, s->touched.i[e]);

    for (PetscInt j = 0; j < l->nb; j++) {
      if (s->stamp[0][node[j]] == s->now) continue;
      s->stamp[0][node[j]] = s->now;
      PetscCall(SnapListAdd(&s->placed, node[j]));
    }
  }
  PetscCall(place_others(s, s->touched.n, s->touched.i, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}
