/* Flight: see flight.h. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "bodies/flight.h"

#define STAGES        3
#define SWEEPS        40    /* of the stages before a step is halved */
#define CONVERGED     1e-13 /* changes of their rates, in units of scale_rates: small enough if they grow no more */
#define DIVERGED      1e10
#define FINEST        131072 /* parts of a step at most */
#define FINE          1024   /* parts of a step in which a line becomes taut or slack */
#define BRIEF_REBOUND 0.01   /* rebounds that last less of a step end at the stop */
#define REBOUNDS      10000  /* in a step at most */
#define LOCATIONS     60     /* of the moment of an impact or release */

/* Places in the vector of what is integrated: place and velocity of the centre, angle and its rate, orientation and
   angular momentum */
enum {
  AT_X,
  AT_U     = 3,
  AT_ANGLE = 6,
  AT_RATE,
  AT_Q,
  AT_L = 12,
  SIZE = 15
};

/* How the rotation goes on */
typedef enum {
  TURNS_GIVEN, /* prescribed, or rests on a stop */
  TURNS_AXIS,
  TURNS_SPACE
} Turning;

typedef struct {
  Bodies              b;
  PetscInt            k;
  const BodyGroup    *g;
  const Surroundings *around;
  Turning             turning;
  PetscReal           mass, about; /* with what moves along; inertia about the axis */
  PetscReal           difference;  /* in time, for the acceleration of a pivot */
} Flight;

static const PetscReal GAUSS_C[STAGES] = {0.11270166537925831148, 0.5, 0.88729833462074168852};
static const PetscReal GAUSS_B[STAGES] = {5. / 18, 4. / 9, 5. / 18};
static const PetscReal GAUSS_A[STAGES][STAGES] =
  {{0.13888888888888888889, -0.035976667524938934568, 0.0097894440152308325856},
   {0.30026319498086459244, 0.22222222222222222222, -0.022485417203086814660},
   {0.26798833376246945173, 0.48042111196938334790, 0.13888888888888888889}};

