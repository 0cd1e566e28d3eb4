/* Contact, a step of bodies in a flow: integrates the bodies that can come within range by symplectic Euler, under the
   forces of all pairs at once (atonce.c), so that any number of ranks gives the same bits. Two additions make a body
   come to rest although the flow answers only once a step (runs/studies/contact):
   - drag: the frozen acceleration belongs to the old velocity. While contact changes the velocity by du, the
     acceleration changes by -lambda du with lambda from (buoyant acceleration - a) = lambda u, where that is a
     resistance. Without it bodies slower than u_ref/5 overlap when the step exceeds their relaxation time. What takes
     back the contact force of the last step is no drag: see estimate_drag;
   - look-ahead (law repulsive): two steps are integrated, and each pair takes the larger of the means over one and over
     two steps. A second-order scheme (bdf2) gives only 2/3 of a sudden impulse in its first step; without look-ahead
     bodies overlap at u dt > r. The law spring does without, because more than the impulse of the collision would make
     energy.
   Stable while the true effective mass is above 3/4 of ours. Limit: bodies without buoyancy that a very viscous flow
   presses together (step 10 relaxation times) overlap by some r before the force has grown. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

#define REST_SPEED 0.01 /* in r/dt: slower bodies feel no drag */

/* A body's motion without contact during the sub-steps of ContactStep. */
typedef struct {
  PetscReal u0[3], a[3], alpha[3], drag;
} Drift;

/* The sub-steps of a step: who takes part, and the impulses of its pairs over the step and over the look-ahead */
typedef struct {
  Crowd  crowd;
  Drift *drift; /* [n] */
  Impulse (*sum)[2];
  PetscBool turns;
} Steps;

/* Over the pairs of the crowds of all ranks: are there any, and the smallest time in which a contact force changes */
static PetscErrorCode contact_time(Contact c, const Crowd *w, PetscBool *any, PetscReal *time)
{
  PetscReal v[2] = {w->npairs, -PETSC_MAX_REAL};

  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < w->npairs; p++) {
    const Pair *pair = &c->pair[w->pair[p]];
    const Kind *i = ContactKind(c, pair->i), *j = pair->j >= 0 ? ContactKind(c, pair->j) : NULL;
    PetscReal   K = c->law->combine(c, i, j, ContactPairSpeed(c, pair)), lighter = i->moves ? i->mass : PETSC_MAX_REAL;

    if (j && j->moves) lighter = PetscMin(lighter, j->mass);
    if (K > 0) v[1] = PetscMax(v[1], -c->law->time(c, K, lighter));
  }
  PetscCall(BodiesMax(c->bodies, 2, v));
  *any  = (PetscBool)(v[0] > 0);
  *time = -v[1];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void move_body(Contact c, PetscInt k, PetscReal h)
{
  for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += h * c->u[k][a];
  if (ContactKind(c, k)->disc <= 0) RotationAdvance(h, c->w[k], c->q[k]); /* discs look the same from all sides */
}

/* lambda with (buoyant acceleration - a) = lambda u, 0 where a is no resistance; bodies all but at rest have none.

   A body that shares cut cells with another moves as one with it, and the flow takes the contact force of the last step
   back. That is no drag, though it looks like a large one at the small speed that is left: contact that was to overcome
   it would press harder in every step, and fling the body out when the cells part (runs/studies/contact). Of what is
   taken back along that force, a share of it, that share is left out: all of it where the body does not yield. */
static PetscReal estimate_drag(Contact c, PetscInt k, PetscReal dt, const PetscReal a[3])
{
  const BodyGroup *g = BodiesGetGroup(c->state, k);
  const PetscReal *u = c->s->u[k], *f = c->s->contact_force[k];
  const PetscReal  rest = REST_SPEED * c->range / dt, mass = ContactMass(c, k), force = PetscSqrtReal(dot3(f, f)) / mass;
  PetscReal        r[3] = {0, 0, 0}, back, sum;

  for (PetscInt b = 0; b < 3; b++)
    if (g->free & (BODY_FREE_X << b)) r[b] = (c->s->density[k] - c->rho_f) * BodiesVolume(c->state, k) * c->g[b] / mass - a[b];
  sum  = dot3(r, u);
  back = force > 0 ? PetscMax(0, PetscMin(dot3(r, f) / (mass * force), force)) : 0;
  if (back > 0) sum -= PetscSqr(back / force) * dot3(f, u) / mass;
  return PetscMax(0, sum) / (dot3(u, u) + rest * rest);
}

