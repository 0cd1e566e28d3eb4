/* CoupleDrops, leaving: a drop of the plane that has come within a cell of an opening, and goes on towards it, is taken
   out whole; its cells are of the fluid around then, and the step begins anew as after other events. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/log.h"
#include "flow/condition.h"

PetscErrorCode DropsFindOpening(Couple c, PetscInt side, const char **name)
{
  PetscInt n;

  PetscFunctionBeginUser;
  *name = NULL;
  PetscCall(MeshGetBoundaryCount(c->mesh, &n));
  for (PetscInt b = 0; b < n && !*name; b++) {
    PetscInt  on;
    PetscBool wall, open;

    PetscCall(MeshGetBoundarySides(c->mesh, b, &on));
    PetscCall(ConditionsGetKind(FlowConditions(c->flow), b, &wall, &open));
    if (open && on == 1 << side) PetscCall(MeshGetBoundaryName(c->mesh, b, name));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Least distance of a drop's nodes to a side of the domain */
static PetscReal find_gap(const MeshLocal *l, const PhaseCurve *curve, PetscInt drop, PetscInt side)
{
  const PetscInt a   = side / 2;
  PetscReal      gap = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < 3 * curve->n; i++) {
    const PetscReal x = curve->x[i / 3][i % 3][a];

    if (curve->drop[i / 3] == drop) gap = PetscMin(gap, side % 2 ? l->upper[a] - x : x - l->lower[a]);
  }
  return gap;
}

PetscErrorCode DropsLetLeave(CoupleDrops *f, Couple c, PhaseInterface *now)
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  if (l->dim == 3 || c->scalars) PetscFunctionReturn(PETSC_SUCCESS); /* what scalars it has would stay behind */
  for (PetscInt i = 0; i < 4 * f->s->n; i++) {
    const PetscInt  side = i % 4;
    Drop           *d    = f->s->drop + i / 4;
    const PetscReal gap  = find_gap(l, &now->curve, d->number, side);
    const char     *name;

    if (l->period[side / 2] > 0 || gap >= l->h || gap >= find_gap(l, &f->interface.curve, d->number, side)) continue;
    PetscCall(DropsFindOpening(c, side, &name));
    if (!name || d->leaves) continue;
    d->leaves = PETSC_TRUE;
    PetscCall(PhaseCurveRemove(&now->curve, d->number));
    PetscCall(
      LogRemark("drop %" PetscInt_FMT
                " ('%s') has come to the opening '%s' at t = %g and leaves there as a whole (columns drops_left, drop_volume_left of series.csv)",
                d->number, f->s->group[d->group].name, name, (double)c->step->time));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
