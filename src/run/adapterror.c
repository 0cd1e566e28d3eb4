/* Adapt, error: the local error of a step, by its difference to the extrapolation of the fields before it (adapt.h). */
#include "compat.h"
#include "adaptimpl.h"
#include "base/rigid.h"

/* Values at n + 1 by extrapolation are weight[0] u^n + weight[1] u^{n-1} + weight[2] u^{n-2}; *weight_error: the part
   of the difference to the solution that is the error of the scheme. False: the history is too short. */
static PetscBool get_predictor(Adapt a, const FlowStep *step, PetscReal weight[3], PetscReal *weight_error)
{
  const PetscReal h = step->dt, k = step->dt_old, l = a->dt_older;
  PetscReal       predictor;

  if (k <= 0 || (step->order == 2 && l <= 0)) return PETSC_FALSE;
  if (step->order == 1) {
    weight[0] = 1 + h / k;
    weight[1] = -h / k;
    weight[2] = 0;
    predictor = 0.5 * (1 + k / h);
  } else {
    weight[0] = (h + k) * (h + k + l) / (k * (k + l));
    weight[1] = -h * (h + k + l) / (k * l);
    weight[2] = h * (h + k) / (l * (k + l));
    predictor = (1 + k / h) * (1 + (k + l) / h) / 6;
  }
  *weight_error = step->error / (step->error + predictor);
  return PETSC_TRUE;
}

/* Mean square difference between solution and extrapolation over the fluid; tells the largest speed too. Collective. */
static PetscErrorCode measure_flow(Adapt a, const PetscReal weight[3], PetscReal *square, PetscReal *speed)
{
  const MeshLocal *l   = a->l;
  const PetscInt   dim = l->dim, *body;
  const PetscReal *m;
  PetscReal       *u, *now, *old, sum[2] = {0, 0}, top = 0;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSystem(a->couple, &u, NULL, NULL, NULL, NULL));
  PetscCall(CoupleGetNodeBody(a->couple, &body));
  PetscCall(FlowGetFields(a->flow, &now, &old, NULL));
  PetscCall(FlowGetLumpedMass(a->flow, &m));
  for (PetscInt i = 0; i < l->nnode; i++) {
    PetscReal diff = 0, size = 0;
    PetscBool still = PETSC_TRUE;

    for (PetscInt d = 0; d < dim; d++) {
      const PetscInt j = i * dim + d;

      diff += PetscSqr(u[j] - weight[0] * now[j] - weight[1] * old[j] - weight[2] * a->u_older[j]);
      size += PetscSqr(u[j]);
      if (l->x[j] != l->x_start[j]) still = PETSC_FALSE;
    }
    top = PetscMax(top, size);
    if (body[i] >= 0 || !still || a->age[i] < CALM_STEPS) continue;
    sum[0] += m[i] * diff;
    sum[1] += m[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, a->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &top, 1, MPIU_REAL, MPIU_MAX, a->comm));
  *square = sum[1] > 0 ? sum[0] / sum[1] : 0;
  *speed  = PetscSqrtReal(top);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean square of dt times that difference in radii, over free bodies out of contact */
static PetscErrorCode measure_bodies(Adapt a, PetscReal dt, const PetscReal weight[3], PetscReal *square)
{
  const BodyState *s   = a->s;
  const PetscInt   dim = a->l->dim;
  PetscReal       *U, sum[2] = {0, 0};
  PetscInt         nr = RigidSize(dim);

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSystem(a->couple, NULL, NULL, &U, NULL, NULL));
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(s, k);

    if (!s->own[k] || !g->free || g->motion.has_pivot || a->calm[k] < CALM_STEPS) continue;
    for (PetscInt i = 0; i < nr; i++) {
      const PetscReal now = RigidValue(dim, s->u[k], s->w[k], i), old = RigidValue(dim, s->u_old[k], s->w_old[k], i);
      const PetscReal older = RigidValue(dim, a->U_older[k], a->U_older[k] + 3, i);

      if (BodiesIsFree(a->bodies, k, i < dim ? i : 3))
        sum[0] += PetscSqr(dt * (i < dim ? 1 / BodiesGetRadius(s, k) : 1) *
                           (U[k * nr + i] - weight[0] * now - weight[1] * old - weight[2] * older));
    }
    sum[1]++;
  }
  PetscCall(BodiesSum(a->bodies, 2, sum));
  *square = sum[1] > 0 ? sum[0] / sum[1] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From the mean squares of both, and the part of them that is the error of the scheme */
static PetscReal combine_errors(const struct _p_Adapt *a, PetscReal weight_error, PetscReal flow, PetscReal bodies)
{
  return weight_error *
         PetscMax(PetscSqrtReal(flow) / (a->o.speed > 0 ? a->o.speed : a->speed_max), PetscSqrtReal(bodies));
}

/* ---- the first step ---- */

/* What the step of length dt reached, where no fields older than the last ones are kept yet */
PetscErrorCode AdaptKeepStart(Adapt a, PetscReal dt)
{
  const BodyState *s   = a->s;
  const PetscInt   dim = a->l->dim, nr = RigidSize(dim);
  PetscReal       *u, *U;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSystem(a->couple, &u, NULL, &U, NULL, NULL));
  PetscCall(PetscArraycpy(a->u_older, u, a->l->nnode_all * dim));
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt i = 0; i < nr; i++) *RigidComponent(dim, a->U_older[k], a->U_older[k] + 3, i) = U[k * nr + i];
  a->start_dt = dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptEstimateStart(Adapt a, PetscReal dt, PetscBool *estimated)
{
  const PetscReal q            = a->start_dt > 0 ? dt / a->start_dt : 0; /* 0: how much changes at all */
  const PetscReal weight[3]    = {1 - q, 0, q};
  const PetscReal weight_error = q > 0 ? 0.5 * q / (1 - q) : 1;
  PetscReal       flow, bodies, speed, driven;

  PetscFunctionBeginUser;
  PetscCall(measure_flow(a, weight, &flow, &speed));
  a->speed_max = PetscMax(a->speed_max, speed);
  PetscCall(measure_bodies(a, dt, weight, &bodies));
  PetscCall(ConditionsGetSpeed(FlowConditions(a->flow), &driven));
  if (driven > 0) flow = 0; /* a boundary may start at once, which no step resolves */
  a->error   = a->speed_max > 0 ? combine_errors(a, weight_error, flow, bodies) : 0;
  *estimated = (PetscBool)(q > 0 || a->error <= a->o.tolerance);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the others ---- */

PetscErrorCode AdaptEstimateError(Adapt a, const FlowStep *step, PetscBool *estimated)
{
  PetscReal weight[3] = {1, 0, 0}, weight_error = 0, flow = 0, bodies = 0, speed = 0;

  PetscFunctionBeginUser;
  *estimated = (PetscBool)(a->smooth >= step->order && get_predictor(a, step, weight, &weight_error));
  PetscCall(measure_flow(a, weight, &flow, &speed));
  a->speed_max = PetscMax(a->speed_max, speed);
  a->error     = 0;
  if (!*estimated || a->speed_max <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(measure_bodies(a, step->dt, weight, &bodies));
  a->error = combine_errors(a, weight_error, flow, bodies);
  PetscFunctionReturn(PETSC_SUCCESS);
}
