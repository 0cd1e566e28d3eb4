/* Contact, a step of bodies in a flow: integrates the bodies that can come within range by symplectic Euler, all pairs
   at once (atonce.c), on owners with their ghosts. Two additions make a body come to rest although the flow
   answers only once a step (runs/studies/contact):
   - drag: the frozen acceleration belongs to the old velocity. While contact changes the velocity by du, the
     acceleration changes by -lambda du with lambda from (buoyant acceleration - a) = lambda u, where that is a
     resistance. Without it bodies slower than u_ref/5 overlap when the step exceeds their relaxation time;
   - look-ahead (law repulsive): two steps are integrated, and each pair takes the larger of the means over one and over
     two steps. A second-order scheme (bdf2) gives only 2/3 of a sudden impulse in its first step; without look-ahead
     bodies overlap at u dt > r. The law spring does without, because more than the impulse of the collision would make
     energy.
   Stable while the true effective mass is above 3/4 of ours. Limit: bodies without buoyancy that a very viscous flow
   presses together (step 10 relaxation times) overlap by some r before the force has grown. */
#include "compat.h"
#include "cohesion.h"
#include "base/log.h"
#include "bodies/local.h"

#define REST_SPEED 0.01 /* in r/dt: slower bodies feel no drag */

/* A body's motion without contact during the sub-steps of ContactStep. */
typedef struct {
  PetscReal u0[3], a[3], alpha[3], drag;
} BodyDrift;

/* A pair that can touch during the step: the impulses over one step and over the look-ahead. */
typedef struct {
  PetscInt  pair;
  PetscReal stored; /* law spring: its energy at the beginning */
  Impulse   sum[2], by_law;
} Near;

/* The bodies and pairs that take part in the sub-steps. */
typedef struct {
  PetscInt   nnear, nactive, *active;
  PetscBool  turns; /* may a force turn a body? */
  Near      *near;
  BodyDrift *drift; /* [n] */
} Crowd;

