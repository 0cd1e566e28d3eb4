/* Snap: see snap.h. All decisions about a node are made by its owner, who sees all cells around it, and are then sent to the ghosts; all work is on lists of what bodies touch. */
#include "compat.h"
#include "impl.h"

#define NRING    3
#define NSWEEP   20
#define FLATTEST 0.002 /* Jacobians below this share of the largest one in the cell count as not positive */
#define MISSING  0.1   /* largest difference between the area of the dead cells and that of the body, as its share */
#define STRICT   4     /* factor on both limits for bodies that were left alone before */
#define NTRY     6     /* times that dead cells beside a bad one are given back */

static void swap_lists(List *a, List *b)
{
  List t = *a;

  *a = *b;
  *b = t;
}

/* ---- which cells ---- */

/* Own cells with their centre in body k drawn at X (one periodic image); where bodies overlap, the deeper one wins */
static PetscErrorCode cover_image(Snap s, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal radius)
{
  const MeshLocal *l     = s->loc;
  const PetscReal  lo[2] = {X[0] - radius, X[1] - radius}, hi[2] = {X[0] + radius, X[1] + radius};
  const PetscInt  *list;
  PetscInt         n, m = 0, node[CHUNK];
  PetscReal        x[2 * CHUNK], dist[CHUNK];

  PetscFunctionBeginUser;
  PetscCall(MeshNodesInBox(s->mesh, lo, hi, &n, &list));
  for (PetscInt e = 0; e <= n; e++) {
    if (e < n && s->kind[list[e]] == NODE_CENTRE && list[e] < l->nnode) {
      x[2 * m]     = l->x_start[2 * list[e]];
      x[2 * m + 1] = l->x_start[2 * list[e] + 1];
      node[m++]    = list[e];
    }
    if (m < CHUNK && e < n) continue;
    PetscCall(BodiesDistance(s->bodies, k, X, q, m, x, dist));
    for (PetscInt i = 0; i < m; i++) {
      const PetscInt c = s->centre_of[node[i]];

      if (dist[i] >= 0 || (s->cover[c] && dist[i] >= s->depth[node[i]])) continue;
      if (!s->cover[c]) PetscCall(SnapListAdd(&s->dead, c));
      s->cover[c]       = k + 1;
      s->depth[node[i]] = dist[i];
    }
    m = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Tell the ghosts; the code of the centre nodes carries the message */
static PetscErrorCode share_cover(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->dead.n; e++) s->code[SnapCellNodes(s, s->dead.i[e])[4]] = s->cover[s->dead.i[e]];
  PetscCall(MeshSyncNodesInt(s->mesh, s->code));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->depth));
  for (PetscInt e = 0; e < s->dead.n; e++) s->code[SnapCellNodes(s, s->dead.i[e])[4]] = 0;
  for (PetscInt i = l->nnode; i < l->nnode_all; i++) {
    if (s->code[i]) {
      s->cover[s->centre_of[i]] = s->code[i];
      PetscCall(SnapListAdd(&s->dead, s->centre_of[i]));
    }
    s->code[i] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode cover_cells(Snap s, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool fitted[])
{
  const MeshLocal *l = s->loc;
  BodyState       *state;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(s->bodies, &state));
  for (PetscInt k = 0; k < s->nbodies; k++) {
    const PetscReal radius = BodiesGetGroup(state, k)->radius * (1 + 1e-12);

    for (PetscInt image = 0; image < 9 && fitted[k] && !s->is_path[k]; image++) { /* 4 is the body itself */
      const PetscInt  shift[2] = {image % 3 - 1, image / 3 - 1};
      const PetscReal at[3]    = {X[k][0] + shift[0] * l->period[0], X[k][1] + shift[1] * l->period[1], 0};
      PetscBool       reaches  = PETSC_TRUE;

      for (PetscInt a = 0; a < 2; a++)
        if (shift[a] && (l->period[a] == 0 || at[a] + radius < l->lower[a] || at[a] - radius > l->upper[a])) reaches = PETSC_FALSE;
      if (reaches) PetscCall(cover_image(s, k, at, q[k], radius));
    }
  }
  PetscCall(share_cover(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mark in work[] (at centre nodes) the cells that own vertex i must give back: all when it is on the boundary, the least covered one when two bodies meet there */
static void choose_open(Snap s, PetscInt i)
{
  const MeshLocal *l     = s->loc;
  PetscInt         first = 0, last = -1;
  PetscBool        two = PETSC_FALSE;

  for (PetscInt e = l->node_cell_ptr[i]; e < l->node_cell_ptr[i + 1]; e++) {
    const PetscInt c = l->node_cell[e], centre = SnapCellNodes(s, c)[4];

    if (!s->cover[c]) continue;
    if (s->boundary[i]) s->work[centre] = 1;
    if (first && s->cover[c] != first) two = PETSC_TRUE;
    first = s->cover[c];
    if (last >= 0) {
      const PetscReal gain = s->depth[centre] - s->depth[SnapCellNodes(s, last)[4]];

      if (gain < 0 || (gain == 0 && l->cell_global[c] < l->cell_global[last])) continue;
    }
    last = c;
  }
  if (two) s->work[SnapCellNodes(s, last)[4]] = 1;
}

/* Give back the cells that are marked in work[] on some rank; *any: are there any? */
static PetscErrorCode open_marked_cells(Snap s, PetscBool *any)
{
  PetscInt left = 0;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  PetscCall(MeshSumNodes(s->mesh, 1, s->work));
  PetscCall(MeshSyncNodes(s->mesh, 1, s->work));
  for (PetscInt e = 0; e < s->dead.n; e++) {
    const PetscInt c = s->dead.i[e], centre = SnapCellNodes(s, c)[4];

    if (s->work[centre] > 0) {
      s->cover[c] = 0;
      *any        = PETSC_TRUE;
    } else s->dead.i[left++] = c;
    s->work[centre] = 0;
  }
  s->dead.n = left;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Give dead cells back until no vertex touches two bodies, or a body and the boundary */
static PetscErrorCode open_gaps(Snap s)
{
  const MeshLocal *l = s->loc;
  PetscBool        any;

  PetscFunctionBeginUser;
  do {
    for (PetscInt e = 0; e < s->dead.n; e++)
      for (PetscInt v = 0; v < 4; v++) {
        const PetscInt i = SnapCellNodes(s, s->dead.i[e])[CORNER[v]];

        if (i < l->nnode) choose_open(s, i);
      }
    PetscCall(open_marked_cells(s, &any));
  } while (any);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes of dead cells: on the wall if a fluid cell touches them, otherwise inside */
static PetscErrorCode classify_nodes(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->dead.n; e++) {
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt i    = SnapCellNodes(s, s->dead.i[e])[j];
      PetscBool      wall = PETSC_FALSE;

      if (i >= l->nnode || s->code[i]) continue;
      for (PetscInt n = l->node_cell_ptr[i]; n < l->node_cell_ptr[i + 1]; n++) wall = (PetscBool)(wall || !s->cover[l->node_cell[n]]);
      s->code[i] = 2 * s->cover[s->dead.i[e]] - (wall ? 1 : 0);
      PetscCall(SnapListAdd(&s->marked, i));
    }
  }
  PetscCall(MeshSyncNodesInt(s->mesh, s->code));
  for (PetscInt i = l->nnode; i < l->nnode_all; i++)
    if (s->code[i]) PetscCall(SnapListAdd(&s->marked, i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool is_on_wall(Snap s, PetscInt i)
{
  return (PetscBool)(s->code[i] % 2);
}

/* ---- narrow gaps ---- */

/* Size of the cells around own node i before they move: square root of their mean area */
static PetscReal node_size(Snap s, PetscInt i)
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
  size      = PetscMax(PetscSqrtReal(PetscSqr(d[0] - d[1]) + PetscSqr(d[2] - d[3])), 0.1 * step); /* a sharp tip has none */
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

/* Draw walls back in narrow gaps, half of the way each between two bodies: y [n] are the wall points of body k for the listed nodes */
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

/* Displacements of the n listed nodes: from where they are now to the closest point of their wall, or behind it in narrow gaps */
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

/* Own wall vertices to the wall; all wall vertices are ring 0 */
static PetscErrorCode place_wall_vertices(Snap s, PetscReal (*X)[3], PetscReal (*q)[4])
{
  const MeshLocal *l   = s->loc;
  List             own = {0, 0, NULL};

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->marked.n; e++) {
    const PetscInt i = s->marked.i[e];

    if (s->kind[i] != NODE_VERTEX || !is_on_wall(s, i)) continue;
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

/* Rings of fluid vertices around the walls, by cells that share a vertex with the ring before */
static PetscErrorCode find_rings(Snap s)
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

          if (i >= l->nnode || s->level[i] || s->code[i] || s->boundary[i]) continue;
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

/* Jacobi sweeps: own ring vertices take the mean displacement of their neighbours along edges (every edge is seen from two cells) */
static PetscErrorCode smooth_rings(Snap s)
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

/* Mid-edge and centre nodes of all cells with a displaced vertex */
static PetscErrorCode place_other_nodes(Snap s, PetscReal (*X)[3], PetscReal (*q)[4])
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
    if (s->kind[s->placed.i[e]] == NODE_EDGE && is_on_wall(s, s->placed.i[e]) && !s->path[(s->code[s->placed.i[e]] - 1) / 2].n)
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

/* ---- is it a mesh? ---- */

/* Smallest Jacobian of cell c at the Gauss points over the largest one, with the displacements added, and its area by the 3 x 3 points */
static PetscReal cell_quality(Snap s, PetscInt c, PetscReal *area)
{
  const MeshLocal *l         = s->loc;
  const PetscInt  *node      = SnapCellNodes(s, c);
  const PetscReal  weight[3] = {5 / 9.0, 8 / 9.0, 5 / 9.0};
  PetscReal        x[18], low = PETSC_MAX_REAL, high = 0;

  *area = 0;

  for (PetscInt j = 0; j < 9; j++) {
    for (PetscInt a = 0; a < 2; a++) {
      x[2 * j + a] = DomainNearest(l->period[a], l->x_start[2 * node[j] + a], l->x_start[2 * node[4] + a]);
      x[2 * j + a] += s->d[2 * node[j] + a];
    }
  }
  for (PetscInt p = 0; p < NPOINT; p++) {
    PetscReal J[4] = {0, 0, 0, 0}, det;

    for (PetscInt j = 0; j < 9; j++)
      for (PetscInt e = 0; e < 4; e++) J[e] += s->dphi[p][e % 2][j] * x[2 * j + e / 2];
    det  = J[0] * J[3] - J[1] * J[2];
    low  = PetscMin(low, det);
    high = PetscMax(high, det);
    if (p >= 16) *area += weight[(p - 16) % 3] * weight[(p - 16) / 3] * det;
  }
  return high > 0 ? low / high : -1;
}

/* Bodies with a cell around them that cannot be used: those whose wall the cell has a vertex on, or, where there is none, those whose rings it is in.
   flags [nbodies]: bad cells; [nbodies] those that are bad only for bodies that were left alone before;
   [2 nbodies]: is its wall drawn back?; area [nbodies]: of the dead cells; summed over ranks */
static PetscErrorCode check_cells(Snap s, PetscReal *quality)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  *quality = 1;
  s->bad.n = 0;
  PetscCall(PetscArrayzero(s->flags, 3 * s->nbodies));
  PetscCall(PetscArrayzero(s->area, s->nbodies));
  for (PetscInt e = 0; e < s->dead.n; e++) {
    PetscReal area;

    if (s->dead.i[e] >= l->ncell) continue;
    (void)cell_quality(s, s->dead.i[e], &area);
    s->area[s->cover[s->dead.i[e]] - 1] += area;
  }
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt c = s->touched.i[e];
    PetscReal      share, area;
    PetscBool      at_wall = PETSC_FALSE;

    if (c >= l->ncell || s->cover[c]) continue;
    share    = cell_quality(s, c, &area);
    *quality = PetscMin(*quality, share);
    if (share > STRICT * FLATTEST) continue;
    if (share <= FLATTEST) PetscCall(SnapListAdd(&s->bad, c));
    for (PetscInt v = 0; v < 4; v++) at_wall = (PetscBool)(at_wall || s->level[SnapCellNodes(s, c)[CORNER[v]]] % 8 == 1);
    for (PetscInt v = 0; v < 4; v++) {
      const PetscInt t = s->level[SnapCellNodes(s, c)[CORNER[v]]];

      if (t && (!at_wall || t % 8 == 1)) s->flags[t / 8 + (share > FLATTEST ? s->nbodies : 0)]++;
    }
  }
  for (PetscInt k = 0; k < s->nbodies; k++) {
    s->area[k] += s->lost[k];
    s->flags[2 * s->nbodies + k] = s->lost[k] > 0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, s->flags, (PetscMPIInt)(3 * s->nbodies), MPIU_INT, MPI_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, s->area, (PetscMPIInt)s->nbodies, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, quality, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  for (PetscInt k = 0; k < s->nbodies; k++)
    if (s->path[k].n) PetscCall(BodiesGetVolume(s->bodies, k, &s->area[k])); /* a path has none to compare */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A fluid cell that cannot be used has mostly two dead neighbours round a corner and its fourth vertex on another wall. Give back the least covered neighbour of every such cell;
   *any: was there one? */
static PetscErrorCode open_bad_corners(Snap s, PetscBool *any)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->bad.n; e++) {
    const PetscInt *node = SnapCellNodes(s, s->bad.i[e]);
    PetscInt        best = -1;

    for (PetscInt v = 0; v < 4; v++) {
      for (PetscInt m = l->node_cell_ptr[node[EDGE[v]]]; m < l->node_cell_ptr[node[EDGE[v]] + 1]; m++) {
        const PetscInt c = l->node_cell[m];

        if (!s->cover[c]) continue;
        if (best >= 0) {
          const PetscReal gain = s->depth[SnapCellNodes(s, c)[4]] - s->depth[SnapCellNodes(s, best)[4]];

          if (gain < 0 || (gain == 0 && l->cell_global[c] < l->cell_global[best])) continue;
        }
        best = c;
      }
    }
    if (best >= 0) s->work[SnapCellNodes(s, best)[4]] = 1;
  }
  PetscCall(open_marked_cells(s, any));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the mesh follow body k, after check_cells? */
static PetscErrorCode judge_body(Snap s, PetscInt k, PetscBool strict, PetscBool *good)
{
  PetscReal volume;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetVolume(s->bodies, k, &volume));
  *good = (PetscBool)(!s->flags[k] && !(strict && s->flags[s->nbodies + k]) &&
                      PetscAbsReal(s->area[k] - volume) <= MISSING / (strict ? STRICT : 1) * volume);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the result ---- */

/* What was made of the dead cells */
static void clear_places(Snap s)
{
  for (PetscInt e = 0; e < s->marked.n; e++) s->code[s->marked.i[e]] = 0;
  for (PetscInt e = 0; e < s->ring.n; e++) s->level[s->ring.i[e]] = 0;
  for (PetscInt e = 0; e < s->placed.n; e++) s->d[2 * s->placed.i[e]] = s->d[2 * s->placed.i[e] + 1] = 0;
  s->ring.n = s->touched.n = 0;
}

static void clear_entries(Snap s)
{
  for (PetscInt e = 0; e < s->dead.n; e++) s->cover[s->dead.i[e]] = 0;
  clear_places(s);
}

/* Cells of the fitted bodies and the mesh around them */
static PetscErrorCode try_fit(Snap s, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool fitted[], PetscReal *quality)
{
  PetscBool any;

  PetscFunctionBeginUser;
  s->fitted = fitted;
  PetscCall(cover_cells(s, X, q, fitted));
  for (PetscInt i = 0; i <= NTRY; i++) {
    PetscCall(open_gaps(s));
    PetscCall(classify_nodes(s));
    PetscCall(PetscArrayzero(s->lost, s->nbodies));
    PetscCall(place_wall_vertices(s, X, q));
    PetscCall(SnapPathPlaceVertices(s, X, q));
    PetscCall(find_rings(s));
    PetscCall(smooth_rings(s));
    PetscCall(place_other_nodes(s, X, q));
    PetscCall(check_cells(s, quality));
    if (i == NTRY) break;
    PetscCall(open_bad_corners(s, &any));
    if (!any) break;
    clear_places(s);
    s->marked.n = s->placed.n = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Nodes (of the last fit and of this one) whose place changes */
static PetscErrorCode collect_nodes(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  s->node.n = 0;
  if (s->x_room < 2 * (s->placed.n + s->old_placed.n)) {
    s->x_room = 4 * (s->placed.n + s->old_placed.n);
    PetscCall(PetscRealloc(s->x_room * sizeof(PetscReal), &s->x));
  }
  for (PetscInt e = 0; e < s->placed.n + s->old_placed.n; e++) {
    const PetscInt  i    = e < s->placed.n ? s->placed.i[e] : s->old_placed.i[e - s->placed.n];
    const PetscReal x[2] = {l->x_start[2 * i] + s->d[2 * i], l->x_start[2 * i + 1] + s->d[2 * i + 1]};

    if (s->stamp[0][i] == s->now || (x[0] == l->x[2 * i] && x[1] == l->x[2 * i + 1])) continue;
    s->stamp[0][i]          = s->now;
    s->x[2 * s->node.n]     = x[0];
    s->x[2 * s->node.n + 1] = x[1];
    PetscCall(SnapListAdd(&s->node, i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_cell(Snap s, PetscInt c)
{
  PetscFunctionBeginUser;
  if (s->stamp[1][c] == s->now) PetscFunctionReturn(PETSC_SUCCESS);
  s->stamp[1][c] = s->now;
  PetscCall(SnapListAdd(&s->cell, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode collect_cells(Snap s)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  s->now++;
  s->cell.n = 0;
  for (PetscInt e = 0; e < s->node.n; e++)
    for (PetscInt m = l->node_cell_ptr[s->node.i[e]]; m < l->node_cell_ptr[s->node.i[e] + 1]; m++) PetscCall(collect_cell(s, l->node_cell[m]));
  for (PetscInt e = 0; e < s->old_dead.n; e++)
    if (!s->cover[s->old_dead.i[e]]) PetscCall(collect_cell(s, s->old_dead.i[e]));
  for (PetscInt e = 0; e < s->dead.n; e++)
    if (s->cell_body[s->dead.i[e]] < 0) PetscCall(collect_cell(s, s->dead.i[e]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Keep this fit as the last one */
static PetscErrorCode publish(Snap s, const PetscInt old_marked[], PetscInt nold, SnapResult *r)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < nold; e++) {
    s->node_body[old_marked[e]] = -1;
    s->on_wall[old_marked[e]]   = PETSC_FALSE;
  }
  for (PetscInt e = 0; e < s->older_dead.n; e++) s->cell_before[s->older_dead.i[e]] = -1;
  for (PetscInt e = 0; e < s->old_dead.n; e++) {
    s->cell_before[s->old_dead.i[e]] = s->cell_body[s->old_dead.i[e]];
    s->cell_body[s->old_dead.i[e]]   = -1;
  }
  for (PetscInt e = 0; e < s->marked.n; e++) {
    s->node_body[s->marked.i[e]] = (s->code[s->marked.i[e]] - 1) / 2;
    s->on_wall[s->marked.i[e]]   = is_on_wall(s, s->marked.i[e]);
  }
  for (PetscInt e = 0; e < s->dead.n; e++) s->cell_body[s->dead.i[e]] = s->cover[s->dead.i[e]] - 1;
  r->nmarked     = s->marked.n;
  r->marked      = s->marked.i;
  r->node_body   = s->node_body;
  r->on_wall     = s->on_wall;
  r->cell_body   = s->cell_body;
  r->cell_before = s->cell_before;
  r->hollow      = s->hollow;
  r->node_side   = s->node_side;
  r->side_before = s->cell_side[1];
  r->nnode       = s->node.n;
  r->node        = s->node.i;
  r->x           = s->x;
  r->ncell       = s->cell.n;
  r->cell        = s->cell.i;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- public ---- */

/* Derivatives of the Q2 basis at the points of the check */
static void tabulate(Snap s)
{
  const PetscReal g3 = PetscSqrtReal(0.6), a = 2 / 7.0 * PetscSqrtReal(1.2), outer = PetscSqrtReal(3 / 7.0 + a), inner = PetscSqrtReal(3 / 7.0 - a);
  const PetscReal four[4] = {-outer, -inner, inner, outer}, three[3] = {-g3, 0, g3};

  for (PetscInt p = 0; p < NPOINT; p++) {
    const PetscReal xi[2] = {p < 16 ? four[p % 4] : three[(p - 16) % 3], p < 16 ? four[p / 4] : three[(p - 16) / 3]};
    PetscReal       phi[9];

    ElementBasis(2, xi, phi, &s->dphi[p][0][0]);
  }
}

static PetscErrorCode know_nodes(Snap s)
{
  const MeshLocal *l = s->loc;
  PetscInt         nboundary;
  PetscReal        reach = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->nnode_all; i++) s->centre_of[i] = -1;
  for (PetscInt i = 0; i < l->ncell_all * l->nb; i++) {
    const PetscInt j = i % l->nb, odd = j % 3 % 2 + j / 3 % 2;

    s->kind[l->cell_node[i]] = odd == 2 ? NODE_CENTRE : odd ? NODE_EDGE : NODE_VERTEX;
    if (odd == 2) s->centre_of[l->cell_node[i]] = i / l->nb;
  }
  PetscCall(MeshGetBoundaryCount(s->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) {
    const PetscInt *node;
    PetscInt        n;

    PetscCall(MeshGetBoundaryNodes(s->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n; i++) s->boundary[node[i]] = PETSC_TRUE;
  }
  for (PetscInt i = 0; i < l->nnode; i++) {
    s->size[i] = node_size(s, i);
    reach      = PetscMax(reach, 2 * CLEAR * s->size[i]);
  }
  PetscCall(MeshSyncNodes(s->mesh, 1, s->size));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &reach, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  PetscCall(ClearanceCreate(s->mesh, s->bodies, reach, &s->clearance));
  PetscCall(SnapPathSetUp(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapCreate(Mesh mesh, Bodies bodies, Snap *snap)
{
  Snap       s;
  BodyState *state;
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->mesh   = mesh;
  s->bodies = bodies;
  PetscCall(MeshGetLocal(mesh, &s->loc));
  PetscCheck(s->loc->dim == 2, PETSC_COMM_WORLD, PETSC_ERR_SUP,
             "-couple_boundary snap lines up plane meshes only, this one has dimension %" PetscInt_FMT ": use -couple_boundary penalty or nodal",
             s->loc->dim);
  PetscCall(BodiesGetState(bodies, &state));
  s->nbodies = state->n;
  n          = s->loc->nnode_all;
  PetscCall(PetscCalloc6(n, &s->kind, n, &s->centre_of, n, &s->boundary, n, &s->code, n, &s->level, 2 * n, &s->d));
  PetscCall(PetscCalloc6(n, &s->depth, n, &s->work, n, &s->stamp[0], n, &s->node_body, n, &s->on_wall, n, &s->size));
  PetscCall(PetscCalloc5(s->loc->ncell_all, &s->cover, s->loc->ncell_all, &s->stamp[1], s->loc->ncell_all, &s->cell_body, s->loc->ncell_all,
                         &s->cell_before, 3 * s->nbodies, &s->flags));
  PetscCall(PetscCalloc3(s->nbodies, &s->area, s->nbodies, &s->lost, s->nbodies, &s->hollow));
  for (PetscInt i = 0; i < n; i++) s->node_body[i] = -1;
  for (PetscInt c = 0; c < s->loc->ncell_all; c++) s->cell_body[c] = s->cell_before[c] = -1;
  PetscCall(know_nodes(s));
  tabulate(s);
  *snap = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapDestroy(Snap *snap)
{
  Snap s = *snap;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree6(s->kind, s->centre_of, s->boundary, s->code, s->level, s->d));
  PetscCall(PetscFree6(s->depth, s->work, s->stamp[0], s->node_body, s->on_wall, s->size));
  PetscCall(PetscFree5(s->cover, s->stamp[1], s->cell_body, s->cell_before, s->flags));
  PetscCall(PetscFree3(s->area, s->lost, s->hollow));
  PetscCall(SnapPathTearDown(s));
  PetscCall(ClearanceDestroy(&s->clearance));
  PetscCall(PetscFree(s->dead.i));
  PetscCall(PetscFree(s->marked.i));
  PetscCall(PetscFree(s->ring.i));
  PetscCall(PetscFree(s->touched.i));
  PetscCall(PetscFree(s->bad.i));
  PetscCall(PetscFree(s->placed.i));
  PetscCall(PetscFree(s->old_dead.i));
  PetscCall(PetscFree(s->older_dead.i));
  PetscCall(PetscFree(s->old_placed.i));
  PetscCall(PetscFree(s->node.i));
  PetscCall(PetscFree(s->cell.i));
  PetscCall(PetscFree(s->x));
  PetscCall(PetscFree(*snap));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapFit(Snap s, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool wanted[], const PetscBool before[], PetscBool fitted[],
                       SnapResult *result)
{
  List      old_marked = {0, 0, NULL};
  PetscBool again      = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(fitted, wanted, s->nbodies));
  swap_lists(&s->marked, &old_marked);
  PetscCall(ClearanceUpdate(s->clearance, X));
  PetscCall(SnapPathChoose(s, X, q, wanted));
  while (again) {
    PetscCall(try_fit(s, X, q, fitted, &result->quality));
    again = PETSC_FALSE;
    for (PetscInt k = 0; k < s->nbodies; k++) {
      PetscBool good = PETSC_FALSE;

      if (!fitted[k]) continue;
      PetscCall(judge_body(s, k, (PetscBool)(before && !before[k]), &good));
      again     = (PetscBool)(again || (!good && s->area[k] != 0));
      fitted[k] = good;
    }
    if (!again) break;
    clear_entries(s);
    s->dead.n = s->marked.n = s->placed.n = 0;
  }
  result->nnarrow = 0;
  for (PetscInt k = 0; k < s->nbodies; k++) {
    result->nnarrow += fitted[k] && s->flags[2 * s->nbodies + k];
    s->hollow[k] = (PetscBool)(fitted[k] && !s->is_path[k]);
  }
  PetscCall(collect_nodes(s));
  PetscCall(collect_cells(s));
  PetscCall(SnapPathFindSides(s, X, q));
  PetscCall(publish(s, old_marked.i, old_marked.n, result));
  PetscCall(PetscFree(old_marked.i));
  clear_entries(s);
  swap_lists(&s->older_dead, &s->old_dead);
  swap_lists(&s->dead, &s->old_dead);
  swap_lists(&s->placed, &s->old_placed);
  s->dead.n = s->placed.n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
