/* Flow, time schemes (flow.h): coefficients of a step, extrapolation of the convecting velocity, history of fields. */
#include "compat.h"
#include "flow/device.h"
#include "impl.h"

#define MAX_CURVATURE 1                      /* that a parabola adds, beside what the linear form does */
#define HUGE_CFL      5                      /* and beyond which it may grow: 2D-3 on a coarse mesh does from 6 on */
#define LARGE_CFL     2                      /* beyond which a step takes it */
#define FSTHETA       0.29289321881345247560 /* 1 - sqrt(1/2) */

/* What makes a parabola of w; limited where the flow chose it itself */
static void add_curvature(Flow f)
{
  const PetscInt  dim   = f->loc->dim;
  const PetscReal limit = f->par.extrapolation == FLOW_AUTO ? MAX_CURVATURE : PETSC_MAX_REAL;

  for (PetscInt i = 0; i < f->loc->nnode_all; i++) {
    PetscReal c[3], change = 0, size = 0, scale;

    for (PetscInt a = 0, j = i * dim; a < dim; a++, j++) {
      c[a] = f->time.curvature *
             ((f->u[j] - f->u_old[j]) / f->time.dt_old - (f->u_old[j] - f->u_older[j]) / f->time.dt_older);
      size += PetscSqr(c[a]);
      change += PetscSqr(f->time.extrapolation * (f->u[j] - f->u_old[j]));
    }
    scale = limit < PETSC_MAX_REAL && size > PetscSqr(limit) * change ? limit * PetscSqrtReal(change / size) : 1;
    for (PetscInt a = 0; a < dim; a++) f->w[i * dim + a] += scale * c[a];
  }
}

