/* Conditions (condition.h): of what type the boundaries are, and where they lie. */
#include "compat.h"
#include "boundary.h"

PetscErrorCode ConditionsGetOpenAxes(Conditions f, PetscInt *axes)
{
  PetscFunctionBeginUser;
  *axes = 0;
  for (PetscInt d = 0; d < f->loc->dim; d++) {
    PetscReal lower = PETSC_MAX_REAL, upper = -PETSC_MAX_REAL;

    for (PetscInt b = 0; b < f->n; b++) {
      const PetscReal *start = f->condition[b].lower, *end = f->condition[b].upper;

      if (!BoundaryIsFree(f->condition + b) || end[d] - start[d] > 1e-10 * (f->loc->upper[d] - f->loc->lower[d]))
        continue;
      lower = PetscMin(lower, start[d]);
      upper = PetscMax(upper, end[d]);
    }
    if (f->loc->period[d] > 0 || upper - lower > 1e-10 * (f->loc->upper[d] - f->loc->lower[d])) *axes |= 1 << d;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetSlidingAxes(Conditions f, PetscInt *axes)
{
  PetscFunctionBeginUser;
  *axes = (1 << f->loc->dim) - 1;
  for (PetscInt b = 0; b < f->n; b++) {
    const Condition *bc   = f->condition + b;
    PetscInt         flat = -1;

    if (bc->type == BC_INFLOW || BoundaryIsFree(bc)) continue;
    for (PetscInt d = 0; d < f->loc->dim; d++)
      if (bc->upper[d] - bc->lower[d] < 1e-10 * (f->loc->upper[d] - f->loc->lower[d])) flat = d;
    *axes &= flat < 0 || bc->type == BC_ROTATING_WALL ? 0 : ~(1 << flat);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does a boundary lie in side `side` of the box? */
static PetscBool is_side(Conditions f, const Condition *bc, PetscInt side)
{
  const PetscInt  a   = side / 2;
  const PetscReal tol = 1e-6 * (f->loc->upper[a] - f->loc->lower[a]);

  return (PetscBool)(side % 2 ? bc->lower[a] > f->loc->upper[a] - tol : bc->upper[a] < f->loc->lower[a] + tol);
}

PetscErrorCode ConditionsGetSolidFaces(Conditions f, PetscInt *faces)
{
  PetscFunctionBeginUser;
  *faces = 0;
  for (PetscInt b = 0; b < f->n; b++) {
    const char *name;

    if (f->condition[b].type > BC_ROTATING_WALL) continue;
    PetscCall(MeshGetBoundaryName(f->mesh, b, &name));
    for (PetscInt i = 0; i < 2 * f->loc->dim; i++) {
      PetscBool match;

      PetscCall(PetscStrcmp(name, DOMAIN_SIDE[i], &match));
      if (match && is_side(f, &f->condition[b], i)) *faces |= 1 << i;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetSide(Conditions f, PetscInt side, PetscReal v[3], PetscBool *wall)
{
  PetscFunctionBeginUser;
  *wall = PETSC_FALSE;
  PetscCall(PetscArrayzero(v, 3));
  for (PetscInt b = 0; b < f->n; b++) {
    const Condition *bc = f->condition + b;
    const char      *name;
    PetscBool        match;

    PetscCall(MeshGetBoundaryName(f->mesh, b, &name));
    PetscCall(PetscStrcmp(name, DOMAIN_SIDE[side], &match));
    if (!match || (bc->type != BC_NO_SLIP && bc->type != BC_MOVING_WALL)) continue;
    *wall = PETSC_TRUE;
    PetscCheck(!bc->formula && !bc->parabolic, f->comm, PETSC_ERR_USER_INPUT,
               "-flow_initial knows no flow between walls whose velocity varies, as that of '%s' does: use -flow_initial steady or expression",
               name);
    for (PetscInt a = 0; a < f->loc->dim; a++) v[a] = bc->factor[0] * bc->velocity[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetKind(Conditions f, PetscInt b, PetscBool *wall, PetscBool *open)
{
  PetscFunctionBeginUser;
  *open = (PetscBool)(f->condition[b].type == BC_INFLOW || BoundaryIsFree(f->condition + b));
  *wall = (PetscBool) !*open;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ConditionsHaveOpening(Conditions f)
{
  PetscBool wall, open = PETSC_FALSE;

  for (PetscInt b = 0; b < f->n && !open; b++) PetscCallAbort(PETSC_COMM_SELF, ConditionsGetKind(f, b, &wall, &open));
  return open;
}

PetscErrorCode ConditionsSticks(Conditions f, PetscInt b, PetscBool *sticks, PetscBool *moves)
{
  const ConditionsType type = f->condition[b].type;

  PetscFunctionBeginUser;
  *sticks = (PetscBool)(type == BC_NO_SLIP || type == BC_MOVING_WALL || type == BC_ROTATING_WALL);
  *moves  = (PetscBool)(type == BC_MOVING_WALL || type == BC_ROTATING_WALL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsIsOutflow(Conditions f, PetscInt b, PetscBool *outflow)
{
  PetscFunctionBeginUser;
  *outflow = BoundaryIsFree(f->condition + b);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ConditionsGetOwners(Conditions f, PetscInt owner[])
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->nnode_all * dim; i++) owner[i] = -1;
  for (PetscInt pass = 0; pass < 5; pass++) {
    for (PetscInt b = 0; b < f->n; b++) {
      const Condition *bc = f->condition + b;
      const PetscInt  *node;
      PetscInt         n;

      if (bc->type != ORDER[pass]) continue;
      PetscCall(MeshGetBoundaryNodes(f->mesh, b, &n, &node));
      for (PetscInt i = 0; i < n; i++)
        for (PetscInt a = 0; a < dim; a++)
          if (bc->type != BC_SLIP || a == bc->axis) owner[node[i] * dim + a] = b;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ConditionsHasPressure(Conditions f, PetscInt b)
{
  return (PetscBool)(f->condition[b].type == BC_PRESSURE);
}