/* Smallest time in which a contact force changes, over the listed pairs. m: the smaller mass of the pair. */
static PetscErrorCode contact_time(Contact c, PetscInt n, const Near near[], PetscReal *min)
{
  PetscFunctionBeginUser;
  *min = PETSC_MAX_REAL;
  for (PetscInt p = 0; p < n; p++) {
    const Pair *pair = &c->list.pair[near[p].pair];
    const Kind *i = ContactKind(c, pair->i), *j = pair->j >= 0 ? ContactKind(c, pair->j) : NULL;
    PetscReal   speed, K, m = i->moves ? i->mass : PETSC_MAX_REAL;

    PetscCall(ContactPairSpeed(c, pair, &speed));
    K = c->law->combine(c, i, j, speed);
    if (c->cohesion) K = PetscMax(K, CohesionSlope(c, i, j));
    if (j && j->moves) m = PetscMin(m, j->mass);
    if (K > 0) *min = PetscMin(*min, c->law->time(c, K, m));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void move_body(Contact c, PetscInt k, PetscReal h)
{
  for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += h * c->u[k][a];
  if (ContactKind(c, k)->disc <= 0) RotationAdvance(h, c->w[k], c->q[k]); /* discs look the same from all sides */
}

/* lambda with (buoyant acceleration - a) = lambda u, 0 where a is no resistance; bodies all but at rest have none */
static PetscReal estimate_drag(Contact c, PetscInt k, PetscReal dt, const PetscReal a[3])
{
  const BodyGroup *g          = BodiesGetGroup(c->state, k);
  const PetscReal *u          = c->s->u[k];
  const PetscReal  rest_speed = REST_SPEED * c->range / dt;
  PetscReal        sum        = 0;

  for (PetscInt b = 0; b < c->dim; b++)
    if (g->free & (BODY_FREE_X << b))
      sum += ((c->s->density[k] - c->fluid.density) * BodiesVolume(c->state, k) * c->g[b] / ContactMass(c, k) - a[b]) *
             u[b];
  return PetscMax(0, sum) / (dot3(u, u) + rest_speed * rest_speed);
}

static PetscErrorCode set_drift(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3], BodyDrift drift[])
{
  const BodyArrays *s    = c->s;
  const PetscReal   time = c->law->lookahead * dt;

  PetscFunctionBeginUser;
  if (!c->list.reach) PetscCall(PetscMalloc1(s->n, &c->list.reach));
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = BodiesGetGroup(c->state, k);
    BodyDrift       *d = &drift[k];

    for (PetscInt b = 0; b < 3; b++) {
      const PetscBool moves = g->free & (BODY_FREE_X << b) ? PETSC_TRUE : PETSC_FALSE,
                      turns = (g->free & BODY_FREE_ROTATION) && (c->dim == 3 || b == 2) ? PETSC_TRUE : PETSC_FALSE;

      d->u0[b]    = s->u[k][b];
      d->a[b]     = moves ? a[k][b] : 0;
      d->alpha[b] = turns ? alpha[k][b] : 0;
    }
    d->drag          = estimate_drag(c, k, dt, d->a);
    c->list.reach[k] = (PetscSqrtReal(dot3(s->u[k], s->u[k])) + 0.5 * PetscSqrtReal(dot3(d->a, d->a)) * time) * time +
                       0.5 * c->range;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode gather_crowd(Contact c, Crowd *w)
{
  PetscBool *listed;

  PetscFunctionBeginUser;
  w->nnear = w->nactive = 0;
  PetscCall(PetscMalloc1(c->list.n, &w->near));
  PetscCall(PetscCalloc1(c->s->n, &listed));
  PetscCall(PetscMalloc1(c->s->n, &w->active));
  for (PetscInt p = 0; p < c->list.n; p++) {
    PetscBool can;

    PetscCall(ContactCanMeet(c, &c->list.pair[p], &can));
    if (!can) continue;
    w->near[w->nnear++] = (Near){.pair = p};
    if (c->law->impulses) PetscCall(ContactPairEnergy(c, p, &w->near[w->nnear - 1].stored));
    for (PetscInt side = 0; side < 2; side++) {
      const PetscInt k = side ? c->list.pair[p].j : c->list.pair[p].i;

      if (k < 0 || listed[k]) continue;
      listed[k]               = PETSC_TRUE;
      w->active[w->nactive++] = k;
    }
  }
  PetscCall(PetscFree(listed));
  c->count.near = w->nnear;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity after the motion without contact. */
static void drift_velocity(Contact c, PetscInt k, const BodyDrift *d, PetscReal h)
{
  const Kind *kind = ContactKind(c, k);

  for (PetscInt a = 0; a < 3; a++) {
    /* implicit in the drag: du/dt = a - lambda (u - u0) */
    if (kind->inverse_mass[a] > 0) c->u[k][a] = (c->u[k][a] + h * (d->a[a] + d->drag * d->u0[a])) / (1 + h * d->drag);
    c->w[k][a] += h * d->alpha[a];
  }
  BodiesKeepAxes(c->state, k, c->u[k], c->w[k]);
}

/* The velocities of own bodies change by the forces of all pairs at once, those of ghosts by their owners' */
static PetscErrorCode kick_crowd(Contact c, PetscReal h, const Crowd *w)
{
  const AtOnce *all = &c->at_once;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < w->nactive; e++) {
    const PetscInt k     = w->active[e];
    PetscReal      dw[3] = {0, 0, 0};

    if (!c->s->own[k]) continue;
    if (w->turns) ContactSpin(c, k, all->torque[k], dw);
    for (PetscInt a = 0; a < 3; a++) {
      c->u[k][a] += h * ContactKind(c, k)->inverse_mass[a] * all->force[k][a];
      c->w[k][a] += h * dw[a];
    }
    BodiesKeepAxes(c->state, k, c->u[k], c->w[k]);
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->u));
  if (w->turns) PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode advance_crowd(Contact c, PetscReal h, Crowd *w, PetscBool in_step)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < w->nactive; k++) drift_velocity(c, w->active[k], &w->drift[w->active[k]], h);
  PetscCall(PetscArrayzero(c->at_once.of_pair, c->list.n));
  if (c->at_once.by_law) PetscCall(PetscArrayzero(c->at_once.by_law, c->list.n));
  PetscCall(ContactForcesAtOnce(c, h, w->turns));
  for (PetscInt k = 0; k < w->nnear; k++) {
    Near          *near = &w->near[k];
    const Impulse *now  = &c->at_once.of_pair[near->pair];

    for (PetscInt a = 0; a < 3 && c->at_once.by_law; a++) {
      near->by_law.f[a] += h * c->at_once.by_law[near->pair].f[a];
      near->by_law.ti[a] += h * c->at_once.by_law[near->pair].ti[a];
      near->by_law.tj[a] += h * c->at_once.by_law[near->pair].tj[a];
    }
    for (PetscInt a = 0; a < 3; a++)
      for (PetscInt s = in_step ? 0 : 1; s < 2; s++) {
        near->sum[s].f[a] += h * now->f[a];
        near->sum[s].ti[a] += h * now->ti[a];
        near->sum[s].tj[a] += h * now->tj[a];
      }
  }
  PetscCall(kick_crowd(c, h, w));
  for (PetscInt k = 0; k < w->nactive; k++) move_body(c, w->active[k], h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The larger of the means over one step and the look-ahead, a pair as a whole, so that momentum is conserved. */
static void store_means(Contact c, PetscReal dt, const Crowd *w)
{
  const PetscInt lookahead = c->law->lookahead;

  for (PetscInt k = 0; k < w->nnear; k++) {
    const Near     *near = &w->near[k];
    const PetscReal f1   = dot3(near->sum[0].f, near->sum[0].f),
                    f2   = dot3(near->sum[1].f, near->sum[1].f) / (lookahead * lookahead);
    const PetscInt s     = f2 > f1;

    ContactScatter(&c->list.pair[near->pair], &near->sum[s], 1 / (s ? lookahead * dt : dt), c->s->contact_force,
                   c->s->contact_torque);
  }
}

static PetscErrorCode integrate(Contact c, PetscReal dt, Crowd *w)
{
  PetscReal time;
  PetscInt  n;

  PetscFunctionBeginUser;
  PetscCall(contact_time(c, w->nnear, w->near, &time));
  PetscCall(BodiesMin(c->bodies, 1, &time));
  PetscCall(ContactRemarkUnresolved(c, time, dt));
  PetscCall(ContactChooseSubsteps(c, dt, time, &n));
  PetscCall(PetscMalloc1(c->list.n, &c->at_once.of_pair));
  if (c->law->impulses) PetscCall(PetscMalloc1(c->list.n, &c->at_once.by_law));
  for (PetscInt i = 0; i < c->law->lookahead * n; i++)
    PetscCall(advance_crowd(c, dt / n, w, i < n ? PETSC_TRUE : PETSC_FALSE));
  PetscCall(PetscFree(c->at_once.of_pair));
  PetscCall(PetscFree(c->at_once.by_law));
  c->count.substeps = n;
  for (PetscInt k = 0; k < w->nnear; k++)
    PetscCall(ContactAddSpring(c, &c->list.pair[w->near[k].pair], w->near[k].stored, &w->near[k].by_law,
                               &w->near[k].sum[0], dt));
  store_means(c, dt, w);
  if (c->impulse.mean) PetscCall(BodiesUpdateGhosts(c->bodies, 7, c->impulse.mean_next));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->s->contact_force));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->s->contact_torque));
  PetscCall(ContactFindShifts(c, dt, w->nactive, w->active));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactStep(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  BodyArrays *s = c->s;
  Crowd       w = {.turns = ContactTurns(c)};
  PetscBool   any;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the contact must be positive",
             (double)dt);
  ContactClear(s);
  c->count.substeps = c->count.near = c->springs.n = 0;
  if (c->impulse.mean) PetscCall(PetscArrayzero((PetscReal *)c->impulse.shift, 3 * s->n));
  for (PetscInt k = 0; k < s->n && c->impulse.mean; k++) c->impulse.mean_next[k][6] = 0;
  if (!c->law->lookahead) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  PetscCall(ContactSetScales(c, dt, a));
  PetscCall(ContactUseCopies(c, s->x, s->q, s->u, s->w));
  PetscCall(PetscMalloc1(s->n, &w.drift));
  PetscCall(set_drift(c, dt, a, alpha, w.drift));
  PetscCall(ContactFindPairs(c));
  PetscCall(ContactSetInertias(c));
  PetscCall(gather_crowd(c, &w));
  any = (PetscBool)(w.nnear > 0);
  PetscCall(BodiesAny(c->bodies, &any));
  if (any) PetscCall(integrate(c, dt, &w));
  PetscCall(ContactMeasureForces(c));
  PetscCall(PetscFree(w.near));
  PetscCall(PetscFree(w.active));
  PetscCall(PetscFree(w.drift));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
