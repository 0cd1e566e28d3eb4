/* CoupleDrops, leaving: a drop of the plane that has come within a cell of an opening where fluid goes out, and goes on
   towards it, is taken out whole; its cells are of the fluid around then, and the step begins anew as after other
   events. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/log.h"
#include "flow/condition.h"

/* Does fluid go out through boundary b at x on that side: nothing holds it there, or it is prescribed so? */
static PetscErrorCode goes_out(Couple c, PetscInt b, PetscInt side, const PetscReal x[3], PetscBool *out)
{
  PetscReal v[3];

  PetscFunctionBeginUser;
  PetscCall(ConditionsIsOutflow(FlowConditions(c->flow), b, out));
  if (*out) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ConditionsGetVelocity(FlowConditions(c->flow), b, x, v));
  *out = (PetscBool)((side % 2 ? 1 : -1) * v[side / 2] > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsFindOpening(Couple c, PetscInt side, const PetscReal x[3], const char **name, PetscBool *out)
{
  PetscInt n;

  PetscFunctionBeginUser;
  *name = NULL;
  *out  = PETSC_FALSE;
  PetscCall(MeshGetBoundaryCount(c->mesh, &n));
  for (PetscInt b = 0; b < n && !*name; b++) {
    PetscInt  on;
    PetscBool wall, open;

    PetscCall(MeshGetBoundarySides(c->mesh, b, &on));
    PetscCall(ConditionsGetKind(FlowConditions(c->flow), b, &wall, &open));
    if (!open || on != 1 << side) continue;
    PetscCall(MeshGetBoundaryName(c->mesh, b, name));
    PetscCall(goes_out(c, b, side, x, out));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Least distance of a drop's nodes to a side of the domain, and the node that has it (none: x is left) */
static PetscReal find_gap(const MeshLocal *l, const PhaseCurve *curve, PetscInt drop, PetscInt side, PetscReal x[2])
{
  const PetscInt a   = side / 2;
  PetscReal      gap = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < 3 * curve->n; i++) {
    const PetscReal *y = curve->x[i / 3][i % 3], d = side % 2 ? l->upper[a] - y[a] : y[a] - l->lower[a];

    if (curve->drop[i / 3] != drop || d >= gap) continue;
    gap  = d;
    x[0] = y[0];
    x[1] = y[1];
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
    PetscReal       x[3] = {0}, old[2];
    const PetscReal gap  = find_gap(l, &now->curve, d->number, side, x);
    const char     *name;
    PetscBool       out;

    if (l->period[side / 2] > 0 || gap >= l->h || gap >= find_gap(l, &f->interface.curve, d->number, side, old))
      continue;
    PetscCall(DropsFindOpening(c, side, x, &name, &out));
    if (!out || d->leaves) continue;
    d->leaves = PETSC_TRUE;
    PetscCall(PhaseCurveRemove(&now->curve, d->number));
    PetscCall(
      LogRemark("drop %" PetscInt_FMT
                " ('%s') has come to the opening '%s' at t = %g and leaves there as a whole (columns drops_left, drop_volume_left of series.csv)",
                d->number, f->s->group[d->group].name, name, (double)c->step->time));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
