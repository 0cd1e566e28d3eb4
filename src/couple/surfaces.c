/* Surfaces: distance and velocity of the nearest body for laws of the flow that want them (FlowSurfaces of flow.h, for
   -flow_rheology smagorinsky), bodies where the flow sees them in this step and with the velocities known then: of free
   bodies those extrapolated to its end. Only bodies within reach are looked at closely, by the distance of their shape;
   the velocity is that of the rigid motion continued to the point. */
#include "compat.h"
#include "impl.h"
#include "base/grid.h"
#include "base/array.h"

#define FEW 8 /* so many bodies need no grid */

typedef struct _p_Surfaces {
  Couple    couple;
  Grid      grid; /* NULL: not made since bodies have moved */
  PetscReal half; /* boxes in it are larger by this than their bodies */
  PetscInt  capacity, *body;
} * Surfaces;

static PetscErrorCode fill_grid(Surfaces s, PetscReal half)
{
  const Couple     c    = s->couple;
  const MeshLocal *l    = c->loc;
  PetscReal        mean = 0;
  PetscInt         n    = 0;

  PetscFunctionBeginUser;
  PetscCall(GridDestroy(&s->grid));
  s->half = half;
  for (PetscInt k = 0; k < c->s->n; k++) mean += BodiesGetRadius(c->s, k) / (PetscReal)c->s->n;
  PetscCall(GridCreate(l->dim, l->lower, l->upper, 2 * (mean + half), 8 * c->s->n, &s->grid));
  for (PetscInt k = 0; k < c->s->n; k++) {
    const PetscReal size = BodiesGetRadius(c->s, k) + half;

    if (c->s->removed[k]) continue;
    for (DomainImages i = {0}; MeshNextImage(l, c->rigid.X[k], size, &i);) {
      PetscCall(ArrayReserve(n + 1, &s->capacity, &s->body, sizeof(*s->body), NULL));
      s->body[n] = k;
      PetscCall(GridInsert(s->grid, n++, i.at, size));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Body k, for n <= MESH_MAX_NB points around `middle`, the farthest `radius` away */
static PetscErrorCode try_body(Couple c, PetscInt k, PetscReal reach, const PetscReal middle[3], PetscReal radius,
                               PetscInt n, const PetscReal x[], PetscReal distance[], PetscReal v[])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;
  const PetscReal *U   = c->rigid.U + k * c->nr;
  PetscReal        y[MESH_MAX_NB * 3], d[MESH_MAX_NB], away = 0, farthest = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < dim; a++) away += PetscSqr(MeshNearest(l, a, middle[a] - c->rigid.X[k][a]));
  away = PetscSqrtReal(away) - BodiesGetRadius(c->s, k) - radius;
  for (PetscInt i = 0; i < n; i++) farthest = PetscMax(farthest, distance[i]);
  if (c->s->removed[k] || away > reach || away > farthest) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < n * dim; i++) y[i] = DomainNearest(l->period[i % dim], x[i], c->rigid.X[k][i % dim]);
  PetscCall(BodiesDistance(c->bodies, k, c->rigid.X[k], c->rigid.q[k], n, y, d));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal r[3] = {0, 0, 0};

    if (d[i] > reach || d[i] >= distance[i]) continue;
    distance[i] = PetscMax(d[i], 0);
    for (PetscInt a = 0; a < dim; a++) r[a] = y[i * dim + a] - c->rigid.P[k][a];
    RigidVelocityAt(dim, U, r, v + 3 * i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode find_nearest(void *ctx, PetscReal reach, PetscInt n, const PetscReal x[], PetscReal distance[],
                                   PetscReal v[])
{
  Surfaces       s         = ctx;
  const Couple   c         = s->couple;
  const PetscInt dim       = c->loc->dim;
  PetscReal      middle[3] = {0, 0, 0}, radius = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n * dim; i++) middle[i % dim] += x[i] / n;
  for (PetscInt i = 0; i < n; i++) {
    PetscReal r = 0;

    for (PetscInt a = 0; a < dim; a++) r += PetscSqr(x[i * dim + a] - middle[a]);
    radius = PetscMax(radius, PetscSqrtReal(r));
  }
  if (c->s->n <= FEW) {
    for (PetscInt k = 0; k < c->s->n; k++) PetscCall(try_body(c, k, reach, middle, radius, n, x, distance, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!s->grid || s->half < reach + radius) PetscCall(fill_grid(s, reach + radius));
  for (PetscInt e = GridFirst(s->grid, middle); e >= 0; e = GridNext(s->grid, e))
    PetscCall(try_body(c, s->body[GridItem(s->grid, e)], reach, middle, radius, n, x, distance, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode forget_grid(Couple c, void *data)
{
  PetscFunctionBeginUser;
  (void)c;
  PetscCall(GridDestroy(&((Surfaces)data)->grid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(Couple c, void *data)
{
  Surfaces s = (Surfaces)data;

  PetscFunctionBeginUser;
  (void)c;
  PetscCall(GridDestroy(&s->grid));
  PetscCall(PetscFree(s->body));
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant SURFACES = {.name = "surfaces", .prepare = forget_grid, .destroy = destroy};

PetscErrorCode CoupleAddSurfaces(Couple c)
{
  Surfaces s;

  PetscFunctionBeginUser;
  if (!FlowSeesSurfaces(c->flow) || !c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&s));
  s->couple = c;
  PetscCall(FlowSetSurfaces(c->flow, s, find_nearest));
  PetscCall(CoupleAddParticipant(c, &SURFACES, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
