/* Bodies, prescribed motion: where bodies are and how they move where they are not free, and where a step is
   predicted to take them. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/domain.h"

/* Nothing prescribed: the common case, which must cost nothing. The motion of a hole of the mesh is that of its
   boundary, which writes the state. */
static PetscBool nothing_prescribed(Bodies b, PetscInt k)
{
  const BodyGroup *g = BodiesGetGroup(&b->view, k);

  return (PetscBool)((g->free == BodyAllFree(b->state.dim) && !b->state.stopped[k]) || g->body_fitted ||
                     b->state.removed[k] || b->fixed);
}

void BodySetStart(Bodies b, PetscInt group, PetscInt i, const PetscReal x[3], const PetscReal q[4], PetscReal angle)
{
  Placement *p = &b->start[group][i];

  p->angle  = angle;
  p->turned = (PetscBool)(b->state.dim == 3);
  (void)PetscArraycpy(p->x, x, 3);
  (void)PetscArraycpy(p->q, q, 4);
}

/* MotionEvaluate of body k, every axis by its own clock */
PetscErrorCode BodyEvaluateMotion(Bodies b, PetscInt k, PetscReal time, PetscReal x[3], PetscReal u[3],
                                  PetscReal turn[3], PetscReal w[3])
{
  const Motion    *m     = &BodiesGetGroup(&b->view, k)->motion;
  const PetscReal *clock = b->clock[b->state.body_group[k]];
  PetscReal        xa[3], ua[3], ta[3], wa[3];

  PetscFunctionBeginUser;
  if (time == PETSC_MAX_REAL) clock = (const PetscReal[4]){0, 0, 0, 0}; /* steady: no time */
  PetscCall(MotionEvaluate(m, BodyStart(b, k), time - clock[3], x, u, turn, w));
  for (PetscInt a = 0; a < b->state.dim; a++) {
    if (clock[a] == clock[3]) continue;
    PetscCall(MotionEvaluate(m, BodyStart(b, k), time - clock[a], xa, ua, ta, wa));
    x[a] = xa[a];
    u[a] = ua[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

void BodyTurnFromStart(Bodies b, PetscInt k, const PetscReal turn[3], PetscReal q[4], PetscReal *angle)
{
  const Placement *p = BodyStart(b, k);

  *angle = p->angle + dot3(turn, BodiesGetGroup(&b->view, k)->motion.axis);
  if (p->turned) (void)PetscArraycpy(q, p->q, 4);
  else RotationFromAngle(b->state.dim == 2 ? *angle : p->angle, q);
  if (b->state.dim == 3) RotationAdvance(1, turn, q);
}

void BodyOrient(Bodies b, PetscInt k, PetscReal angle, const PetscReal turn[3], PetscReal q[4])
{
  const Motion *m = &BodiesGetGroup(&b->view, k)->motion;

  if (b->state.dim == 2) RotationFromAngle(angle, q);
  else if (m->has_hinge) {
    (void)PetscArraycpy(q, BodyStart(b, k)->q, 4);
    RotationAdvance(angle - BodyStart(b, k)->angle, m->hinge, q);
  } else RotationAdvance(1, turn, q);
}

PetscErrorCode BodiesGetPrescribedVelocity(Bodies b, PetscInt k, PetscReal time, PetscReal u[3], PetscReal w[3])
{
  const BodyArrays *s = &b->state;
  const BodyGroup  *g = BodiesGetGroup(&b->view, k);
  PetscReal         x[3], turn[3], uk[3], wk[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(u, s->u[k], 3));
  PetscCall(PetscArraycpy(w, s->w[k], 3));
  if (nothing_prescribed(b, k)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodyEvaluateMotion(b, k, time, x, uk, turn, wk));
  for (PetscInt a = 0; a < 3; a++) {
    if (!BodiesIsFree(b, k, a)) u[a] = uk[a];
    if (!(g->free & BODY_FREE_ROTATION)) w[a] = wk[a];
    else if (s->stopped[k]) w[a] = 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Replace what is not free by its prescribed value at `time`, in x, q, angle and, if wanted, in u, w of the centre.
   Free translation is taken as it is. */
static PetscErrorCode place_prescribed(Bodies b, PetscInt k, PetscReal time, PetscReal X[3], PetscReal q[4],
                                       PetscReal *angle, PetscReal u[], PetscReal w[])
{
  const BodyGroup *g = BodiesGetGroup(&b->view, k);
  PetscReal        x[3], uk[3], turn[3], wk[3], arm[3], spin[3];

  PetscFunctionBeginUser;
  if (nothing_prescribed(b, k)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodyEvaluateMotion(b, k, time, x, uk, turn, wk));
  if (!(g->free & BODY_FREE_ROTATION)) {
    BodyTurnFromStart(b, k, turn, q, angle);
    if (w) PetscCall(PetscArraycpy(w, wk, 3));
  }
  PetscCall(BodiesGetArm(b, k, q, arm));
  if (u) cross(w, arm, spin);
  for (PetscInt a = 0; a < b->state.dim; a++) {
    if (BodiesIsFree(b, k, a)) continue;
    X[a] = x[a] + arm[a] - b->state.frame_next[a];
    if (b->state.travels) X[a] = DomainWrap(b->period[a], X[a], b->lower[a]); /* period 0: as it is */
    if (u) u[a] = uk[a] + spin[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesApplyPrescribed(Bodies b, PetscInt k, PetscReal time)
{
  BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  PetscCall(place_prescribed(b, k, time, s->x[k], s->q[k], &s->angle[k], s->u[k], s->w[k]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesPredict(Bodies b, PetscInt k, PetscReal dt, PetscInt order, PetscReal X[3], PetscReal q[4],
                             PetscReal *angle)
{
  const BodyArrays *s = &b->state;
  const Motion     *m;
  PetscReal         turn[3], now, old;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  PetscCheck(order >= 0 && order <= 2, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Prediction of order %" PetscInt_FMT ": use 0, 1 or 2", order);
  m   = &BodiesGetGroup(&b->view, k)->motion;
  old = order == 2 ? -0.5 * (s->dt_old > 0 ? dt / s->dt_old : 1) : 0;
  now = PetscMin(order, 1) - old;
  for (PetscInt a = 0; a < 3; a++) {
    X[a] = s->x[k][a] + dt * (now * s->u[k][a] + old * s->u_old[k][a]);
    if (order) X[a] -= s->frame_next[a] - s->frame[a];
    turn[a] = dt * (now * s->w[k][a] + old * s->w_old[k][a]);
  }
  *angle = s->angle[k] + dot3(turn, m->hinge);
  if (m->has_stops) *angle = PetscMin(PetscMax(*angle, m->stops[0]), m->stops[1]);
  PetscCall(PetscArraycpy(q, s->q[k], 4));
  BodyOrient(b, k, *angle, turn, q);
  PetscCall(place_prescribed(b, k, s->time + dt, X, q, angle, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}
