/* Motion: see motion.h. Everything is evaluated from the time and the start, nothing is integrated, so that a
   prescribed body is where it should be at any time and step size. */
#include "compat.h"
#include "motion.h"
#include "joint.h"
#include "base/algebra.h"
#include "base/opt.h"

static PetscErrorCode read_components(const char group[], Motion *m, PetscBool *oscillate)
{
  const char *const word[] = {"constant", "oscillate", "rotate"};
  PetscBool         has[3] = {PETSC_FALSE, PETSC_FALSE, PETSC_FALSE};
  char              name[OPT_NAME], *list[8];
  PetscInt          n = 8;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray(OptJoin("-particle_", group, "_motion", name), &n, list));
  for (PetscInt i = 0; i < n; i++) {
    PetscInt k = 0;

    while (k < 3 && strcmp(list[i], word[k])) k++;
    PetscCheck(k < 3, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "%s: '%s' is not known (known: constant, oscillate, rotate)", name, list[i]);
    has[k] = PETSC_TRUE;
    PetscCall(PetscFree(list[i]));
  }
  m->given    = (PetscBool)(n > 0);
  m->named    = m->given;
  m->constant = (PetscBool)(n == 0 || has[0]);
  m->rotate   = (PetscBool)(n == 0 || has[2]);
  *oscillate  = has[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_oscillation(const char group[], PetscInt dim, Motion *m)
{
  char      name[OPT_NAME];
  PetscBool has_amplitude, has_rotation;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_motion_amplitude", name), dim, m->amplitude, &has_amplitude));
  if (has_amplitude) {
    PetscBool has_period;

    PetscCall(OptRealArray(OptJoin("-particle_", group, "_motion_period", name), dim, m->period, &has_period));
    PetscCheck(has_period, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_%s_motion_amplitude needs %s, one value an axis", group, name);
    PetscCall(OptRealArray(OptJoin("-particle_", group, "_motion_phase", name), dim, m->phase, NULL));
  }
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_motion_rotation", name), 3, m->rotation, &has_rotation));
  PetscCheck(!has_rotation || m->rotation[1] > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: the period %g must be positive", name, (double)m->rotation[1]);
  PetscCheck(has_amplitude || has_rotation, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-particle_%s_motion oscillate needs -particle_%s_motion_amplitude or -particle_%s_motion_rotation", group,
             group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_stops(const char group[], PetscInt dim, Motion *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_stops", name), 2, m->stops, &m->has_stops));
  if (!m->has_stops) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(dim == 2 || m->has_hinge, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: in space stops need the axis of the angle: give -particle_%s_hinge", name, group);
  PetscCheck(m->stops[0] < m->stops[1], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: the lower stop %g must be below the upper one %g", name, (double)m->stops[0], (double)m->stops[1]);
  PetscCall(OptReal(OptJoin("-particle_", group, "_stops_restitution", name), &m->restitution));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A direction that the scene gives, made a unit vector */
static PetscErrorCode read_direction(const char name[], PetscInt dim, PetscReal e[3], PetscBool *has)
{
  PetscReal length;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(name, dim, e, has));
  if (!*has) PetscFunctionReturn(PETSC_SUCCESS);
  length = PetscSqrtReal(dot3(e, e));
  PetscCheck(length > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s: a direction has a length: give one that is not zero", name);
  for (PetscInt a = 0; a < 3; a++) e[a] /= length;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_axes(const char group[], PetscInt dim, Motion *m)
{
  char name[OPT_NAME];

  PetscFunctionBeginUser;
  if (dim == 3) PetscCall(read_direction(OptJoin("-particle_", group, "_hinge", name), dim, m->hinge, &m->has_hinge));
  if (!m->has_hinge) m->hinge[2] = 1;
  PetscCall(read_direction(OptJoin("-particle_", group, "_slide", name), dim, m->slide, &m->has_slide));
  PetscCheck(!m->has_slide || !m->has_pivot, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Group '%s' turns about -particle_%s_pivot, which does not move freely, and has -particle_%s_slide: remove one of them",
             group, group, group);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Numbers, or expressions of t with their values at the time 0 */
static PetscErrorCode read_velocities(const char group[], PetscInt dim, Motion *m, PetscReal u[3], PetscReal w[3])
{
  const PetscInt n = dim == 2 ? 1 : 3;
  char           name[OPT_NAME];
  PetscInt       turns = 0;

  PetscFunctionBeginUser;
  PetscCall(ExprRead(OptJoin("-particle_", group, "_velocity", name), dim, dim, u, &m->velocity, &m->has_u));
  if (m->velocity) PetscCall(ExprEvaluate(m->velocity, 0, 1, NULL, u));
  PetscCall(ExprRead(OptJoin("-particle_", group, "_angular_velocity", name), dim, n, w + 3 - n, &m->omega, &m->has_w));
  if (m->velocity || m->omega) m->given = PETSC_TRUE;
  if (!m->omega) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ExprEvaluate(m->omega, 0, 1, NULL, w + 3 - n));
  for (PetscInt a = 0; a < n; a++) turns += ExprValueUsesTime(m->omega, a) || w[3 - n + a] != 0;
  PetscCheck(turns == 1, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s = %s: an axis that turns has no angle in closed form; let only one component be other than 0", name,
             ExprText(m->omega));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MotionRead(const char group[], PetscInt dim, Motion *m, PetscReal u[3], PetscReal w[3])
{
  char      name[OPT_NAME];
  PetscBool oscillate = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(m, sizeof(*m)));
  for (PetscInt a = 0; a < 3; a++) m->period[a] = 1;
  m->rotation[1] = 1;
  m->dim         = dim;
  PetscCall(read_components(group, m, &oscillate));
  PetscCall(read_velocities(group, dim, m, u, w));
  PetscCall(TrackRead(group, dim, &m->track));
  if (m->track) m->given = PETSC_TRUE;
  if (oscillate) PetscCall(read_oscillation(group, dim, m));
  if (m->given) { PetscCall(OptReal(OptJoin("-particle_", group, "_motion_ramp", name), &m->ramp)); }
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_pivot", name), dim, m->pivot, &m->has_pivot));
  PetscCall(read_axes(group, dim, m));
  PetscCall(PetscArraycpy(m->axis, m->hinge, 3));
  PetscCall(read_stops(group, dim, m));
  PetscCall(JointRead(group, dim, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MotionDestroy(Motion *m)
{
  PetscFunctionBeginUser;
  PetscCall(ExprDestroy(&m->velocity));
  PetscCall(ExprDestroy(&m->omega));
  PetscCall(TrackDestroy(&m->track));
  PetscCall(JointDestroy(m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool MotionChanges(const Motion *m, PetscInt a)
{
  if (a < 3 && m->velocity && m->constant && a < m->dim && ExprValueUsesTime(m->velocity, a)) return PETSC_TRUE;
  if (a == 3 && m->omega && m->rotate) return PETSC_TRUE;
  if (TrackHas(m->track, a)) return PETSC_TRUE;
  return MotionOscillates(m, a);
}

PetscBool MotionOscillates(const Motion *m, PetscInt a)
{
  return a < 3 ? (PetscBool)(m->amplitude[a] != 0) : (PetscBool)(m->rotation[0] != 0);
}

/* Adds the motion of the file */
static void add_track(const Motion *m, PetscReal s, PetscReal u[3], PetscReal displacement[3], PetscReal w[3],
                      PetscReal turn[3])
{
  for (PetscInt a = 0; a < 4; a++) {
    PetscReal gained, velocity;

    if (!TrackHas(m->track, a)) continue;
    TrackEvaluate(m->track, a, s, &gained, &velocity);
    for (PetscInt d = 0; d < 3; d++) {
      if (a == 3) {
        w[d] += velocity * m->axis[d];
        turn[d] += gained * m->axis[d];
      } else if (a == d) {
        u[d] += velocity;
        displacement[d] += gained;
      }
    }
  }
}

/* Velocities of the start at the motion's own time s and their integrals: u, way, w, turn [3] each */
static PetscErrorCode evaluate_start(const Motion *m, const Placement *start, PetscReal s, PetscReal u[3],
                                     PetscReal displacement[3], PetscReal w[3], PetscReal turn[3])
{
  const PetscInt first = m->dim == 2 ? 2 : 0; /* of the components of a turn */

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    u[a]            = m->constant ? start->u[a] : 0;
    w[a]            = m->rotate ? start->omega[a] : 0;
    displacement[a] = u[a] * s;
    turn[a]         = w[a] * s;
  }
  if (m->velocity && m->constant) {
    PetscCall(ExprEvaluate(m->velocity, s, 1, NULL, u));
    PetscCall(ExprIntegrate(m->velocity, s, displacement));
  }
  if (m->omega && m->rotate) {
    PetscCall(ExprEvaluate(m->omega, s, 1, NULL, w + first));
    PetscCall(ExprIntegrate(m->omega, s, turn + first));
  }
  add_track(m, s, u, displacement, w, turn);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MotionEvaluate(const Motion *m, const Placement *start, PetscReal time, PetscReal x[3], PetscReal u[3],
                              PetscReal turn[3], PetscReal w[3])
{
  PetscReal s = time < PETSC_MAX_REAL ? time : 0, rate = 1; /* a steady problem has no time: velocities act, and nothing
                                                               leaves its place */
  PetscReal displacement[3];

  PetscFunctionBeginUser;
  if (m->ramp > 0 && time < PETSC_MAX_REAL) {
    const PetscReal fraction = PetscMin(PetscMax(time / m->ramp, 0), 1);

    rate = 0.5 * (1 - PetscCosReal(PETSC_PI * fraction));
    s    = 0.5 * m->ramp * (fraction - PetscSinReal(PETSC_PI * fraction) / PETSC_PI) + PetscMax(time - m->ramp, 0);
  }
  PetscCall(evaluate_start(m, start, s, u, displacement, w, turn));
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal c = 2 * PETSC_PI / m->period[a], angle = c * s + m->phase[a];

    u[a] += m->amplitude[a] * c * PetscCosReal(angle);
    x[a] = start->x[a] + displacement[a] + m->amplitude[a] * PetscSinReal(angle);
  }
  {
    const PetscReal c = 2 * PETSC_PI / m->rotation[1], angle = c * s + m->rotation[2];

    w[2] += m->rotation[0] * c * PetscCosReal(angle);
    turn[2] += m->rotation[0] * PetscSinReal(angle);
  }
  for (PetscInt a = 0; a < 3; a++) {
    u[a] *= rate;
    w[a] *= rate;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
