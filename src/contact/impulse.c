/* Contact, the impulse of a step in a flow (law spring), which sub-steps have found for bodies of a guessed added mass
   under the loads of the step before. Three things make of it what the flow gives the bodies:

   - The scheme is linear in the history of velocities, so that forces D(I) = c_t I^{n+1} - d(I), with I the impulse
     up to a time, give velocities as if I had acted in an instant each (bdf2 takes a force for that of the end of its
     step: of the impulse of a short contact it gives 2/3 in its step and the rest after). With I^{n+1} = I^n + dt f
     and 1 = c_t dt + what counts of the step before, D(I) = weight f^n + (1 - weight) f^{n-1}. The fluid's added
     mass takes part.
   - A spring along the impulse of a pair holds its bodies to the speed at which they part after the sub-steps, whatever
     their added mass and the loads are: the more, the shorter the contact is beside the step. In steps that resolve it
     the flow acts during contact as it does without.
   - The bodies end the step where the sub-steps do: a straight way, or the mean of two speeds of which one is before
     and the other after a collision, is another one, on which the law would store energy that nobody has given. */
#include "compat.h"
#include "bond.h"
#include "cohesion.h"
#include "base/log.h"
#include "base/array.h"

#define RESOLVED 2  /* steps that a contact takes at least to be resolved */
#define MAX_RATE 20 /* largest rate of a spring, in masses of the pair over dt */

