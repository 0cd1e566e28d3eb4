/* Align, place: where the nodes go. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define NSWEEP 20

/* ---- slots ---- */

void AlignDescribeCell(PetscInt dim, AlignCell *cell)
{
  const PetscInt step[3] = {1, 3, 9}, nb = dim == 2 ? 9 : 27;

  cell->dim     = dim;
  cell->ncorner = 1 << dim;
  cell->centre  = nb / 2;
  cell->nedge = cell->nface = 0;
  for (PetscInt j = 0; j < nb; j++) {
    const PetscInt odd[3] = {j % 3 == 1, j / 3 % 3 == 1, dim == 3 && j / 9 == 1},
                   a      = odd[0] ? 0
                          : odd[1] ? 1
                                   : 2,
                   b      = odd[2] ? 2 : 1;

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

/* ---- sizes ---- */

PetscReal AlignNodeSize(Align s, PetscInt i)
{
  const MeshLocal *l       = s->loc;
  const PetscInt   step[3] = {1, 3, 9}, dim = l->dim, n = l->node_cell_ptr[i + 1] - l->node_cell_ptr[i],
                 mid = s->grid.cell.centre;
  PetscReal sum      = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt *node = AlignCellNodes(s, l->node_cell[e]);
    PetscReal       axis[9];

    for (PetscInt a = 0; a < dim; a++)
      for (PetscInt b = 0; b < dim; b++)
        axis[dim * b + a] = MeshNearest(l, a,
                                        l->x_start[dim * node[mid + step[b]] + a] -
                                          l->x_start[dim * node[mid - step[b]] + a]);
    sum += PetscAbsReal(DenseDeterminant(dim, axis));
  }
  return dim == 2 ? PetscSqrtReal(sum / PetscMax(1, n)) : PetscCbrtReal(sum / PetscMax(1, n));
}

/* ---- where the nodes go ---- */

PetscErrorCode AlignPlaceWallVertices(Align s)
{
  const MeshLocal *l   = s->loc;
  List             own = {0, 0, NULL};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];

    if (s->grid.kind[i] != NODE_VERTEX || !AlignIsOnWall(s, i)) continue;
    s->level[i] = 8 * ((s->code[i] - 1) / 2) + 1;
    PetscCall(AlignListAdd(&s->ring, i));
    if (i < l->nnode) PetscCall(AlignListAdd(&own, i));
  }
  PetscCall(AlignProjectNodes(s, own.n, own.i, PETSC_TRUE));
  if (l->dim == 2) PetscCall(AlignPlaceCorners(s, own.n, own.i));
  else if (!s->pull) PetscCall(AlignPlaceEdges(s, own.n, own.i));
  if (s->pull) {
    AlignPullVertices(s, own.n, own.i);
    PetscCall(MeshSyncNodes(s->mesh, l->dim, s->rest));
  }
  PetscCall(PetscFree(own.i));
  PetscCall(MeshSyncNodes(s->mesh, l->dim, s->d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Lowest surface among the vertices of a ring in the cells around own vertex i, as level + 1 (0: none) */
static PetscInt ring_around(Align s, PetscInt i, PetscInt ring)
{
  const MeshLocal *l    = s->loc;
  PetscInt         best = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
      const PetscInt t = s->level[AlignCellNodes(s, l->node_cell[e])[CORNER[v]]];

      if (t % 8 == ring + 1 && (!best || t < best)) best = t;
    }
  }
  return best ? best + 1 : 0;
}

/* Vertices that all rings but the first leave where they are: those of cells with nodes of a larger one */
static PetscBool is_beside_jump(Align s, PetscInt i)
{
  const MeshLocal *l = s->loc;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++)
    if (MeshCellHang(l, l->node_cell[e])) return PETSC_TRUE;
  return PETSC_FALSE;
}

/* Is node i inside a surface, of cells whose shape does not matter? */
static PetscBool is_inactive(Align s, PetscInt i)
{
  return (PetscBool)(s->code[i] && AlignIsInactive(s, (s->code[i] - 1) / 2));
}

