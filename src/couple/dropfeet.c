/* CoupleDrops, feet: old velocities, and scalars, at the feet of the trajectories that end in the nodes of the new
   mesh, and how fast the nodes move (feet.h). */
#include "compat.h"
#include "drops.h"
#include "feet.h"
#include "impl.h"
#include "scalarphases.h"

/* Of the nearest image of the interface (before the first step nothing has moved) */
static PetscReal find_distance(const void *ctx, const MeshLocal *l, const PetscReal x[])
{
  const CoupleDrops   *f     = (const CoupleDrops *)ctx;
  const PetscReal      reach = FEET_FAR * l->h, place[3] = {x[0], x[1], l->dim == 3 ? x[2] : 0};
  PetscReal            best = reach;
  const AlignSurfaces *s    = PhaseSurfacesGet(f->surfaces);

  if (!PhaseInterfaceSize(&f->interface)) return best;
  for (DomainImages i = {0}; MeshNextImage(l, place, PETSC_MAX_REAL / 4, &i);) {
    PetscReal  square = 0;
    PhasePoint p;

    for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(i.at[a] - s->centre[0][a]);
    if (PetscSqrtReal(square) > s->radius[0] + reach) continue;
    if (l->dim == 3) {
      best = PhaseSheetNear(&f->interface.sheet, i.at, best); /* about */
      continue;
    }
    PhaseInterfaceClosest(&f->interface, i.at, best, &p);
    if (p.edge >= 0) best = PetscMin(best, PetscAbsReal(p.d));
  }
  return best;
}

PetscErrorCode DropsCarry(CoupleDrops *f, Couple c, PetscInt *n, PetscInt *node[], PetscReal *value[])
{
  const PetscInt dim = c->loc->dim;
  const FeetMesh m   = {.mesh     = c->mesh,
                        .loc      = c->loc,
                        .remap    = f->remap,
                        .way      = f->way,
                        .shift    = f->shift,
                        .velocity = f->velocity,
                        .distance = find_distance,
                        .ctx      = f,
                        .scalars  = CoupleCarriedScalars(c)};
  PetscReal     *u[2];
  Feet           t;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u[0], &u[1], NULL));
  PetscCall(FeetFind(&m, c->step, &f->result, 2, (const PetscReal *const *)u, &t));
  *n = t.n;
  PetscCall(PetscMalloc2(t.n, node, 2 * dim * t.n, value));
  PetscCall(PetscArraycpy(*node, t.node, t.n));
  for (PetscInt e = 0; e < t.n; e++)
    PetscCall(PetscArraycpy(*value + 2 * dim * e, t.value + t.width * e + dim, 2 * dim));
  PetscCall(FeetDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}
