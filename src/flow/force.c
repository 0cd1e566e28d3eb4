/* Flow, what drives it (flow.h): gravity and body forces that are expressions, as the step takes them. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

PetscErrorCode FlowReadFluid(PetscInt dim, PetscReal *density, PetscReal gravity[], Expr *changing)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-flow_density", density));
  PetscCall(ExprRead("-flow_gravity", dim, dim, gravity, changing, NULL));
  if (*changing) PetscCall(ExprEvaluate(*changing, 0, 1, NULL, gravity));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowReadForces(Flow f)
{
  const PetscInt dim = f->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(FlowReadFluid(dim, &f->par.density, f->par.gravity, &f->force.gravity));
  PetscCall(ExprRead("-flow_force", dim, dim, f->force.given, &f->force.expr, NULL));
  PetscCall(PetscArraycpy(f->par.force, f->force.given, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Memory for nodal forces, if there are any */
static PetscErrorCode allocate_source(Flow f)
{
  const PetscBool wanted = (PetscBool)(f->force.field || (f->force.expr && ExprUsesPosition(f->force.expr)));

  PetscFunctionBeginUser;
  if (!wanted) PetscCall(PetscFree(f->force.source));
  else if (!f->force.source) PetscCall(PetscCalloc1(f->loc->nnode_all * f->loc->dim, &f->force.source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetSource(Flow f, VectorField field, void *ctx)
{
  PetscFunctionBeginUser;
  f->force.field = field;
  f->force.ctx   = ctx;
  PetscCall(allocate_source(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* theta times the expressions at the end of the step + (1 - theta) times those at its beginning: value [dim] */
static PetscErrorCode average(Flow f, Expr e, const PetscReal x[], PetscReal value[])
{
  const FlowStep *s = &f->step;
  PetscReal       begin[3];

  PetscFunctionBeginUser;
  PetscCall(ExprEvaluate(e, s->time, 1, x, value));
  if (s->theta == 1 || !ExprUsesTime(e)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ExprEvaluate(e, s->time - s->dt, 1, x, begin));
  for (PetscInt a = 0; a < f->loc->dim; a++) value[a] = s->theta * value[a] + (1 - s->theta) * begin[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_field(Flow f)
{
  const PetscInt  dim = f->loc->dim;
  const FlowStep *s   = &f->step;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < f->loc->nnode_all; i++) {
    PetscReal end[3], begin[3] = {0, 0, 0};

    PetscCall(f->force.field(f->force.ctx, s->time, f->loc->x + i * dim, end));
    if (s->theta < 1) PetscCall(f->force.field(f->force.ctx, s->time - s->dt, f->loc->x + i * dim, begin));
    for (PetscInt a = 0; a < dim; a++) f->force.source[i * dim + a] += s->theta * end[a] + (1 - s->theta) * begin[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_force(Flow f)
{
  const MeshLocal *l = f->loc;
  const FlowStep  *s = &f->step;
  const PetscReal *end;
  PetscReal       *begin = NULL;

  PetscFunctionBeginUser;
  PetscCall(ExprKeep(f->force.expr, s->time, l->nnode_all, l->x, &end));
  if (s->theta < 1 && ExprUsesTime(f->force.expr)) {
    PetscCall(PetscMalloc1(l->nnode_all * l->dim, &begin));
    PetscCall(ExprEvaluate(f->force.expr, s->time - s->dt, l->nnode_all, l->x, begin));
  }
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++)
    f->force.source[i] += begin ? s->theta * end[i] + (1 - s->theta) * begin[i] : end[i];
  PetscCall(PetscFree(begin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetMeanPressureGradient(Flow f, const PetscReal force[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    f->force.pressure_gradient[a] = force[a];
    f->par.force[a]               = f->force.given[a] + force[a];
    if (f->force.kept.impulse[a] != 0 && f->step.dt > 0) f->par.force[a] += f->force.kept.impulse[a] / f->step.dt;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowCheckKept(Flow f)
{
  PetscInt open;

  PetscFunctionBeginUser;
  if (!f->force.kept.wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!ConditionsHaveOpening(f->boundary), f->comm, PETSC_ERR_USER_INPUT,
             "-flow_convection_form conservative counts on a domain without inflow or outflow, through which momentum goes: use convective or skew");
  PetscCall(ConditionsGetOpenAxes(f->boundary, &open));
  f->force.kept.axes = open & ~f->par.rate_axes; /* there the mean velocity is held */
  PetscFunctionReturn(PETSC_SUCCESS);
}

void FlowKeepMomentum(Flow f, const PetscReal flux[3], PetscReal volume)
{
  for (PetscInt a = 0; a < f->loc->dim; a++)
    if ((f->force.kept.axes >> a) & 1) f->force.kept.impulse[a] = flux[a] / volume * f->step.dt;
}

PetscErrorCode FlowEvaluateForces(Flow f)
{
  PetscFunctionBeginUser;
  if (f->force.gravity) PetscCall(average(f, f->force.gravity, NULL, f->par.gravity));
  if (f->force.expr && !ExprUsesPosition(f->force.expr)) PetscCall(average(f, f->force.expr, NULL, f->force.given));
  PetscCall(FlowSetMeanPressureGradient(f, f->force.pressure_gradient));
  PetscCall(allocate_source(f));
  if (!f->force.source) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(f->force.source, f->loc->nnode_all * f->loc->dim));
  if (f->force.field) PetscCall(add_field(f));
  if (f->force.expr && ExprUsesPosition(f->force.expr)) PetscCall(add_force(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRefuseTime(Flow f)
{
  const char *const name[] = {"-flow_gravity", "-flow_force"};
  const Expr        expr[] = {f->force.gravity, f->force.expr};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++)
    PetscCheck(!expr[i] || !ExprUsesTime(expr[i]), f->comm, PETSC_ERR_USER_INPUT,
               "Option %s = %s changes in time, and such a flow has no steady state: remove t, or run in time without -sim_steady",
               name[i], ExprText(expr[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetSource(Flow f, const PetscReal *source[])
{
  PetscFunctionBeginUser;
  *source = f->force.source;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowForceAt(Flow f, const PetscReal x[], PetscReal force[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(force, f->par.force, 3));
  if (!f->force.expr || !ExprUsesPosition(f->force.expr)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(average(f, f->force.expr, x, force));
  for (PetscInt a = 0; a < f->loc->dim; a++) force[a] += f->par.force[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddTraction(Flow f, PetscReal r[])
{
  PetscFunctionBeginUser;
  if (f->force.traction) TractionAdd(f->force.traction, r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasTraction(Flow f)
{
  return (PetscBool)(f->force.traction != NULL);
}
