/* Contact, the force of a pair: what its law says at each touch, friction, the film between them. Laws and formulas:
   law.c. All of it is a force and a rate of damping along a normal, a dashpot, but friction, which is a force. */
#include "compat.h"
#include "cohesion.h"

/* Measured, spheres with 8 and 12 cells a diameter under method penalty: runs/studies/contact, "Films" */
#define FILM_NARROW 0.4  /* gap in ranges at which the recess begins to act, */
#define FILM_WIDE   0.75 /* and at which all of it acts, to 1; FILM_OPEN: it is gone */

/* At a wall, between bodies: what the mesh makes of a closed film, in ranges; how that blends with the true gap */
static const PetscReal FILM_CLOSED[2] = {0.165, 0.305}, FILM_POWER[2] = {6, 4};

static void add_force(Impulse *s, const PetscReal f[3], const PetscReal ri[3], const PetscReal rj[3])
{
  PetscReal ti[3], tj[3];

  cross(ri, f, ti);
  cross(f, rj, tj); /* the force on j is -f */
  for (PetscInt a = 0; a < 3; a++) {
    s->f[a] += f[a];
    s->ti[a] += ti[a];
    s->tj[a] += tj[a];
  }
}

PetscReal ContactInverseMass(Contact c, PetscInt k, const PetscReal r[3], const PetscReal n[3])
{
  const Kind *kind = ContactKind(c, k);
  PetscReal   rn[3], irn[3], arm[3] = {0, 0, 0}, sum = 0;

  if (ContactPivots(c, k)) (void)BodiesGetArm(c->bodies, k, c->q[k], arm);
  for (PetscInt a = 0; a < 3; a++) arm[a] += r[a];
  cross(arm, n, rn);
  ContactSpin(c, k, rn, irn);
  for (PetscInt a = 0; a < 3; a++) sum += kind->inverse_mass[a] * n[a] * n[a];
  return sum + dot3(rn, irn);
}

/* Velocity of i relative to j where they touch. */
static void relative_velocity(Contact c, PetscInt i, PetscInt j, const PetscReal ri[3], const PetscReal rj[3],
                              PetscReal v[3])
{
  PetscReal wr[3];

  cross(c->w[i], ri, wr);
  for (PetscInt a = 0; a < 3; a++) v[a] = c->u[i][a] + wr[a];
  if (j < 0) return;
  cross(c->w[j], rj, wr);
  for (PetscInt a = 0; a < 3; a++) v[a] -= c->u[j][a] + wr[a];
}

static PetscReal pair_inverse_mass(Contact c, PetscInt i, PetscInt j, const Touch *t, const PetscReal n[3])
{
  return ContactInverseMass(c, i, t->ri, n) + (j >= 0 ? ContactInverseMass(c, j, t->rj, n) : 0);
}

void ContactPlaceDashpot(Contact c, const Pair *p, const Touch *t, Dashpot *d)
{
  d->value        = 0;
  d->has_levers   = PETSC_TRUE;
  d->of_i         = ContactInverseMass(c, p->i, t->ri, t->normal);
  d->inverse_mass = d->of_i + (p->j >= 0 ? ContactInverseMass(c, p->j, t->rj, t->normal) : 0);
  for (PetscInt a = 0; a < 3; a++) {
    d->normal[a] = t->normal[a];
    d->ri[a]     = t->ri[a];
    d->rj[a]     = t->rj[a];
  }
}

/* One touch in place of many, weighted. */
static void average_touch(PetscInt n, const Touch t[], const PetscReal weight[], Touch *mean)
{
  PetscReal total = 0, length;

  *mean = (Touch){.gap = PETSC_MAX_REAL, .weight = 1};
  for (PetscInt k = 0; k < n; k++) {
    total += weight[k];
    mean->gap = PetscMin(mean->gap, t[k].gap);
    for (PetscInt a = 0; a < 3; a++) {
      mean->normal[a] += weight[k] * t[k].normal[a];
      mean->ri[a] += weight[k] * t[k].ri[a];
      mean->rj[a] += weight[k] * t[k].rj[a];
    }
  }
  length = PetscSqrtReal(dot3(mean->normal, mean->normal));
  for (PetscInt a = 0; a < 3; a++) {
    mean->normal[a] /= length;
    mean->ri[a] /= total;
    mean->rj[a] /= total;
  }
}

