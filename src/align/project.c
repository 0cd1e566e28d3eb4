/* Align, project: onto the wall of a surface. Walls are drawn back in narrow gaps, see align/align.h. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

PetscErrorCode AlignWallNormal(Align s, PetscInt k, const PetscReal y[], PetscReal step, PetscReal normal[])
{
  const PetscInt dim   = s->loc->dim;
  PetscReal      x[18] = {0}, d[6], size = 0;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < 2 * dim; e++)
    for (PetscInt a = 0; a < dim; a++) x[dim * e + a] = y[a] + (e / 2 == a ? (e % 2 ? -step : step) : 0);
  PetscCall(AlignDistance(s, k, AlignCentreOf(s, k), 2 * dim, x, d));
  for (PetscInt a = 0; a < dim; a++) size += PetscSqr(d[2 * a] - d[2 * a + 1]);
  size = PetscMax(PetscSqrtReal(size), 0.1 * step); /* a sharp tip has none */
  for (PetscInt a = 0; a < dim; a++) normal[a] = (d[2 * a] - d[2 * a + 1]) / size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From displaced vertex i to displaced vertex j */
static void vector_between(Align s, PetscInt i, PetscInt j, PetscReal r[])
{
  const MeshLocal *l = s->loc;

  for (PetscInt a = 0; a < l->dim; a++)
    r[a] = MeshNearest(l, a, l->x_start[l->dim * j + a] - l->x_start[l->dim * i + a]) + s->d[l->dim * j + a] -
           s->d[l->dim * i + a];
}

/* Length of the wall edge, in space area of the wall face, with middle node i */
static PetscReal wall_size(Align s, PetscInt i)
{
  const PetscInt *node = AlignCellNodes(s, s->loc->node_cell[s->loc->node_cell_ptr[i]]), *face;
  PetscInt        end[2], f = 0;
  PetscReal       r[3], t[3], n[3];

  if (s->loc->dim == 2) {
    AlignEdgeEnds(s, i, end);
    vector_between(s, end[0], end[1], r);
    return PetscSqrtReal(r[0] * r[0] + r[1] * r[1]);
  }
  while (node[s->grid.cell.face[f][4]] != i) f++;
  face = s->grid.cell.face[f];
  vector_between(s, node[face[0]], node[face[8]], r);
  vector_between(s, node[face[2]], node[face[6]], t);
  cross(r, t, n);
  return 0.5 * PetscSqrtReal(dot3(n, n));
}

PetscReal AlignFilmGapOffset(PetscReal gap, PetscReal width)
{
  if (gap >= 2 * width) return 0;
  return gap > 0 ? PetscSqr(2 * width - gap) / (4 * width) : width - gap;
}

/* Draw walls back in narrow gaps, half of the way each between two surfaces: y [n] are the wall points of surface k for
   the listed nodes */
static PetscErrorCode draw_back(Align s, PetscInt k, PetscInt n, const PetscInt list[], PetscBool count, PetscReal y[])
{
  const PetscInt dim    = s->loc->dim;
  const NodeKind middle = dim == 2 ? NODE_EDGE : NODE_FACE;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt  i      = list[e];
    const PetscReal h      = s->grid.size[i];
    PetscReal       gap[2] = {0, 0}, back, normal[3] = {0, 0, 0};

    PetscCall(ClearanceMeasure(s->clearance, s->aligned, k, y + dim * e, gap));
    back = PetscMax(0.5 * AlignFilmGapOffset(gap[0], CLEAR * h), AlignFilmGapOffset(gap[1], CLEAR * h));
    if (back == 0) continue;
    PetscCall(AlignWallNormal(s, k, y + dim * e, 0.01 * h, normal));
    for (PetscInt a = 0; a < dim; a++) y[dim * e + a] -= back * normal[a];
    if (count && s->grid.kind[i] == middle && i < s->loc->nnode) s->tally.lost[k] += back * wall_size(s, i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- nodes ---- */

PetscErrorCode AlignProjectNodes(Align s, PetscInt n, const PetscInt list[], PetscBool count)
{
  const PetscInt dim = s->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt begin = 0, m; begin < n; begin += m) {
    const PetscInt k = (s->code[list[begin]] - 1) / 2;
    PetscReal      x[3 * CHUNK], y[3 * CHUNK];

    for (m = 0; m < CHUNK && begin + m < n; m++) {
      const PetscInt i = list[begin + m];

      if ((s->code[i] - 1) / 2 != k) break;
      AlignOffset(s, k, AlignCentreOf(s, k), i, PETSC_TRUE, x + dim * m);
      for (PetscInt a = 0; a < dim; a++) x[dim * m + a] += AlignCentreOf(s, k)[a];
    }
    PetscCall(AlignClosest(s, k, m, list + begin, x, y));
    for (PetscInt e = 0; e < m; e++)
      if (s->grid.side[list[begin + e]]) PetscCall(AlignProjectOnSide(s, k, list[begin + e], x + dim * e, y + dim * e));
    if (!s->pull) PetscCall(draw_back(s, k, m, list + begin, count, y));
    for (PetscInt e = 0; e < m; e++) {
      for (PetscInt a = 0; a < dim; a++) s->d[dim * list[begin + e] + a] += y[dim * e + a] - x[dim * e + a];
      for (PetscInt a = 0; a < dim && s->grid.held[list[begin + e]]; a++) s->d[dim * list[begin + e] + a] = 0;
      if (s->grid.side[list[begin + e]]) AlignKeepOnSides(s, list[begin + e]);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscInt AlignEdgesAt(Align s, PetscInt i, PetscBool marked, PetscInt max, PetscInt ends[])
{
  const MeshLocal *l = s->loc;
  PetscInt         n = 0;

  for (PetscInt m = l->node_cell_ptr[i]; m < l->node_cell_ptr[i + 1]; m++) {
    const PetscInt *node = AlignCellNodes(s, l->node_cell[m]);

    for (PetscInt j = 0; j < s->grid.cell.nedge; j++) {
      const PetscInt a = node[s->grid.cell.end[j][0]], b = node[s->grid.cell.end[j][1]],
                     middle = node[s->grid.cell.edge[j]];
      const PetscInt other  = a == i ? b : a;
      PetscBool      listed = PETSC_FALSE;

      if ((a != i && b != i) ||
          !(marked ? s->corners.at[middle] != 0 : s->cover[l->node_cell[m]] && AlignIsOnWall(s, middle)))
        continue;
      for (PetscInt e = 0; e < n; e++) listed = (PetscBool)(listed || ends[e] == other);
      if (!listed && n < max) ends[n++] = other;
    }
  }
  return n;
}
