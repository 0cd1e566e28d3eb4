/* Contact, momentum: masses, the scales of stiffness, and what an impulse does to a pair; used by both ways of stepping
   (step.c, alone.c).

   Speed scale. u_ref of a pair is the terminal speed sqrt(2 Vol/A |rho_s/rho_f - 1| |g|) of the body that gives the
   stiffness (drag coefficient 1; disc: Vol/A = pi d/4, sphere 2 d/3, with d twice the bounding radius), or the present
   speed of either body if that is faster; not that of the fastest of all, which would stiffen a whole bed when one disc
   is flung out (runs/studies/contact). Without gravity or difference of density only the motion gives a scale: the
   fastest of all, or sqrt(8 r a/3) with a the largest frozen acceleration (so that K >= 4 m a), or 0.01 r/dt. No
   history enters: a restart gives the same forces. A body counts with the effective mass m = (rho_s + C rho_f) Vol (C =
   1 in 2D, 1/2 in 3D: added mass of a disc, a sphere). Of a pair the larger stiffness counts; bodies that cannot move
   have none. */
#include "compat.h"
#include "impl.h"

#define OFFSET_NUMBER 0.18 /* viscosity dt/(density h^2) at which films have no recess */
#define LIMIT_FACTOR  0.4  /* longest sub-step that -contact_substeps may ask for */
#define SPEED_FLOOR   0.01 /* in r/dt */

static void invert_tensor(const PetscReal t[6], PetscReal inv[6])
{
  const PetscReal xx = t[1] * t[2] - t[5] * t[5], xy = t[4] * t[5] - t[3] * t[2], xz = t[3] * t[5] - t[1] * t[4];
  const PetscReal det = t[0] * xx + t[3] * xy + t[4] * xz;

  inv[0] = xx / det;
  inv[1] = (t[0] * t[2] - t[4] * t[4]) / det;
  inv[2] = (t[0] * t[1] - t[3] * t[3]) / det;
  inv[3] = xy / det;
  inv[4] = xz / det;
  inv[5] = (t[3] * t[4] - t[0] * t[5]) / det;
}

PetscReal ContactMass(Contact c, PetscInt k)
{
  const PetscReal added = !c->impulse.scheme.implicit ? 0 : c->dim == 2 ? 1 : 0.5;

  return (c->s->density[k] + added * c->fluid.density) * BodiesVolume(c->state, k);
}

/* A tenth of the fluid's inertia turns with the body: keeps very light bodies from spinning up within a sub-step. */
static PetscErrorCode effective_inertia(Contact c, PetscInt k, PetscReal inertia[6])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(c->bodies, k, NULL, PETSC_TRUE, inertia));
  for (PetscInt i = 0; i < 6; i++) inertia[i] *= c->state->density[k] + 0.1 * c->fluid.density;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ContactTurns(Contact c)
{
  PetscBool turns = (PetscBool)(c->film.wanted || c->spring.friction > 0 || c->bonds);

  for (PetscInt g = 0; g < c->s->ngroups; g++) turns = (PetscBool)(turns || c->s->group[g].disc <= 0);
  for (PetscInt g = 0; g < c->s->ngroups && c->alone; g++)
    turns = (PetscBool)(turns || c->s->group[g].motion.has_pivot);
  return turns;
}

