/* Contact, forces of bonds: how a bond is strained, and what pull that is over a step.

   Strain. Both bodies carry the end of the bond and its axis. With d from the end on the carrier to that on the partner
   and n the mean of the two axes, the bond is stretched by d.n and sheared by the rest of d; the rotation that takes
   the
   carrier's frame to the partner's, as a vector, is twist along n and bending across it. Nothing is summed up over
   steps, so nothing drifts, and a rotation of both bodies changes nothing (finite rotations).

   Pull over a step: k (e + a v + b v_old) + c v, with e the strain before it and v the speed of parting at its end.
   For a bond that the step resolves a and b are those of the time at which the rows of the bodies hold (BondRule). For
   one whose period the step does not see they are a = h, b = 0: the strain is to be gone at the end of the step. Where
   bodies move by the mean speed of the step (order 2) that would leave half of it, which swings and loses .3 a step;
   with b = h/2 strain and speed are gone after two steps. In between they go from one to the other as the frequency
   times the step goes from STIFF_RESOLVED to STIFF_UNSEEN (base/stiff.h), as in couple/joint.c. */
#include "compat.h"
#include "bond.h"
#include "base/array.h"
#include "base/stiff.h"

static inline void turn_vector(const PetscReal q[4], const PetscReal x[3], PetscReal y[3])
{
  PetscReal t[3], u[3];

  cross(q + 1, x, t);
  for (PetscInt a = 0; a < 3; a++) t[a] += t[a];
  cross(q + 1, t, u);
  for (PetscInt a = 0; a < 3; a++) y[a] = x[a] + q[0] * t[a] + u[a];
}

/* Rotation vector of a unit quaternion, shorter than pi */
static void take_vector(const PetscReal q[4], PetscReal v[3])
{
  const PetscReal sine = PetscSqrtReal(dot3(q + 1, q + 1)), side = q[0] < 0 ? -1 : 1;
  const PetscReal factor = sine > 0 ? 2 * side * PetscAtan2Real(sine, side * q[0]) / sine : 0;

  for (PetscInt a = 0; a < 3; a++) v[a] = factor * q[1 + a];
}

static void normalise(PetscReal v[3])
{
  const PetscReal size = PetscSqrtReal(dot3(v, v));

  for (PetscInt a = 0; a < 3; a++) v[a] /= size;
}

/* Unit vectors across the first, which turn with the carrier; in the plane it turned by a right angle */
static void set_axes(Contact c, const Bond *b, PetscReal e[3][3])
{
  const PetscReal *axis    = b->record->axis;
  PetscInt         min     = 0;
  PetscReal        unit[3] = {0, 0, 0}, turned[3];

  if (c->dim == 2) {
    e[1][0] = -e[0][1];
    e[1][1] = e[0][0];
    e[1][2] = e[2][0] = e[2][1] = 0;
    e[2][2]                     = 1;
    return;
  }
  for (PetscInt a = 1; a < 3; a++)
    if (PetscAbsReal(axis[a]) < PetscAbsReal(axis[min])) min = a;
  unit[min] = 1;
  turn_vector(c->q[b->i], unit, turned);
  cross(e[0], turned, e[1]);
  normalise(e[1]);
  cross(e[0], e[1], e[2]);
}

/* Frames of both bodies: their ends and axes in space, the frame of the partner in that of the carrier */
static void carry_frames(Contact c, const Bond *b, PetscReal d[3], PetscReal axis[3], PetscReal turn[3], BondFrame *s)
{
  const PetscReal   none[4] = {1, 0, 0, 0}, *qi = c->q[b->i], *qj = b->j >= 0 ? c->q[b->j] : none;
  const BondRecord *r = b->record;
  PetscReal         ei[3], ej[3], other[3], back[4], carried[4], inverse[4], relative[4];

  turn_vector(qi, r->end[0], ei);
  turn_vector(qj, r->end[1], ej);
  for (PetscInt a = 0; a < 3; a++) d[a] = (b->j >= 0 ? c->x[b->j][a] : 0) - c->x[b->i][a];
  if (b->j >= 0) ContactWrap(c, d);
  for (PetscInt a = 0; a < 3; a++) d[a] += ej[a] - ei[a];
  if (b->j < 0) ContactWrap(c, d);
  for (PetscInt a = 0; a < 3; a++) {
    s->lever[0][a] = ei[a] + 0.5 * d[a];
    s->lever[1][a] = b->j >= 0 ? ej[a] - 0.5 * d[a] : 0;
  }
  RotationInvert(r->turn, back);
  turn_vector(back, r->axis, other);
  turn_vector(qj, other, other);
  turn_vector(qi, r->axis, axis);
  for (PetscInt a = 0; a < 3; a++) axis[a] += other[a];
  normalise(axis);
  RotationMultiply(qi, r->turn, carried);
  RotationInvert(carried, inverse);
  RotationMultiply(qj, inverse, relative);
  take_vector(relative, turn);
}

