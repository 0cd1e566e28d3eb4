/* Contact, forces that are solved with the flow (law repulsive with implicit coupling): every touch becomes a spring
   and a dashpot, F = value - rate v with the speed v at which the bodies part there at the end of the step, for the
   linear system of flow and bodies. So a force is as large as the gap in which the step ends asks for, whatever the
   flow does to the bodies: it may hold them, press them, or move others with them (runs/studies/contact, "Contact that
   is solved with the flow").

   F is the law's at two speeds w = -v of approach and linear between and beyond: 0, where the flow holds the bodies;
   and where an implicit step of the two alone would end, m (w0 - w)/dt = F(w), F(w) = f(gap - w dt) (1 + w/damping
   speed). f falls with the gap and the damping grows with the speed, so F is monotone in w and that end unique. The gap
   of the end counts by backward Euler, with which a stiff contact damps whatever the scheme of the flow. The stiffness
   goes by the speed of approach. Pairs are looked at where they come within reach on a straight way. */
#include "compat.h"
#include "bond.h"
#include "cohesion.h"
#include "base/log.h"
#include "base/array.h"

#define COUNTED_STEPS 2    /* steps that an approach counts: bdf2 moves a body that stops by half of the speed it had */
#define SAMPLES       6    /* parts of the way of a step at whose ends a pair is looked at */
#define COHESIVE_RATE 1e3  /* of a pair that cohesion holds, in its mass over the step */
#define BISECTIONS    40   /* of the speed */
#define DIFFERENCE    1e-4 /* for the slope of the force, in the range of speeds */

/* The pair where its bodies are after `time` on a straight way */
static void place_pair(Contact c, const Pair *p, PetscReal time)
{
  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt k = side ? p->j : p->i;

    if (k < 0) continue;
    for (PetscInt a = 0; a < 3; a++) c->x[k][a] = c->s->x[k][a] + time * c->u[k][a];
    if (ContactKind(c, k)->disc > 0) continue;
    for (PetscInt a = 0; a < 4; a++) c->q[k][a] = c->s->q[k][a];
    RotationAdvance(time, c->s->w[k], c->q[k]);
  }
}

/* What a touch needs to know of the law */
typedef struct {
  Meeting   m;
  PetscReal gap, dt; /* at the beginning */
} Approach;

/* Force at speed w of approach */
static PetscReal force_at(Contact c, Approach *t, PetscReal w)
{
  PetscReal rate, value;

  t->m.gap = t->gap - (w > 0 ? COUNTED_STEPS : 1) * w * t->dt;
  if (t->m.gap >= c->range) return 0;
  value = c->law->force(c, &t->m, &rate);
  return PetscMax(0, value + rate * w);
}

/* The speed of approach at which two bodies that come with w0 end the step; no force below `free` */
static PetscReal end_speed(Contact c, Approach *t, PetscReal w0, PetscReal free)
{
  PetscReal low = free, high = w0;

  for (PetscInt i = 0; i < BISECTIONS; i++) {
    const PetscReal w = 0.5 * (low + high);

    if (w0 - w > t->dt * t->m.inverse_mass * force_at(c, t, w)) low = w;
    else high = w;
  }
  return 0.5 * (low + high);
}

static void place_spring(const Pair *p, const Dashpot *d, ContactSpring *s)
{
  *s = (ContactSpring){.i = p->i, .j = p->j, .rate = d->rate};
  for (PetscInt a = 0; a < 3; a++) {
    s->normal[a] = d->normal[a];
    s->ri[a]     = d->has_levers ? d->ri[a] : 0;
    s->rj[a]     = d->has_levers ? d->rj[a] : 0;
  }
}

/* Spring of a dashpot that was found after `time`, of a pair that a pull brings nearer; *acts: is there a force in
   this step? */
