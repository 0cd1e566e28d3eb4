/* Contact, bodies without a flow: symplectic Euler under contact, gravity and buoyancy, in place in the state. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "bodies/spin.h"

#define MANY 100 /* kinds of bodies, above which not every pair of them is looked at */

/* Kinetic energy with the effective inertia, less the work of gravity: what contact alone changes */
static PetscReal mechanical_energy(Contact c)
{
  const BodyArrays *s   = c->s;
  PetscReal         sum = 0;

  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g    = BodiesGetGroup(c->state, k);
    const PetscReal  spin = c->dim == 2 && ContactKind(c, k)->inverse_spin > 0 ? 1 / ContactKind(c, k)->inverse_spin : 0;

    if (!g->free || s->gone[k]) continue;
    sum += 0.5 * ContactMass(c, k) * dot3(s->u[k], s->u[k]) + 0.5 * spin * PetscSqr(s->w[k][2]);
    sum -= (s->density[k] - c->rho_f) * BodiesVolume(c->state, k) * dot3(c->g, s->x[k]);
  }
  return sum;
}

static void drop_bodies(Contact c, PetscReal h)
{
  for (PetscInt k = 0; k < c->s->n; k++) {
    const Kind     *kind = ContactKind(c, k);
    const PetscReal mass = (c->s->density[k] - c->rho_f) * BodiesVolume(c->state, k);

    if (c->s->gone[k]) continue;
    for (PetscInt a = 0; a < c->dim; a++) c->u[k][a] += h * mass * kind->inverse_mass[a] * c->g[a];
    BodiesKeepAxes(c->state, k, c->u[k], NULL);
  }
}

/* Discs that are pushed along the line of centres: no torques */
static void push_discs(Contact c, const Pair *p, PetscReal h, PetscReal share, const PetscReal f[3])
{
  const Kind *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;

  for (PetscInt a = 0; a < 3; a++) {
    c->u[p->i][a] += h * f[a] * ki->inverse_mass[a];
    c->s->contact_force[p->i][a] += share * f[a];
    if (!kj) continue;
    c->u[p->j][a] -= h * f[a] * kj->inverse_mass[a];
    c->s->contact_force[p->j][a] -= share * f[a];
  }
  BodiesKeepAxes(c->state, p->i, c->u[p->i], NULL);
  if (kj) BodiesKeepAxes(c->state, p->j, c->u[p->j], NULL);
}

static PetscErrorCode push_pairs(Contact c, PetscReal h, PetscReal share)
{
  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < c->npairs; p++) {
    Impulse   now;
    PetscReal gap, f[3];

    if (ContactDiscForce(c, &c->pair[p], h, f, &gap)) {
      ContactNoteGap(&c->pair[p], gap, c->s->gap);
      if (gap < c->range) push_discs(c, &c->pair[p], h, share, f);
      continue;
    }
    PetscCall(ContactPairForce(c, p, h, &now, &gap));
    ContactNoteGap(&c->pair[p], gap, c->s->gap);
    if (gap >= c->horizon) continue;
    ContactScatter(&c->pair[p], &now, share, c->s->contact_force, c->s->contact_torque);
    ContactKick(c, &c->pair[p], h, &now);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Smallest time in which a contact force changes between any two kinds: without a look at the pairs, which change
   during the step. Of many kinds a bound: the stiffest and the lightest meet. */
static PetscReal alone_time(Contact c)
{
  const PetscReal top   = ContactFastest(c);
  PetscReal       least = PETSC_MAX_REAL, mass = PETSC_MAX_REAL;

  if (c->nkinds > MANY) {
    for (PetscInt i = 0; i < c->nkinds; i++)
      if (c->kind[i].moves) mass = PetscMin(mass, c->kind[i].mass);
    for (PetscInt i = 0; i < c->nkinds && mass < PETSC_MAX_REAL; i++) {
      const PetscReal K = PetscMax(c->law->combine(c, &c->kind[i], &c->kind[i], top), c->law->combine(c, &c->kind[i], NULL, top));

      if (K > 0) least = PetscMin(least, c->law->time(c, K, mass));
    }
    return least;
  }
  for (PetscInt i = 0; i < c->nkinds; i++)
    for (PetscInt j = 0; j <= c->nkinds; j++) { /* the last: a wall */
      const Kind     *a = &c->kind[i], *b = j < c->nkinds ? &c->kind[j] : NULL;
      const PetscReal K = c->law->combine(c, a, b, top), m = b && b->moves ? PetscMin(a->mass, b->mass) : a->mass;

      if (a->moves && K > 0) least = PetscMin(least, c->law->time(c, K, m));
    }
  return least;
}

/* In space a body that is not a sphere turns about no axis that stays */
static PetscErrorCode turn_body(Contact c, PetscInt k, PetscReal h)
{
  const PetscReal  none[3] = {0, 0, 0}, w[3] = {c->w[k][0], c->w[k][1], c->w[k][2]};
  const BodyGroup *g = BodiesGetGroup(c->state, k);
  PetscReal        inertia[6], turn[3];

  PetscFunctionBeginUser;
  if (ContactKind(c, k)->disc > 0 || g->motion.has_hinge || !(g->free & BODY_FREE_ROTATION)) {
    RotationAdvance(h, w, c->q[k]);
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(ContactGetMass(c, k, &(PetscReal){0}, inertia));
  BodySpin(h, inertia, none, c->w[k]);
  BodyTurn(h, w, c->w[k], turn);
  RotationAdvance(1, turn, c->q[k]);
  PetscCall(ContactSetInertia(c, k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode advance_alone(Contact c, PetscReal h, PetscReal share)
{
  PetscFunctionBeginUser;
  drop_bodies(c, h);
  PetscCall(ContactFindPairs(c));
  PetscCall(push_pairs(c, h, share));
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (c->s->gone[k]) continue;
    for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += h * c->u[k][a];
    c->s->angle[k] += h * dot3(c->w[k], BodiesGetGroup(c->state, k)->motion.hinge);
    if (c->dim == 2) RotationFromAngle(c->s->angle[k], c->q[k]);
    else PetscCall(turn_body(c, k, h));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactAdvanceAlone(Contact c, PetscReal dt)
{
  BodyArrays *s = c->s;
  PetscReal   before;
  PetscInt    n = 1;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the bodies must be positive", (double)dt);
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  ContactClear(s);
  ContactSetScales(c, dt, NULL);
  c->x   = s->x;
  c->q   = s->q;
  c->u   = s->u;
  c->w   = s->w;
  before = mechanical_energy(c);
  PetscCall(PetscFree(c->reach));
  PetscCall(PetscArraycpy((PetscReal *)s->u_old, (PetscReal *)s->u, 3 * s->n));
  PetscCall(PetscArraycpy((PetscReal *)s->w_old, (PetscReal *)s->w, 3 * s->n));
  PetscCall(ContactFindPairs(c));
  for (PetscInt k = 0; k < s->n && c->dim == 3; k++) PetscCall(ContactSetInertia(c, k));
  if (c->law->lookahead) PetscCall(ContactChooseSubsteps(c, dt, alone_time(c), &n));
  for (PetscInt i = 0; i < n; i++) PetscCall(advance_alone(c, dt / n, 1. / n));
  c->steps_done = n;
  c->nnear      = c->npairs;
  c->work += mechanical_energy(c) - before;
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
