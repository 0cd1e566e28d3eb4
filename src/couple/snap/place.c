/* Snap, place: where the nodes go. */
#include "compat.h"
#include "impl.h"

#define NRING  3
#define NSWEEP 20

/* ---- narrow gaps ---- */

PetscReal SnapNodeSize(Snap s, PetscInt i)
{
  const MeshLocal *l   = s->loc;
  PetscReal        sum = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt *node = SnapCellNodes(s, l->node_cell[e]);
    PetscReal       axis[2][2];

    for (PetscInt a = 0; a < 2; a++) {
      for (PetscInt b = 0; b < 2; b++) { axis[b][a] = MeshNearest(l, a, l->x_start[2 * node[b ? 7 : 5] + a] - l->x_start[2 * node[b ? 1 : 3] + a]); }
    }
    sum += PetscAbsReal(axis[0][0] * axis[1][1] - axis[0][1] * axis[1][0]);
  }
  return PetscSqrtReal(sum / PetscMax(1, l->node_cell_ptr[i + 1] - l->node_cell_ptr[i]));
}

/* Outward normal at wall point y of body k, from differences of the distance */
static PetscErrorCode wall_normal(Snap s, PetscReal (*X)[3], PetscReal (*q)[4], PetscInt k, const PetscReal y[2], PetscReal step, PetscReal normal[2])
{
  const PetscReal x[8] = {y[0] + step, y[1], y[0] - step, y[1], y[0], y[1] + step, y[0], y[1] - step};
  PetscReal       d[4], size;

  PetscFunctionBeginUser;
  PetscCall(BodiesDistance(s->bodies, k, X[k], q[k], 4, x, d));
  /* a sharp tip has none */
  size      = PetscMax(PetscSqrtReal(PetscSqr(d[0] - d[1]) + PetscSqr(d[2] - d[3])), 0.1 * step);
  normal[0] = (d[0] - d[1]) / size;
  normal[1] = (d[2] - d[3]) / size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Length of the wall edge with mid-edge node i */
static PetscReal edge_length(Snap s, PetscInt i)
{
  const MeshLocal *l = s->loc;
  PetscInt         end[2];
  PetscReal        r[2];

  SnapEdgeEnds(s, i, end);
  for (PetscInt a = 0; a < 2; a++)
    r[a] = MeshNearest(l, a, l->x_start[2 * end[1] + a] - l->x_start[2 * end[0] + a]) + s->d[2 * end[1] + a] - s->d[2 * end[0] + a];
  return PetscSqrtReal(r[0] * r[0] + r[1] * r[1]);
}

PetscReal SnapWidening(PetscReal gap, PetscReal width)
{
  if (gap >= 2 * width) return 0;
  return gap > 0 ? PetscSqr(2 * width - gap) / (4 * width) : width - gap;
}

/* Draw walls back in narrow gaps, half of the way each between two bodies: y [n] are the wall points of body k for
   the listed nodes */
static PetscErrorCode draw_back(Snap s, PetscReal (*X)[3], PetscReal (*q)[4], PetscInt k, PetscInt n, const PetscInt list[], PetscReal y[])
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  i      = list[e];
    const PetscReal h      = s->size[i];
    PetscReal       gap[2] = {0, 0}, back, normal[2] = {0, 0};

    PetscCall(ClearanceMeasure(s->clearance, X, q, s->fitted, k, y + 2 * e, gap));
    back = PetscMax(0.5 * SnapWidening(gap[0], CLEAR * h), SnapWidening(gap[1], CLEAR * h));
    if (back == 0) continue;
    PetscCall(wall_normal(s, X, q, k, y + 2 * e, 0.01 * h, normal));
    for (PetscInt a = 0; a < 2; a++) y[2 * e + a] -= back * normal[a];
    if (s->kind[i] == NODE_EDGE && i < s->loc->nnode) s->lost[k] += back * edge_length(s, i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where the nodes go ---- */

/* Displacements of the n listed nodes to the closest point of their wall, or behind it in narrow gaps */
static PetscErrorCode project_nodes(Snap s, PetscReal (*X)[3], PetscReal (*q)[4], PetscInt n, const PetscInt list[])
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt begin = 0, m; begin < n; begin += m) {
    const PetscInt k = (s->code[list[begin]] - 1) / 2;
    PetscReal      x[2 * CHUNK], y[2 * CHUNK];

    for (m = 0; m < CHUNK && begin + m < n; m++) {
      const PetscInt i = list[begin + m];

      if ((s->code[i] - 1) / 2 != k) break;
      for (PetscInt a = 0; a < 2; a++) { x[2 * m + a] = X[k][a] + MeshNearest(l, a, l->x_start[2 * i + a] + s->d[2 * i + a] - X[k][a]); }
    }
    PetscCall(BodiesProject(s->bodies, k, X[k], q[k], m, x, y));
    PetscCall(draw_back(s, X, q, k, m, list + begin, y));
    for (PetscInt e = 0; e < 2 * m; e++) s->d[2 * list[begin + e / 2] + e % 2] += y[e] - x[e];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPlaceWallVertices(Snap s, PetscReal (*X)[3], PetscReal (*q)[4])
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
  PetscCall(project_nodes(s, X, q, own.n, own.i));
  PetscCall(PetscFree(own.i));
  PetscCall(MeshSyncNodes(s->mesh, 2, s->d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Lowest body among the vertices of a ring in the cells around own vertex i, as level + 1 (0: none) */
static PetscInt ring_around(Snap s, PetscInt i, PetscInt ring)
{
  const MeshLocal *l    = s->loc;
  PetscInt         best = 0;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    for (PetscInt v = 0; v < 4; v++) {
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
  for (PetscInt ring = 1; ring <= NRING; ring++) {
    const PetscInt end = s->ring.n;

    for (PetscInt f = begin; f < end; f++) {
      const PetscInt at = s->ring.i[f];

      for (PetscInt e = l->node_cell_ptr[at]; e < l->node_cell_ptr[at + 1]; e++) {
        for (PetscInt v = 0; v < 4; v++) {
          const PetscInt i = SnapCellNodes(s, l->node_cell[e])[CORNER[v]];

          if (i >= l->nnode || s->level[i] || s->code[i] || s->boundary[i] || (ring == NRING && is_beside_jump(s, i))) continue;
          s->level[i] = ring_around(s, i, ring - 1);
          PetscCall(SnapListAdd(&s->ring, i));
        }
      }
    }
    PetscCall(MeshSyncNodesInt(s->mesh, s->level));
    for (PetscInt i = l->nnode; i < l->nnode_all; i++)
      if (s->level[i] % 8 == ring + 1) PetscCall(SnapListAdd(&s->ring, i));
    begin = end;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapSmoothRings(Snap s)
{
  const MeshLocal *l = s->loc;
  PetscInt         n = 0, *vertex, *start, *next, total = 0;
  PetscReal       *mean;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(s->ring.n, &vertex, s->ring.n + 1, &start));
  start[0] = 0;
  for (PetscInt e = 0; e < s->ring.n; e++) {
    const PetscInt i = s->ring.i[e];

    if (i >= l->nnode || s->level[i] % 8 == 1) continue;
    vertex[n++] = i;
    total += 2 * (l->node_cell_ptr[i + 1] - l->node_cell_ptr[i]);
    start[n] = total;
  }
  PetscCall(PetscMalloc2(total, &next, 2 * n, &mean));
  for (PetscInt e = 0; e < n; e++) {
    PetscInt at = start[e];

    for (PetscInt m = l->node_cell_ptr[vertex[e]]; m < l->node_cell_ptr[vertex[e] + 1]; m++) {
      const PetscInt *node = SnapCellNodes(s, l->node_cell[m]);
      PetscInt        v    = 0;

      while (node[CORNER[v]] != vertex[e]) v++;
      next[at++] = node[CORNER[v ^ 1]];
      next[at++] = node[CORNER[v ^ 2]];
    }
  }
  for (PetscInt sweep = 0; sweep < NSWEEP; sweep++) {
    for (PetscInt e = 0; e < n; e++) {
      mean[2 * e] = mean[2 * e + 1] = 0;
      for (PetscInt m = start[e]; m < start[e + 1]; m++)
        for (PetscInt a = 0; a < 2; a++) mean[2 * e + a] += s->d[2 * next[m] + a] / (start[e + 1] - start[e]);
    }
    for (PetscInt e = 0; e < 2 * n; e++) s->d[2 * vertex[e / 2] + e % 2] = mean[e];
    PetscCall(MeshSyncNodes(s->mesh, 2, s->d));
  }
  PetscCall(PetscFree2(next, mean));
  PetscCall(PetscFree2(vertex, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapPlaceOtherNodes(Snap s, PetscReal (*X)[3], PetscReal (*q)[4])
{
  const MeshLocal *l    = s->loc;
  List             wall = {0, 0, NULL};

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
    for (PetscInt j = 0; j < 4; j++) {
      const PetscInt i = node[EDGE[j]];

      for (PetscInt a = 0; a < 2; a++) s->d[2 * i + a] = 0.5 * (s->d[2 * node[EDGE_END[j][0]] + a] + s->d[2 * node[EDGE_END[j][1]] + a]);
    }
  }
  for (PetscInt e = 0; e < s->placed.n; e++)
    if (s->kind[s->placed.i[e]] == NODE_EDGE && SnapIsOnWall(s, s->placed.i[e]) && !s->path[(s->code[s->placed.i[e]] - 1) / 2].n)
      PetscCall(SnapListAdd(&wall, s->placed.i[e]));
  PetscCall(project_nodes(s, X, q, wall.n, wall.i));
  PetscCall(SnapPathPlaceEdges(s, X, q));
  PetscCall(PetscFree(wall.i));
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt *node = SnapCellNodes(s, s->touched.i[e]);

    for (PetscInt a = 0; a < 2; a++) {
      PetscReal sum = 0;

      for (PetscInt v = 0; v < 4; v++) sum += 0.5 * s->d[2 * node[EDGE[v]] + a] - 0.25 * s->d[2 * node[CORNER[v]] + a];
      s->d[2 * node[4] + a] = sum;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
