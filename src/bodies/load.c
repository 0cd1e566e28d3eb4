/* Bodies, load: what acts on a body from outside, fluid and contact apart; see bodies.h and joint.h. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "base/rigid.h"
#include "base/domain.h"
#include "bodies/mass.h"

#define DIFFERENCE 1e-4 /* of a radius, of a radius a step, of a rad: for slopes of expressions */

/* ---- forces ---- */

/* Line i of body k: from its end on the body to the centre (arm), from its point in space to that end (way), the speed
   of that end */
static void stretch_of_line(Bodies b, PetscInt k, PetscInt i, const BodyPose *p, PetscReal arm[3],
                            PetscReal displacement[3], PetscReal speed[3])
{
  const BodyGroup *g = BodiesGetGroup(&b->view, k);
  const Mooring   *m = &g->motion.mooring[i];
  PetscReal        R[9], Rs[9], wr[3];

  RotationMatrix(p->q, R);
  for (PetscInt a = 0; a < 3; a++) arm[a] = b->state.scale[k] * dot3(R + 3 * a, m->at);
  cross(p->w, arm, wr);
  if (g->motion.from_start) {
    const Placement *s    = BodyStart(b, k);
    PetscReal        q[4] = {s->q[0], s->q[1], s->q[2], s->q[3]};

    if (!s->turned) RotationFromAngle(s->angle, q);
    RotationMatrix(q, Rs);
  }
  for (PetscInt a = 0; a < 3; a++) {
    PetscReal point = m->point[a];

    if (g->motion.from_start) { /* a start is that of the reference point */
      const PetscReal at[3] = {m->at[0] + g->arm[0], m->at[1] + g->arm[1], m->at[2] + g->arm[2]};

      point = BodyStart(b, k)->x[a] + b->state.scale[k] * dot3(Rs + 3 * a, at);
    }
    displacement[a] = a < b->state.dim ? DomainNearest(b->box[a], p->x[a] + b->state.frame[a] + arm[a] - point, 0) : 0;
    speed[a]        = p->u[a] + wr[a];
  }
}

/* Tension and the direction of a line with a length; PETSC_FALSE: it has none, or is slack */
static PetscBool stretch_line(const Motion *m, const Mooring *l, const PetscReal displacement[3],
                              const PetscReal speed[3], PetscReal e[3], PetscReal *tension)
{
  const PetscReal r = PetscSqrtReal(dot3(displacement, displacement));

  if (r == 0) return PETSC_FALSE;
  for (PetscInt a = 0; a < 3; a++) e[a] = displacement[a] / r;
  *tension = l->stiffness * (r - l->length) + l->damping * dot3(speed, e);
  return (PetscBool)(!m->slack || (r > l->length && *tension > 0));
}

static void add_mooring(Bodies b, PetscInt k, PetscInt i, const BodyPose *p, PetscReal force[3], PetscReal torque[3])
{
  const Motion  *m = &BodiesGetGroup(&b->view, k)->motion;
  const Mooring *l = &m->mooring[i];
  PetscReal      arm[3], displacement[3], speed[3], e[3], f[3] = {0, 0, 0}, moment[3], tension;

  stretch_of_line(b, k, i, p, arm, displacement, speed);
  if (l->length == 0)
    for (PetscInt a = 0; a < b->state.dim; a++) f[a] = -l->stiffness * displacement[a] - l->damping * speed[a];
  else if (stretch_line(m, l, displacement, speed, e, &tension))
    for (PetscInt a = 0; a < 3; a++) f[a] = -tension * e[a];
  cross(arm, f, moment);
  for (PetscInt a = 0; a < 3; a++) {
    force[a] += f[a];
    torque[a] += moment[a];
  }
}

PetscInt BodyCountTaut(Bodies b, PetscInt k, const BodyPose *p)
{
  const Motion *m = &BodiesGetGroup(&b->view, k)->motion;
  PetscInt      n = 0;

  for (PetscInt i = 0; i < m->nmooring; i++) {
    PetscReal arm[3], displacement[3], speed[3];

    stretch_of_line(b, k, i, p, arm, displacement, speed);
    n += dot3(displacement, displacement) > PetscSqr(m->mooring[i].length);
  }
  return n;
}

