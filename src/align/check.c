/* Snap, check: is what came out a mesh, and does it follow the bodies? */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "base/opt.h"

#define FLATTEST 0.002 /* Jacobians below this share of the largest one in the cell count as not positive */
#define MISSING  0.1   /* largest difference between the area of the dead cells and that of the body, as its share */
#define STRICT   4     /* factor on both limits for bodies that were left alone before */
#define MENDED   2     /* on the first one in space, where cells are mended to 0.005 and no further */

PetscReal SnapCellQuality(Snap s, PetscInt c, PetscReal *area)
{
  const MeshLocal *l    = s->loc;
  const PetscInt  *node = SnapCellNodes(s, c), dim = l->dim, nb = l->nb;
  PetscReal        x[3 * MESH_MAX_NB], low = PETSC_MAX_REAL, high = 0, sum = 0;

  for (PetscInt j = 0; j < nb; j++) {
    for (PetscInt a = 0; a < dim; a++)
      x[dim * j + a] = DomainNearest(l->period[a], l->x_start[dim * node[j] + a], l->x_start[dim * node[s->cell_kind.centre] + a]) +
                       s->d[dim * node[j] + a];
  }
  MeshCellGather(l, c, dim, x);
  for (PetscInt p = 0; p < s->npoint; p++) {
    PetscReal J[9] = {0}, det;

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt e = 0; e < dim * dim; e++) J[e] += s->dphi[p][e % dim * nb + j] * x[dim * j + e / dim];
    det  = DenseDeterminant(dim, J);
    low  = PetscMin(low, det);
    high = PetscMax(high, det);
    sum += s->weight[p] * det;
  }
  if (area) *area = sum;
  return high > 0 ? low / high : -1;
}

PetscErrorCode SnapCheckLevels(Snap s)
{
  const MeshLocal *l      = s->loc;
  PetscReal        at[4]  = {0, -PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL}; /* how many, and a place of one */
  const PetscReal  wanted = l->dim == 2 ? 3 : 4;
  PetscReal        band   = 3;
  PetscBool        given;
  char             where[96], advice[96];

  PetscFunctionBeginUser;
  if (!l->hang) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt c = s->touched.i[e];

    if (c >= l->ncell || !MeshCellHang(l, c)) continue;
    for (PetscInt a = 0; a < l->dim; a++) at[1 + a] = l->x_start[l->dim * SnapCentre(s, c) + a];
    at[0]++;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at[0], 1, MPIU_REAL, MPIU_SUM, s->comm));
  if (at[0] == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at[1], 3, MPIU_REAL, MPIU_MAX, s->comm));
  (void)snprintf(where, sizeof(where), l->dim == 2 ? "%g, %g" : "%g, %g, %g", (double)at[1], (double)at[2], (double)at[3]);
  PetscCall(OptPeekReal("-mesh_refine_distance", &band, &given));
  if (band < wanted)
    (void)snprintf(advice, sizeof(advice), "Raise -mesh_refine_distance (now %g; around a smooth body %g is enough)", (double)band, (double)wanted);
  else (void)snprintf(advice, sizeof(advice), "Raise -mesh_refine_distance (now %g)", (double)band);
  SETERRQ(s->comm, PETSC_ERR_USER_INPUT,
          "Levels of the mesh jump at %" PetscInt_FMT
          " cells that -couple_method aligned would move (near (%s)): it needs four cells of one size around a surface. "
          "%s, move or enlarge the boxes of -mesh_refine, or use -couple_method penalty",
          (PetscInt)at[0], where, advice);
}