void ContactMeanTouch(PetscInt n, const Touch t[], Touch *mean)
{
  PetscReal weight[2 * CONTACT_MAX_POINTS];

  for (PetscInt k = 0; k < n; k++) weight[k] = t[k].weight;
  average_touch(n, t, weight, mean);
}

PetscErrorCode ContactRelativeVelocity(Contact c, const Pair *p, const PetscReal ri[3], const PetscReal rj[3],
                                       const PetscReal normal[3], PetscReal v[3])
{
  const PetscReal x[3] = {c->x[p->i][0] + ri[0], c->x[p->i][1] + ri[1], c->x[p->i][2] + ri[2]};
  PetscReal       wall[3];

  PetscFunctionBeginUser;
  relative_velocity(c, p->i, p->j, ri, rj, v);
  if (p->j >= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactGetWallVelocity(c, p->j, x, normal, wall));
  for (PetscInt a = 0; a < 3; a++) v[a] -= wall[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The gap at which the mesh resists as it does at this one (runs/studies/contact, "Films") */
static PetscReal resolved_gap(Contact c, const Pair *p, PetscReal gap)
{
  const PetscInt  kind   = p->j < 0 ? 0 : 1;
  const PetscReal closed = FILM_CLOSED[kind] * c->film.range, power = FILM_POWER[kind], x = gap / c->film.range;
  const PetscReal fraction = PetscMin(1, (x - FILM_NARROW) / (FILM_WIDE - FILM_NARROW)) *
                             PetscMin(1, (FILM_OPEN - x) / (FILM_OPEN - 1));
  const PetscReal wide = gap + PetscMax(0, fraction) * c->film.step_offset * c->film.range;

  if (c->dim == 2) return c->film.range;
  return PetscPowReal(PetscPowReal(wide, power) + PetscPowReal(closed, power), 1 / power);
}

/* Resistance of the film at a gap less what the mesh resolves of it */
static PetscReal film_resistance(Contact c, const Pair *pair, PetscReal gap, const Curvature *k)
{
  const PetscReal open = resolved_gap(c, pair, gap), *p = k->principal, R = 2 / (p[0] + p[1]);

  if (c->dim == 2) {
    const PetscReal scale = 3 * PetscSqrtReal(2) * PETSC_PI * c->fluid.viscosity;

    return scale * PetscPowReal(R / gap, 1.5) - scale * PetscPowReal(R / open, 1.5);
  }
  return 6 * PETSC_PI * c->fluid.viscosity *
         (R / PetscSqrtReal(p[0] * p[1]) * (1 / gap - 1 / open) +
          R / 5 * (1 + 5 * k->of[0] * k->of[1] * R * R) * PetscLogReal(open / gap));
}

/* Of the film at the mean touch t, which goes to where the gap is narrowest. PETSC_FALSE: the mesh resolves it. */
static PetscErrorCode film_dashpot(Contact c, const Pair *p, Touch *t, Dashpot *d, PetscBool *thin)
{
  Curvature curvature;

  PetscFunctionBeginUser;
  *thin = PETSC_FALSE;
  if (c->fluid.viscosity <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFindNarrowest(c, p->i, p->j, t, &curvature));
  *thin = (PetscBool)(t->gap < c->film.begin);
  if (!*thin) PetscFunctionReturn(PETSC_SUCCESS);
  ContactPlaceDashpot(c, p, t, d);
  d->rate = film_resistance(c, p, PetscMax(t->gap, c->film.roughness), &curvature);
  d->film = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPairSpeed(Contact c, const Pair *p, PetscReal *speed)
{
  PetscReal v[3] = {0}, d[3] = {0};

  PetscFunctionBeginUser;
  if (!c->with_flow) {
    *speed = p->j >= 0 ? PetscMax(c->speed.of_body[p->i], c->speed.of_body[p->j]) : c->speed.of_body[p->i];
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (p->j < 0) PetscCall(ContactGetWallNormal(c, p->i, p->j, d));
  for (PetscInt a = 0; a < c->dim; a++) {
    v[a] = c->u[p->i][a] - (p->j >= 0 ? c->u[p->j][a] : 0);
    if (p->j >= 0) d[a] = c->x[p->i][a] - c->x[p->j][a];
  }
  ContactWrap(c, d);
  *speed = PetscMax(0, -dot3(v, d)) / PetscMax(PetscSqrtReal(dot3(d, d)), PETSC_SMALL);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Added mass of a disc, a sphere at a wall, moving along its normal: 2 zeta(2) - 1 of the displaced mass (Yang 2010, by
   images); .803 (Lamb, section 138). Two equal ones that approach each other are at the wall between them. */
static PetscReal mass_where_touching(Contact c, const Kind *k)
{
  const PetscReal open = c->dim == 2 ? 1 : 0.5, touching = c->dim == 2 ? PETSC_PI * PETSC_PI / 3 - 1 : 0.803;

  if (!k->moves || !c->impulse.scheme.implicit) return 1;
  return (k->density + touching * c->fluid.density) / (k->density + open * c->fluid.density);
}

PetscErrorCode ContactFillMeeting(Contact c, const Pair *p, Meeting *m)
{
  const Kind *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  PetscReal   speed;

  PetscFunctionBeginUser;
  PetscCall(ContactPairSpeed(c, p, &speed));
  m->stiffness = c->law->combine(c, ki, kj, speed);
  m->heavier   = PetscMax(mass_where_touching(c, ki), kj ? mass_where_touching(c, kj) : 1);
  m->speed     = PetscMax(speed, kj && kj->stiffness > ki->stiffness ? kj->speed : ki->speed);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Springs along the surfaces; c->list.slip holds what frictionless pairs remember, too */
static PetscBool has_friction(const struct _p_Contact *c)
{
  return (PetscBool)(c->list.slip && c->spring.friction > 0);
}

/* A pair that was laid within the range (law spring) has no energy there: it feels the law from the widest gap on
   that it has had. As it parts the range grows with it, without a force; not with cohesion, which pulls it back. */
static PetscReal begun_within(Contact c, PetscInt number, PetscReal gap)
{
  if (c->cohesion) {
    if (!c->list.slip) return 0;
    if (gap >= c->horizon) c->list.slip[number][3] = 0;
    return PetscAbsReal(c->list.slip[number][3]);
  }
  if (!c->list.slip || c->list.slip[number][3] <= 0) return 0;
  c->list.slip[number][3] = PetscMax(0, PetscMin(c->list.slip[number][3], c->range - gap));
  return c->list.slip[number][3];
}

/* By the law, at a gap within the range */
static void ask_law(Contact c, Meeting *m, PetscReal gap, PetscReal weight, PetscReal h, Dashpot *d)
{
  m->gap          = gap;
  m->weight       = weight;
  m->inverse_mass = d->inverse_mass;
  d->value        = c->law->force(c, m, &d->rate);
  d->gap          = gap;
  d->weight       = weight;
  d->film         = PETSC_FALSE;
  if (h <= 0) d->rate = 0;
}

/* Discs (spheres) and sides of a box without friction or film: along the line of centres, no torques. *are: is it
   such a pair? The common case of many bodies, in closed form. */
static PetscErrorCode discs_dashpot(Contact c, const Pair *p, PetscReal h, PetscInt *n, Dashpot *d, PetscReal *gap,
                                    PetscBool *are)
{
  const Kind *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  Meeting     m;
  PetscReal   within;
  Dashpot     dashpot;

  PetscFunctionBeginUser;
  *are = (PetscBool)(ki->disc > 0 && (!kj || kj->disc > 0) && !has_friction(c) && !c->film.wanted &&
                     !ContactIsPiece(p->j));
  if (ContactPivots(c, p->i) || (kj && ContactPivots(c, p->j))) *are = PETSC_FALSE;
  if (!*are) PetscFunctionReturn(PETSC_SUCCESS);
  ContactDiscGap(c, p->i, ki->disc, p->j, kj ? kj->disc : 0, d->normal, gap);
  within = begun_within(c, p - c->list.pair, *gap);
  *n     = *gap + within < c->range;
  if (!*n && !c->cohesion) PetscFunctionReturn(PETSC_SUCCESS);
  d->inverse_mass = d->of_i = 0;
  d->has_levers             = PETSC_FALSE;
  for (PetscInt a = 0; a < 3; a++) {
    d->inverse_mass += (ki->inverse_mass[a] + (kj ? kj->inverse_mass[a] : 0)) * d->normal[a] * d->normal[a];
    d->of_i += ki->inverse_mass[a] * d->normal[a] * d->normal[a];
  }
  if (c->cohesion) {
    dashpot = *d;
    *n      = *n && !c->cohesion->law->elastic;
  }
  if (*n) {
    PetscCall(ContactFillMeeting(c, p, &m));
    ask_law(c, &m, *gap + within, 1, h, d);
  }
  if (c->cohesion && !c->with_flow)
    PetscCall(CohesionAddDashpots(c, p - c->list.pair, &dashpot, CohesionDiscRadius(ki, kj), *gap + within - c->range,
                                  h, n, &(PetscReal){0}, &(PetscReal){0}));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal ContactApproach(Contact c, const Pair *p, const Dashpot *d)
{
  PetscReal v[3];

  if (d->has_levers) relative_velocity(c, p->i, p->j, d->ri, d->rj, v);
  else
    for (PetscInt a = 0; a < 3; a++) v[a] = c->u[p->i][a] - (p->j >= 0 ? c->u[p->j][a] : 0);
  return -dot3(v, d->normal);
}

PetscReal ContactDashpotForce(Contact c, const Dashpot *d, PetscReal approach, PetscReal h)
{
  const PetscReal f = (d->value + d->rate * approach) /
                      (1 + ContactImplicit(c, d->film) * h * d->rate * d->inverse_mass);

  return d->film || c->spring.pulls ? f : PetscMax(0, f);
}

void ContactAddForce(const Dashpot *d, PetscReal value, Impulse *sum)
{
  const PetscReal f[3] = {value * d->normal[0], value * d->normal[1], value * d->normal[2]};

  if (d->has_levers) add_force(sum, f, d->ri, d->rj);
  else
    for (PetscInt a = 0; a < 3; a++) sum->f[a] += f[a];
}

/* Spring and damper act at the end of the sub-step (implicit), so that a body at rest on a slope does not creep. */
PetscErrorCode ContactAddFriction(Contact c, const Rub *rub, PetscReal h, Impulse *sum)
{
  const Pair *const  p      = &c->list.pair[rub->pair];
  const Touch *const t      = &rub->touch;
  PetscReal *const   slip   = c->list.slip[rub->pair];
  const PetscReal    normal = PetscMax(0, rub->normal), k = c->spring.tangential * rub->stiffness;
  PetscReal          v[3], f[3], unit[3], along, size, rate, inverse;

  PetscFunctionBeginUser;
  PetscCall(ContactRelativeVelocity(c, p, t->ri, t->rj, t->normal, v));
  along = dot3(v, t->normal);
  for (PetscInt a = 0; a < 3; a++) v[a] -= along * t->normal[a];
  along = dot3(slip, t->normal); /* the plane of contact has turned */
  for (PetscInt a = 0; a < 3; a++) {
    slip[a] -= along * t->normal[a];
    f[a] = slip[a] + h * v[a];
  }
  size = PetscSqrtReal(dot3(f, f));
  for (PetscInt a = 0; a < 3; a++) unit[a] = size > 0 ? f[a] / size : 0;
  inverse = pair_inverse_mass(c, p->i, p->j, t, unit);
  if (inverse <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  rate = 2 * c->spring.damping_ratio * PetscSqrtReal(k / inverse);
  for (PetscInt a = 0; a < 3; a++) f[a] = -(k * slip[a] + (k * h + rate) * v[a]) / (1 + h * inverse * (k * h + rate));
  size = PetscSqrtReal(dot3(f, f));
  if (size > c->spring.friction * normal) {
    for (PetscInt a = 0; a < 3; a++) {
      f[a] *= c->spring.friction * normal / size;
      slip[a] = -f[a] / k; /* it slides: the spring keeps what it can hold */
    }
  } else
    for (PetscInt a = 0; a < 3; a++) slip[a] += h * (v[a] + h * inverse * f[a]);
  add_force(sum, f, t->ri, t->rj);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Friction and film of a pair whose n touches carry the force as in load [n] */
static PetscErrorCode add_others(Contact c, PetscInt number, PetscInt n, PetscReal load[], PetscReal pressing,
                                 PetscReal stiffness, PetscReal h, PetscInt *dashpots, Rub *rub)
{
  const Pair *p = &c->list.pair[number];
  PetscBool   thin;
  Touch       mean;

  PetscFunctionBeginUser;
  if (has_friction(c) && pressing > 0 && h > 0) {
    *rub = (Rub){.pair = number, .stiffness = stiffness};
    average_touch(n, c->touch, load, &rub->touch);
  }
  if (c->film.wanted) {
    for (PetscInt k = 0; k < n; k++) load[k] = c->touch[k].weight;
    average_touch(n, c->touch, load, &mean);
    PetscCall(film_dashpot(c, p, &mean, &c->dashpot[*dashpots], &thin));
    *dashpots += thin;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPairDashpots(Contact c, PetscInt number, PetscReal h, PetscInt *n, Rub *rub, PetscReal *gap)
{
  const Pair *p  = &c->list.pair[number];
  const Kind *ki = ContactKind(c, p->i), *kj         = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  PetscReal   load[2 * CONTACT_MAX_POINTS], pressing = 0, within;
  PetscInt    touches;
  PetscBool   discs, elastic = (PetscBool)(c->cohesion && c->cohesion->law->elastic);
  Meeting     m;

  PetscFunctionBeginUser;
  *n        = 0;
  rub->pair = -1;
  *gap      = PETSC_MAX_REAL;
  if (ContactIsBonded(c, number)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(discs_dashpot(c, p, h, n, c->dashpot, gap, &discs));
  if (discs) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFindTouch(c, p->i, p->j, &touches, gap));
  if (*gap >= (c->cohesion ? c->horizon : c->range) && c->list.slip)
    c->list.slip[number][0] = c->list.slip[number][1] = c->list.slip[number][2] = c->list.slip[number][3] = 0;
  within = begun_within(c, number, *gap);
  if (*gap >= c->horizon) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFillMeeting(c, p, &m));
  for (PetscInt k = 0; k < touches; k++) {
    const Touch *t = &c->touch[k];
    Dashpot     *d = &c->dashpot[*n];

    load[k] = 0;
    if (t->weight <= 0 || t->gap + within >= c->range || elastic) continue;
    ContactPlaceDashpot(c, p, t, d);
    /* nothing turns discs */
    d->has_levers = (PetscBool)(ki->disc <= 0 || (kj && kj->disc <= 0) || has_friction(c) || c->film.wanted);
    ask_law(c, &m, t->gap + within, t->weight, h, d);
    load[k] = PetscMax(0, ContactDashpotForce(c, d, ContactApproach(c, p, d), h));
    pressing += load[k];
    (*n)++;
  }
  if (c->cohesion && !c->with_flow)
    PetscCall(CohesionAddAtTouches(c, number, touches, within, h, n, &pressing, &m.stiffness));
  for (PetscInt k = 0; k < touches && elastic; k++) load[k] = c->touch[k].weight;
  PetscCall(add_others(c, number, touches, load, pressing, m.stiffness, h, n, rub));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPairEnergy(Contact c, PetscInt number, PetscReal *energy)
{
  const Pair *p = &c->list.pair[number];
  PetscInt    n;
  PetscReal   gap, within;
  Meeting     m;

  PetscFunctionBeginUser;
  *energy = 0;
  PetscCall(ContactFindTouch(c, p->i, p->j, &n, &gap));
  within = begun_within(c, number, gap);
  if (c->cohesion && gap < c->horizon) PetscCall(CohesionPairEnergy(c, number, n, c->touch, within, energy));
  if (gap + within >= c->range) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFillMeeting(c, p, &m));
  for (PetscInt k = 0; k < n; k++) {
    m.gap    = c->touch[k].gap + within;
    m.weight = c->touch[k].weight;
    if (m.weight > 0 && !(c->cohesion && c->cohesion->law->elastic)) *energy += c->law->energy(c, &m);
  }
  if (c->list.slip)
    *energy += 0.5 * c->spring.tangential * m.stiffness * dot3(c->list.slip[number], c->list.slip[number]);
  PetscFunctionReturn(PETSC_SUCCESS);
}