PetscErrorCode BondFindStrain(Contact c, const Bond *b, BondStrain *s)
{
  PetscReal d[3], turn[3];

  PetscFunctionBeginUser;
  carry_frames(c, b, d, s->frame.axis[0], turn, &s->frame);
  set_axes(c, b, s->frame.axis);
  (*c->bonds->law->stiffness)(c->bonds, c->dim, b->record, s->stiffness);
  for (PetscInt m = 0; m < b->n; m++) s->strain[m] = dot3(m < c->dim ? d : turn, BondDirection(&s->frame, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity of a body along a mode */
static PetscReal speed_of(Contact c, const Bond *b, PetscInt mode, PetscInt side)
{
  const PetscInt   k = side ? b->j : b->i;
  const PetscReal *n = BondDirection(&b->frame, mode);
  PetscReal        v[3];

  if (mode >= c->dim) return dot3(c->w[k], n);
  cross(c->w[k], b->frame.lever[side], v);
  return dot3(c->u[k], n) + dot3(v, n);
}

PetscErrorCode BondSpeed(Contact c, const Bond *b, PetscInt mode, PetscReal *speed)
{
  PetscReal x[3], v[3];

  PetscFunctionBeginUser;
  *speed = -speed_of(c, b, mode, 0);
  if (b->j >= 0) *speed += speed_of(c, b, mode, 1);
  else if (mode < c->dim && c->domain.wall.velocity) {
    for (PetscInt a = 0; a < 3; a++) x[a] = c->x[b->i][a] + b->frame.lever[0][a];
    PetscCall(ContactGetWallVelocity(c, b->j, x, b->frame.axis[0], v));
    *speed += dot3(v, BondDirection(&b->frame, mode));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondGetWallSpeeds(Contact c, const Bond *b, PetscReal wall[])
{
  PetscFunctionBeginUser;
  for (PetscInt m = 0; m < b->n; m++) {
    wall[m] = 0;
    if (b->j >= 0 || m >= c->dim || !c->domain.wall.velocity) continue;
    PetscCall(BondSpeed(c, b, m, &wall[m]));
    wall[m] += speed_of(c, b, m, 0);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal BondInverseMass(Contact c, const Bond *b, PetscInt mode)
{
  PetscReal sum = 0, dw[3];

  for (PetscInt side = 0; side < (b->j >= 0 ? 2 : 1); side++) {
    const PetscInt k = side ? b->j : b->i;

    if (mode < c->dim) sum += ContactInverseMass(c, k, b->frame.lever[side], BondDirection(&b->frame, mode));
    else {
      ContactSpin(c, k, BondDirection(&b->frame, mode), dw);
      sum += dot3(dw, BondDirection(&b->frame, mode));
    }
  }
  return sum;
}

/* Levers and directions of the end of the step, where a flow draws the bodies: speeds at its end are along these, so
   that a pair that turns is not stretched by its curved way */
static PetscErrorCode predict_bodies_ahead(Contact c, const BondRule *rule, Bond *b)
{
  BondStrain end;
  PetscReal  angle;

  PetscFunctionBeginUser;
  PetscCall(BodiesPredict(c->bodies, b->i, rule->h, rule->prediction, c->copy.x[b->i], c->copy.q[b->i], &angle));
  if (b->j >= 0)
    PetscCall(BodiesPredict(c->bodies, b->j, rule->h, rule->prediction, c->copy.x[b->j], c->copy.q[b->j], &angle));
  c->x = c->copy.x;
  c->q = c->copy.q;
  PetscCall(BondFindStrain(c, b, &end));
  c->x     = c->s->x;
  c->q     = c->s->q;
  b->frame = end.frame;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BondMakeSprings(Contact c, const BondRule *rule, Bond *b)
{
  BondStrain s;

  PetscFunctionBeginUser;
  PetscCall(BondFindStrain(c, b, &s));
  b->frame = s.frame;
  b->begin = b->elastic[0] = b->elastic[1] = b->elastic[2] = b->elastic[3] = 0;
  for (PetscInt m = 0; m < b->n; m++) {
    const PetscReal k = s.stiffness[BondKind(b->n, m)], inverse = BondInverseMass(c, b, m);
    const PetscReal frequency = PetscSqrtReal(k * inverse);
    const PetscReal stiff     = StiffFraction(rule->h * frequency);
    const PetscReal damping   = c->bonds->par.damping;
    const PetscReal damper    = inverse > 0 && damping > 0 ? 2 * damping * PetscSqrtReal(k / inverse) : 0;
    PetscReal       old;

    PetscCall(BondSpeed(c, b, m, &old));
    b->stiff[m]         = stiff;
    b->slope[m]         = k * ((1 - stiff) * rule->next + stiff * rule->end);
    b->elastic_value[m] = k * (s.strain[m] + ((1 - stiff) * rule->before + stiff * rule->last) * old);
    b->rate[m]          = b->slope[m] + damper * ((1 - stiff) * rule->damped + stiff);
    b->value[m]         = b->elastic_value[m] + damper * (1 - stiff) * (1 - rule->damped) * old;
    b->begin += 0.5 * (1 - stiff) * k * PetscSqr(s.strain[m]);
  }
  if (rule->prediction) PetscCall(predict_bodies_ahead(c, rule, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void BondGetImpulse(const Bond *b, PetscInt mode, PetscReal pull, Impulse *sum)
{
  const PetscInt   dim = b->n == 3 ? 2 : 3;
  const PetscReal *n   = BondDirection(&b->frame, mode);
  PetscReal        back[3];

  *sum = (Impulse){{0}, {0}, {0}};
  for (PetscInt a = 0; a < 3; a++) {
    const PetscReal v = pull * n[a];

    if (mode < dim) sum->f[a] = v;
    else {
      sum->ti[a] = v;
      sum->tj[a] = -v;
    }
  }
  if (mode >= dim) return;
  cross(b->frame.lever[0], sum->f, sum->ti);
  for (PetscInt a = 0; a < 3; a++) back[a] = -sum->f[a];
  cross(b->frame.lever[1], back, sum->tj);
}

void BondTake(Bond *b, PetscInt mode, PetscReal speed, PetscReal pull)
{
  const PetscInt kind = BondKind(b->n, mode);
  PetscReal     *load = b->record->load;

  b->elastic[kind] += b->stiff[mode] * PetscSqr(b->elastic_value[mode] + b->slope[mode] * speed);
  if (mode == 0) load[1] = load[2] = load[3] = 0;
  if (kind == 0 || kind == 2) load[kind] = pull;
  else load[kind] = PetscSqrtReal(PetscSqr(load[kind]) + PetscSqr(pull));
}

/* A bond breaks by its load. Where a step does not see its period, what is left of strain and speed swings about the
   load from one step to the next; there the mean of two steps counts, of a new bond half of its first.

   Of what a step resolves the energy is that of the strain (without a flow velocities are those of the middle of the
   step, and so is the energy); of what it does not, that of the pull: the strain that the curved way of a step leaves
   is none */
PetscErrorCode BondStore(Contact c, Bond *b)
{
  const PetscInt mode[4] = {0, 1, c->dim == 3 ? 3 : 1, b->n - 1}; /* of the kinds */
  BondStrain     now;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 4; a++) {
    const PetscReal half = 0.5 * b->stiff[mode[a]];

    b->record->mean[a]   = (1 - half) * b->record->load[a] + half * b->record->before[a];
    b->record->before[a] = b->record->load[a];
  }
  PetscCall(BondFindStrain(c, b, &now));
  b->record->stored = c->alone ? 0.5 * b->begin : 0;
  for (PetscInt m = 0; m < b->n; m++)
    b->record->stored += (c->alone ? 0.25 : 0.5) * (1 - b->stiff[m]) * now.stiffness[BondKind(b->n, m)] *
                         PetscSqr(now.strain[m]);
  for (PetscInt a = 0; a < 4; a++)
    if (now.stiffness[a] > 0) b->record->stored += 0.5 * b->elastic[a] / now.stiffness[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- in a flow ---- */

/* Its springs in the order of the modes; ContactSpring pushes body i along its normal, from j to i */
static void add_springs(Contact c, const Bond *b, PetscReal wall[])
{
  for (PetscInt m = 0; m < b->n; m++) {
    ContactSpring   *s = &c->springs.spring[c->springs.n++];
    const PetscReal *n;

    *s       = (ContactSpring){.i = b->i, .j = b->j, .rate = b->rate[m], .value = -b->value[m] - b->rate[m] * wall[m]};
    n        = BondDirection(&b->frame, m);
    s->turns = (PetscBool)(m >= c->dim);
    s->again = (PetscBool)(m > 0);
    for (PetscInt a = 0; a < 3; a++) {
      s->normal[a] = -n[a];
      s->ri[a]     = b->frame.lever[0][a];
      s->rj[a]     = b->frame.lever[1][a];
    }
  }
}

PetscErrorCode ContactAddBonds(Contact c, PetscReal dt, PetscReal theta, PetscInt order, PetscInt *n,
                               const ContactSpring *spring[])
{
  Bonds           bonds  = c->bonds;
  const PetscReal middle = order == 2 ? 0.5 : 1;
  const BondRule  rule   = {.h          = dt,
                            .next       = dt * theta * middle,
                            .before     = dt * theta * (1 - middle),
                            .end        = dt,
                            .last       = dt * (1 - middle),
                            .damped     = theta,
                            .prediction = order};

  PetscFunctionBeginUser;
  if (!bonds) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BondList(c));
  PetscCall(ContactUseCopies(c, c->s->x, c->s->q, c->s->u, c->s->w));
  c->x         = c->s->x;
  c->q         = c->s->q;
  c->u         = c->s->u;
  c->w         = c->s->w;
  c->springs.n = bonds->first = *n;
  PetscCall(ArrayReserve(*n + BOND_MODES * bonds->n, &c->springs.capacity, &c->springs.spring,
                         sizeof(*c->springs.spring), NULL));
  PetscCall(ContactSetInertias(c));
  for (PetscInt e = 0; e < bonds->n; e++) {
    Bond     *b = &bonds->bond[e];
    PetscReal wall[BOND_MODES];

    PetscCall(BondMakeSprings(c, &rule, b));
    PetscCall(BondGetWallSpeeds(c, b, wall));
    add_springs(c, b, wall);
  }
  *n      = c->springs.n;
  *spring = c->springs.spring;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The forces of the step, in the order of the springs */
PetscErrorCode BondTakeForces(Contact c, const PetscReal force[])
{
  Bonds bonds = c->bonds;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(bonds->force, c->s->n));
  for (PetscInt e = 0, at = bonds->first; e < bonds->n; e++) {
    Bond *b = &bonds->bond[e];

    for (PetscInt m = 0; m < b->n; m++, at++) {
      const PetscReal pull = -force[at];
      Impulse         sum;

      BondTake(b, m, b->rate[m] > 0 ? (pull - b->value[m]) / b->rate[m] : 0, pull);
      BondGetImpulse(b, m, pull, &sum);
      for (PetscInt a = 0; a < 3; a++) {
        bonds->force[b->i][a] += sum.f[a];
        bonds->force[b->i][3 + a] += sum.ti[a];
        if (b->j < 0) continue;
        bonds->force[b->j][a] -= sum.f[a];
        bonds->force[b->j][3 + a] += sum.tj[a];
      }
    }
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 6, bonds->force));
  for (PetscInt e = 0; e < 3 * c->s->n; e++) {
    c->s->contact_force[e / 3][e % 3] += bonds->force[e / 3][e % 3];
    c->s->contact_torque[e / 3][e % 3] += bonds->force[e / 3][3 + e % 3];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