static PetscErrorCode make_spring(Contact c, const Pair *p, const Dashpot *d, PetscReal pull, PetscReal time,
                                  PetscReal dt, ContactSpring *s, PetscBool *acts)
{
  const PetscReal w0 = ContactApproach(c, p, d) + dt * d->inverse_mass * pull, gap = d->gap + time * w0,
                  free = (gap - c->range) / (gap > c->range ? COUNTED_STEPS * dt : dt);
  Approach  t          = {.gap = gap, .dt = dt};
  PetscReal w, step, from, force;

  PetscFunctionBeginUser;
  *acts = PETSC_TRUE;
  place_spring(p, d, s);
  if (d->film) PetscFunctionReturn(PETSC_SUCCESS);
  *acts = (PetscBool)(w0 > free && d->inverse_mass > 0);
  if (!*acts) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFillMeeting(c, p, &t.m));
  t.m.weight       = d->weight;
  t.m.inverse_mass = d->inverse_mass;
  w                = end_speed(c, &t, w0, free);
  force            = force_at(c, &t, w);
  step             = DIFFERENCE * (w0 - free);
  from             = PetscAbsReal(w) > step ? 0 : w + (w > 0 ? -step : step);
  s->rate          = (force - force_at(c, &t, from)) / (w - from);
  s->value         = force - s->rate * w;
  *acts            = (PetscBool)(s->rate > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The pull of cohesion over a step: that where it begins, but no more than brings surfaces together in it, where no
   law of contact would meet them (it acts: n springs) */
static PetscErrorCode add_pull(Contact c, PetscInt number, PetscInt n, PetscReal dt, const Dashpot *dashpot,
                               PetscReal s, PetscReal pull)
{
  const Pair     *p    = &c->list.pair[number];
  const PetscReal free = dashpot->inverse_mass > 0
                         ? (s / dt - ContactApproach(c, p, dashpot)) / (dt * dashpot->inverse_mass)
                         : PETSC_MAX_REAL;
  ContactSpring  *spring;

  PetscFunctionBeginUser;
  if (!n && s > 0) pull = PetscClipInterval(free, 0, pull);
  if (pull <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(c->springs.n + 1, &c->springs.capacity, &c->springs.spring, sizeof(*c->springs.spring), NULL));
  spring = &c->springs.spring[c->springs.n++];
  place_spring(p, dashpot, spring);
  spring->rate  = 0;
  spring->value = -pull;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A pull and the springs that bear it all but cancel. Where they are stiffer than any step sees, what a solve leaves of
   them would throw the bodies (pull dt^2/(mass range) from 1e5 on). So all of them, from `first` on, are reduced alike
   to a rate at which the pair ends the step where they balance: that place stays. A load that moves bodies less than
   some COHESIVE_RATE/2 ranges in a step does not part them, as the pull itself would have it; a pair that is drawn
   farther is brought back (add_pull). */
static void reduce_pull(Contact c, PetscInt first, PetscReal inverse_mass, PetscReal dt)
{
  PetscReal rate = 0, factor;

  for (PetscInt k = first; k < c->springs.n; k++) rate += c->springs.spring[k].rate;
  factor = rate * inverse_mass * dt > COHESIVE_RATE ? COHESIVE_RATE / (rate * inverse_mass * dt) : 1;
  for (PetscInt k = first; k < c->springs.n; k++) {
    c->springs.spring[k].rate *= factor;
    c->springs.spring[k].value *= factor;
  }
}

static PetscErrorCode add_springs(Contact c, PetscInt number, PetscReal dt)
{
  const Pair    *p     = &c->list.pair[number];
  const PetscInt first = c->springs.n;
  Rub            rub;
  PetscInt       n = 0;
  PetscReal      gap, time = 0, pull = 0, s = 0;
  Dashpot        dashpot = {0};

  PetscFunctionBeginUser;
  if (c->cohesion) PetscCall(CohesionPull(c, number, &dashpot, &s, &pull));
  for (PetscInt i = 0; i <= SAMPLES && !n; i++) {
    time = i * COUNTED_STEPS * dt / SAMPLES;
    place_pair(c, p, time);
    PetscCall(ContactPairDashpots(c, number, dt, &n, &rub, &gap));
  }
  PetscCall(ArrayReserve(c->springs.n + n, &c->springs.capacity, &c->springs.spring, sizeof(*c->springs.spring), NULL));
  for (PetscInt k = 0; k < n; k++) {
    PetscBool acts;

    PetscCall(make_spring(c, p, &c->dashpot[k], pull, time, dt, &c->springs.spring[c->springs.n], &acts));
    c->springs.n += acts;
  }
  place_pair(c, p, 0);
  if (pull > 0) PetscCall(add_pull(c, number, n, dt, &dashpot, s, pull));
  if (pull > 0) reduce_pull(c, first, dashpot.inverse_mass, dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactFindSprings(Contact c, PetscReal dt, PetscBool start, PetscReal (*a)[3], PetscInt *n,
                                  const ContactSpring *spring[])
{
  BodyArrays *s = c->s;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the contact must be positive",
             (double)dt);
  ContactClear(s);
  c->with_flow = PETSC_TRUE;
  c->springs.n = c->count.near = 0;
  c->count.substeps            = 1;
  *n                           = 0;
  if (!c->law->lookahead) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  PetscCall(ContactSetScales(c, dt, a));
  PetscCall(ContactUseCopies(c, s->x, s->q, s->u, s->w));
  for (PetscInt k = 0; k < s->n && start; k++)
    for (PetscInt b = 0; b < c->dim; b++)
      if (ContactKind(c, k)->inverse_mass[b] > 0) c->u[k][b] += dt * a[k][b];
  if (!c->list.reach) PetscCall(PetscMalloc1(s->n, &c->list.reach));
  for (PetscInt k = 0; k < s->n; k++)
    c->list.reach[k] = PetscSqrtReal(dot3(c->u[k], c->u[k])) * COUNTED_STEPS * dt + 0.5 * c->range;
  PetscCall(ContactFindPairs(c));
  PetscCall(ContactSetInertias(c));
  for (PetscInt p = 0; p < c->list.n; p++) {
    PetscBool can;

    PetscCall(ContactCanMeet(c, &c->list.pair[p], &can));
    if (!can) continue;
    c->count.near++;
    PetscCall(add_springs(c, p, dt));
  }
  *n      = c->springs.n;
  *spring = c->springs.spring;
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactTakeForces(Contact c, const PetscReal force[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->springs.n; k++) {
    const ContactSpring *s   = &c->springs.spring[k];
    const Pair           p   = {s->i, s->j};
    Impulse              sum = {{0}, {0}, {0}};

    if (c->bonds && k >= c->bonds->first) break;
    for (PetscInt a = 0; a < 3; a++) sum.f[a] = force[k] * s->normal[a];
    cross(s->ri, sum.f, sum.ti);
    cross(sum.f, s->rj, sum.tj);
    ContactScatter(&p, &sum, 1, c->s->contact_force, c->s->contact_torque);
  }
  if (c->bonds) PetscCall(BondTakeForces(c, force));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->s->contact_force));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->s->contact_torque));
  PetscFunctionReturn(PETSC_SUCCESS);
}
