/* Contact, the forces of all pairs at once (alone.c, step.c): all from the same places and
   velocities, and those on a body summed in the order of the pairs' numbers. So a rank needs to know no more than the
   neighbours of its own bodies, and the same bits come out on any number of ranks.

   Passes: first the forces without damping and the velocities that they give; then every dashpot damps what is left
   of the speed at its touch; last friction, by the normal force that came of both. As the damping of all of them acts
   at once, each acts against the inverse masses of its two bodies times the rates of all dashpots that hold on to them
   (sums of rows, as in mass splitting: Tonge, Benevolenski, Voroshilov 2012; here by rates in place of numbers), so
   that the second pass takes energy out whatever
   the rates and the packing: sum rate (a - b)^2/(S_i + S_j) <= sum rate (a^2/S_i + b^2/S_j), with S the sums of rate
   times inverse mass. A pair that meets alone is damped as in a flow, to the last bit but rounding, and a force that a
   body passes on is carried as it is, because the speed that is damped is that after all elastic forces. */
#include "compat.h"
#include "impl.h"
#include "base/array.h"

/* A dashpot until the second pass */
struct _p_PendingDashpot {
  PetscInt  pair, lever, rub; /* lever: -1: acts at the centres; rub: -1: without friction */
  PetscReal value, rate, normal[3];
};