PetscErrorCode FlowAllowParabola(Flow f, PetscBool allow)
{
  PetscFunctionBeginUser;
  f->time.parabola = (PetscBool)(allow && f->par.extrapolation == FLOW_AUTO && f->par.convection &&
                                 !(f->material && f->material->linear));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowExtrapolateConvection(Flow f)
{
  PetscFunctionBeginUser;
  if (f->material) (*f->material->outdate)(f);
  if (FlowStaysOnDevice(f) && f->time.curvature == 0 && !f->mesh_velocity) {
    if (f->par.convection) PetscCall(OnDeviceConvect(f));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowBringFields(f));
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim && f->par.convection; i++)
    f->w[i] = f->u[i] + f->time.extrapolation * (f->u[i] - f->u_old[i]);
  if (f->time.curvature > 0) add_curvature(f);
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim && f->mesh_velocity; i++) f->w[i] -= f->mesh_velocity[i];
  if (f->device) PetscCall(OnDeviceForgetConvection(f));
  if (f->step.frame[0] == 0 && f->step.frame[1] == 0 && f->step.frame[2] == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim && f->par.convection; i++)
    f->w[i] -= f->step.frame[i % f->loc->dim];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetSubsteps(Flow f, PetscInt *n, const PetscReal *fraction[])
{
  static const PetscReal whole[1] = {1}, substeps[3] = {FSTHETA, 1 - 2 * FSTHETA, FSTHETA};

  PetscFunctionBeginUser;
  *n = f->time.scheme == SCHEME_FSTHETA ? 3 : 1;
  if (fraction) *fraction = f->time.scheme == SCHEME_FSTHETA ? substeps : whole;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowBeginStep(Flow f, PetscReal time, PetscReal dt)
{
  FlowStep       *s     = &f->step;
  const PetscBool first = (PetscBool)(f->time.nsteps == 0);
  const PetscReal r     = first ? 0 : dt / f->time.dt_old; /* ratio of steps */
  PetscBool       parabola;

  PetscFunctionBeginUser;
  s->time               = time;
  s->dt                 = dt;
  s->dt_old             = first ? 0 : f->time.dt_old;
  s->error              = 0.5;
  s->ct                 = 1 / dt;
  s->d0                 = 1 / dt;
  s->d1                 = 0;
  s->theta              = 1;
  s->order              = 1;
  f->time.extrapolation = 0;
  if (f->time.scheme == SCHEME_BDF2 && !first) {
    s->ct                 = (1 + 2 * r) / ((1 + r) * dt);
    s->d0                 = (1 + r) / dt;
    s->d1                 = -r * r / ((1 + r) * dt);
    f->time.extrapolation = r;
    s->order              = 2;
    s->error              = PetscSqr(1 + 1 / r) / (6 * (2 + 1 / r));
  } else if (f->time.scheme == SCHEME_CN || f->time.scheme == SCHEME_FSTHETA) {
    s->theta = f->time.scheme == SCHEME_CN ? 0.5 : (f->time.substep == 1 ? FSTHETA : 1 - 2 * FSTHETA) / (1 - FSTHETA);
    f->time.extrapolation = s->theta * r;
    s->order              = first ? 1 : 2;
    s->error              = f->time.scheme == SCHEME_CN ? 1. / 12 : 0;
  }
  /* Newton's interpolation */
  parabola          = (PetscBool)(f->par.extrapolation != FLOW_AUTO ||
                         (f->time.parabola && !first && f->time.cfl * r > LARGE_CFL && f->time.cfl * r <= HUGE_CFL));
  f->time.curvature = f->time.dt_older > 0 && parabola
                      ? f->time.extrapolation * (f->time.extrapolation + 1) * f->time.dt_old * f->time.dt_old /
                          (f->time.dt_old + f->time.dt_older)
                      : 0;
  if (f->material && f->material->begin) PetscCall((*f->material->begin)(f, dt));
  if (f->device) PetscCall(OnDeviceBeginStep(f));
  PetscCall(FlowExtrapolateConvection(f));
  PetscCall(FlowEvaluateForces(f));
  PetscCall(ConditionsSetTime(f->boundary, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowForgetHistory(Flow f)
{
  PetscFunctionBeginUser;
  f->time.nsteps = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowBeginSteady(Flow f, PetscReal rate)
{
  FlowStep *s = &f->step;

  PetscFunctionBeginUser;
  if (f->material && f->material->refuse_steady) PetscCall((*f->material->refuse_steady)(f));
  PetscCall(FlowRefuseTime(f));
  s->time               = 0;
  s->dt                 = 0;
  s->ct                 = rate;
  s->d0                 = rate;
  s->d1                 = 0;
  s->theta              = 1;
  s->order              = 1;
  f->time.extrapolation = 0;
  PetscCall(FlowSetConvection(f, f->u));
  PetscCall(FlowSetRheologyVelocity(f, f->u));
  PetscCall(FlowEvaluateForces(f));
  PetscCall(ConditionsSetTime(f->boundary, PETSC_MAX_REAL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddRate(Flow f, PetscReal more, PetscReal *now)
{
  PetscFunctionBeginUser;
  f->step.ct += more;
  *now = f->step.ct;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetMeshVelocity(Flow f, const PetscReal velocity[])
{
  PetscFunctionBeginUser;
  PetscCheck(f->step.theta == 1 && f->par.convection && f->par.skew == 0 && f->par.extrapolation != FLOW_QUADRATIC,
             f->comm, PETSC_ERR_SUP,
             "A mesh that follows bodies (-mesh_deform) carries its velocity in the convection at the end of a step: use -flow_time bdf2 or be, -flow_convection true, "
             "-flow_convection_form convective and -flow_extrapolation linear, or remove -mesh_deform");
  f->mesh_velocity = velocity;
  PetscCall(FlowExtrapolateConvection(f));
  PetscCall(FlowEvaluateForces(f));
  PetscCall(ConditionsSetTime(f->boundary, f->step.time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetMeshVelocity(Flow f, const PetscReal *velocity[])
{
  PetscFunctionBeginUser;
  *velocity = f->mesh_velocity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetFrame(Flow f, const PetscReal v[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(f->step.frame, v, 3));
  PetscCall(FlowExtrapolateConvection(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSetConvection(Flow f, const PetscReal w[])
{
  PetscFunctionBeginUser;
  if (f->par.convection) PetscCall(PetscArraycpy(f->w, w, f->loc->nnode_all * f->loc->dim));
  if (f->device) PetscCall(OnDeviceForgetConvection(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetStep(Flow f, const FlowStep **step)
{
  PetscFunctionBeginUser;
  *step = &f->step;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowExtrapolate(Flow f, PetscReal u[], PetscReal p[], PetscReal dp[])
{
  const PetscReal r = f->time.nsteps > 1 ? f->step.dt / f->time.dt_old : 0;

  PetscFunctionBeginUser;
  if (FlowStaysOnDevice(f)) {
    PetscCall(OnDeviceExtrapolate(f));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowBringFields(f));
  for (PetscInt i = 0; i < f->loc->nnode_all * f->loc->dim; i++) u[i] = f->u[i] + r * (f->u[i] - f->u_old[i]);
  PetscCall(PetscArraycpy(p, f->p, f->loc->ncell * (f->loc->dim + 1)));
  for (PetscInt i = 0; i < f->loc->ncell * (f->loc->dim + 1) && dp; i++)
    dp[i] = f->time.nsteps > 1 ? f->p[i] - f->p_old[i] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u_older <- u_old <- u <- that of the step, p_old <- p likewise */
static PetscErrorCode move_fields(Flow f, const PetscReal u[], const PetscReal p[])
{
  const PetscInt nu = f->loc->nnode_all * f->loc->dim, np = f->loc->ncell * (f->loc->dim + 1);
  PetscReal     *swap;

  PetscFunctionBeginUser;
  if (f->device) PetscCall(OnDeviceBring(f, PETSC_TRUE));
  swap             = f->u_older ? f->u_older : f->u_old;
  f->u_older       = f->u_older ? f->u_old : NULL;
  f->time.dt_older = f->u_older && f->time.nsteps ? f->time.dt_old : 0;
  f->u_old         = f->u;
  f->u             = swap;
  PetscCall(PetscArraycpy(f->p_old, f->p, np));
  if (FlowStaysOnDevice(f)) PetscCall(OnDeviceTakeLast(f, f->u, f->p));
  else {
    PetscCall(PetscArraycpy(f->u, u, nu));
    PetscCall(PetscArraycpy(f->p, p, np));
  }
  if (f->device) PetscCall(OnDeviceReport(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAcceptStep(Flow f, const PetscReal u[], const PetscReal p[])
{
  PetscFunctionBeginUser;
  if (f->material && f->material->accept) PetscCall((*f->material->accept)(f, u));
  /* from now on it is kept */
  if (f->time.parabola && !f->u_older && f->time.cfl > LARGE_CFL)
    PetscCall(PetscCalloc1(f->loc->nnode_all * f->loc->dim, &f->u_older));
  if (FlowStaysOnDevice(f) && !f->u_older) PetscCall(OnDeviceAccept(f));
  else PetscCall(move_fields(f, u, p));
  f->time.dt_old = f->step.dt;
  f->time.nsteps++;
  f->time.substep = f->time.scheme == SCHEME_FSTHETA ? (f->time.substep + 1) % 3 : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}