static PetscErrorCode begin_impulses(Contact c)
{
  PetscFunctionBeginUser;
  if (c->impulse.mean) PetscFunctionReturn(PETSC_SUCCESS);
  ContactStopPulling(c);
  PetscCall(BodiesAttach(c->bodies, sizeof(*c->impulse.mean), (void **)&c->impulse.mean));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*c->impulse.mean_next), (void **)&c->impulse.mean_next));
  PetscCall(BodiesAttachWork(c->bodies, sizeof(*c->impulse.shift), (void **)&c->impulse.shift));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactVisitMeans(Contact c, State state)
{
  PetscInt size = 0;
  BodyRows rows;

  PetscFunctionBeginUser;
  if (StateIsLoading(state)) {
    PetscCall(StateGetSize(state, "means", &size));
    if (size <= 0 || !c->law->impulses) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(begin_impulses(c));
  }
  if (!c->impulse.mean) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesBeginRows(c->bodies, &rows));
  PetscCall(BodiesVisitReals(c->bodies, &rows, state, "means", 7, &c->impulse.mean[0][0]));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetScheme(Contact c, const ContactScheme *scheme)
{
  const PetscBool other = (PetscBool)(c->law->impulses && scheme->implicit != c->impulse.scheme.implicit);

  PetscFunctionBeginUser;
  if (!c->law->impulses) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(begin_impulses(c));
  c->impulse.scheme = *scheme;
  if (other) PetscCall(ContactUpdateLocalBodies(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetMean(Contact c, PetscInt k, PetscReal force[3], PetscReal torque[3], PetscReal *touched)
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    force[a]  = c->impulse.mean ? c->impulse.mean[k][a] : c->s->contact_force[k][a];
    torque[a] = c->impulse.mean ? c->impulse.mean[k][3 + a] : c->s->contact_torque[k][a];
    if (!c->bonds || c->impulse.mean) continue;
    force[a] -= c->bonds->force[k][a];
    torque[a] -= c->bonds->force[k][3 + a];
  }
  if (touched) *touched = c->impulse.mean ? c->impulse.mean[k][6] : 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetSprings(Contact c, PetscInt *n, const ContactSpring *spring[])
{
  PetscFunctionBeginUser;
  *n      = c->springs.n;
  *spring = c->springs.spring;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactRemarkUnresolved(Contact c, PetscReal time, PetscReal dt)
{
  const PetscReal steps = PETSC_PI * PetscSqrtReal(2) * time / dt; /* half a period of a pair that meets a wall */

  PetscFunctionBeginUser;
  if (!c->impulse.mean || c->impulse.remarked) PetscFunctionReturn(PETSC_SUCCESS);
  c->impulse.remarked = PETSC_TRUE;
  if (steps < RESOLVED)
    PetscCall(
      LogRemark("a contact of -contact_law spring takes %.2g steps: bodies part by -contact_restitution, and what the flow does to them "
                "meanwhile is not resolved (lower -sim_dt or -contact_spring_stiffness)",
                (double)steps));
  if (!c->film.wanted)
    PetscCall(
      LogRemark("films thinner than -contact_range %g are not resolved, in which bodies with a Stokes number below some 100 lose speed: "
                "-contact_lubrication true and a range as small as their roughness count them",
                (double)c->range));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- found in sub-steps ---- */

/* Part of v across the unit vector n */
static void lever_of(const PetscReal torque[3], const PetscReal n[3], PetscReal size, PetscReal r[3])
{
  cross(n, torque, r);
  for (PetscInt a = 0; a < 3; a++) r[a] /= size;
}

static PetscReal point_speed(const PetscReal u[3], const PetscReal w[3], const PetscReal r[3], const PetscReal n[3])
{
  PetscReal wr[3];

  cross(w, r, wr);
  return dot3(u, n) + dot3(wr, n);
}

/* At which the bodies part along a spring, by u and w [n] */
static PetscReal parting(const ContactSpring *s, PetscReal (*u)[3], PetscReal (*w)[3])
{
  return point_speed(u[s->i], w[s->i], s->ri, s->normal) -
         (s->j >= 0 ? point_speed(u[s->j], w[s->j], s->rj, s->normal) : 0);
}

/* Along an impulse */
static void direct(const Pair *p, const Impulse *impulse, PetscReal size, ContactSpring *s)
{
  PetscReal back[3];

  *s = (ContactSpring){.i = p->i, .j = p->j};
  for (PetscInt a = 0; a < 3; a++) {
    s->normal[a] = impulse->f[a] / size;
    back[a]      = -s->normal[a];
  }
  lever_of(impulse->ti, s->normal, size, s->ri);
  if (p->j >= 0) lever_of(impulse->tj, back, size, s->rj);
}

/* By how much an impulse that changes the speed of a pair by `change` is a collision: bodies that go on all but as they
   came have grazed each other, and what round-off makes of that must not decide whether they are held. */
static PetscReal collides(PetscReal change, PetscReal before, PetscReal after)
{
  const PetscReal speed = PetscMax(PetscAbsReal(before), PetscAbsReal(after));

  return MAX_RATE * change < speed ? MAX_RATE * change / speed : 1;
}

/* Largest speed at which a pair may part that began the step with `before` and the energy `stored` in its law */
static PetscReal max_parting_speed(Contact c, PetscReal before, PetscReal stored, PetscReal inverse)
{
  const PetscReal kept = before < 0 ? c->spring.restitution * before : before;

  return PetscSqrtReal(kept * kept + 2 * stored * inverse);
}

PetscErrorCode ContactAddSpring(Contact c, const Pair *p, PetscReal stored, const Impulse *by_law, Impulse *impulse,
                                PetscReal dt)
{
  const PetscReal size = PetscSqrtReal(dot3(by_law->f, by_law->f));
  PetscReal       inverse, speed, before, max, cut, collision;
  ContactSpring   s;
  Meeting         m;

  PetscFunctionBeginUser;
  if (!c->impulse.mean || size <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  direct(p, by_law, size, &s);
  inverse = ContactInverseMass(c, p->i, s.ri, s.normal) + (p->j >= 0 ? ContactInverseMass(c, p->j, s.rj, s.normal) : 0);
  if (inverse <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  speed     = parting(&s, c->u, c->w);
  before    = parting(&s, c->s->u, c->s->w);
  collision = collides(size * inverse, before, speed);
  for (PetscInt side = 0; side < 2; side++) {
    const PetscInt k = side ? p->j : p->i;

    if (k >= 0) c->impulse.mean_next[k][6] = PetscMax(c->impulse.mean_next[k][6], collision);
  }
  if (c->cohesion) stored += CohesionDepth(c, p); /* what it falls into gives speed */
  max = max_parting_speed(c, before, stored, inverse);
  if (speed > max) {
    cut = PetscMin(1, (speed - max) / (size * inverse));
    for (PetscInt a = 0; a < 3; a++) {
      impulse->f[a] -= cut * by_law->f[a];
      impulse->ti[a] -= cut * by_law->ti[a];
      impulse->tj[a] -= cut * by_law->tj[a];
    }
    speed = max;
  }
  if (!c->impulse.scheme.implicit) PetscFunctionReturn(PETSC_SUCCESS);
  ContactFillMeeting(c, p, &m);
  s.rate = collision * PetscMin(MAX_RATE, m.stiffness * inverse * dt * dt) / (inverse * dt);
  /* the flow may have stopped bodies that still come: no pull then */
  if (speed < 0) s.rate = PetscMin(s.rate, -size / (dt * speed));
  s.rate *= c->impulse.scheme.weight;
  s.value = s.rate * speed;
  PetscCall(ArrayReserve(c->springs.n + 1, &c->springs.capacity, &c->springs.spring, sizeof(*c->springs.spring), NULL));
  c->springs.spring[c->springs.n++] = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactFindShifts(Contact c, PetscReal dt, PetscInt n, const PetscInt active[])
{
  const BodyArrays *s = c->s;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; c->impulse.mean && e < n; e++) {
    const PetscInt k = active[e];

    if (c->impulse.mean_next[k][6] <= 0) continue;
    for (PetscInt a = 0; a < c->dim; a++) {
      const PetscReal scheme = dt * (c->impulse.scheme.theta * c->u[k][a] + (1 - c->impulse.scheme.theta) * s->u[k][a]);

      if (ContactKind(c, k)->inverse_mass[a] > 0)
        c->impulse.shift[k][a] = c->impulse.mean_next[k][6] * (c->x[k][a] - s->x[k][a] - scheme);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactMeasureForces(Contact c)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; c->impulse.mean && e < 6 * c->s->n; e++) {
    const PetscInt   k = e / 6, a = e % 6;
    PetscReal *const f = a < 3 ? &c->s->contact_force[k][a] : &c->s->contact_torque[k][a - 3];

    c->impulse.mean_next[k][a] = *f;
    *f                         = c->impulse.scheme.weight * *f + (1 - c->impulse.scheme.weight) * c->impulse.mean[k][a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the step is over ---- */

PetscErrorCode ContactAcceptForces(Contact c)
{
  BodyArrays *s = c->s;

  PetscFunctionBeginUser;
  if (!c->impulse.mean) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < s->n; k++) {
    for (PetscInt a = 0; a < 3; a++) {
      PetscReal force  = (1 - c->impulse.scheme.weight) * c->impulse.mean[k][a],
                torque = (1 - c->impulse.scheme.weight) * c->impulse.mean[k][3 + a];

      if (c->bonds) force += c->bonds->force[k][a];
      if (c->bonds) torque += c->bonds->force[k][3 + a];

      c->impulse.mean_next[k][a]     = (s->contact_force[k][a] - force) / c->impulse.scheme.weight;
      c->impulse.mean_next[k][3 + a] = (s->contact_torque[k][a] - torque) / c->impulse.scheme.weight;
      s->x[k][a] += c->impulse.shift[k][a];
    }
  }
  PetscCall(PetscArraycpy((PetscReal *)c->impulse.mean, (PetscReal *)c->impulse.mean_next, 7 * s->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}
