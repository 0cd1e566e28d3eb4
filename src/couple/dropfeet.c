/* CoupleDrops, feet: old velocities, and scalars, at the feet of the trajectories that end in the nodes of the new
   mesh, and how fast the nodes move (feet.h). */
#include "compat.h"
#include "drops.h"
#include "feet.h"
#include "impl.h"
#include "scalarphases.h"

/* Of the nearest image of the interface (before the first step nothing has moved), in space about */
static PetscReal find_distance(const void *ctx, const MeshLocal *l, const PetscReal x[])
{
  const PhaseInterface *f    = &((const CoupleDrops *)ctx)->interface;
  PetscReal             best = FEET_FAR * l->h;
  PhasePoint            p;

  if (l->dim == 2) {
    DropsNearest(f, l, x, best, &p);
    return PetscAbsReal(p.d);
  }
  for (DomainImages i = {0}; MeshNextImage(l, x, PETSC_MAX_REAL / 4, &i);) best = PhaseSheetNear(&f->sheet, i.at, best);
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
