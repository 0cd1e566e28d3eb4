/* Contact, bodies without a flow: symplectic Euler under contact, gravity and buoyancy, in place in the state. All
   pairs act at once (atonce.c), so that any number of ranks gives the same bits. Bodies that a joint, loads or the
   scene guide (bodies/flight.h) go so in the sub-steps in which contact acts on them, and by themselves in all
   others. */
#include "compat.h"
#include "bond.h"
#include "cohesion.h"
#include "base/log.h"
#include "bodies/flight.h"
#include "bodies/spin.h"

/* Of body k in space, with the effective inertia */
static PetscReal rotational_energy(Contact c, PetscInt k)
{
  PetscReal mass, inertia[6], Iw[3];

  (void)ContactGetMass(c, k, &mass, inertia);
  apply_tensor(inertia, c->s->w[k], Iw);
  return 0.5 * dot3(Iw, c->s->w[k]);
}

/* Kinetic energy with the effective inertia, less the work of gravity: what contact alone changes. Of bodies that
   nothing guides; on the others its work is counted as it is done. */
static PetscErrorCode mechanical_energy(Contact c, PetscReal *energy)
{
  const BodyArrays *s   = c->s;
  Exact             sum = {{0}, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g    = BodiesGetGroup(c->state, k);
    const PetscReal  spin = c->dim == 2 && ContactKind(c, k)->inverse_moment > 0 ? 1 / ContactKind(c, k)->inverse_moment
                                                                                 : 0;

    if (!g->free || g->guided || s->removed[k] || !s->own[k]) continue;
    ExactAdd(&sum, 0.5 * ContactMass(c, k) * dot3(s->u[k], s->u[k]) + 0.5 * spin * PetscSqr(s->w[k][2]) -
                     (s->density[k] - c->fluid.density) * BodiesVolume(c->state, k) * dot3(c->g, s->x[k]));
    if (c->bonds && c->dim == 3) ExactAdd(&sum, rotational_energy(c, k));
  }
  PetscCall(ExactGetSum(BodiesComm(c->bodies), &sum, energy));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void take_surroundings(Contact c, Surroundings *around)
{
  *around = (Surroundings){.fluid_density = c->fluid.density,
                           .added         = (c->dim == 2 ? 1 : 0.5) * c->fluid.density,
                           .added_spin    = 0.1 * c->fluid.density};
  for (PetscInt a = 0; a < c->dim; a++) around->gravity[a] = c->g[a];
}

/* Those that are guided, after their velocities have been kept; ghosts get them from their owners */
static PetscErrorCode accelerate_guided(Contact c, PetscReal time, PetscReal h)
{
  Surroundings around;

  PetscFunctionBeginUser;
  if (!c->guided) PetscFunctionReturn(PETSC_SUCCESS);
  take_surroundings(c, &around);
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (c->s->removed[k] || !c->s->own[k] || !BodiesGetGroup(c->state, k)->guided) continue;
    for (PetscInt a = 0; a < 3; a++) {
      c->guided[k][a]     = c->u[k][a];
      c->guided[k][3 + a] = c->w[k][a];
    }
    PetscCall(FlightAccelerate(c->bodies, k, &around, time, h));
  }
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->u));
  PetscCall(BodiesUpdateGhosts(c->bodies, 3, c->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Velocity of body k after a sub-step under the forces of all pairs */
static void push_body(Contact c, PetscInt k, PetscReal h, PetscReal fraction, PetscBool turns)
{
  const Kind *kind  = ContactKind(c, k);
  PetscReal   dw[3] = {0, 0, 0};

  if (turns) ContactSpin(c, k, c->at_once.torque[k], dw);
  for (PetscInt a = 0; a < 3; a++) {
    c->u[k][a] += h * kind->inverse_mass[a] * c->at_once.force[k][a];
    c->s->contact_force[k][a] += fraction * c->at_once.force[k][a];
    if (!turns) continue;
    c->w[k][a] += h * dw[a];
    c->s->contact_torque[k][a] += fraction * c->at_once.torque[k][a];
  }
  BodiesKeepAxes(c->state, k, c->u[k], turns ? c->w[k] : NULL);
}

/* A body that is guided, from its velocities after contact: work gains what contact has done on it */
static PetscErrorCode move_guided(Contact c, PetscInt k, PetscReal time, PetscReal h, PetscReal fraction, Exact *work)
{
  const AtOnce *all     = &c->at_once;
  PetscReal     none[3] = {0, 0, 0}, swirl[3], gain = 0;
  PetscReal    *torque = all->torque ? all->torque[k] : none;
  Surroundings  around;

  PetscFunctionBeginUser;
  take_surroundings(c, &around);
  if (dot3(all->force[k], all->force[k]) == 0 && dot3(torque, torque) == 0) {
    for (PetscInt a = 0; a < 3; a++) {
      c->u[k][a] = c->guided[k][a];
      c->w[k][a] = c->guided[k][3 + a];
    }
    PetscCall(FlightMove(c->bodies, k, &around, time, h));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  for (PetscInt a = 0; a < 3; a++) gain += all->force[k][a] * c->u[k][a] + torque[a] * c->w[k][a];
  push_body(c, k, h, fraction, (PetscBool)(all->torque != NULL));
  if (ContactPivots(c, k)) {
    ContactSwirl(c, k, all->force[k], swirl);
    for (PetscInt a = 0; a < 3; a++) c->w[k][a] += h * swirl[a];
  }
  PetscCall(FlightMovePivot(c->bodies, k, time + h));
  for (PetscInt a = 0; a < 3; a++) gain += all->force[k][a] * c->u[k][a] + torque[a] * c->w[k][a];
  if (BodiesGetGroup(c->state, k)->free) ExactAdd(work, 0.5 * h * gain);
  PetscCall(FlightSetPosition(c->bodies, k, &around, time, h));
  if (c->dim == 3) PetscCall(ContactSetInertia(c, k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Ghosts too: forces see the velocities after it */
static void apply_gravity(Contact c, PetscReal h)
{
  for (PetscInt k = 0; k < c->s->n; k++) {
    const Kind     *kind = ContactKind(c, k);
    const PetscReal mass = (c->s->density[k] - c->fluid.density) * BodiesVolume(c->state, k);

    if (c->s->removed[k] || BodiesGetGroup(c->state, k)->guided) continue;
    for (PetscInt a = 0; a < c->dim; a++) c->u[k][a] += h * mass * kind->inverse_mass[a] * c->g[a];
    BodiesKeepAxes(c->state, k, c->u[k], NULL);
  }
}

/* Smallest time in which a contact force changes between any two kinds: without a look at the pairs, which change
   during the step. The stiffest body meets the lightest, or any the wall. Collective. */
static PetscErrorCode alone_time(Contact c, PetscReal *min)
{
  PetscReal v[3] = {0, -PETSC_MAX_REAL, -PETSC_MAX_REAL}; /* stiffness; - mass, - time at a wall */

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < c->kinds.n; i++) {
    const Kind *k    = &c->kinds.kind[i];
    PetscReal   wall = c->law->combine(c, k, NULL, c->speed.fastest);

    v[0] = PetscMax(v[0], c->law->combine(c, k, k, c->speed.fastest));
    if (c->cohesion) wall = PetscMax(wall, CohesionSlope(c, k, NULL));
    if (c->cohesion) v[0] = PetscMax(v[0], wall); /* of a small body and a large one */
    if (!k->moves) continue;
    v[1] = PetscMax(v[1], -k->mass);
    if (wall > 0) v[2] = PetscMax(v[2], -c->law->time(c, wall, k->mass));
  }
  PetscCall(BodiesMax(c->bodies, 3, v));
  *min = -v[2];
  if (v[0] > 0 && v[1] > -PETSC_MAX_REAL) *min = PetscMin(*min, c->law->time(c, v[0], -v[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
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

static PetscErrorCode advance_alone(Contact c, PetscReal time, PetscReal h, PetscReal fraction, Exact *work)
{
  const PetscBool turns = ContactTurns(c);

  PetscFunctionBeginUser;
  PetscCall(ContactFindPairs(c));
  if (c->bonds) PetscCall(BondBeginAlone(c, h));
  apply_gravity(c, h);
  PetscCall(accelerate_guided(c, time, h));
  PetscCall(ContactForcesAtOnce(c, h, turns));
  if (c->bonds) PetscCall(BondSolveAlone(c, h));
  for (PetscInt k = 0; k < c->s->n; k++) {
    if (c->s->removed[k] || !c->s->own[k]) continue;
    if (BodiesGetGroup(c->state, k)->guided) {
      PetscCall(move_guided(c, k, time, h, fraction, work));
      continue;
    }
    push_body(c, k, h, fraction, turns);
    for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += h * c->u[k][a];
    c->s->angle[k] += h * dot3(c->w[k], BodiesGetGroup(c->state, k)->motion.hinge);
    if (c->dim == 2) RotationFromAngle(c->s->angle[k], c->q[k]);
    else PetscCall(turn_body(c, k, h));
  }
  PetscCall(BodiesSync(c->bodies, (PetscBool)(turns || c->guided)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Before the first step: are there bodies that are guided? */
static PetscErrorCode begin_alone(Contact c)
{
  PetscBool any = PETSC_FALSE;

  PetscFunctionBeginUser;
  c->alone = PETSC_TRUE;
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    any = (PetscBool)(any || (c->s->group[g].guided && c->s->group[g].count));
  if (any) PetscCall(BodiesAttachWork(c->bodies, sizeof(*c->guided), (void **)&c->guided));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactAdvanceAlone(Contact c, PetscReal dt)
{
  BodyArrays     *s     = c->s;
  const PetscReal start = s->time;
  PetscReal       before, after, guided, time = PETSC_MAX_REAL;
  PetscInt        n    = 1;
  Exact           work = {{0}, 0, 0};

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the bodies must be positive",
             (double)dt);
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  if (!c->alone) PetscCall(begin_alone(c));
  ContactClear(s);
  PetscCall(ContactSetScales(c, dt, NULL));
  c->x = s->x;
  c->q = s->q;
  c->u = s->u;
  c->w = s->w;
  PetscCall(mechanical_energy(c, &before));
  PetscCall(PetscFree(c->list.reach));
  PetscCall(PetscArraycpy((PetscReal *)s->u_old, (PetscReal *)s->u, 3 * s->n));
  PetscCall(PetscArraycpy((PetscReal *)s->w_old, (PetscReal *)s->w, 3 * s->n));
  PetscCall(ContactFindPairs(c));
  PetscCall(ContactSetInertias(c));
  if (c->law->lookahead) {
    PetscCall(alone_time(c, &time));
    PetscCall(ContactChooseSubsteps(c, dt, time, &n));
  }
  for (PetscInt i = 0; i < n; i++) PetscCall(advance_alone(c, start + i * (dt / n), dt / n, 1. / n, &work));
  c->count.substeps = n;
  c->count.near     = c->list.n;
  if (c->bonds) PetscCall(BondFinishStep(c, start + dt, dt));
  PetscCall(mechanical_energy(c, &after));
  c->work += after - before;
  if (c->guided) PetscCall(ExactGetSum(BodiesComm(c->bodies), &work, &guided));
  if (c->guided) c->work += guided;
  PetscCall(ContactCheckImages(c, PETSC_FALSE));
  PetscCall(ContactCheckDriven(c, PETSC_FALSE));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