static void list_variables(Bodies b, const Motion *m, const BodyPose *p, PetscReal v[EXPR_VARIABLES])
{
  for (PetscInt a = 0; a < 3; a++) {
    v[EXPR_X + a] = p->x[a] + b->state.frame[a];
    v[EXPR_U + a] = p->u[a];
  }
  v[EXPR_TIME]  = p->time < PETSC_MAX_REAL ? p->time : 0; /* a steady problem has none */
  v[EXPR_ANGLE] = p->angle;
  v[EXPR_OMEGA] = dot3(p->w, m->hinge);
}

PetscErrorCode BodyGetExternal(Bodies b, PetscInt k, const BodyPose *p, PetscReal force[3], PetscReal torque[3])
{
  const Motion *m = &BodiesGetGroup(&b->view, k)->motion;
  PetscReal     v[EXPR_VARIABLES];

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(force, m->force, 3));
  PetscCall(PetscArraycpy(torque, m->torque, 3));
  if (m->force_of || m->torque_of) list_variables(b, m, p, v);
  if (m->force_of) PetscCall(ExprEvaluateAt(m->force_of, v, NULL, force));
  if (m->torque_of) PetscCall(ExprEvaluateAt(m->torque_of, v, NULL, torque + (b->state.dim == 2 ? 2 : 0)));
  for (PetscInt i = 0; i < m->nmooring; i++) add_mooring(b, k, i, p, force, torque);
  if (m->spring == 0 && m->spring_damping == 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < 3; a++)
    torque[a] -= (m->spring * (p->angle - m->spring_angle) + m->spring_damping * dot3(p->w, m->hinge)) * m->hinge[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void take_pose(Bodies b, PetscInt k, PetscReal time, BodyPose *p)
{
  const BodyArrays *s = &b->state;

  *p = (BodyPose){.time = time, .angle = s->angle[k]};
  for (PetscInt a = 0; a < 4; a++) p->q[a] = s->q[k][a];
  for (PetscInt a = 0; a < 3; a++) {
    p->x[a] = s->x[k][a];
    p->u[a] = s->u[k][a];
    p->w[a] = s->w[k][a];
  }
}

PetscErrorCode BodiesGetLoadAt(Bodies b, PetscInt k, PetscReal time, PetscReal rho_f, const PetscReal gravity[3],
                               PetscReal force[3], PetscReal torque[3])
{
  const BodyArrays *s = &b->state;
  BodyPose          p;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  take_pose(b, k, time, &p);
  PetscCall(BodyGetExternal(b, k, &p, force, torque));
  for (PetscInt a = 0; a < s->dim; a++)
    force[a] = force[a] + (s->density[k] - s->lighter[k] - rho_f) * BodiesVolume(&b->view, k) * gravity[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSetLighter(Bodies b, PetscInt k, PetscReal less)
{
  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  b->state.lighter[k] = less;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetLoad(Bodies b, PetscInt k, PetscReal rho_f, const PetscReal gravity[3], PetscReal force[3],
                             PetscReal torque[3])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesGetLoadAt(b, k, b->state.time, rho_f, gravity, force, torque));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- how it resists ---- */

/* M [nr][nr] += J^T A J, J the map from rigid slots to the velocity of the point that is r from the reference point */
static void add_at_point(PetscInt dim, const PetscReal r[3], const PetscReal A[3][3], PetscReal M[])
{
  const PetscReal turn[3][3] = {{0, r[2], -r[1]}, {-r[2], 0, r[0]}, {r[1], -r[0], 0}};
  const PetscInt  nr         = RigidSize(dim);
  PetscReal       J[3][6]    = {{0}};

  for (PetscInt a = 0; a < dim; a++) {
    J[a][a] = 1;
    for (PetscInt c = 0; c < nr - dim; c++) J[a][dim + c] = turn[a][dim == 2 ? 2 : c];
  }
  for (PetscInt i = 0; i < nr; i++)
    for (PetscInt j = 0; j < nr; j++)
      for (PetscInt a = 0; a < dim; a++)
        for (PetscInt c = 0; c < dim; c++) M[i * nr + j] += J[a][i] * A[a][c] * J[c][j];
}

/* M += value h h^T on the slots of the rotation */
static void add_about(PetscInt dim, const PetscReal h[3], PetscReal value, PetscReal M[])
{
  const PetscInt nr = RigidSize(dim);

  for (PetscInt i = dim; i < nr; i++)
    for (PetscInt j = dim; j < nr; j++) M[i * nr + j] += value * (dim == 2 ? 1 : h[i - dim] * h[j - dim]);
}

static void resist_line(Bodies b, PetscInt k, PetscInt i, const BodyPose *p, const PetscReal arm[3], PetscReal K[],
                        PetscReal C[])
{
  const Motion  *m = &BodiesGetGroup(&b->view, k)->motion;
  const Mooring *l = &m->mooring[i];
  PetscReal      end[3], displacement[3], speed[3], e[3] = {0, 0, 0}, tension, across = l->stiffness, A[3][3], B[3][3];

  stretch_of_line(b, k, i, p, end, displacement, speed);
  if (l->length > 0) {
    if (!stretch_line(m, l, displacement, speed, e, &tension)) return;
    across = PetscMax(0, tension) / PetscSqrtReal(dot3(displacement, displacement));
  }
  for (PetscInt a = 0; a < 3; a++) {
    end[a] += arm[a];
    for (PetscInt c = 0; c < 3; c++) {
      A[a][c] = (l->length > 0 ? l->stiffness - across : 0) * e[a] * e[c] + (a == c ? across : 0);
      B[a][c] = l->length > 0 ? l->damping * e[a] * e[c] : a == c ? l->damping : 0;
    }
  }
  add_at_point(b->state.dim, end, A, K);
  add_at_point(b->state.dim, end, B, C);
}

/* By which value i of an expression falls with variable v, 0: it grows or stays */
static PetscErrorCode fall_of(Expr e, PetscInt i, ExprVariable v, const PetscReal at[], PetscReal step, PetscReal *fall)
{
  PetscReal near[EXPR_VARIABLES], value[2][3];

  PetscFunctionBeginUser;
  *fall = 0;
  if (!ExprUses(e, i, v)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArraycpy(near, at, EXPR_VARIABLES));
  for (PetscInt side = 0; side < 2; side++) {
    near[v] = at[v] + (side ? step : -step);
    PetscCall(ExprEvaluateAt(e, near, NULL, value[side]));
  }
  *fall = PetscMax(0, (value[0][i] - value[1][i]) / (2 * step));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode resist_expressions(Bodies b, PetscInt k, const BodyPose *p, PetscReal dt, const PetscReal arm[3],
                                         PetscReal K[], PetscReal C[])
{
  const Motion   *m      = &BodiesGetGroup(&b->view, k)->motion;
  const PetscInt  dim    = b->state.dim;
  const PetscReal length = DIFFERENCE * BodiesGetRadius(&b->view, k);
  PetscReal       v[EXPR_VARIABLES], A[3][3] = {{0}}, B[3][3] = {{0}}, fall;

  PetscFunctionBeginUser;
  list_variables(b, m, p, v);
  for (PetscInt a = 0; a < dim && m->force_of; a++) {
    PetscCall(fall_of(m->force_of, a, (ExprVariable)(EXPR_X + a), v, length, &A[a][a]));
    PetscCall(fall_of(m->force_of, a, (ExprVariable)(EXPR_U + a), v,
                      PetscMax(length / dt, DIFFERENCE * PetscAbsReal(p->u[a])), &B[a][a]));
  }
  add_at_point(dim, arm, A, K);
  add_at_point(dim, arm, B, C);
  for (PetscInt a = 0; a < 3 && m->torque_of; a++) { /* about the axis of the angle, as far as that is along an axis */
    const PetscInt i = dim == 2 ? 0 : a;

    if (m->hinge[a] == 0) continue;
    PetscCall(fall_of(m->torque_of, i, EXPR_ANGLE, v, DIFFERENCE, &fall));
    add_about(dim, m->hinge, fall * PetscAbsReal(m->hinge[a]), K);
    PetscCall(fall_of(m->torque_of, i, EXPR_OMEGA, v, DIFFERENCE / dt, &fall));
    add_about(dim, m->hinge, fall * PetscAbsReal(m->hinge[a]), C);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetResistance(Bodies b, PetscInt k, PetscReal time, PetscReal dt, PetscReal K[], PetscReal C[],
                                   PetscBool *any)
{
  const Motion  *m   = &BodiesGetGroup(&b->view, k)->motion;
  const PetscInt dim = b->state.dim, nr = RigidSize(dim);
  PetscReal      arm[3];
  BodyPose       p;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  *any = BodiesGroupResists(BodiesGetGroup(&b->view, k));
  if (!*any) PetscFunctionReturn(PETSC_SUCCESS);
  take_pose(b, k, time, &p);
  PetscCall(BodiesGetArm(b, k, NULL, arm));
  PetscCall(PetscArrayzero(K, nr * nr));
  PetscCall(PetscArrayzero(C, nr * nr));
  for (PetscInt i = 0; i < m->nmooring; i++) resist_line(b, k, i, &p, arm, K, C);
  add_about(dim, m->hinge, m->spring, K);
  add_about(dim, m->hinge, m->spring_damping, C);
  if (dt > 0 && (m->force_of || m->torque_of)) PetscCall(resist_expressions(b, k, &p, dt, arm, K, C));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Directions in which body k moves freely, on its rigid slots: basis [n][nr] */
static PetscInt free_directions(Bodies b, PetscInt k, PetscReal basis[6][6])
{
  const Motion  *m   = &BodiesGetGroup(&b->view, k)->motion;
  const PetscInt dim = b->state.dim, nr = RigidSize(dim);
  PetscInt       n = 0;

  (void)PetscArrayzero(basis[0], 36);
  for (PetscInt a = 0; a < dim && m->has_slide; a++) basis[0][a] = m->slide[a];
  if (m->has_slide) n = 1;
  for (PetscInt a = 0; a < dim && !m->has_slide; a++)
    if (BodiesIsFree(b, k, a)) basis[n++][a] = 1;
  if (!BodiesIsFree(b, k, 3)) return n;
  for (PetscInt i = dim; i < nr && !m->has_hinge; i++) basis[n++][i] = 1;
  for (PetscInt i = dim; i < nr && m->has_hinge; i++) basis[n][i] = m->hinge[i - dim];
  return n + m->has_hinge;
}

/* (M + dt C + dt^2 K) dU = M gain - dt^2 K U in the free directions: backward Euler where gain [nr] is explicit */
PetscErrorCode BodyDampGain(Bodies b, PetscInt k, PetscReal dt, const PetscReal U[], PetscReal gain[])
{
  const PetscInt nr = RigidSize(b->state.dim);
  PetscReal      M[36], K[36], C[36], basis[6][6], A[36], inverse[36], right[6];
  PetscInt       n;
  PetscBool      any;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetResistance(b, k, b->state.time, dt, K, C, &any));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(RigidGetMass(b, k, b->state.q[k], M));
  n = free_directions(b, k, basis);
  for (PetscInt p = 0; p < n; p++) {
    right[p] = 0;
    for (PetscInt q = 0; q < n; q++) A[p * n + q] = 0;
    for (PetscInt i = 0; i < nr; i++)
      for (PetscInt j = 0; j < nr; j++) {
        const PetscInt  e    = i * nr + j;
        const PetscReal mass = b->state.density[k] * M[e];

        right[p] += basis[p][i] * (mass * gain[j] - dt * dt * K[e] * U[j]);
        for (PetscInt q = 0; q < n; q++)
          A[p * n + q] += basis[p][i] * (mass + dt * C[e] + dt * dt * K[e]) * basis[q][j];
      }
  }
  DenseInvert(n, A, inverse);
  for (PetscInt i = 0; i < nr; i++) {
    gain[i] = 0;
    for (PetscInt p = 0; p < n; p++)
      for (PetscInt q = 0; q < n; q++) gain[i] += basis[p][i] * inverse[p * n + q] * right[q];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- energy ---- */

PetscErrorCode BodiesGetSpringEnergy(Bodies b, PetscReal *energy, PetscBool *any)
{
  const BodyArrays *s   = &b->state;
  Exact             sum = {{0}, 0, 0};
  PetscBool         has = PETSC_FALSE;

  PetscFunctionBeginUser;
  *energy = 0;
  for (PetscInt g = 0; g < s->ngroups; g++)
    has = (PetscBool)(has || s->group[g].motion.spring > 0 || s->group[g].motion.nmooring);
  if (any) *any = has;
  if (!has) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) {
    const Motion *m = &BodiesGetGroup(&b->view, k)->motion;
    BodyPose      p;

    if (s->removed[k] || !s->own[k]) continue;
    take_pose(b, k, s->time, &p);
    if (m->spring > 0) ExactAdd(&sum, 0.5 * m->spring * PetscSqr(p.angle - m->spring_angle));
    for (PetscInt i = 0; i < m->nmooring; i++) {
      PetscReal arm[3], displacement[3], speed[3], r;

      stretch_of_line(b, k, i, &p, arm, displacement, speed);
      r = PetscSqrtReal(dot3(displacement, displacement)) - m->mooring[i].length;
      if (!m->slack || r > 0) ExactAdd(&sum, 0.5 * m->mooring[i].stiffness * r * r);
    }
  }
  PetscCall(ExactGetSum(BodiesComm(b), &sum, energy));
  PetscFunctionReturn(PETSC_SUCCESS);
}
