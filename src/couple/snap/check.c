/* Snap, check: is what came out a mesh, and does it follow the bodies? */
#include "compat.h"
#include "impl.h"

#define FLATTEST 0.002 /* Jacobians below this share of the largest one in the cell count as not positive */
#define MISSING  0.1   /* largest difference between the area of the dead cells and that of the body, as its share */
#define STRICT   4     /* factor on both limits for bodies that were left alone before */

/* Smallest Jacobian of cell c at the Gauss points over the largest one, with the displacements added, and its area
   by the 3 x 3 points */
static PetscReal cell_quality(Snap s, PetscInt c, PetscReal *area)
{
  const MeshLocal *l         = s->loc;
  const PetscInt  *node      = SnapCellNodes(s, c);
  const PetscReal  weight[3] = {5 / 9.0, 8 / 9.0, 5 / 9.0};
  PetscReal        x[18], low = PETSC_MAX_REAL, high = 0;

  *area = 0;

  for (PetscInt j = 0; j < 9; j++) {
    for (PetscInt a = 0; a < 2; a++) {
      x[2 * j + a] = l->x_start[2 * node[j] + a];
      if (l->period[a] > 0) x[2 * j + a] -= l->period[a] * PetscFloorReal((x[2 * j + a] - l->x_start[2 * node[4] + a]) / l->period[a] + 0.5);
      x[2 * j + a] += s->d[2 * node[j] + a];
    }
  }
  MeshCellGather(l, c, 2, x);
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

PetscErrorCode SnapCheckLevels(Snap s)
{
  const MeshLocal *l     = s->loc;
  PetscReal        at[3] = {0, -PETSC_MAX_REAL, -PETSC_MAX_REAL}; /* how many, and a place of one */

  PetscFunctionBeginUser;
  if (!l->hang) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt c = s->touched.i[e];

    if (c >= l->ncell || !MeshCellHang(l, c)) continue;
    for (PetscInt a = 0; a < 2; a++) at[1 + a] = l->x_start[2 * SnapCellNodes(s, c)[4] + a];
    at[0]++;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at[0], 1, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  if (at[0] == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at[1], 2, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  SETERRQ(PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
          "Levels of the mesh jump at %g cells that -couple_boundary snap would move (near (%g, %g)): it needs four cells of one size around a surface. "
          "Raise -mesh_band (3 leaves six), move or enlarge the boxes of -mesh_refine, or use -couple_boundary penalty",
          (double)at[0], (double)at[1], (double)at[2]);
}

PetscErrorCode SnapCheckCells(Snap s, PetscReal *quality)
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

/* A fluid cell that cannot be used has mostly two dead neighbours round a corner and its fourth vertex on another
   wall. Give back the least covered neighbour of every such cell; *any: was there one? */
PetscErrorCode SnapOpenBadCorners(Snap s, PetscBool *any)
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
  PetscCall(SnapOpenMarkedCells(s, any));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapJudgeBody(Snap s, PetscInt k, PetscBool strict, PetscBool *good)
{
  PetscReal volume;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetVolume(s->bodies, k, &volume));
  *good = (PetscBool)(!s->flags[k] && !(strict && s->flags[s->nbodies + k]) &&
                      PetscAbsReal(s->area[k] - volume) <= MISSING / (strict ? STRICT : 1) * volume);
  PetscFunctionReturn(PETSC_SUCCESS);
}

void SnapTabulate(Snap s)
{
  const PetscReal g3 = PetscSqrtReal(0.6), a = 2 / 7.0 * PetscSqrtReal(1.2), outer = PetscSqrtReal(3 / 7.0 + a), inner = PetscSqrtReal(3 / 7.0 - a);
  const PetscReal four[4] = {-outer, -inner, inner, outer}, three[3] = {-g3, 0, g3};

  for (PetscInt p = 0; p < NPOINT; p++) {
    const PetscReal xi[2] = {p < 16 ? four[p % 4] : three[(p - 16) % 3], p < 16 ? four[p / 4] : three[(p - 16) / 3]};
    PetscReal       phi[9];

    ElementBasis(2, xi, phi, &s->dphi[p][0][0]);
  }
}