static PetscErrorCode start_drift(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3], Drift drift[])
{
  const BodyArrays *s    = c->s;
  const PetscReal   time = c->law->lookahead * dt;

  PetscFunctionBeginUser;
  if (!c->reach) PetscCall(PetscMalloc1(s->n, &c->reach));
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(c->state, k);
    Drift           *d = &drift[k];

    for (PetscInt b = 0; b < 3; b++) {
      const PetscBool moves = g->free & (BODY_FREE_X << b) ? PETSC_TRUE : PETSC_FALSE,
                      turns = (g->free & BODY_FREE_ROTATION) && (c->dim == 3 || b == 2) ? PETSC_TRUE : PETSC_FALSE;

      d->u0[b]    = s->u[k][b];
      d->a[b]     = moves ? a[k][b] : 0;
      d->alpha[b] = turns ? alpha[k][b] : 0;
    }
    d->drag     = estimate_drag(c, k, dt, d->a);
    c->reach[k] = (PetscSqrtReal(dot3(s->u[k], s->u[k])) + 0.5 * PetscSqrtReal(dot3(d->a, d->a)) * time) * time + 0.5 * c->range;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Can the pair meet during the step? The list holds also those that its skin brought in. */
static PetscBool can_meet(Contact c, const Pair *p)
{
  PetscReal reach = c->horizon + ContactKind(c, p->i)->radius + c->reach[p->i];

  if (p->j < 0) {
    const PetscInt face = -1 - p->j, a = face / 2;

    return (PetscBool)((face % 2 ? c->upper[a] - c->x[p->i][a] : c->x[p->i][a] - c->lower[a]) < reach);
  }
  return ContactWithin(c, p->i, p->j, reach + ContactKind(c, p->j)->radius + c->reach[p->j]);
}

static PetscErrorCode gather_crowd(Contact c, Crowd *w)
{
  PetscBool *listed;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(c->npairs, &w->pair, c->npairs, &w->force));
  PetscCall(PetscMalloc1(c->s->n, &w->body));
  PetscCall(PetscCalloc1(c->s->n, &listed));
  for (PetscInt p = 0; p < c->npairs; p++) {
    if (!can_meet(c, &c->pair[p])) continue;
    w->pair[w->npairs++] = p;
    for (PetscInt side = 0; side < 2; side++) {
      const PetscInt k = side ? c->pair[p].j : c->pair[p].i;

      if (k < 0 || listed[k]) continue;
      listed[k]             = PETSC_TRUE;
      w->body[w->nbodies++] = k;
      if (c->dim == 3) PetscCall(ContactSetInertia(c, k));
    }
  }
  PetscCall(PetscFree(listed));
  c->nnear = w->npairs;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity after the motion without contact. */
static void drift_velocity(Contact c, PetscInt k, const Drift *d, PetscReal h)
{
  const Kind *kind = ContactKind(c, k);

  for (PetscInt a = 0; a < 3; a++) {
    /* implicit in the drag: du/dt = a - lambda (u - u0) */
    if (kind->inverse_mass[a] > 0) c->u[k][a] = (c->u[k][a] + h * (d->a[a] + d->drag * d->u0[a])) / (1 + h * d->drag);
    c->w[k][a] += h * d->alpha[a];
  }
  BodiesKeepAxes(c->state, k, c->u[k], c->w[k]);
}

static void push_body(Contact c, PetscInt k, PetscReal h, PetscBool turns)
{
  const Kind *kind  = ContactKind(c, k);
  PetscReal   dw[3] = {0, 0, 0};

  if (turns) ContactSpin(c, k, c->at_once.torque[k], dw);
  for (PetscInt a = 0; a < 3; a++) {
    c->u[k][a] += h * kind->inverse_mass[a] * c->at_once.force[k][a];
    c->w[k][a] += h * dw[a];
  }
  BodiesKeepAxes(c->state, k, c->u[k], c->w[k]);
}

static PetscErrorCode advance_crowd(Contact c, PetscReal h, PetscBool in_step, Steps *w)
{
  Crowd *crowd = &w->crowd;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < crowd->nbodies; k++) drift_velocity(c, crowd->body[k], &w->drift[crowd->body[k]], h);
  PetscCall(ContactForcesAtOnce(c, h, w->turns, crowd));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->at_once.force));
  if (w->turns) PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->at_once.torque));
  for (PetscInt p = 0; p < crowd->npairs; p++)
    for (PetscInt s = in_step ? 0 : 1; s < 2; s++) ImpulseAdd(h, &crowd->force[p], &w->sum[p][s]);
  for (PetscInt k = 0; k < crowd->nbodies; k++) {
    push_body(c, crowd->body[k], h, w->turns);
    move_body(c, crowd->body[k], h);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The larger of the means over one step and the look-ahead, a pair as a whole, so that momentum is conserved. */
static PetscErrorCode store_means(Contact c, PetscReal dt, const Steps *w)
{
  const PetscInt ahead = c->law->lookahead;

  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < w->crowd.npairs; p++) {
    const Impulse  *sum = w->sum[p];
    const PetscReal f1 = dot3(sum[0].f, sum[0].f), f2 = dot3(sum[1].f, sum[1].f) / (ahead * ahead);
    const PetscInt  s = f2 > f1;

    ContactScatter(&c->pair[w->crowd.pair[p]], &sum[s], 1 / (s ? ahead * dt : dt), c->s->contact_force, c->s->contact_torque);
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->s->contact_force));
  if (w->turns) PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->s->contact_torque));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactStep(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  BodyArrays *s    = c->s;
  Steps       w    = {.turns = ContactTurns(c)};
  PetscReal   time = PETSC_MAX_REAL;
  PetscBool   any  = PETSC_FALSE;
  PetscInt    n;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the contact must be positive", (double)dt);
  c->steps_done = c->nnear = 0;
  if (!c->law->lookahead) {
    ContactClear(s);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  PetscCall(ContactSetScales(c, dt, a));
  PetscCall(ContactUseCopies(c, s->x, s->q, s->u, s->w));
  PetscCall(PetscMalloc1(s->n, &w.drift));
  PetscCall(start_drift(c, dt, a, alpha, w.drift));
  ContactClear(s);
  PetscCall(ContactFindPairs(c));
  PetscCall(gather_crowd(c, &w.crowd));
  PetscCall(PetscCalloc1(w.crowd.npairs, &w.sum));
  PetscCall(contact_time(c, &w.crowd, &any, &time));
  if (any) {
    PetscCall(ContactChooseSubsteps(c, dt, time, &n));
    for (PetscInt i = 0; i < c->law->lookahead * n; i++) PetscCall(advance_crowd(c, dt / n, (PetscBool)(i < n), &w));
    c->steps_done = n;
    PetscCall(store_means(c, dt, &w));
  }
  PetscCall(PetscFree(w.sum));
  PetscCall(PetscFree2(w.crowd.pair, w.crowd.force));
  PetscCall(PetscFree(w.crowd.body));
  PetscCall(PetscFree(w.drift));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