PetscErrorCode FlightGetInertia(Bodies b, PetscInt k, const PetscReal q[4], const Surroundings *around,
                                PetscReal inertia[6])
{
  PetscReal arm[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(b, k, q, PETSC_TRUE, inertia));
  PetscCall(BodiesGetArm(b, k, q, arm));
  for (PetscInt i = 0; i < 6; i++) inertia[i] *= b->state.density[k] + around->added_spin;
  add_point_inertia((b->state.density[k] + around->added) * BodiesVolume(&b->view, k), arm, inertia);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool moves_along(const Flight *f, PetscInt a)
{
  return (PetscBool)(f->g->free >> a & 1);
}

/* ---- what is integrated ---- */

static PetscErrorCode begin(Bodies b, PetscInt k, const Surroundings *around, PetscReal h, Flight *f)
{
  const PetscReal *e;
  PetscReal        inertia[6], Ie[3];

  PetscFunctionBeginUser;
  *f = (Flight){.b = b, .k = k, .g = BodiesGetGroup(&b->view, k), .around = around, .difference = 1e-3 * h};
  e  = f->g->motion.hinge;

  f->mass    = (b->state.density[k] + around->added) * BodiesVolume(&b->view, k);
  f->turning = !BodiesIsFree(b, k, 3)                      ? TURNS_GIVEN
             : b->state.dim == 2 || f->g->motion.has_hinge ? TURNS_AXIS
                                                           : TURNS_SPACE;
  if (!(f->g->free & BODY_FREE_ROTATION)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlightGetInertia(b, k, b->state.q[k], around, inertia));
  apply_tensor(inertia, e, Ie);
  f->about = dot3(e, Ie);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode pack(const Flight *f, PetscReal y[SIZE])
{
  const BodyArrays *s = &f->b->state;
  PetscReal         inertia[6];

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(y + AT_X, s->x[f->k], 3));
  PetscCall(PetscArraycpy(y + AT_U, s->u[f->k], 3));
  PetscCall(PetscArraycpy(y + AT_Q, s->q[f->k], 4));
  y[AT_ANGLE] = s->angle[f->k];
  y[AT_RATE]  = dot3(s->w[f->k], f->g->motion.hinge);
  PetscCall(PetscArrayzero(y + AT_L, 3));
  if (f->turning != TURNS_SPACE) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlightGetInertia(f->b, f->k, s->q[f->k], f->around, inertia));
  apply_tensor(inertia, s->w[f->k], y + AT_L);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* w of the angular momentum L */
static void invert(const PetscReal t[6], const PetscReal L[3], PetscReal w[3])
{
  const PetscReal full[9] = {t[0], t[3], t[4], t[3], t[1], t[5], t[4], t[5], t[2]};

  solve3(full, L, w);
}

/* Orientation and angular velocity by what is integrated, prescribed or held */
static PetscErrorCode turn_pose(const Flight *f, const PetscReal y[SIZE], const PetscReal turn[3], const PetscReal w[3],
                                BodyPose *p)
{
  const BodyArrays *s       = &f->b->state;
  const PetscReal   none[3] = {0, 0, 0};
  PetscReal         inertia[6], size;

  PetscFunctionBeginUser;
  p->angle = y[AT_ANGLE];
  PetscCall(PetscArraycpy(p->q, s->q[f->k], 4));
  PetscCall(PetscArrayzero(p->w, 3));
  if (f->turning == TURNS_SPACE) {
    size = PetscSqrtReal(y[AT_Q] * y[AT_Q] + dot3(y + AT_Q + 1, y + AT_Q + 1));
    for (PetscInt a = 0; a < 4; a++) p->q[a] = y[AT_Q + a] / size;
    PetscCall(FlightGetInertia(f->b, f->k, p->q, f->around, inertia));
    invert(inertia, y + AT_L, p->w);
  } else if (f->g->free & BODY_FREE_ROTATION) { /* or it rests on a stop */
    BodyOrient(f->b, f->k, p->angle, none, p->q);
    for (PetscInt a = 0; a < 3 && f->turning == TURNS_AXIS; a++) p->w[a] = y[AT_RATE] * f->g->motion.hinge[a];
  } else {
    BodyTurnFromStart(f->b, f->k, turn, p->q, &p->angle);
    PetscCall(PetscArraycpy(p->w, w, 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where the body is by y, and the velocity of its pivot */
static PetscErrorCode take_pose(const Flight *f, PetscReal time, const PetscReal y[SIZE], BodyPose *p, PetscReal arm[3])
{
  PetscReal x[3] = {0, 0, 0}, u[3] = {0, 0, 0}, turn[3] = {0, 0, 0}, w[3] = {0, 0, 0}, spin[3];

  PetscFunctionBeginUser;
  p->time = time;
  if (f->b->start[f->b->state.body_group[f->k]]) PetscCall(BodyEvaluateMotion(f->b, f->k, time, x, u, turn, w));
  PetscCall(turn_pose(f, y, turn, w, p));
  PetscCall(BodiesGetArm(f->b, f->k, p->q, arm));
  cross(p->w, arm, spin);
  for (PetscInt a = 0; a < 3; a++) {
    p->x[a] = moves_along(f, a) ? y[AT_X + a] : x[a] + arm[a];
    p->u[a] = moves_along(f, a) ? y[AT_U + a] : u[a] + spin[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the pivot, which is prescribed */
static PetscErrorCode pivot_acceleration(const Flight *f, PetscReal time, PetscReal a[3])
{
  PetscReal x[3], u[2][3], turn[3], w[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(a, 3));
  if (!f->g->motion.given) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 2; i++)
    PetscCall(BodyEvaluateMotion(f->b, f->k, time + (i ? 1 : -1) * f->difference, x, u[i], turn, w));
  for (PetscInt d = 0; d < 3; d++) a[d] = (u[1][d] - u[0][d]) / (2 * f->difference);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Force, and torque about the reference point; *p: where it is */
static PetscErrorCode get_load(const Flight *f, PetscReal time, const PetscReal y[SIZE], BodyPose *p,
                               PetscReal force[3], PetscReal torque[3])
{
  const BodyArrays *s      = &f->b->state;
  const PetscReal   weight = (s->density[f->k] - f->around->fluid_density) * BodiesVolume(&f->b->view, f->k);
  PetscReal         arm[3], a[3], at_centre[3], moment[3];

  PetscFunctionBeginUser;
  PetscCall(take_pose(f, time, y, p, arm));
  PetscCall(BodyGetExternal(f->b, f->k, p, force, torque));
  for (PetscInt d = 0; d < s->dim; d++) force[d] += weight * f->around->gravity[d];
  if (!f->g->motion.has_pivot) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(pivot_acceleration(f, time, a));
  for (PetscInt d = 0; d < 3; d++) at_centre[d] = force[d] - f->mass * a[d];
  cross(arm, at_centre, moment);
  for (PetscInt d = 0; d < 3; d++) torque[d] += moment[d];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode get_rate(const Flight *f, PetscReal time, const PetscReal y[SIZE], PetscReal dy[SIZE])
{
  BodyPose  p;
  PetscReal force[3], torque[3];

  PetscFunctionBeginUser;
  PetscCall(get_load(f, time, y, &p, force, torque));
  PetscCall(PetscArrayzero(dy, SIZE));
  for (PetscInt a = 0; a < 3; a++) {
    dy[AT_X + a] = moves_along(f, a) ? p.u[a] : 0;
    dy[AT_U + a] = moves_along(f, a) ? force[a] / f->mass : 0;
  }
  BodiesKeepAxes(&f->b->view, f->k, dy + AT_U, NULL);
  if (f->turning == TURNS_GIVEN) PetscFunctionReturn(PETSC_SUCCESS);
  dy[AT_ANGLE] = dot3(p.w, f->g->motion.hinge);
  if (f->turning == TURNS_AXIS) dy[AT_RATE] = dot3(torque, f->g->motion.hinge) / f->about;
  else {
    const PetscReal *w = p.w, *q = y + AT_Q;

    dy[AT_Q] = -0.5 * dot3(w, q + 1);
    cross(w, q + 1, dy + AT_Q + 1);
    for (PetscInt a = 0; a < 3; a++) {
      dy[AT_Q + 1 + a] = 0.5 * (dy[AT_Q + 1 + a] + w[a] * q[0]);
      dy[AT_L + a]     = torque[a];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What rates are compared with: a radius, a rad in a step, and the velocities of the body */
static void scale_rates(const Flight *f, PetscReal h, const PetscReal y[SIZE], PetscReal scale[SIZE])
{
  const BodyArrays *s    = &f->b->state;
  const PetscReal radius = BodiesGetRadius(&f->b->view, f->k), u = radius / h + PetscSqrtReal(dot3(y + AT_U, y + AT_U));
  const PetscReal w = 1 / h + PetscSqrtReal(dot3(s->w[f->k], s->w[f->k]));

  for (PetscInt a = 0; a < 3; a++) {
    scale[AT_X + a] = u;
    scale[AT_U + a] = u / h;
    scale[AT_L + a] = f->mass * radius * radius * w / h;
  }
  for (PetscInt a = 0; a < 4; a++) scale[AT_Q + a] = w;
  scale[AT_ANGLE] = w;
  scale[AT_RATE]  = w / h;
}

/* A sweep over the stages; *change: the largest, in units of the scales */
static PetscErrorCode sweep_stages(const Flight *f, PetscReal time, PetscReal h, const PetscReal y[SIZE],
                                   const PetscReal scale[SIZE], PetscReal (*rate)[SIZE], PetscReal *change)
{
  PetscReal next[SIZE], at[SIZE];

  PetscFunctionBeginUser;
  *change = 0;
  for (PetscInt i = 0; i < STAGES; i++) {
    for (PetscInt m = 0; m < SIZE; m++) {
      at[m] = y[m];
      for (PetscInt j = 0; j < STAGES; j++) at[m] += h * GAUSS_A[i][j] * rate[j][m];
    }
    PetscCall(get_rate(f, time + GAUSS_C[i] * h, at, next));
    for (PetscInt m = 0; m < SIZE; m++) {
      const PetscReal now = PetscAbsReal(next[m] - rate[i][m]) / scale[m];

      *change    = PetscIsInfOrNanReal(now) ? PETSC_INFINITY : PetscMax(*change, now);
      rate[i][m] = next[m];
    }
    if (*change > DIVERGED) break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One step from y to out; PETSC_FALSE: its stages do not converge */
static PetscErrorCode step_once(const Flight *f, PetscReal time, PetscReal h, const PetscReal y[SIZE],
                                PetscReal out[SIZE], PetscBool *converged)
{
  PetscReal rate[STAGES][SIZE], scale[SIZE], change = 1, before = 1;

  PetscFunctionBeginUser;
  scale_rates(f, h, y, scale);
  for (PetscInt i = 0; i < STAGES; i++) PetscCall(get_rate(f, time + GAUSS_C[i] * h, y, rate[i]));
  for (PetscInt sweep = 0;
       sweep < SWEEPS && change > 1e-16 && change < DIVERGED && !(change < CONVERGED && change >= before); sweep++) {
    before = change;
    PetscCall(sweep_stages(f, time, h, y, scale, rate, &change));
  }
  *converged = (PetscBool)(change < CONVERGED);
  for (PetscInt m = 0; m < SIZE; m++) {
    PetscReal sum = 0;

    for (PetscInt i = 0; i < STAGES; i++) sum += GAUSS_B[i] * rate[i][m];
    out[m] = y[m] + h * sum;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- stops ---- */

/* By how far it is beyond the stop of a side: negative inside */
static PetscReal beyond(const Flight *f, PetscInt side, const PetscReal y[SIZE])
{
  return side * (y[AT_ANGLE] - f->g->motion.stops[side > 0]);
}

/* The torque that presses it to the stop of a side, were it there at rest */
static PetscErrorCode get_press(const Flight *f, PetscInt side, PetscReal time, const PetscReal y[SIZE],
                                PetscReal *press)
{
  Flight    at_rest = *f;
  PetscReal at[SIZE], dy[SIZE];

  PetscFunctionBeginUser;
  at_rest.turning = TURNS_AXIS;
  PetscCall(PetscArraycpy(at, y, SIZE));
  at[AT_ANGLE] = f->g->motion.stops[side > 0];
  at[AT_RATE]  = 0;
  PetscCall(get_rate(&at_rest, time, at, dy));
  *press = side * dy[AT_RATE];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* It has passed a stop in the step h from y to out: *h and out become those of the moment before it does */
static PetscErrorCode find_impact(const Flight *f, PetscInt side, PetscReal time, const PetscReal y[SIZE],
                                  PetscReal out[SIZE], PetscReal *h)
{
  PetscReal low = 0, high = *h, at = *h;
  PetscBool converged;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < LOCATIONS && high - low > 4 * PETSC_MACHINE_EPSILON * *h; i++) {
    const PetscReal newton = at - beyond(f, side, out) / (side * out[AT_RATE]);

    at = i < 8 && newton > low && newton < high ? newton : 0.5 * (low + high);
    PetscCall(step_once(f, time, at, y, out, &converged));
    if (beyond(f, side, out) > 0) high = at;
    else low = at;
    if (PetscAbsReal(beyond(f, side, out)) < 4 * PETSC_MACHINE_EPSILON) break;
  }
  *h            = at;
  out[AT_ANGLE] = f->g->motion.stops[side > 0];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* At the stop, with the velocity of the impact; it rests where a rebound would be over within `min` */
static PetscErrorCode rebound(Flight *f, PetscInt side, PetscReal time, PetscReal min, PetscReal y[SIZE])
{
  const PetscReal speed = f->g->motion.restitution * PetscMax(0, side * y[AT_RATE]);
  PetscReal       press;

  PetscFunctionBeginUser;
  PetscCall(get_press(f, side, time, y, &press));
  y[AT_RATE] = -side * speed;
  if (press < 0 || 2 * speed > min * press) PetscFunctionReturn(PETSC_SUCCESS);
  y[AT_RATE]                = 0;
  f->b->state.stopped[f->k] = side;
  f->turning                = TURNS_GIVEN;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A body on a stop until the time + *h, or until the torque turns away from it: then it is free, and *h shorter */
static PetscErrorCode stop_at_limit(Flight *f, PetscReal time, PetscReal *h, const PetscReal y[SIZE])
{
  const PetscInt side = f->b->state.stopped[f->k];
  PetscReal      press[2], low = 0, high = *h;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) PetscCall(get_press(f, side, time + i * *h, y, &press[i]));
  if (press[0] >= 0 && press[1] >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < LOCATIONS && press[0] >= 0; i++) {
    const PetscReal at = 0.5 * (low + high);

    PetscCall(get_press(f, side, time + at, y, &press[1]));
    if (press[1] < 0) high = at;
    else low = at;
  }
  *h                        = press[0] < 0 ? 0 : high;
  f->b->state.stopped[f->k] = 0;
  f->turning                = TURNS_AXIS;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- steps ---- */

/* Lines that pull */
static PetscErrorCode count_taut(const Flight *f, PetscReal time, const PetscReal y[SIZE], PetscInt *n)
{
  PetscReal arm[3];
  BodyPose  p;

  PetscFunctionBeginUser;
  *n = 0;
  if (!f->g->motion.slack) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(take_pose(f, time, y, &p, arm));
  *n = BodyCountTaut(f->b, f->k, &p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One piece of at most *h: as long as it could be taken */
static PetscErrorCode take_piece(Flight *f, PetscReal time, PetscReal step, PetscReal *h, PetscReal y[SIZE],
                                 PetscBool *taken)
{
  PetscReal out[SIZE];
  PetscInt  side, taut[2];

  PetscFunctionBeginUser;
  *taken = PETSC_TRUE;
  if (f->b->state.stopped[f->k]) PetscCall(stop_at_limit(f, time, h, y));
  if (*h == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(step_once(f, time, *h, y, out, taken));
  if (!*taken) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(count_taut(f, time, y, &taut[0]));
  PetscCall(count_taut(f, time + *h, out, &taut[1]));
  *taken = (PetscBool)(taut[0] == taut[1] || *h * FINE <= step);
  if (!*taken) PetscFunctionReturn(PETSC_SUCCESS);
  side = f->turning != TURNS_AXIS || !f->g->motion.has_stops ? 0
       : beyond(f, 1, out) > 0                               ? 1
       : beyond(f, -1, out) > 0                              ? -1
                                                             : 0;
  if (side) {
    PetscCall(find_impact(f, side, time, y, out, h));
    PetscCall(rebound(f, side, time + *h, BRIEF_REBOUND * step, out));
  }
  PetscCall(PetscArraycpy(y, out, SIZE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode store(const Flight *f, PetscReal time, const PetscReal y[SIZE])
{
  BodyArrays *s = &f->b->state;
  PetscReal   arm[3];
  BodyPose    p;

  PetscFunctionBeginUser;
  PetscCall(take_pose(f, time, y, &p, arm));
  PetscCall(PetscArraycpy(s->x[f->k], p.x, 3));
  PetscCall(PetscArraycpy(s->u[f->k], p.u, 3));
  PetscCall(PetscArraycpy(s->q[f->k], p.q, 4));
  PetscCall(PetscArraycpy(s->w[f->k], p.w, 3));
  s->angle[f->k] = p.angle;
  for (PetscInt a = 0; a < s->dim; a++)
    PetscCheck(!PetscIsInfOrNanReal(p.x[a]) && !PetscIsInfOrNanReal(p.angle), PETSC_COMM_SELF, PETSC_ERR_FP,
               "Body %" PetscInt_FMT " of group '%s' has left all bounds at t = %g: lower -sim_dt",
               BodiesIndexInGroup(&f->b->view, f->k), f->g->name, (double)time);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlightMove(Bodies b, PetscInt k, const Surroundings *around, PetscReal time, PetscReal h)
{
  PetscReal y[SIZE], done = 0, max = h;
  PetscInt  rebounds = 0;
  Flight    f;

  PetscFunctionBeginUser;
  PetscCall(begin(b, k, around, h, &f));
  PetscCall(pack(&f, y));
  while (f.g->free && h - done > 1e-12 * h) {
    const PetscReal wanted = PetscMin(max, h - done);
    PetscReal       piece  = wanted;
    PetscBool       taken;

    PetscCall(take_piece(&f, time + done, h, &piece, y, &taken));
    if (taken) {
      done += piece;
      rebounds += piece < wanted;
      if (rebounds > REBOUNDS) break;
      continue;
    }
    max *= 0.5;
    PetscCheck(max * FINEST > h, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT
               " of group '%s' cannot be moved over a step of %g at t = %g: its springs, dampers or loads (-particle_%s_spring, _mooring_*, "
               "_force, _torque) change it %d times faster. Lower them or -sim_dt",
               BodiesIndexInGroup(&b->view, k), f.g->name, (double)h, (double)time, f.g->name, FINEST);
  }
  PetscCall(store(&f, time + h, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlightMovePivot(Bodies b, PetscInt k, PetscReal time)
{
  BodyArrays *s = &b->state;
  PetscReal   x[3], u[3], turn[3], w[3], arm[3], spin[3];

  PetscFunctionBeginUser;
  if (!BodiesGetGroup(&b->view, k)->motion.has_pivot) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodyEvaluateMotion(b, k, time, x, u, turn, w));
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  cross(s->w[k], arm, spin);
  for (PetscInt a = 0; a < 3; a++) s->u[k][a] = u[a] + spin[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlightAccelerate(Bodies b, PetscInt k, const Surroundings *around, PetscReal time, PetscReal h)
{
  BodyArrays *s = &b->state;
  PetscReal   y[SIZE], force[3], torque[3], inertia[6], L[3], gain[3];
  BodyPose    p;
  Flight      f;

  PetscFunctionBeginUser;
  PetscCall(begin(b, k, around, h, &f));
  if (!f.g->free) PetscFunctionReturn(PETSC_SUCCESS);
  if (f.turning == TURNS_GIVEN && s->stopped[k]) f.turning = TURNS_AXIS; /* presses on its stop */
  PetscCall(pack(&f, y));
  PetscCall(get_load(&f, time, y, &p, force, torque));
  for (PetscInt a = 0; a < 3; a++)
    if (moves_along(&f, a)) s->u[k][a] += h * force[a] / f.mass;
  BodiesKeepAxes(&b->view, k, s->u[k], NULL);
  if (f.turning == TURNS_AXIS)
    for (PetscInt a = 0; a < 3; a++) s->w[k][a] += h * dot3(torque, f.g->motion.hinge) / f.about * f.g->motion.hinge[a];
  if (f.turning == TURNS_SPACE) {
    PetscCall(FlightGetInertia(b, k, s->q[k], around, inertia));
    apply_tensor(inertia, s->w[k], L);
    cross(L, s->w[k], gain);
    for (PetscInt a = 0; a < 3; a++) torque[a] += gain[a];
    invert(inertia, torque, gain);
    for (PetscInt a = 0; a < 3; a++) s->w[k][a] += h * gain[a];
  }
  PetscCall(FlightMovePivot(b, k, time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rebound at the end of a sub-step, as soon as the angle is beyond a stop */
static PetscErrorCode keep_stop(Flight *f, PetscReal time, PetscReal h, PetscReal y[SIZE])
{
  const PetscInt side = beyond(f, 1, y) > 0 ? 1 : beyond(f, -1, y) > 0 ? -1 : 0;

  PetscFunctionBeginUser;
  if (!side) PetscFunctionReturn(PETSC_SUCCESS);
  y[AT_ANGLE] = f->g->motion.stops[side > 0];
  PetscCall(rebound(f, side, time, h, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlightSetPosition(Bodies b, PetscInt k, const Surroundings *around, PetscReal time, PetscReal h)
{
  BodyArrays *s = &b->state;
  PetscReal   y[SIZE];
  Flight      f;

  PetscFunctionBeginUser;
  if (s->stopped[k] && dot3(s->w[k], BodiesGetGroup(&b->view, k)->motion.hinge) * s->stopped[k] < 0) s->stopped[k] = 0;
  PetscCall(begin(b, k, around, h, &f));
  PetscCall(pack(&f, y));
  for (PetscInt a = 0; a < 3; a++) y[AT_X + a] += h * y[AT_U + a];
  if (f.turning != TURNS_GIVEN) y[AT_ANGLE] += h * y[AT_RATE];
  if (f.turning == TURNS_AXIS && f.g->motion.has_stops) PetscCall(keep_stop(&f, time + h, h, y));
  if (f.turning == TURNS_SPACE) RotationAdvance(h, s->w[k], y + AT_Q);
  PetscCall(store(&f, time + h, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}
