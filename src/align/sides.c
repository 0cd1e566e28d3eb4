/* Align, sides: surfaces that pass through plane sides of the domain.

   A surface that is at least DEEP cells outside of a side, measured on the side, passes through it: a cylinder
   between the walls of a channel, half a sphere on a floor, a surface that leaves through an opening. Its covered cells
   stay covered there, and vertices of the side move with it as all others do, but within the side: where a
   wall node goes is found by Newton's method on the distance there. Surfaces that only come close to a side, or touch
   it, keep a layer of fluid cells as before; so do those that end at a side or less than DEEP cells behind it, of which
   the closest point may be the end. Sides that are not planes across an axis have nodes that do not move. Fluid
   surfaces end on the sides that their owner names. */
#include "compat.h"
#include "impl.h"

#define DEEP  1.0  /* cells */
#define NSTEP 12   /* of Newton's method */
#define LEVEL 0.2  /* least sine of the angle between surface and side */
#define CLOSE 1e-9 /* to the surface, cells */

/* ---- sides ---- */

PetscErrorCode AlignFindSides(Align s)
{
  PetscInt nboundary;

  PetscFunctionBeginUser;
  PetscCall(MeshGetBoundaryCount(s->mesh, &nboundary));
  for (PetscInt b = 0; b < nboundary; b++) {
    const PetscInt *node;
    PetscInt        n, side;

    PetscCall(MeshGetBoundaryNodes(s->mesh, b, &n, &node));
    PetscCall(MeshGetBoundarySides(s->mesh, b, &side));
    for (PetscInt i = 0; i < n; i++) s->grid.side[node[i]] |= side ? side : SIDE_CURVED;
  }
  PetscCall(MeshSyncNodesInt(s->mesh, s->grid.side));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does a side hold local node i along axis a? */
static PetscBool is_fixed(Align s, PetscInt i, PetscInt a)
{
  return (PetscBool)((s->grid.side[i] & (3 << 2 * a | SIDE_CURVED)) != 0);
}

void AlignKeepOnSides(Align s, PetscInt i)
{
  for (PetscInt a = 0; a < s->loc->dim; a++)
    if (is_fixed(s, i, a)) s->d[s->loc->dim * i + a] = 0;
}

/* ---- who passes through which ---- */

/* May surface k at X reach out of the domain, or round a period into itself? */
static void reaches(Align s, PetscInt k, const PetscReal X[3], PetscBool *out, PetscBool *round)
{
  const MeshLocal *l      = s->loc;
  const PetscReal  radius = s->surfaces->radius[k];

  *out = *round = PETSC_FALSE;
  for (PetscInt a = 0; a < l->dim; a++) {
    if (l->period[a] > 0) *round = (PetscBool)(*round || 2 * radius > l->period[a]);
    else *out = (PetscBool)(*out || X[a] - radius < l->lower[a] || X[a] + radius > l->upper[a]);
  }
}

/* Deepest point of surface k on each side, cells, among the own nodes of one image's list */
static PetscErrorCode measure_depth(Align s, PetscInt k, const PetscReal X[3], PetscInt n, const PetscInt list[],
                                    PetscReal depth[6])
{
  const PetscInt dim = s->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < n; e++) {
    const PetscInt i = list[e];
    PetscReal      d;

    if (i >= s->loc->nnode || !(s->grid.side[i] & ~SIDE_CURVED)) continue;
    PetscCall(AlignDistance(s, k, X, 1, s->loc->x_start + dim * i, &d));
    for (PetscInt b = 0; b < 2 * dim; b++)
      if (s->grid.side[i] >> b & 1) depth[b] = PetscMax(depth[b], -d / s->grid.size[i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Distances of the nodes of cell c from surface k at X, or from the next of its images if it is as wide as a period */
static PetscErrorCode cell_distances(Align s, PetscInt k, const PetscReal X[3], PetscInt c, PetscReal d[])
{
  const MeshLocal *l = s->loc;
  PetscReal        x[3 * MESH_MAX_NB], other[MESH_MAX_NB];

  PetscFunctionBeginUser;
  for (PetscInt j = 0; j < l->nb; j++) AlignPositionNear(s, AlignCellNodes(s, c)[j], X, x + l->dim * j);
  PetscCall(AlignDistance(s, k, X, l->nb, x, d));
  if (!s->images.wide) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt j = 0; j < l->nb; j++)
    for (PetscInt a = 0; a < l->dim; a++) x[l->dim * j + a] = l->x_start[l->dim * AlignCellNodes(s, c)[j] + a];
  for (DomainImages image = {0}; MeshNextImage(l, X, s->surfaces->radius[k], &image);) {
    PetscCall(AlignDistance(s, k, image.at, l->nb, x, other));
    for (PetscInt j = 0; j < l->nb; j++) d[j] = PetscMin(d[j], other[j]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volume of surface k in cell c: Simpson's rule for its indicator, smoothed over the distance of two nodes */
static PetscErrorCode volume_in_cell(Align s, PetscInt k, const PetscReal X[3], PetscInt c, PetscReal *volume)
{
  const MeshLocal *l    = s->loc;
  const PetscInt   dim  = l->dim;
  const PetscReal  size = s->grid.size[AlignCentre(s, c)];
  PetscReal        d[MESH_MAX_NB], all = dim == 2 ? size * size : size * size * size;

  PetscFunctionBeginUser;
  PetscCall(cell_distances(s, k, X, c, d));
  for (PetscInt j = 0; j < l->nb; j++) {
    PetscReal weight = PetscMax(0, PetscMin(1, 0.5 - 2 * d[j] / size));

    for (PetscInt a = 0, m = j; a < dim; a++, m /= 3) weight *= m % 3 == 1 ? 2. / 3 : 1. / 6;
    *volume += weight * all;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of this rank: depths of surface k on the sides, and its volume within the domain */
static PetscErrorCode measure_surface(Align s, PetscInt k, const PetscReal X[3], PetscReal depth[6], PetscReal *volume)
{
  const PetscReal radius = s->surfaces->radius[k] * (1 + 1e-12);

  PetscFunctionBeginUser;
  s->now++;
  for (DomainImages image = {0}; MeshNextImage(s->loc, X, radius, &image);) {
    const PetscInt *list;
    PetscInt        n;

    PetscCall(MeshNodesInBox(s->mesh, image.at, radius, &n, &list));
    PetscCall(measure_depth(s, k, image.at, n, list, depth));
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt c = s->grid.kind[list[e]] == NODE_CENTRE && list[e] < s->loc->nnode ? s->loc->centre_cell[list[e]]
                                                                                         : -1;

      if (c < 0 || s->stamp[1][c] == s->now) continue;
      s->stamp[1][c] = s->now;
      PetscCall(volume_in_cell(s, k, X, c, volume));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignFindPassages(Align s, const PetscBool wanted[])
{
  PetscReal(*depth)[6], *volume;
  PetscBool *measured, *round, any = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc4(s->n, &depth, s->n, &volume, s->n, &measured, s->n, &round));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscBool out;

    s->tally.passes[k] = s->surfaces->ends_on ? s->surfaces->ends_on[k] : 0;
    s->tally.inside[k] = s->surfaces->volume[k];
    if (s->tally.passes[k] || s->pull) continue; /* a fluid surface is cut short elsewhere */
    reaches(s, k, AlignCentreOf(s, k), &out, &round[k]);
    measured[k] = (PetscBool)(wanted[k] && !s->paths.is[k] && (out || round[k]));
    if (measured[k]) PetscCall(measure_surface(s, k, AlignCentreOf(s, k), depth[k], &volume[k]));
    any = (PetscBool)(any || measured[k]);
  }
  PetscCall(AlignAny(s, &any));
  if (any) PetscCall(AlignMaxLocal(s, 6, (PetscReal *)depth));
  if (any) PetscCall(AlignSumLocal(s, 1, volume));
  for (PetscInt k = 0; k < s->n; k++) {
    for (PetscInt b = 0; b < 6 && measured[k]; b++) s->tally.passes[k] |= depth[k][b] >= DEEP ? 1 << b : 0;
    if (measured[k] && (s->tally.passes[k] || (round[k] && s->images.joined[k]))) s->tally.inside[k] = volume[k];
  }
  PetscCall(PetscFree4(depth, volume, measured, round));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where surface and side meet ---- */

PetscErrorCode AlignProjectOnSide(Align s, PetscInt k, PetscInt i, const PetscReal x[], PetscReal y[])
{
  const PetscInt dim  = s->loc->dim;
  PetscReal      z[3] = {0};

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < dim; a++) y[a] = x[a];
  for (PetscInt step = 0; step < NSTEP; step++) {
    PetscReal square = 0, along = 0;

    PetscCall(AlignClosest(s, k, 1, &i, y, z));
    for (PetscInt a = 0; a < dim; a++) {
      z[a] -= y[a];
      square += z[a] * z[a];
      if (is_fixed(s, i, a)) z[a] = 0;
      along += z[a] * z[a];
    }
    if (square <= PetscSqr(CLOSE * s->grid.size[i])) PetscFunctionReturn(PETSC_SUCCESS);
    if (along < PetscSqr(LEVEL) * square) break;
    for (PetscInt a = 0; a < dim; a++) y[a] += square / along * z[a];
  }
  for (PetscInt a = 0; a < dim; a++) y[a] = x[a];
  if (!s->pull) s->tally.stray[k]++; /* a fluid surface takes a vertex that stays where it is */
  PetscFunctionReturn(PETSC_SUCCESS);
}
