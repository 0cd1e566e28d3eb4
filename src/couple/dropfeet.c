/* CoupleDrops, feet: old velocities, and scalars, at the feet of the trajectories that end in the nodes of the new
   mesh, and how fast the nodes move (feet.h). */
#include "compat.h"
#include "drops.h"
#include "feet.h"
#include "impl.h"
#include "scalarfields.h"
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
  const MeshLocal *l      = c->loc;
  const PetscInt   dim    = l->dim;
  const FeetMesh   m      = {.mesh     = c->mesh,
                             .loc      = l,
                             .remap    = f->remap,
                             .way      = f->way,
                             .shift    = f->shift,
                             .velocity = f->velocity,
                             .distance = find_distance,
                             .ctx      = f};
  const Scalars    s      = CoupleCarriedScalars(c);
  const PetscInt   nfield = 2 + (s ? ScalarsCount(s) : 0);
  PetscReal       *u, *u_old, **field;
  Feet             t;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  PetscCall(PetscMalloc1(nfield, &field));
  field[0] = u;
  field[1] = u_old;
  if (s) PetscCall(ScalarFieldsPack(s, l, field + 2));
  PetscCall(FeetFind(&m, c->step, &f->result, nfield, (const PetscReal *const *)field, &t));
  *n = t.n;
  PetscCall(PetscMalloc2(t.n, node, 2 * dim * t.n, value));
  for (PetscInt e = 0; e < t.n; e++) {
    const PetscReal *v = t.value + t.width * e;

    (*node)[e] = t.node[e];
    PetscCall(PetscArraycpy(*value + 2 * dim * e, v + dim, 2 * dim));
    if (s) PetscCall(ScalarFieldsSet(s, dim, t.node[e], v, v + 3 * dim));
  }
  if (s) PetscCall(ScalarFieldsSync(s, c->mesh));
  for (PetscInt i = 2; i < nfield; i++) PetscCall(PetscFree(field[i]));
  PetscCall(PetscFree(field));
  PetscCall(FeetDestroy(&t));
  PetscFunctionReturn(PETSC_SUCCESS);
}
