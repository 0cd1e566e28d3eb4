/* Bodies, motion: Newton-Euler equations, what is prescribed instead is in prescribed.c. See bodies.h.

   Velocity: Euler step under the force of the step; rotation in 3D by spin.h, which keeps energy and angular momentum
   of a torque-free body. Position: explicit with a weighted mean of old and new velocity, orientation by the
   exponential map. A pivot reduces the body to its rotation about that point: inertia of the parallel axis, centre of
   mass from the angle. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/rigid.h"
#include "base/domain.h"
#include "bodies/spin.h"

#define SHORT_BOUNCE 8 /* steps: a body that is back at a stop so soon stays there */

/* Torque about the reference point of all that acts on body k in the present state: fluid, contact, load */
static PetscErrorCode get_torque(Bodies b, PetscInt k, PetscReal rho_f, const PetscReal gravity[3], PetscReal torque[3])
{
  const BodyArrays *s = &b->state;
  PetscReal         force[3], arm[3], moment[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetLoad(b, k, rho_f, gravity, force, torque));
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  for (PetscInt a = 0; a < 3; a++) force[a] += s->force[k][a] + s->contact_force[k][a];
  cross(arm, force, moment);
  for (PetscInt a = 0; a < 3; a++) torque[a] += s->torque[k][a] + s->contact_torque[k][a] + moment[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesRelease(Bodies b, PetscInt k, PetscReal rho_f, const PetscReal gravity[3])
{
  PetscReal T[3];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  if (!b->state.stopped[k]) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(get_torque(b, k, rho_f, gravity, T));
  if (dot3(T, BodiesGetGroup(&b->view, k)->motion.hinge) * b->state.stopped[k] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  b->state.stopped[k] = 0;
  b->left[k]          = b->state.time;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inertia about the reference point: I + M (arm^2 1 - arm arm^T) */
static PetscErrorCode reference_inertia(Bodies b, PetscInt k, PetscReal inertia[6])
{
  PetscReal arm[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(b, k, NULL, PETSC_FALSE, inertia));
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  add_point_inertia(b->state.density[k] * BodiesVolume(&b->view, k), arm, inertia);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The reference point is the centre or moves with constant velocity; the inertial force of a pivot that is accelerated,
   -M a, acts at the centre. */
static PetscErrorCode advance_rotation(Bodies b, PetscInt k, PetscReal dt, PetscReal rho_f, const PetscReal gravity[3])
{
  BodyArrays      *s = &b->state;
  const BodyGroup *g = BodiesGetGroup(&b->view, k);
  PetscReal        inertia[6], T[3], arm[3], u[2][3], w[3], a[3], moment[3];

  PetscFunctionBeginUser;
  PetscCall(get_torque(b, k, rho_f, gravity, T));
  PetscCall(reference_inertia(b, k, inertia));
  if (g->motion.has_pivot) {
    PetscCall(BodiesGetArm(b, k, NULL, arm));
    PetscCall(BodiesGetPrescribedVelocity(b, k, s->time, u[0], w));
    PetscCall(BodiesGetPrescribedVelocity(b, k, s->time + dt, u[1], w));
    for (PetscInt d = 0; d < 3; d++) a[d] = -s->density[k] * BodiesVolume(&b->view, k) * (u[1][d] - u[0][d]) / dt;
    cross(arm, a, moment);
    for (PetscInt d = 0; d < 3; d++) T[d] += moment[d];
  }
  if (s->dim == 2) s->w[k][2] += dt * T[2] / inertia[2];
  else if (g->motion.has_hinge) {
    PetscReal Ie[3];

    apply_tensor(inertia, g->motion.hinge, Ie);
    for (PetscInt d = 0; d < 3; d++)
      s->w[k][d] += dt * dot3(T, g->motion.hinge) / dot3(Ie, g->motion.hinge) * g->motion.hinge[d];
  } else BodySpin(dt, inertia, T, s->w[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the body has gained in the step since u_old, w_old, with springs and dampers at its end */
static PetscErrorCode resist_gain(Bodies b, PetscInt k, PetscReal dt)
{
  BodyArrays    *s   = &b->state;
  const PetscInt dim = s->dim, nr = RigidSize(dim);
  PetscReal      U[6], gain[6], arm[3], spin[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  cross(s->w_old[k], arm, spin);
  for (PetscInt i = 0; i < nr; i++) {
    const PetscReal now = RigidValue(dim, s->u[k], s->w[k], i), old = RigidValue(dim, s->u_old[k], s->w_old[k], i);

    U[i]    = i < dim ? old - spin[i] : old;
    gain[i] = i >= dim || BodiesIsFree(b, k, i) ? now - old : 0;
  }
  PetscCall(BodyDampGain(b, k, dt, U, gain));
  for (PetscInt i = 0; i < nr; i++) {
    const PetscReal old = RigidValue(dim, s->u_old[k], s->w_old[k], i);

    if (i >= dim || BodiesIsFree(b, k, i)) *RigidComponent(dim, s->u[k], s->w[k], i) = old + gain[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAdvanceVelocity(Bodies b, PetscReal dt, PetscReal rho_f, const PetscReal gravity[3])
{
  BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal mass = s->density[k] * BodiesVolume(&b->view, k);
    PetscReal       force[3], torque[3], u[3], w[3], spin[3], arm[3];

    PetscCall(PetscArraycpy(s->u_old[k], s->u[k], 3));
    PetscCall(PetscArraycpy(s->w_old[k], s->w[k], 3));
    PetscCall(BodiesGetLoad(b, k, rho_f, gravity, force, torque));
    for (PetscInt a = 0; a < s->dim; a++)
      if (BodiesIsFree(b, k, a)) s->u[k][a] += dt * (s->force[k][a] + s->contact_force[k][a] + force[a]) / mass;
    BodiesKeepAxes(&b->view, k, s->u[k], NULL);
    PetscCall(BodiesRelease(b, k, rho_f, gravity));
    if (BodiesIsFree(b, k, 3)) PetscCall(advance_rotation(b, k, dt, rho_f, gravity));
    if (BodiesGroupResists(BodiesGetGroup(&b->view, k))) PetscCall(resist_gain(b, k, dt));
    PetscCall(BodiesGetPrescribedVelocity(b, k, s->time + dt, u, w));
    PetscCall(BodiesGetArm(b, k, NULL, arm));
    cross(w, arm, spin);
    for (PetscInt a = 0; a < 3; a++) {
      if (a < s->dim && !BodiesIsFree(b, k, a)) s->u[k][a] = u[a] + spin[a];
      s->w[k][a] = w[a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A body that has come to a stop in the step, in angles that grow towards it: speed at the impact, and for how long it
   has been over at the end. The acceleration is that of the step. */
static void find_impact(PetscReal beyond, PetscReal speed, PetscReal acceleration, PetscReal dt, PetscReal *impact,
                        PetscReal *since)
{
  *impact = acceleration > 0 ? PetscSqrtReal(PetscMax(0, speed * speed - 2 * acceleration * beyond)) : speed;
  *since  = PetscMin(dt, 2 * beyond / (speed + *impact));
}

static void stop_at_limit(BodyArrays *s, PetscInt k, PetscInt side, PetscReal stop)
{
  s->angle[k]   = stop;
  s->stopped[k] = side;
  for (PetscInt a = 0; a < 3; a++) s->w[k][a] = s->w_old[k][a] = 0;
}

/* The rebound of a body that has passed a stop (see bodies.h). Both velocities make the same jump, so that their
   difference stays the acceleration. The fluid around the body keeps its velocity, and may press it to the stop again
   within a step or two: that, too, is the end of its bounces. */
static void keep_stops(Bodies b, PetscInt k, PetscReal dt)
{
  BodyArrays     *s = &b->state;
  const Motion   *m = &BodiesGetGroup(&b->view, k)->motion;
  const PetscReal w = dot3(s->w[k], m->hinge), w_old = dot3(s->w_old[k], m->hinge), end = s->time + dt;
  const PetscInt  side = s->angle[k] >= m->stops[1] ? 1 : s->angle[k] <= m->stops[0] ? -1 : 0;
  const PetscReal stop = m->stops[side > 0], speed = side * w, gain = side * (w - w_old);
  PetscReal       impact, since, jump;

  if (!m->has_stops || !side) return;
  if (speed <= 0) { /* has turned round by itself within the step */
    s->angle[k] = stop;
    return;
  }
  find_impact(side * (s->angle[k] - stop), speed, gain / dt, dt, &impact, &since);
  if (m->restitution == 0 || m->restitution * impact <= 2 * PetscAbsReal(gain) ||
      end - b->left[k] <= SHORT_BOUNCE * dt) {
    stop_at_limit(s, k, side, stop);
    return;
  }
  jump        = -m->restitution * impact + (speed - impact) - speed;
  s->angle[k] = PetscClipInterval(stop - side * (m->restitution * impact - 0.5 * (speed - impact)) * since, m->stops[0],
                                  m->stops[1]);
  b->left[k]  = end - since;
  for (PetscInt a = 0; a < 3; a++) {
    s->w[k][a] += side * jump * m->hinge[a];
    s->w_old[k][a] += side * jump * m->hinge[a];
  }
}

/* Of scenes with stops; files of before have none */
PetscErrorCode BodyVisitStops(Bodies b, const BodyRows *rows, State state)
{
  PetscBool any = PETSC_FALSE;
  PetscInt  n   = b->state.nall;

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < b->state.ngroups; g++) any = (PetscBool)(any || b->state.group[g].motion.has_stops);
  if (StateIsLoading(state)) PetscCall(StateGetSize(state, "left_stop", &n));
  if (any && n == b->state.nall) PetscCall(BodiesVisitReals(b, rows, state, "left_stop", 1, b->left));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAdvancePosition(Bodies b, PetscReal dt, PetscReal theta)
{
  BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal w[3], turn[3] = {0};

    for (PetscInt a = 0; a < 3; a++) {
      if (a < s->dim) s->x[k][a] += dt * (theta * s->u[k][a] + (1 - theta) * s->u_old[k][a]);
      s->x[k][a] -= s->frame_next[a] - s->frame[a];
      w[a] = theta * s->w[k][a] + (1 - theta) * s->w_old[k][a];
    }
    s->angle[k] += dt * dot3(w, BodiesGetGroup(&b->view, k)->motion.hinge);
    keep_stops(b, k, dt);
    PetscCall(PetscArraycpy(s->q_old[k], s->q[k], 4));
    if (s->dim == 3) BodyTurn(dt, s->w_old[k], s->w[k], turn);
    BodyOrient(b, k, s->angle[k], turn, s->q[k]);
    PetscCall(BodiesApplyPrescribed(b, k, s->time + dt));
    for (PetscInt a = 0; a < s->dim; a++)
      PetscCheck(!PetscIsInfOrNanReal(s->x[k][a]) && !PetscIsInfOrNanReal(s->angle[k]), PETSC_COMM_SELF, PETSC_ERR_FP,
                 "Body %" PetscInt_FMT " of group '%s' has left all bounds (velocity %g): lower -sim_dt",
                 BodiesIndexInGroup(&b->view, k), BodiesGetGroup(&b->view, k)->name, (double)s->u[k][a]);
  }
  s->time += dt;
  s->dt_old = dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesResize(Bodies b, const PetscReal scale[])
{
  BodyArrays *s = &b->state;
  PetscReal   largest[BODIES_MAX_GROUPS];

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++) largest[g] = s->group[g].largest;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscInt g = s->body_group[k];

    if (!s->group[g].grows || s->removed[k]) continue;
    s->scale[k] = scale[k];
    largest[g]  = PetscMax(largest[g], scale[k]);
  }
  PetscCall(BodiesMax(b, s->ngroups, largest));
  for (PetscInt g = 0; g < s->ngroups; g++) s->group[g].largest = largest[g];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAreStill(Bodies b, PetscBool *still)
{
  const BodyArrays *s     = &b->state;
  PetscBool         moves = (PetscBool)(s->travels && s->nall);

  PetscFunctionBeginUser;
  for (PetscInt g = 0; g < s->ngroups; g++)
    moves = (PetscBool)(moves || s->group[g].free || s->group[g].motion.given || s->group[g].grows);
  if (!moves) { /* all ranks have come here */
    for (PetscInt i = 0; i < 3 * s->n && !moves; i++)
      moves = (PetscBool)(s->u[i / 3][i % 3] != 0 || s->w[i / 3][i % 3] != 0);
    PetscCall(BodiesAny(b, &moves));
  }
  *still = (PetscBool)!moves;
  PetscFunctionReturn(PETSC_SUCCESS);
}
