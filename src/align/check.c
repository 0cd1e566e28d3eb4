/* Align, check: is what came out a mesh, and does it follow the surfaces? */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/domain.h"
#include "base/opt.h"
#include "fem/gauss.h"

#define FLATTEST 0.002 /* Jacobians below this share of the largest one in the cell count as not positive */
#define PULLED   0.02  /* up to this vertices of fluid surfaces are pulled back, */
#define PULLED3  0.004 /* in space, where cells are mended to 0.005 and no further */
#define MISSING  0.1   /* largest difference between the areas of the covered cells and of the surface, as a share */
#define STRICT   4     /* factor on both limits for surfaces that were left alone before */
#define MENDED   2     /* on the first one in space */

PetscReal AlignCellQuality(Align s, PetscInt c, PetscReal *area)
{
  const MeshLocal *l    = s->loc;
  const PetscInt  *node = AlignCellNodes(s, c), dim = l->dim, nb = l->nb;
  PetscReal        x[3 * MESH_MAX_NB], low = PETSC_MAX_REAL, high = 0, sum = 0;

  for (PetscInt j = 0; j < nb; j++) {
    for (PetscInt a = 0; a < dim; a++)
      x[dim * j + a] = DomainNearest(l->period[a], l->x_start[dim * node[j] + a],
                                     l->x_start[dim * node[s->grid.cell.centre] + a]) +
                       s->d[dim * node[j] + a];
  }
  MeshCellGather(l, c, dim, x);
  for (PetscInt p = 0; p < s->grid.npoint; p++) {
    PetscReal J[9] = {0}, det;

    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt e = 0; e < dim * dim; e++) J[e] += s->grid.dphi[p][e % dim * nb + j] * x[dim * j + e / dim];
    det  = DenseDeterminant(dim, J);
    low  = PetscMin(low, det);
    high = PetscMax(high, det);
    sum += s->grid.weight[p] * det;
  }
  if (area) *area = sum;
  return high > 0 ? low / high : -1;
}

PetscErrorCode AlignCheckLevels(Align s)
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
    for (PetscInt a = 0; a < l->dim; a++) at[1 + a] = l->x_start[l->dim * AlignCentre(s, c) + a];
    at[0]++;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at[0], 1, MPIU_REAL, MPIU_SUM, s->comm));
  if (at[0] == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &at[1], 3, MPIU_REAL, MPIU_MAX, s->comm));
  (void)snprintf(where, sizeof(where), l->dim == 2 ? "%g, %g" : "%g, %g, %g", (double)at[1], (double)at[2],
                 (double)at[3]);
  PetscCall(OptPeekReal("-mesh_refine_distance", &band, &given));
  if (band < wanted)
    (void)snprintf(advice, sizeof(advice), "Raise -mesh_refine_distance (now %g; around a smooth body %g is enough)",
                   (double)band, (double)wanted);
  else (void)snprintf(advice, sizeof(advice), "Raise -mesh_refine_distance (now %g)", (double)band);
  SETERRQ(s->comm, PETSC_ERR_USER_INPUT,
          "Levels of the mesh jump at %" PetscInt_FMT
          " cells that -couple_method aligned would move (near (%s)): it needs four cells of one size around a surface. "
          "%s, move or enlarge the boxes of -mesh_refine, or use -couple_method penalty",
          (PetscInt)at[0], where, advice);
}

PetscErrorCode AlignCheckCells(Align s, PetscReal *quality)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  pulled = !s->pull ? FLATTEST : l->dim == 2 ? PULLED : PULLED3;
  PetscReal(*sum)[4];

  PetscFunctionBeginUser;
  *quality = 1;
  s->bad.n = 0;
  PetscCall(PetscArrayzero(s->tally.flags, 3 * s->n));
  PetscCall(PetscArrayzero(s->tally.area, s->n));
  for (PetscInt e = 0; e < s->covered.n; e++) {
    PetscReal area;

    if (s->covered.i[e] >= l->ncell) continue;
    (void)AlignCellQuality(s, s->covered.i[e], &area);
    s->tally.area[s->cover[s->covered.i[e]] - 1] += area;
  }
  for (PetscInt e = 0; e < s->touched.n; e++) {
    const PetscInt c = s->touched.i[e];
    PetscReal      quality_of_cell;
    PetscBool      at_wall = PETSC_FALSE;

    if (c >= l->ncell || !AlignIsCellActive(s, c)) continue;
    quality_of_cell = AlignCellQuality(s, c, NULL);
    *quality        = PetscMin(*quality, quality_of_cell);
    if (quality_of_cell <= pulled) PetscCall(AlignListAdd(&s->bad, c));
    if (quality_of_cell > (l->dim == 2 ? STRICT : MENDED) * FLATTEST) continue;
    for (PetscInt v = 0; v < s->grid.cell.ncorner; v++)
      at_wall = (PetscBool)(at_wall || s->level[AlignCellNodes(s, c)[CORNER[v]]] % 8 == 1);
    for (PetscInt v = 0; v < s->grid.cell.ncorner; v++) {
      const PetscInt t = s->level[AlignCellNodes(s, c)[CORNER[v]]];

      if (t && (!at_wall || t % 8 == 1)) s->tally.flags[t / 8 + (quality_of_cell > FLATTEST ? s->n : 0)]++;
    }
  }
  PetscCall(PetscMalloc1(s->n, &sum));
  for (PetscInt k = 0; k < s->n; k++) {
    s->tally.area[k] += s->tally.lost[k];
    s->tally.flags[k] += s->tally.stray[k];
    s->tally.flags[2 * s->n + k] = s->tally.lost[k] > 0;
    for (PetscInt i = 0; i < 3; i++) sum[k][i] = (PetscReal)s->tally.flags[i * s->n + k];
    sum[k][3] = s->tally.area[k];
  }
  PetscCall(AlignSumLocal(s, 4, (PetscReal *)sum));
  for (PetscInt k = 0; k < s->n; k++) {
    for (PetscInt i = 0; i < 3; i++) s->tally.flags[i * s->n + k] = (PetscInt)sum[k][i];
    s->tally.area[k] = sum[k][3];
  }
  PetscCall(PetscFree(sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, quality, 1, MPIU_REAL, MPIU_MIN, s->comm));
  for (PetscInt k = 0; k < s->n; k++)
    if (s->paths.of[k].n) s->tally.area[k] = s->tally.inside[k]; /* a path has none to compare */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A fluid cell that cannot be used has mostly two covered neighbours round a corner and its fourth vertex on another
   wall. Give back the least covered neighbour of every such cell; *any: was there one? */
