/* Contact: repulsion between bodies and from the walls of the domain box, see contact.h; laws in law.c, search in search.c, geometry in touch.c.

   Speed scale. u_ref of a pair is the terminal speed sqrt(2 Vol/A |rho_s/rho_f - 1| |g|) of the body that gives the stiffness (drag coefficient 1; disc: Vol/A = pi d/4,
   sphere 2 d/3, with d twice the bounding radius), or the present speed of either body if that is faster. (The fastest body of all, in an earlier form, stiffened every contact
   of a bed at rest when one disc was flung out: with 2000 discs the energy stored in contacts rose 40 times in a step, and the bed blew up.)
   Without gravity or difference of density nothing but the motion gives a scale: then it is the fastest of all, or sqrt(8 r a/3) with a the largest frozen acceleration (so that
   K >= 4 m a), or 0.01 r/dt. No history enters: a restart gives the same forces.
   A body counts with the effective mass m = (rho_s + C rho_f) Vol (C = 1 in 2D, 1/2 in 3D: added mass of a disc, a sphere). Of a pair the larger stiffness counts;
   bodies that cannot move have none.

   Time. ContactStep integrates the bodies that can come within range by symplectic Euler, pair after pair (so that damping is implicit). Two additions make a body come
   to rest although the flow answers only once a step (measured with bodies under linear drag in the unit test; values are not critical):
   - drag: the frozen acceleration belongs to the old velocity. While contact changes the velocity by du, the acceleration changes by -lambda du
     with lambda from (buoyant acceleration - a) = lambda u, where that is a resistance. Without it bodies slower than u_ref/5 overlap
     when the step exceeds their relaxation time;
   - look-ahead (law repulsive): two steps are integrated, and each pair takes the larger of the means over one and over two steps (divided by 1 and 2 steps).
     A second-order scheme (bdf2) gives only 2/3 of a sudden impulse in its first step; without look-ahead bodies overlap at u dt > r. The law spring does without,
     because more than the impulse of the collision would make energy.
   Measured for one disc with the repulsive law, densities 0.001 to 10, be and bdf2, true added mass 1 to 1.5: smallest gap 0.37 r up to u dt = 2 r (that is h, CFL number 1).
   At rest the position is steady to round-off in most cases; where drag rules (step beyond the relaxation time) it may wander in a bounded cycle of up to
   0.2 r at u dt = r, 1.5 r at 2 r. Stable while the true effective mass is above 3/4 of ours. Limit: bodies without buoyancy that a very viscous flow
   presses together (step 10 relaxation times) overlap by some r before the force has grown. Replicated on all ranks: every rank does the same work. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"
#include "base/opt.h"
#include "base/rotation.h"

#define STEP_FACTOR  0.1  /* sub-step in the time in which a contact force changes */
#define LIMIT_FACTOR 0.4  /* longest sub-step that -contact_substeps may ask for */
#define SPEED_FLOOR  0.01 /* in r/dt */
#define REST_SPEED   0.01 /* in r/dt: slower bodies feel no drag */

/* A body's motion without contact during the sub-steps of ContactStep. */
typedef struct {
  PetscReal u0[3], a[3], alpha[3], drag;
} Drift;

/* A pair that can touch during the step: the impulses over one step and over the look-ahead. */
typedef struct {
  PetscInt pair;
  Impulse  sum[2];
} Near;

/* The bodies and pairs that take part in the sub-steps. */
typedef struct {
  PetscInt nnear, nactive, *active;
  Near    *near;
  Drift   *drift; /* [n] */
} Crowd;

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

static PetscReal effective_mass(Contact c, const BodyGroup *g)
{
  return (g->density + (c->dim == 2 ? 1 : 0.5) * c->rho_f) * g->mass.volume;
}