PetscErrorCode SnapCheckCells(Snap s, PetscReal *quality)
{
  const MeshLocal *l = s->loc;
  PetscReal(*sum)[4];

  PetscFunctionBeginUser;
  *quality = 1;
  s->bad.n = 0;
  PetscCall(PetscArrayzero(s->flags, 3 * s->nbodies));
  PetscCall(PetscArrayzero(s->area, s->nbodies));
  for (PetscInt e = 0; e < s->dead.n; e++) {
    PetscReal area;

    if (s->dead.i[e] >= l->ncell) continue;
    (void)SnapCellQuality(s, s->dead.i[e], &area);
    s->area[s->cover[s->dead.i[e]] - 1] += area;
  }
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt c = s->touched.i[e];
    PetscReal      share;
    PetscBool      at_wall = PETSC_FALSE;

    if (c >= l->ncell || s->cover[c]) continue;
    share    = SnapCellQuality(s, c, NULL);
    *quality = PetscMin(*quality, share);
    if (share > (l->dim == 2 ? STRICT : MENDED) * FLATTEST) continue;
    if (share <= FLATTEST) PetscCall(SnapListAdd(&s->bad, c));
    for (PetscInt v = 0; v < s->cell_kind.ncorner; v++) at_wall = (PetscBool)(at_wall || s->level[SnapCellNodes(s, c)[CORNER[v]]] % 8 == 1);
    for (PetscInt v = 0; v < s->cell_kind.ncorner; v++) {
      const PetscInt t = s->level[SnapCellNodes(s, c)[CORNER[v]]];

      if (t && (!at_wall || t % 8 == 1)) s->flags[t / 8 + (share > FLATTEST ? s->nbodies : 0)]++;
    }
  }
  PetscCall(PetscMalloc1(s->nbodies, &sum));
  for (PetscInt k = 0; k < s->nbodies; k++) {
    s->area[k] += s->lost[k];
    s->flags[k] += s->stray[k];
    s->flags[2 * s->nbodies + k] = s->lost[k] > 0;
    for (PetscInt i = 0; i < 3; i++) sum[k][i] = (PetscReal)s->flags[i * s->nbodies + k];
    sum[k][3] = s->area[k];
  }
  PetscCall(SnapSumKnown(s, 4, (PetscReal *)sum));
  for (PetscInt k = 0; k < s->nbodies; k++) {
    for (PetscInt i = 0; i < 3; i++) s->flags[i * s->nbodies + k] = (PetscInt)sum[k][i];
    s->area[k] = sum[k][3];
  }
  PetscCall(PetscFree(sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, quality, 1, MPIU_REAL, MPIU_MIN, s->comm));
  for (PetscInt k = 0; k < s->nbodies; k++)
    if (s->path[k].n) s->area[k] = s->inside[k]; /* a path has none to compare */
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
          const PetscReal gain = s->depth[SnapCentre(s, c)] - s->depth[SnapCentre(s, best)];

          if (gain < 0 || (gain == 0 && l->cell_global[c] < l->cell_global[best])) continue;
        }
        best = c;
      }
    }
    if (best >= 0) s->work[SnapCentre(s, best)] = 1;
  }
  PetscCall(SnapOpenMarkedCells(s, any));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SnapJudgeBody(Snap s, PetscInt k, PetscBool strict, PetscBool *good)
{
  const PetscReal volume = s->inside[k];

  PetscFunctionBeginUser;
  *good = (PetscBool)(!s->flags[k] && !(strict && s->flags[s->nbodies + k]) &&
                      PetscAbsReal(s->area[k] - volume) <= MISSING / (strict ? STRICT : 1) * volume);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In the plane 4 x 4 and 3 x 3 points, of which the latter give the area; in space those that the flow uses: where
   three faces of a cell are on a wall, it is flat at their corner, which does no harm */
void SnapTabulate(Snap s)
{
  const PetscReal g3 = PetscSqrtReal(0.6), a = 2 / 7.0 * PetscSqrtReal(1.2), outer = PetscSqrtReal(3 / 7.0 + a), inner = PetscSqrtReal(3 / 7.0 - a);
  const PetscReal four[4] = {-outer, -inner, inner, outer}, three[3] = {-g3, 0, g3}, weight[3] = {5 / 9.0, 8 / 9.0, 5 / 9.0};
  const PetscInt  dim = s->loc->dim, first = dim == 2 ? 16 : 0;

  s->npoint = dim == 2 ? 25 : 27;
  for (PetscInt p = 0; p < s->npoint; p++) {
    const PetscInt  i      = p - first;
    const PetscReal xi4[2] = {four[p % 4], four[p / 4 % 4]};
    PetscReal       phi[MESH_MAX_NB];

    s->weight[p] = 0;
    if (i < 0) ElementBasis(dim, xi4, phi, s->dphi[p]);
    else {
      const PetscReal xi[3] = {three[i % 3], three[i / 3 % 3], three[i / 9 % 3]};

      ElementBasis(dim, xi, phi, s->dphi[p]);
      s->weight[p] = weight[i % 3] * weight[i / 3 % 3] * (dim == 2 ? 1 : weight[i / 9]);
    }
  }
}
