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
  PetscCall(FlowReadFluid(dim, &f->par.density, f->par.gravity, &f->gravity));
  PetscCall(ExprRead("-flow_force", dim, dim, f->given, &f->force, NULL));
  PetscCall(PetscArraycpy(f->par.force, f->given, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Memory for nodal forces, if there are any */
static PetscErrorCode allocate_source(Flow f)
{
  const PetscBool wanted = (PetscBool)(f->source_field || (f->force && ExprUsesPlace(f->force)));

  PetscFunctionBeginUser;
  if (!wanted) PetscCall(PetscFree(f->source));
  else if (!f->source) PetscCall(PetscCalloc1(f->loc->nnode_all * f->loc->dim, &f->source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetSource(Flow f, VectorField field, void *ctx)
{
  PetscFunctionBeginUser;
  f->source_field = field;
  f->source_ctx   = ctx;
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

    PetscCall(f->source_field(f->source_ctx, s->time, f->loc->x + i * dim, end));
    if (s->theta < 1) PetscCall(f->source_field(f->source_ctx, s->time - s->dt, f->loc->x + i * dim, begin));
    for (PetscInt a = 0; a < dim; a++) f->source[i * dim + a] += s->theta * end[a] + (1 - s->theta) * begin[a];
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
  PetscCall(ExprKeep(f->force, s->time, l->nnode_all, l->x, &end));
  if (s->theta < 1 && ExprUsesTime(f->force)) {
    PetscCall(PetscMalloc1(l->nnode_all * l->dim, &begin));
    PetscCall(ExprEvaluate(f->force, s->time - s->dt, l->nnode_all, l->x, begin));
  }
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) f->source[i] += begin ? s->theta * end[i] + (1 - s->theta) * begin[i] : end[i];
  PetscCall(PetscFree(begin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetDrive(Flow f, const PetscReal force[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    f->drive[a]     = force[a];
    f->par.force[a] = f->given[a] + force[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowEvaluateForces(Flow f)
{
  PetscFunctionBeginUser;
  if (f->gravity) PetscCall(average(f, f->gravity, NULL, f->par.gravity));
  if (f->force && !ExprUsesPlace(f->force)) PetscCall(average(f, f->force, NULL, f->given));
  PetscCall(FlowSetDrive(f, f->drive));
  PetscCall(allocate_source(f));
  if (!f->source) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(f->source, f->loc->nnode_all * f->loc->dim));
  if (f->source_field) PetscCall(add_field(f));
  if (f->force && ExprUsesPlace(f->force)) PetscCall(add_force(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowRefuseTime(Flow f)
{
  const char *const name[] = {"-flow_gravity", "-flow_force"};
  const Expr        expr[] = {f->gravity, f->force};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++)
    PetscCheck(!expr[i] || !ExprUsesTime(expr[i]), PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
               "Option %s = %s changes in time, and such a flow has no steady state: remove t, or run in time without -sim_steady", name[i],
               ExprText(expr[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetSource(Flow f, const PetscReal *source[])
{
  PetscFunctionBeginUser;
  *source = f->source;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowForceAt(Flow f, const PetscReal x[], PetscReal force[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(force, f->par.force, 3));
  if (!f->force || !ExprUsesPlace(f->force)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(average(f, f->force, x, force));
  for (PetscInt a = 0; a < f->loc->dim; a++) force[a] += f->drive[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddTraction(Flow f, PetscReal r[])
{
  PetscFunctionBeginUser;
  if (f->traction) TractionAdd(f->traction, r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasTraction(Flow f)
{
  return (PetscBool)(f->traction != NULL);
}