PetscErrorCode AlignFindRings(Align s)
{
  const MeshLocal *l     = s->loc;
  PetscInt         begin = 0;

  PetscFunctionBeginUser;
  for (PetscInt ring = 1; ring <= ALIGN_RINGS; ring++) {
    const PetscInt end = s->ring.n;

    for (PetscInt f = begin; f < end; f++) {
      const PetscInt at = s->ring.i[f];

      for (PetscInt e = l->node_cell_ptr[at]; e < l->node_cell_ptr[at + 1]; e++) {
        for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
          const PetscInt i = AlignCellNodes(s, l->node_cell[e])[CORNER[v]];

          if (i >= l->nnode || s->level[i] || s->grid.held[i] || is_inactive(s, i) ||
              (ring > 1 && is_beside_jump(s, i)))
            continue;
          if (s->grid.side[i] && AlignIsBarred(s, i, ring_around(s, i, ring - 1) / 8)) continue;
          s->level[i] = ring_around(s, i, ring - 1);
          PetscCall(AlignListAdd(&s->ring, i));
        }
      }
    }
    PetscCall(AlignSyncSurfaces(s, 8, s->level));
    for (PetscInt i = l->nnode; i < l->nnode_all; i++)
      if (s->level[i] % 8 == ring + 1) PetscCall(AlignListAdd(&s->ring, i));
    begin = end;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignSmoothRings(Align s)
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
      const PetscInt *node = AlignCellNodes(s, l->node_cell[m]);
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
      if (s->grid.side[vertex[e]]) AlignKeepOnSides(s, vertex[e]);
    }
    PetscCall(MeshSyncNodes(s->mesh, dim, s->d));
  }
  PetscCall(PetscFree2(next, mean));
  PetscCall(PetscFree2(vertex, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the other nodes ---- */

/* Is node i on a wall of cells, not on a path of edges? */
static PetscBool is_at_wall(Align s, PetscInt i)
{
  return (PetscBool)(AlignIsOnWall(s, i) && !s->paths.of[(s->code[i] - 1) / 2].n);
}

static PetscErrorCode place_edges(Align s, PetscInt n, const PetscInt cells[], PetscBool count)
{
  const PetscInt dim  = s->loc->dim;
  List           wall = {0, 0, NULL};

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt *node = AlignCellNodes(s, cells[e]);

    for (PetscInt j = 0; j < s->grid.cell.nedge; j++) {
      const PetscInt i = node[s->grid.cell.edge[j]], *end = s->grid.cell.end[j];

      if (s->stamp[0][i] == s->now) continue;
      s->stamp[0][i] = s->now;
      if (s->grid.held[i]) continue;
      AlignPlaceOnChord(s, node[end[0]], node[end[1]], s->d + dim * i);
      if (is_at_wall(s, i)) PetscCall(AlignListAdd(&wall, i));
    }
  }
  PetscCall(AlignProjectNodes(s, wall.n, wall.i, count));
  if (dim == 2) AlignKeepSides(s, wall.n, wall.i);
  if (s->pull) PetscCall(AlignPullMiddles(s, wall.n, wall.i));
  PetscCall(PetscFree(wall.i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Transfinite interpolation over faces, in the plane over cells */
static PetscErrorCode place_faces(Align s, PetscInt n, const PetscInt cells[], PetscBool count)
{
  const PetscInt dim  = s->loc->dim;
  List           wall = {0, 0, NULL};
  PetscReal     *from = NULL;

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < n * s->grid.cell.nface; e++) {
    const PetscInt *node = AlignCellNodes(s, cells[e / s->grid.cell.nface]),
                   *face = s->grid.cell.face[e % s->grid.cell.nface], i = node[face[4]];

    if (s->stamp[0][i] == s->now || s->grid.held[i]) continue;
    s->stamp[0][i] = s->now;
    for (PetscInt a = 0; a < dim; a++) {
      PetscReal sum = 0;

      for (PetscInt v = 0; v < 4; v++)
        sum += 0.5 * s->d[dim * node[face[EDGE[v]]] + a] - 0.25 * s->d[dim * node[face[CORNER[v]]] + a];
      s->d[dim * i + a] = sum;
    }
    if (dim == 3 && is_at_wall(s, i)) PetscCall(AlignListAdd(&wall, i));
  }
  if (s->pull && dim == 3) {
    PetscCall(PetscMalloc1(3 * wall.n, &from));
    for (PetscInt e = 0; e < 3 * wall.n; e++) from[e] = s->d[3 * wall.i[e / 3] + e % 3];
  }
  PetscCall(AlignProjectNodes(s, wall.n, wall.i, count));
  if (s->pull && dim == 3) AlignPullFaces(s, wall.n, wall.i, from);
  PetscCall(PetscFree(from));
  PetscCall(PetscFree(wall.i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In space: the same over hexahedra */
static void place_centres(Align s, PetscInt n, const PetscInt cells[])
{
  const AlignCell *kind = &s->grid.cell;

  for (PetscInt e = 0; e < n; e++) {
    const PetscInt *node = AlignCellNodes(s, cells[e]);

    for (PetscInt a = 0; a < 3; a++) {
      PetscReal sum = 0;

      for (PetscInt f = 0; f < kind->nface; f++) sum += 0.5 * s->d[3 * node[kind->face[f][4]] + a];
      for (PetscInt j = 0; j < kind->nedge; j++) sum -= 0.25 * s->d[3 * node[kind->edge[j]] + a];
      for (PetscInt v = 0; v < kind->ncorner; v++) sum += 0.125 * s->d[3 * node[CORNER[v]] + a];
      s->d[3 * node[kind->centre] + a] = sum;
    }
  }
}

static PetscErrorCode place_others(Align s, PetscInt n, const PetscInt cells[], PetscBool count)
{
  PetscFunctionBeginUser;
  PetscCall(place_edges(s, n, cells, count));
  PetscCall(AlignPathPlaceEdges(s));
  PetscCall(place_faces(s, n, cells, count));
  if (s->loc->dim == 3) place_centres(s, n, cells);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPlaceAgain(Align s, PetscInt n, const PetscInt cells[])
{
  PetscFunctionBeginUser;
  PetscCall(place_others(s, n, cells, PETSC_FALSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignPlaceOtherNodes(Align s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  for (PetscInt e = 0; e < s->ring.n; e++) {
    for (PetscInt m = l->node_cell_ptr[s->ring.i[e]]; m < l->node_cell_ptr[s->ring.i[e] + 1]; m++) {
      if (s->stamp[1][l->node_cell[m]] == s->now) continue;
      s->stamp[1][l->node_cell[m]] = s->now;
      PetscCall(AlignListAdd(&s->touched, l->node_cell[m]));
    }
  }
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt *node = AlignCellNodes(s, s->touched.i[e]);

    for (PetscInt j = 0; j < l->nb; j++) {
      if (s->stamp[0][node[j]] == s->now) continue;
      s->stamp[0][node[j]] = s->now;
      PetscCall(AlignListAdd(&s->placed, node[j]));
    }
  }
  PetscCall(place_others(s, s->touched.n, s->touched.i, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}