PetscErrorCode ContactGetMass(Contact c, PetscInt k, PetscReal *mass, PetscReal inertia[6])
{
  PetscFunctionBeginUser;
  PetscCheck(k >= 0 && k < c->s->n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Body %" PetscInt_FMT " does not exist: there are %" PetscInt_FMT, k, c->s->n);
  *mass = ContactMass(c, k);
  if (inertia) PetscCall(effective_inertia(c, k, inertia));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetStart(Contact c, PetscInt k, PetscReal dt, PetscReal a[3])
{
  const PetscReal volume = BodiesVolume(c->state, k), force = (c->s->density[k] - c->fluid.density) * volume;
  const PetscReal drag = c->fluid.viscosity *
                         (c->dim == 2 ? 3 : 6 * PETSC_PI * PetscPowReal(0.75 * volume / PETSC_PI, 1. / 3));

  PetscFunctionBeginUser;
  for (PetscInt d = 0; d < 3; d++) a[d] = force * c->g[d] / (ContactMass(c, k) + drag * dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- scales ---- */

static PetscReal present_speed(Contact c, PetscInt k)
{
  return c->s->removed[k] ? 0 : BodiesFastestPoint(c->state, k, 0);
}

PetscErrorCode ContactFastest(Contact c, PetscReal *top)
{
  PetscFunctionBeginUser;
  *top = 0;
  for (PetscInt k = 0; k < c->s->n; k++) *top = PetscMax(*top, present_speed(c, k));
  PetscCall(BodiesMax(c->bodies, 1, top));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ContactScaleKinds(Contact c)
{
  for (PetscInt i = 0; i < c->kinds.n; i++) {
    Kind *k = &c->kinds.kind[i];

    k->speed     = k->terminal > 0 ? k->terminal : PetscMax(c->speed.fastest, c->speed.min);
    k->stiffness = c->law->stiffness ? c->law->stiffness(c, k) : 0;
  }
}

/* The recess of films in a step: method penalty is stiffer in short ones (runs/studies/contact, "Films") */
static PetscReal gap_offset(Contact c, PetscReal dt)
{
  if (dt <= 0 || c->fluid.viscosity <= 0) return c->film.offset;
  return c->film.offset *
         PetscMax(0, 1 - OFFSET_NUMBER * c->fluid.density * PetscSqr(c->h) / (c->fluid.viscosity * dt));
}

PetscErrorCode ContactSetScales(Contact c, PetscReal dt, PetscReal (*a)[3])
{
  PetscReal acceleration = 0;

  PetscFunctionBeginUser;
  c->film.step_offset = gap_offset(c, dt);
  c->speed.fastest    = 0;
  for (PetscInt k = 0; k < c->s->n; k++) {
    c->speed.of_body[k] = present_speed(c, k);
    c->speed.fastest    = PetscMax(c->speed.fastest, c->speed.of_body[k]);
  }
  PetscCall(BodiesMax(c->bodies, 1, &c->speed.fastest));
  for (PetscInt k = 0; a && k < c->s->n; k++)
    if (ContactKind(c, k)->moves) acceleration = PetscMax(acceleration, dot3(a[k], a[k]));
  if (a) PetscCall(BodiesMax(c->bodies, 1, &acceleration));
  if (dt > 0)
    c->speed.min = PetscMax(SPEED_FLOOR * c->range / dt,
                            PetscSqrtReal(8. / 3. * c->range * PetscSqrtReal(acceleration)));
  ContactScaleKinds(c);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- momentum ---- */

void ContactScatter(const Pair *p, const Impulse *s, PetscReal scale, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  for (PetscInt a = 0; a < 3; a++) {
    force[p->i][a] += scale * s->f[a];
    torque[p->i][a] += scale * s->ti[a];
    if (p->j < 0) continue;
    force[p->j][a] -= scale * s->f[a];
    torque[p->j][a] += scale * s->tj[a];
  }
}

void ContactSwirl(Contact c, PetscInt k, const PetscReal force[3], PetscReal dw[3])
{
  PetscReal arm[3], about[3];

  (void)BodiesGetArm(c->bodies, k, c->q[k], arm);
  cross(arm, force, about);
  ContactSpin(c, k, about, dw);
}

void ContactMobility(Contact c, PetscInt k, const PetscReal force[3], PetscReal out[3])
{
  for (PetscInt a = 0; a < 3; a++) out[a] = force[a] * ContactKind(c, k)->inverse_mass[a];
  BodiesKeepAxes(c->state, k, out, NULL);
}

/* e e^T / (e . I e) */
static void hinge_inertia(const PetscReal e[3], const PetscReal inertia[6], PetscReal inverse[6])
{
  const PetscInt row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  PetscReal      Ie[3];

  apply_tensor(inertia, e, Ie);
  for (PetscInt i = 0; i < 6; i++) inverse[i] = e[row[i]] * e[col[i]] / dot3(e, Ie);
}

/* 3D: the inertia turns with the body; within a step its orientation at the beginning counts. */
PetscErrorCode ContactSetInertia(Contact c, PetscInt k)
{
  PetscReal inertia[6], arm[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(c->inverse_inertia[k], 6));
  if (!(BodiesGetGroup(c->state, k)->free & BODY_FREE_ROTATION)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(effective_inertia(c, k, inertia));
  if (ContactPivots(c, k)) {
    PetscCall(BodiesGetArm(c->bodies, k, NULL, arm));
    add_point_inertia(ContactMass(c, k), arm, inertia); /* about the pivot */
  }
  if (BodiesGetGroup(c->state, k)->motion.has_hinge)
    hinge_inertia(BodiesGetGroup(c->state, k)->motion.hinge, inertia, c->inverse_inertia[k]);
  else invert_tensor(inertia, c->inverse_inertia[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetInertias(Contact c)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n && c->inverse_inertia; k++) PetscCall(ContactSetInertia(c, k));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- which can meet ---- */

PetscErrorCode ContactCanMeet(Contact c, const Pair *p, PetscBool *can)
{
  const PetscReal reach = c->horizon + ContactKind(c, p->i)->radius + c->list.reach[p->i];

  PetscFunctionBeginUser;
  *can = PETSC_FALSE;
  if (ContactIsBonded(c, (PetscInt)(p - c->list.pair))) PetscFunctionReturn(PETSC_SUCCESS);
  if (p->j < 0) PetscCall(ContactIsNearWall(c, p->i, p->j, reach, can));
  else *can = ContactWithin(c, p->i, p->j, reach + ContactKind(c, p->j)->radius + c->list.reach[p->j]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sub-steps ---- */

PetscErrorCode ContactChooseSubsteps(Contact c, PetscReal dt, PetscReal time, PetscInt *n)
{
  const PetscReal wanted = PetscCeilReal(dt / (CONTACT_SUBSTEP * time)),
                  needed = PetscCeilReal(dt / (LIMIT_FACTOR * time));

  PetscFunctionBeginUser;
  PetscCheck(c->substeps == 0 || c->substeps >= needed, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_substeps %" PetscInt_FMT
             " is too small: the contact force changes within %g s, a step of %g s needs at least %g (%g for accuracy). Raise or remove -contact_substeps, or lower -sim_dt or the stiffness of -contact_law %s",
             c->substeps, (double)time, (double)dt, (double)needed, (double)wanted, c->law->name);
  PetscCheck(c->substeps || wanted < 1e7, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "The contact force would need %g sub-steps (a step is %g s, the force changes within %g s): lower -sim_dt or the stiffness of -contact_law %s",
             (double)wanted, (double)dt, (double)time, c->law->name);
  *n = c->substeps ? c->substeps : PetscMax(1, (PetscInt)wanted);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactUseCopies(Contact c, PetscReal (*x)[3], PetscReal (*q)[4], PetscReal (*u)[3], PetscReal (*w)[3])
{
  const PetscInt n = c->s->n;

  PetscFunctionBeginUser;
  if (!c->copy.x) {
    PetscCall(BodiesAttachWork(c->bodies, sizeof(*x), (void **)&c->copy.x));
    PetscCall(BodiesAttachWork(c->bodies, sizeof(*q), (void **)&c->copy.q));
    PetscCall(BodiesAttachWork(c->bodies, sizeof(*u), (void **)&c->copy.u));
    PetscCall(BodiesAttachWork(c->bodies, sizeof(*w), (void **)&c->copy.w));
  }
  PetscCall(PetscArraycpy((PetscReal *)c->copy.x, (PetscReal *)x, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)c->copy.q, (PetscReal *)q, 4 * n));
  PetscCall(PetscArraycpy((PetscReal *)c->copy.u, (PetscReal *)u, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)c->copy.w, (PetscReal *)w, 3 * n));
  c->x = c->copy.x;
  c->q = c->copy.q;
  c->u = c->copy.u;
  c->w = c->copy.w;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void ContactClear(BodyArrays *s)
{
  for (PetscInt k = 0; k < s->n; k++) {
    s->gap[k] = PETSC_MAX_REAL;
    for (PetscInt b = 0; b < 3; b++) s->contact_force[k][b] = s->contact_torque[k][b] = 0;
  }
}
