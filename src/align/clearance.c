/* Clearance: see clearance.h. */
#include "compat.h"
#include "clearance.h"
#include "base/array.h"

struct _p_Clearance {
  const MeshLocal     *loc;
  const AlignSurfaces *surfaces;
  PetscReal            reach;
  PetscInt             n;                    /* surfaces for which there is memory */
  PetscInt            *ptr, *near, capacity; /* [n + 1]; near surfaces of each */
  PetscInt            *order;                /* [n] by their left ends */
  PetscReal           *left;                 /* [n] */
  const PetscInt      *passes, *joined;      /* [n] */
};

static PetscReal near_radius(Clearance c, PetscInt k)
{
  return c->surfaces->radius[k] + 0.5 * c->reach;
}

/* Are surfaces k and j, or images of them (j = k: other images), so close that their walls may come within reach of
   each other? */
static PetscBool is_near(Clearance c, PetscInt k, PetscInt j)
{
  PetscReal d2 = 0;

  for (PetscInt a = 0; k == j && a < c->loc->dim; a++)
    if (c->loc->period[a] > 0 && c->loc->period[a] < 2 * near_radius(c, k)) return PETSC_TRUE;
  if (k == j) return PETSC_FALSE;
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    const PetscReal r = MeshNearest(c->loc, a, c->surfaces->centre[j][a] - c->surfaces->centre[k][a]);

    d2 += r * r;
  }
  return (PetscBool)(d2 < PetscSqr(near_radius(c, k) + near_radius(c, j)));
}

/* Pairs of near surfaces, and surfaces near images of their own, by a sweep over the left ends of the surfaces, round
   the period if there is one: counted, or listed from behind */
static void sweep_pairs(Clearance c, PetscBool list)
{
  const PetscReal period = c->loc->period[0];
  const PetscInt  n      = c->surfaces->n;

  for (PetscInt e = 0; e < n; e++) {
    const PetscInt k = c->order[e];

    if (is_near(c, k, k)) {
      if (list) c->near[--c->ptr[k]] = k;
      else c->ptr[k]++;
    }
    for (PetscInt f = e + 1; f < (period > 0 ? e + n : n); f++) {
      const PetscInt j = c->order[f % n];

      if (c->left[f % n] + (f >= n ? period : 0) > c->left[e] + 2 * near_radius(c, k)) break;
      if (!is_near(c, k, j)) continue;
      if (list) {
        c->near[--c->ptr[k]] = j;
        c->near[--c->ptr[j]] = k;
      } else {
        c->ptr[k]++;
        c->ptr[j]++;
      }
    }
  }
}

PetscErrorCode ClearanceCreate(Mesh mesh, const AlignSurfaces *surfaces, PetscReal reach, Clearance *clearance)
{
  Clearance c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  c->surfaces = surfaces;
  c->reach    = reach;
  PetscCall(MeshGetLocal(mesh, &c->loc));
  *clearance = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ClearanceDestroy(Clearance *clearance)
{
  PetscFunctionBeginUser;
  if (!*clearance) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree3((*clearance)->ptr, (*clearance)->order, (*clearance)->left));
  PetscCall(PetscFree((*clearance)->near));
  PetscCall(PetscFree(*clearance));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ClearanceUpdate(Clearance c, const PetscInt passes[], const PetscInt joined[])
{
  const PetscInt n = c->surfaces->n;

  PetscFunctionBeginUser;
  if (!c->ptr || n > c->n) {
    PetscCall(PetscFree3(c->ptr, c->order, c->left));
    PetscCall(PetscMalloc3(n + 1, &c->ptr, n, &c->order, n, &c->left));
    c->n = n;
  }
  c->passes = passes;
  c->joined = joined;
  for (PetscInt k = 0; k < n; k++) {
    c->order[k] = k;
    c->left[k]  = DomainWrap(c->loc->period[0], c->surfaces->centre[k][0] - near_radius(c, k), c->loc->lower[0]);
  }
  PetscCall(PetscSortRealWithArrayInt(n, c->left, c->order));
  PetscCall(PetscArrayzero(c->ptr, n + 1));
  sweep_pairs(c, PETSC_FALSE);
  for (PetscInt k = 0; k < n; k++) c->ptr[k + 1] += c->ptr[k];
  PetscCall(ArrayReserve(c->ptr[n], &c->capacity, &c->near, sizeof(*c->near), NULL));
  sweep_pairs(c, PETSC_TRUE);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Distance of y, a point of surface k as it is at c->surfaces->centre[k], from all images of surface j, but for itself,
   that may be in reach */
static PetscErrorCode measure_images(Clearance c, PetscInt k, PetscInt j, const PetscReal y[], PetscReal *gap)
{
  const MeshLocal *l     = c->loc;
  const PetscReal  reach = c->surfaces->radius[j] + c->reach;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 27; i++) {
    const PetscInt step[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    PetscReal      at[3], d, d2 = 0;
    PetscBool      is = PETSC_TRUE, self = (PetscBool)(k == j), nearest = PETSC_TRUE;

    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal period = a < l->dim ? l->period[a] : 0;

      is    = (PetscBool)(is && (!step[a] || period > 0));
      at[a] = c->surfaces->centre[j][a];
      if (period > 0) at[a] += period * (PetscFloorReal((y[a] - at[a]) / period + 0.5) + step[a]);
      if (a < l->dim) d2 += PetscSqr(y[a] - at[a]);
      self    = (PetscBool)(self &&
                         (PetscAbsReal(at[a] - c->surfaces->centre[j][a]) <= 0.5 * period || c->joined[k] >> a & 1));
      nearest = (PetscBool)(nearest && !step[a]);
    }
    if (!is || self || (!nearest && d2 > reach * reach)) continue;
    PetscCall(c->surfaces->distance(c->surfaces->ctx, j, at, 1, y, &d));
    *gap = PetscMin(*gap, d);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ClearanceMeasure(Clearance c, const PetscBool counts[], PetscInt k, const PetscReal y[],
                                PetscReal gap[2])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  gap[0] = gap[1] = PETSC_MAX_REAL;
  for (PetscInt b = 0; b < 2 * l->dim; b++) {
    const PetscInt a = b / 2;

    if (l->period[a] == 0 && !(c->passes[k] >> b & 1))
      gap[1] = PetscMin(gap[1], b % 2 ? l->upper[a] - y[a] : y[a] - l->lower[a]);
  }
  for (PetscInt e = c->ptr[k]; e < c->ptr[k + 1]; e++) {
    if (counts[c->near[e]]) PetscCall(measure_images(c, k, c->near[e], y, &gap[0]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