/* A tenth of the fluid's inertia turns with the body: keeps very light bodies from spinning up within a sub-step. */
static PetscErrorCode effective_inertia(Contact c, PetscInt k, PetscReal inertia[6])
{
  PetscFunctionBeginUser;
  PetscCall(BodiesGetInertia(c->bodies, k, PETSC_TRUE, inertia));
  for (PetscInt i = 0; i < 6; i++) inertia[i] *= ContactGroup(c, k)->density + 0.1 * c->rho_f;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- scales ---- */

/* Speed of the fastest point of body k, now */
static PetscReal present_speed(Contact c, PetscInt k)
{
  const BodyState *s    = c->s;
  const BodyGroup *g    = ContactGroup(c, k);
  const PetscReal  spin = g->disc > 0 ? 0 : g->radius * PetscSqrtReal(dot3(s->w[k], s->w[k]));

  return s->gone[k] ? 0 : PetscSqrtReal(dot3(s->u[k], s->u[k])) + spin;
}

static PetscReal fastest(Contact c)
{
  PetscReal top = 0;

  for (PetscInt k = 0; k < c->s->n; k++) top = PetscMax(top, present_speed(c, k));
  return top;
}

/* u_ref and stiffness of the groups, speeds of the bodies; a: frozen acceleration or NULL */
static void set_scales(Contact c, PetscReal dt, PetscReal (*a)[3])
{
  PetscReal push = 0, top = 0;

  for (PetscInt k = 0; k < c->s->n; k++) {
    c->present[k] = present_speed(c, k);
    top           = PetscMax(top, c->present[k]);
  }
  for (PetscInt k = 0; a && k < c->s->n; k++)
    if (ContactKind(c, k)->moves) push = PetscMax(push, dot3(a[k], a[k]));
  if (dt > 0) c->floor = PetscMax(SPEED_FLOOR * c->range / dt, PetscSqrtReal(8. / 3. * c->range * PetscSqrtReal(push)));
  for (PetscInt g = 0; g < c->s->ngroups; g++) {
    Kind *k = &c->kind[g];

    k->speed     = k->terminal > 0 ? k->terminal : PetscMax(top, c->floor);
    k->stiffness = c->law->stiffness ? c->law->stiffness(c, k) : 0;
  }
}

/* ---- momentum ---- */

static void scatter_impulse(const Pair *p, const Impulse *s, PetscReal scale, PetscReal (*force)[3], PetscReal (*torque)[3])
{
  for (PetscInt a = 0; a < 3; a++) {
    force[p->i][a] += scale * s->f[a];
    torque[p->i][a] += scale * s->ti[a];
    if (p->j < 0) continue;
    force[p->j][a] -= scale * s->f[a];
    torque[p->j][a] += scale * s->tj[a];
  }
}

static void kick(Contact c, PetscInt k, PetscReal h, const PetscReal f[3], const PetscReal torque[3])
{
  const Kind *kind = ContactKind(c, k);
  PetscReal   dw[3];

  ContactSpin(c, k, torque, dw);
  for (PetscInt a = 0; a < 3; a++) {
    c->u[k][a] += h * f[a] * kind->inverse_mass[a];
    c->w[k][a] += h * dw[a];
  }
}

static void kick_pair(Contact c, const Pair *p, PetscReal h, const Impulse *s)
{
  kick(c, p->i, h, s->f, s->ti);
  if (p->j >= 0) kick(c, p->j, -h, s->f, (const PetscReal[3]){-s->tj[0], -s->tj[1], -s->tj[2]});
}

/* 3D: the inertia turns with the body; within a step its orientation at the beginning counts. */
static PetscErrorCode set_inverse_inertia(Contact c, PetscInt k)
{
  PetscReal inertia[6];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(c->inverse_inertia[k], 6));
  if (!(ContactGroup(c, k)->free & BODY_FREE_ROTATION)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(effective_inertia(c, k, inertia));
  invert_tensor(inertia, c->inverse_inertia[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sub-steps ---- */

/* Smallest time in which a contact force changes, over the listed pairs. m: the smaller mass of the pair. */
static PetscReal contact_time(Contact c, PetscInt n, const Near near[])
{
  PetscReal least = PETSC_MAX_REAL;

  for (PetscInt p = 0; p < n; p++) {
    const Pair *pair = &c->pair[near[p].pair];
    const Kind *i = ContactKind(c, pair->i), *j = pair->j >= 0 ? ContactKind(c, pair->j) : NULL;
    PetscReal   K = c->law->combine(c, i, j, ContactPairSpeed(c, pair)), m = i->moves ? i->mass : PETSC_MAX_REAL;

    if (j && j->moves) m = PetscMin(m, j->mass);
    if (K > 0) least = PetscMin(least, c->law->time(c, K, m));
  }
  return least;
}

static PetscErrorCode choose_substeps(Contact c, PetscReal dt, PetscReal time, PetscInt *n)
{
  const PetscReal wanted = PetscCeilReal(dt / (STEP_FACTOR * time)), needed = PetscCeilReal(dt / (LIMIT_FACTOR * time));

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

static void move_body(Contact c, PetscInt k, PetscReal h)
{
  for (PetscInt a = 0; a < c->dim; a++) c->x[k][a] += h * c->u[k][a];
  if (ContactKind(c, k)->disc <= 0) RotationAdvance(h, c->w[k], c->q[k]); /* discs look the same from all sides */
}

/* ---- a step of bodies in a flow ---- */

/* lambda with (buoyant acceleration - a) = lambda u, 0 where a is no resistance; bodies all but at rest have none */
static PetscReal estimate_drag(Contact c, PetscInt k, PetscReal dt, const PetscReal a[3])
{
  const BodyGroup *g    = ContactGroup(c, k);
  const PetscReal *u    = c->s->u[k];
  const PetscReal  rest = REST_SPEED * c->range / dt;
  PetscReal        sum  = 0;

  for (PetscInt b = 0; b < c->dim; b++)
    if (g->free & (BODY_FREE_X << b)) sum += ((g->density - c->rho_f) * g->mass.volume * c->g[b] / effective_mass(c, g) - a[b]) * u[b];
  return PetscMax(0, sum) / (dot3(u, u) + rest * rest);
}

static PetscErrorCode use_copies(Contact c, PetscReal (*x)[3], PetscReal (*q)[4], PetscReal (*u)[3], PetscReal (*w)[3])
{
  const PetscInt n = c->s->n;

  PetscFunctionBeginUser;
  if (!c->copy_x) PetscCall(PetscMalloc4(n, &c->copy_x, n, &c->copy_q, n, &c->copy_u, n, &c->copy_w));
  PetscCall(PetscArraycpy((PetscReal *)c->copy_x, (PetscReal *)x, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)c->copy_q, (PetscReal *)q, 4 * n));
  PetscCall(PetscArraycpy((PetscReal *)c->copy_u, (PetscReal *)u, 3 * n));
  PetscCall(PetscArraycpy((PetscReal *)c->copy_w, (PetscReal *)w, 3 * n));
  c->x = c->copy_x;
  c->q = c->copy_q;
  c->u = c->copy_u;
  c->w = c->copy_w;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode start_drift(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3], Drift drift[])
{
  const BodyState *s    = c->s;
  const PetscReal  time = c->law->lookahead * dt;

  PetscFunctionBeginUser;
  if (!c->reach) PetscCall(PetscMalloc1(s->n, &c->reach));
  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g = ContactGroup(c, k);
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
  w->nnear = w->nactive = 0;
  PetscCall(PetscMalloc1(c->npairs, &w->near));
  PetscCall(PetscCalloc1(c->s->n, &listed));
  PetscCall(PetscMalloc1(c->s->n, &w->active));
  for (PetscInt p = 0; p < c->npairs; p++) {
    if (!can_meet(c, &c->pair[p])) continue;
    w->near[w->nnear++] = (Near){.pair = p};
    for (PetscInt side = 0; side < 2; side++) {
      const PetscInt k = side ? c->pair[p].j : c->pair[p].i;

      if (k < 0 || listed[k]) continue;
      listed[k]               = PETSC_TRUE;
      w->active[w->nactive++] = k;
      if (c->dim == 3) PetscCall(set_inverse_inertia(c, k));
    }
  }
  PetscCall(PetscFree(listed));
  c->nnear = w->nnear;
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
}

/* Two discs out of reach of each other: most of a crowd in most sub-steps */
static PetscBool discs_apart(Contact c, const Pair *p)
{
  const PetscReal ri = ContactKind(c, p->i)->disc, rj = p->j >= 0 ? ContactKind(c, p->j)->disc : 0;

  return (PetscBool)(ri > 0 && rj > 0 && !ContactWithin(c, p->i, p->j, c->horizon + (ri + rj)));
}

static PetscErrorCode advance_crowd(Contact c, PetscReal h, Crowd *w, PetscBool in_step)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < w->nactive; k++) drift_velocity(c, w->active[k], &w->drift[w->active[k]], h);
  for (PetscInt k = 0; k < w->nnear; k++) {
    Near       *near = &w->near[k];
    const Pair *p    = &c->pair[near->pair];
    Impulse     now;
    PetscReal   gap;

    if (!c->slip && discs_apart(c, p)) continue; /* a tangential spring ends where the bodies part */
    PetscCall(ContactPairForce(c, near->pair, h, &now, &gap));
    if (gap >= c->horizon) continue;
    for (PetscInt a = 0; a < 3; a++)
      for (PetscInt s = in_step ? 0 : 1; s < 2; s++) {
        near->sum[s].f[a] += h * now.f[a];
        near->sum[s].ti[a] += h * now.ti[a];
        near->sum[s].tj[a] += h * now.tj[a];
      }
    kick_pair(c, p, h, &now);
  }
  for (PetscInt k = 0; k < w->nactive; k++) move_body(c, w->active[k], h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The larger of the means over one step and over the look-ahead, pair by pair: as a whole, so that momentum stays conserved. */
static void store_means(Contact c, PetscReal dt, const Crowd *w)
{
  const PetscInt ahead = c->law->lookahead;

  for (PetscInt k = 0; k < w->nnear; k++) {
    const Near     *near = &w->near[k];
    const PetscReal f1 = dot3(near->sum[0].f, near->sum[0].f), f2 = dot3(near->sum[1].f, near->sum[1].f) / (ahead * ahead);
    const PetscInt  s = f2 > f1;

    scatter_impulse(&c->pair[near->pair], &near->sum[s], 1 / (s ? ahead * dt : dt), c->s->contact_force, c->s->contact_torque);
  }
}

static void clear_forces(BodyState *s)
{
  for (PetscInt k = 0; k < s->n; k++) {
    s->gap[k] = PETSC_MAX_REAL;
    for (PetscInt b = 0; b < 3; b++) s->contact_force[k][b] = s->contact_torque[k][b] = 0;
  }
}

PetscErrorCode ContactStep(Contact c, PetscReal dt, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  BodyState *s = c->s;
  Crowd      w = {0};
  PetscInt   n;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the contact must be positive", (double)dt);
  clear_forces(s);
  c->steps_done = c->nnear = 0;
  if (!c->law->lookahead) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  set_scales(c, dt, a);
  PetscCall(use_copies(c, s->x, s->q, s->u, s->w));
  PetscCall(PetscMalloc1(s->n, &w.drift));
  PetscCall(start_drift(c, dt, a, alpha, w.drift));
  PetscCall(ContactFindPairs(c));
  PetscCall(gather_crowd(c, &w));
  if (w.nnear) {
    PetscCall(choose_substeps(c, dt, contact_time(c, w.nnear, w.near), &n));
    for (PetscInt i = 0; i < c->law->lookahead * n; i++) PetscCall(advance_crowd(c, dt / n, &w, i < n ? PETSC_TRUE : PETSC_FALSE));
    c->steps_done = n;
    store_means(c, dt, &w);
  }
  PetscCall(PetscFree(w.near));
  PetscCall(PetscFree(w.active));
  PetscCall(PetscFree(w.drift));
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactEvaluate(Contact c, PetscReal (*x)[3], PetscReal (*q)[4], PetscReal (*force)[3], PetscReal (*torque)[3], PetscReal *gap)
{
  PetscFunctionBeginUser;
  set_scales(c, 0, NULL);
  for (PetscInt k = 0; k < c->s->n; k++) {
    gap[k] = PETSC_MAX_REAL;
    for (PetscInt a = 0; a < 3; a++) force[k][a] = torque[k][a] = 0;
  }
  PetscCall(use_copies(c, x, q, c->s->u, c->s->w));
  PetscCall(PetscFree(c->reach));
  PetscCall(ContactFindPairs(c));
  for (PetscInt k = 0; k < c->s->n && c->dim == 3; k++) PetscCall(set_inverse_inertia(c, k));
  c->nnear = c->npairs;
  for (PetscInt p = 0; p < c->npairs; p++) {
    Impulse   now;
    PetscReal g;

    PetscCall(ContactPairForce(c, p, 0, &now, &g));
    ContactNoteGap(&c->pair[p], g, gap);
    scatter_impulse(&c->pair[p], &now, 1, force, torque);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- bodies alone ---- */

/* Kinetic energy with the effective inertia, less the work of gravity at the present place: what contact alone changes */
static PetscReal mechanical_energy(Contact c)
{
  const BodyState *s   = c->s;
  PetscReal        sum = 0;

  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g    = ContactGroup(c, k);
    const PetscReal  spin = c->dim == 2 && c->kind[s->body_group[k]].inverse_spin > 0 ? 1 / c->kind[s->body_group[k]].inverse_spin : 0;

    if (!g->free || s->gone[k]) continue;
    sum += 0.5 * effective_mass(c, g) * dot3(s->u[k], s->u[k]) + 0.5 * spin * PetscSqr(s->w[k][2]);
    sum -= (g->density - c->rho_f) * g->mass.volume * dot3(c->g, s->x[k]);
  }
  return sum;
}

static void drop_bodies(Contact c, PetscReal h)
{
  for (PetscInt k = 0; k < c->s->n; k++) {
    const BodyGroup *g    = ContactGroup(c, k);
    const Kind      *kind = ContactKind(c, k);

    if (c->s->gone[k]) continue;
    for (PetscInt a = 0; a < c->dim; a++) c->u[k][a] += h * (g->density - c->rho_f) * g->mass.volume * kind->inverse_mass[a] * c->g[a];
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
    scatter_impulse(&c->pair[p], &now, share, c->s->contact_force, c->s->contact_torque);
    kick_pair(c, &c->pair[p], h, &now);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Smallest time in which a contact force changes between any two kinds: without a look at the pairs, which change during the step. */
static PetscReal alone_time(Contact c)
{
  const PetscReal top   = fastest(c);
  PetscReal       least = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < c->s->ngroups; i++)
    for (PetscInt j = 0; j <= c->s->ngroups; j++) { /* the last: a wall */
      const Kind     *a = &c->kind[i], *b = j < c->s->ngroups ? &c->kind[j] : NULL;
      const PetscReal K = c->law->combine(c, a, b, top), m = b && b->moves ? PetscMin(a->mass, b->mass) : a->mass;

      if (a->moves && K > 0) least = PetscMin(least, c->law->time(c, K, m));
    }
  return least;
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
    c->s->angle[k] += h * c->w[k][2];
    if (c->dim == 2) RotationFromAngle(c->s->angle[k], c->q[k]);
    else RotationAdvance(h, c->w[k], c->q[k]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactAdvanceAlone(Contact c, PetscReal dt)
{
  BodyState *s = c->s;
  PetscReal  before;
  PetscInt   n = 1;

  PetscFunctionBeginUser;
  PetscCheck(dt > 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Time step %g of the bodies must be positive", (double)dt);
  PetscCall(PetscLogEventBegin(TB_CONTACT, 0, 0, 0, 0));
  clear_forces(s);
  set_scales(c, dt, NULL);
  c->x   = s->x;
  c->q   = s->q;
  c->u   = s->u;
  c->w   = s->w;
  before = mechanical_energy(c);
  PetscCall(PetscFree(c->reach));
  PetscCall(PetscArraycpy((PetscReal *)s->u_old, (PetscReal *)s->u, 3 * s->n));
  PetscCall(PetscArraycpy((PetscReal *)s->w_old, (PetscReal *)s->w, 3 * s->n));
  PetscCall(ContactFindPairs(c));
  for (PetscInt k = 0; k < s->n && c->dim == 3; k++) PetscCall(set_inverse_inertia(c, k));
  if (c->law->lookahead) PetscCall(choose_substeps(c, dt, alone_time(c), &n));
  for (PetscInt i = 0; i < n; i++) PetscCall(advance_alone(c, dt / n, 1. / n));
  c->steps_done = n;
  c->nnear      = c->npairs;
  c->work += mechanical_energy(c) - before;
  PetscCall(PetscLogEventEnd(TB_CONTACT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the start ---- */

static PetscBool can_travel(Contact c, PetscInt k)
{
  return (PetscBool)(k >= 0 && (ContactGroup(c, k)->free & (BODY_FREE_X | BODY_FREE_Y | BODY_FREE_Z)) != 0);
}

static PetscErrorCode complain(Contact c, const Pair *p, PetscReal overlap)
{
  static const char *const FACES[] = {"left", "right", "bottom", "top", "back", "front"};
  const BodyGroup         *i = ContactGroup(c, p->i), *j = p->j >= 0 ? ContactGroup(c, p->j) : NULL;
  char                     partner[128];

  PetscFunctionBeginUser;
  if (j) (void)snprintf(partner, sizeof(partner), "body %" PetscInt_FMT " of group '%s'", p->j - j->first, j->name);
  else (void)snprintf(partner, sizeof(partner), "wall '%s'", FACES[-1 - p->j]);
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "Body %" PetscInt_FMT
          " of group '%s' overlaps %s by %g at the start: move one of them (-particle_%s_position, _lower, _upper, _margin, _table)",
          p->i - i->first, i->name, partner, (double)overlap, i->name);
}

PetscErrorCode ContactCheckStart(Contact c)
{
  PetscFunctionBeginUser;
  c->x = c->s->x;
  c->q = c->s->q;
  PetscCall(PetscFree(c->reach));
  PetscCall(ContactFindPairs(c));
  for (PetscInt k = 0; k < c->npairs; k++) {
    const Pair *p = &c->pair[k];
    PetscInt    n;
    PetscReal   gap;

    if (!can_travel(c, p->i) && !can_travel(c, p->j)) continue;
    PetscCall(ContactFindTouch(c, p->i, p->j, &n, &gap));
    if (gap < -1e-6 * ContactKind(c, p->i)->radius) PetscCall(complain(c, p, -gap));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- energy ---- */

PetscErrorCode ContactCountWork(Contact c, PetscReal dt)
{
  const BodyState *s = c->s;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt a = 0; a < 3; a++)
      c->work += 0.5 * dt * (s->contact_force[k][a] * (s->u[k][a] + s->u_old[k][a]) + s->contact_torque[k][a] * (s->w[k][a] + s->w_old[k][a]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetEnergy(Contact c, PetscReal *stored, PetscReal *work)
{
  PetscFunctionBeginUser;
  *stored = 0;
  *work   = c->work;
  if (!c->have_list) PetscFunctionReturn(PETSC_SUCCESS); /* nothing has been near anything */
  c->x = c->s->x;
  c->q = c->s->q;
  for (PetscInt p = 0; p < c->npairs; p++) {
    PetscReal energy;

    PetscCall(ContactPairEnergy(c, p, &energy));
    *stored += energy;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- questions ---- */

PetscErrorCode ContactGetMass(Contact c, PetscInt k, PetscReal *mass, PetscReal inertia[6])
{
  PetscFunctionBeginUser;
  PetscCheck(k >= 0 && k < c->s->n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Body %" PetscInt_FMT " does not exist: there are %" PetscInt_FMT, k,
             c->s->n);
  *mass = effective_mass(c, ContactGroup(c, k));
  if (inertia) PetscCall(effective_inertia(c, k, inertia));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetRange(Contact c, PetscReal *range)
{
  PetscFunctionBeginUser;
  *range = c->range;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetWork(Contact c, PetscInt *tests, PetscInt *pairs, PetscInt *substeps)
{
  PetscFunctionBeginUser;
  if (tests) *tests = c->tests;
  if (pairs) *pairs = c->nnear;
  if (substeps) *substeps = c->steps_done;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetSeparation(Contact c, PetscReal *overlap)
{
  PetscFunctionBeginUser;
  *overlap = c->separation;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactView(Contact c, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "contact: law %s, range %g, walls%s%s%s%s%s%s%s\n", c->law->name, (double)c->range,
                                   c->walls & 1 ? " x-" : "", c->walls & 2 ? " x+" : "", c->walls & 4 ? " y-" : "", c->walls & 8 ? " y+" : "",
                                   c->walls & 16 ? " z-" : "", c->walls & 32 ? " z+" : "", c->walls ? "" : " none"));
  if (c->lubricate)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  lubrication below gap %g, roughness %g, viscosity %g\n", (double)c->lubrication_range,
                                     (double)c->roughness, (double)c->viscosity));
  for (PetscInt g = 0; g < c->s->ngroups; g++)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  group %s: terminal speed scale %g, %" PetscInt_FMT " surface points\n", c->s->group[g].name,
                                     (double)c->kind[g].terminal, c->kind[g].npoints));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- creation ---- */

static PetscReal terminal_speed(Contact c, const BodyGroup *g)
{
  const PetscReal d = 2 * g->radius, height = c->dim == 2 ? PETSC_PI / 2 * d : 4. / 3. * d;            /* 2 Vol/A of a disc, a sphere */
  const PetscReal excess = PetscAbsReal(g->density - c->rho_f) / PetscMax(c->rho_f, 0.1 * g->density); /* without a fluid: a fall of some diameters */

  if (excess < 1e-6) return 0; /* meant to be neutrally buoyant */
  return PetscSqrtReal(height * excess * PetscSqrtReal(dot3(c->g, c->g)));
}

static void create_kind(Contact c, const BodyGroup *g, Kind *k)
{
  k->moves    = g->free ? PETSC_TRUE : PETSC_FALSE;
  k->mass     = effective_mass(c, g);
  k->radius   = g->radius;
  k->disc     = g->disc;
  k->terminal = terminal_speed(c, g);
  for (PetscInt a = 0; a < c->dim; a++)
    if (g->free & (BODY_FREE_X << a)) k->inverse_mass[a] = 1 / k->mass;
  if (g->free & BODY_FREE_ROTATION) k->inverse_spin = 1 / (g->mass.inertia[2] * (g->density + 0.1 * c->rho_f));
}

static PetscErrorCode check_scale(Contact c)
{
  PetscReal top = 0;

  PetscFunctionBeginUser;
  c->spring_speed = fastest(c);
  for (PetscInt g = 0; g < c->s->ngroups; g++) top = PetscMax(top, c->kind[g].terminal);
  c->spring_speed = PetscMax(c->spring_speed, top);
  PetscCheck(c->law->lookahead != 1 || c->spring > 0 || c->spring_speed > 0 || !c->s->n, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_law %s finds no scale for its stiffness (no buoyancy, no initial velocity): give -contact_spring_stiffness", c->law->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCreate(Bodies bodies, PetscReal h, PetscReal rho_f, const PetscReal gravity[3], const PetscReal lower[3],
                             const PetscReal upper[3], PetscInt walls, Contact *contact)
{
  Contact c;

  PetscFunctionBeginUser;
  PetscCheck(h > 0 && rho_f >= 0, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Contact needs a positive cell size and a fluid density, not %g and %g",
             (double)h, (double)rho_f);
  PetscCall(PetscNew(&c));
  c->bodies = bodies;
  PetscCall(BodiesGetState(bodies, &c->s));
  c->dim   = c->s->dim;
  c->h     = h;
  c->rho_f = rho_f;
  c->walls = walls;
  for (PetscInt a = 0; a < c->dim; a++) {
    c->g[a]     = gravity[a];
    c->lower[a] = lower[a];
    c->upper[a] = upper[a];
  }
  PetscCall(ContactReadLaws(c));
  PetscCall(OptInt("-contact_substeps", "Sub-steps of the contact in a time step, 0: from the stiffness", "", 0, PETSC_MAX_INT / 2, &c->substeps));
  c->separate = PETSC_TRUE;
  if (c->s->n) PetscCall(OptBool("-contact_separate", "bodies that overlap after a step of the flow are moved apart", &c->separate));
  PetscCall(PetscCalloc1(c->s->ngroups, &c->kind));
  PetscCall(PetscCalloc1(c->s->n, &c->present));
  for (PetscInt g = 0; g < c->s->ngroups; g++) create_kind(c, &c->s->group[g], &c->kind[g]);
  PetscCall(ContactCreatePoints(c));
  PetscCall(check_scale(c));
  if (c->dim == 3) PetscCall(PetscCalloc1(c->s->n, &c->inverse_inertia));
  *contact = c;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetPeriod(Contact c, const PetscReal period[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < c->dim; a++) c->period[a] = period[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactSetViscosity(Contact c, PetscReal viscosity)
{
  PetscFunctionBeginUser;
  c->viscosity = viscosity;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactDestroy(Contact *contact)
{
  Contact c = *contact;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < c->s->ngroups; g++) PetscCall(PetscFree(c->kind[g].point));
  PetscCall(PetscFree(c->kind));
  PetscCall(PetscFree(c->present));
  PetscCall(PetscFree4(c->copy_x, c->copy_q, c->copy_u, c->copy_w));
  PetscCall(PetscFree(c->inverse_inertia));
  PetscCall(PetscFree(c->pair));
  PetscCall(PetscFree(c->slip));
  PetscCall(PetscFree(c->kept));
  PetscCall(PetscFree(c->kept_pair));
  PetscCall(PetscFree(c->kept_slip));
  PetscCall(PetscFree(c->listed));
  PetscCall(PetscFree(c->reach));
  PetscCall(PetscFree(*contact));
  PetscFunctionReturn(PETSC_SUCCESS);
}