PetscErrorCode AlignOpenBadCorners(Align s, PetscBool *any)
{
  const MeshLocal *l = s->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->bad.n; e++) {
    const PetscInt *node = AlignCellNodes(s, s->bad.i[e]);
    PetscInt        best = -1;

    for (PetscInt v = 0; v < 4; v++) {
      for (PetscInt m = l->node_cell_ptr[node[EDGE[v]]]; m < l->node_cell_ptr[node[EDGE[v]] + 1]; m++) {
        const PetscInt c = l->node_cell[m];

        if (!s->cover[c]) continue;
        if (best >= 0) {
          const PetscReal gain = s->depth[AlignCentre(s, c)] - s->depth[AlignCentre(s, best)];

          if (gain < 0 || (gain == 0 && l->cell_global[c] < l->cell_global[best])) continue;
        }
        best = c;
      }
    }
    if (best >= 0) s->work[AlignCentre(s, best)] = 1;
  }
  PetscCall(AlignOpenMarkedCells(s, any));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A place of the flattest cells, the same on all ranks. Collective. */
static PetscErrorCode find_flat(Align s, PetscReal x[3])
{
  const MeshLocal *l     = s->loc;
  PetscReal        at[3] = {-PETSC_MAX_REAL, -PETSC_MAX_REAL, -PETSC_MAX_REAL}, worst = PETSC_MAX_REAL, all;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < s->bad.n; e++) {
    const PetscReal quality = AlignCellQuality(s, s->bad.i[e], NULL);

    if (quality >= worst) continue;
    worst = quality;
    PetscCall(PetscArraycpy(at, l->x_start + l->dim * AlignCentre(s, s->bad.i[e]), l->dim));
  }
  PetscCall(MPIU_Allreduce(&worst, &all, 1, MPIU_REAL, MPIU_MIN, s->comm));
  if (worst > all)
    for (PetscInt a = 0; a < 3; a++) at[a] = -PETSC_MAX_REAL;
  PetscCall(MPIU_Allreduce(at, x, 3, MPIU_REAL, MPIU_MAX, s->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignIsFollowed(Align s, PetscInt k, PetscBool strict, PetscBool *good)
{
  const PetscReal volume = s->tally.inside[k];

  PetscFunctionBeginUser;
  *good = (PetscBool)(!s->tally.flags[k] && !(strict && s->tally.flags[s->n + k]) &&
                      (s->pull || PetscAbsReal(s->tally.area[k] - volume) <= MISSING / (strict ? STRICT : 1) * volume));
  if (!*good && s->pull) PetscCall(find_flat(s, s->flat));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In the plane 4 x 4 and 3 x 3 points, of which the latter give the area; in space those that the flow uses: where
   three faces of a cell are on a wall, it is flat at their corner, which does no harm */
void AlignTabulate(Align s)
{
  const PetscInt dim = s->loc->dim, first = dim == 2 ? 16 : 0;

  s->grid.npoint = dim == 2 ? 25 : 27;
  for (PetscInt p = 0; p < s->grid.npoint; p++) {
    const PetscInt  i      = p - first;
    const PetscReal xi4[2] = {GAUSS4_POINT[p % 4], GAUSS4_POINT[p / 4 % 4]};
    PetscReal       phi[MESH_MAX_NB];

    s->grid.weight[p] = 0;
    if (i < 0) ElementBasis(dim, xi4, phi, s->grid.dphi[p]);
    else {
      const PetscReal xi[3] = {GAUSS3_POINT[i % 3], GAUSS3_POINT[i / 3 % 3], GAUSS3_POINT[i / 9 % 3]};

      ElementBasis(dim, xi, phi, s->grid.dphi[p]);
      s->grid.weight[p] = GAUSS3_WEIGHT[i % 3] * GAUSS3_WEIGHT[i / 3 % 3] * (dim == 2 ? 1 : GAUSS3_WEIGHT[i / 9]);
    }
  }
}