static PetscErrorCode reserve(Contact c, PetscBool turns)
{
  AtOnce        *a = &c->at_once;
  const PetscInt n = c->s->n;

  PetscFunctionBeginUser;
  if (a->capacity < n || (turns && !a->torque)) {
    PetscCall(PetscFree2(a->force, a->after));
    PetscCall(PetscFree2(a->torque, a->angular));
    a->capacity = n + n / 16;
    PetscCall(PetscMalloc2(a->capacity, &a->force, a->capacity, &a->after));
    if (turns) PetscCall(PetscMalloc2(a->capacity, &a->torque, a->capacity, &a->angular));
  }
  PetscCall(PetscArrayzero(a->force, n));
  for (PetscInt k = 0; k < n; k++) a->after[k][3] = 0;
  if (turns) PetscCall(PetscArrayzero(a->torque, n));
  a->ndashpots = a->nlevers = a->nrubs = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void add_difference(Impulse *sum, const Impulse *s, const Impulse *less)
{
  for (PetscInt b = 0; b < 3; b++) {
    sum->f[b] += s->f[b] - less->f[b];
    sum->ti[b] += s->ti[b] - less->ti[b];
    sum->tj[b] += s->tj[b] - less->tj[b];
  }
}

static void add_impulse(Contact c, PetscInt pair, const Impulse *s, PetscBool turns)
{
  AtOnce     *a = &c->at_once;
  const Pair *p = &c->list.pair[pair];

  for (PetscInt b = 0; b < 3 && a->of_pair; b++) {
    a->of_pair[pair].f[b] += s->f[b];
    a->of_pair[pair].ti[b] += s->ti[b];
    a->of_pair[pair].tj[b] += s->tj[b];
  }
  for (PetscInt b = 0; b < 3; b++) {
    a->force[p->i][b] += s->f[b];
    if (turns) a->torque[p->i][b] += s->ti[b];
    if (p->j < 0) continue;
    a->force[p->j][b] -= s->f[b];
    if (turns) a->torque[p->j][b] += s->tj[b];
  }
}

static PetscErrorCode add_dashpot(Contact c, PetscInt pair, PetscInt rub, const Dashpot *d)
{
  const Pair               *p    = &c->list.pair[pair];
  AtOnce                   *a    = &c->at_once;
  const PetscReal           rate = ContactImplicit(c, d->film) * d->rate;
  struct _p_PendingDashpot *dashpot;

  PetscFunctionBeginUser;
  a->after[p->i][3] += rate * d->of_i;
  if (p->j >= 0) a->after[p->j][3] += rate * (d->inverse_mass - d->of_i);
  PetscCall(ArrayReserve(a->ndashpots + 1, &a->dashpot_capacity, &a->dashpot, sizeof(*a->dashpot), NULL));
  dashpot  = &a->dashpot[a->ndashpots++];
  *dashpot = (struct _p_PendingDashpot){.pair  = pair,
                                        .lever = d->has_levers ? a->nlevers : -1,
                                        .rub   = rub,
                                        .value = d->value,
                                        .rate  = d->rate};
  for (PetscInt b = 0; b < 3; b++) dashpot->normal[b] = d->normal[b];
  if (!d->has_levers) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(a->nlevers + 1, &a->lever_capacity, &a->lever, sizeof(*a->lever), NULL));
  for (PetscInt b = 0; b < 3; b++) {
    a->lever[a->nlevers].i[b] = d->ri[b];
    a->lever[a->nlevers].j[b] = d->rj[b];
  }
  a->lever[a->nlevers++].film = d->film;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *number of the pair's rub, -1: none */
static PetscErrorCode list_rub(AtOnce *a, const Rub *rub, PetscInt *number)
{
  PetscFunctionBeginUser;
  *number = -1;
  if (rub->pair < 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ArrayReserve(a->nrubs + 1, &a->rub_capacity, &a->rub, sizeof(*a->rub), NULL));
  *number            = a->nrubs;
  a->rub[a->nrubs++] = *rub;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The first pass: forces without damping */
static PetscErrorCode sum_elastic(Contact c, PetscReal h, PetscBool turns)
{
  AtOnce *a = &c->at_once;

  PetscFunctionBeginUser;
  for (PetscInt p = 0; p < c->list.n; p++) {
    const Impulse none = {{0}, {0}, {0}};
    Impulse       sum = none, pull = none; /* of cohesion, which nobody is held to */
    PetscInt      n, rubs;
    PetscReal     gap;
    Rub           rub;

    PetscCall(ContactPairDashpots(c, p, h, &n, &rub, &gap));
    if (c->alone) ContactNoteGap(&c->list.pair[p], gap, c->s->gap);
    if (gap >= c->horizon) continue;
    PetscCall(list_rub(a, &rub, &rubs));
    for (PetscInt k = 0; k < n; k++) {
      const Dashpot *d = &c->dashpot[k];

      ContactAddForce(d, d->value, &sum);
      if (c->cohesion && d->film) ContactAddForce(d, d->value, &pull);
      if (rubs >= 0 && !d->film) a->rub[rubs].normal += d->value;
      if (d->rate > 0) PetscCall(add_dashpot(c, p, d->film ? -1 : rubs, d));
    }
    if (a->by_law) add_difference(&a->by_law[p], &sum, &pull);
    add_impulse(c, p, &sum, turns);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity of body k after the forces of the first pass */
static void kick_body(Contact c, PetscInt k, PetscReal h, PetscBool turns)
{
  AtOnce   *a     = &c->at_once;
  PetscReal dw[3] = {0, 0, 0}, swirl[3], arm[3], du[3];

  for (PetscInt b = 0; b < 3; b++)
    a->after[k][b] = c->u[k][b] + h * ContactKind(c, k)->inverse_mass[b] * a->force[k][b];
  if (turns) ContactSpin(c, k, a->torque[k], dw);
  if (ContactPivots(c, k)) { /* turns */
    ContactSwirl(c, k, a->force[k], swirl);
    for (PetscInt b = 0; b < 3; b++) dw[b] += swirl[b];
    (void)BodiesGetArm(c->bodies, k, c->q[k], arm);
    cross(dw, arm, du);
    for (PetscInt b = 0; b < 3; b++) a->after[k][b] = c->u[k][b] + h * du[b];
  }
  for (PetscInt b = 0; b < 3 && turns; b++) a->angular[k][b] = c->w[k][b] + h * dw[b];
  BodiesKeepAxes(c->state, k, a->after[k], turns ? a->angular[k] : NULL);
}

/* At which the bodies of a pair part along n: u has `stride` numbers a body */
static PetscReal parting(const Pair *p, const Lever *lever, const PetscReal n[3], const PetscReal u[], PetscInt stride,
                         PetscReal (*w)[3])
{
  PetscReal v[3] = {0, 0, 0}, wr[3];

  for (PetscInt b = 0; b < 3; b++) v[b] = u[p->i * stride + b] - (p->j >= 0 ? u[p->j * stride + b] : 0);
  if (lever) {
    cross(w[p->i], lever->i, wr);
    for (PetscInt b = 0; b < 3; b++) v[b] += wr[b];
  }
  if (lever && p->j >= 0) {
    cross(w[p->j], lever->j, wr);
    for (PetscInt b = 0; b < 3; b++) v[b] -= wr[b];
  }
  return dot3(v, n);
}

/* The second pass */
static void add_damping(Contact c, PetscReal h, PetscBool turns)
{
  const Impulse none = {{0}, {0}, {0}};
  AtOnce       *a    = &c->at_once;

  for (PetscInt k = 0; k < a->ndashpots; k++) {
    const struct _p_PendingDashpot *d     = &a->dashpot[k];
    const Pair                     *p     = &c->list.pair[d->pair];
    const Lever                    *lever = d->lever < 0 ? NULL : &a->lever[d->lever];
    const PetscBool                 film  = (PetscBool)(lever && lever->film);
    const PetscReal implicit = ContactImplicit(c, film), all = a->after[p->i][3] + (p->j >= 0 ? a->after[p->j][3] : 0);
    PetscReal       speed = parting(p, lever, d->normal, (PetscReal *)a->after, 4, a->angular), damping;
    Impulse         sum   = {{0}, {0}, {0}};

    if (implicit < 1)
      speed = implicit * speed + (1 - implicit) * parting(p, lever, d->normal, (PetscReal *)c->u, 3, c->w);
    damping = -d->rate * speed / (1 + h * all);
    if (!film && !c->spring.pulls) damping = PetscMax(-d->value, damping);
    if (d->rub >= 0) a->rub[d->rub].normal += damping;
    for (PetscInt b = 0; b < 3; b++) sum.f[b] = damping * d->normal[b];
    if (lever) {
      cross(lever->i, sum.f, sum.ti);
      cross(sum.f, lever->j, sum.tj);
    }
    if (a->by_law && !film) add_difference(&a->by_law[d->pair], &sum, &none);
    add_impulse(c, d->pair, &sum, turns);
  }
}

/* The third */
static PetscErrorCode add_frictions(Contact c, PetscReal h, PetscBool turns)
{
  AtOnce *a = &c->at_once;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < a->nrubs; k++) {
    Impulse sum = {{0}, {0}, {0}};

    PetscCall(ContactAddFriction(c, &a->rub[k], h, &sum));
    add_impulse(c, a->rub[k].pair, &sum, turns);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactForcesAtOnce(Contact c, PetscReal h, PetscBool turns)
{
  PetscFunctionBeginUser;
  PetscCall(reserve(c, turns));
  PetscCall(sum_elastic(c, h, turns));
  for (PetscInt k = 0; k < c->s->n; k++)
    if (c->s->own[k] && !c->s->removed[k]) kick_body(c, k, h, turns);
  PetscCall(BodiesUpdateGhosts(c->bodies, 4, c->at_once.after));
  if (turns) PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->at_once.angular));
  add_damping(c, h, turns);
  PetscCall(add_frictions(c, h, turns));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactForgetAtOnce(Contact c)
{
  AtOnce *a = &c->at_once;

  PetscFunctionBeginUser;
  PetscCall(PetscFree2(a->force, a->after));
  PetscCall(PetscFree2(a->torque, a->angular));
  PetscCall(PetscFree(a->dashpot));
  PetscCall(PetscFree(a->lever));
  PetscCall(PetscFree(a->rub));
  PetscFunctionReturn(PETSC_SUCCESS);
}
