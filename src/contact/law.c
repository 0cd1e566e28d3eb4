/* Contact, laws: the force at a touch, friction, lubrication.

   Repulsive: see contact.h. A body of effective mass m that arrives with speed u_ref is to stop without overlap: K =
   1.5 m u_ref^2/r, because the work of the law over its range is K r/3. The slope in the overlap, 2 K/r, makes the law
   continuously differentiable; it is also the ratio of the two stiffnesses that FeatFlow uses, eps = h^2 and eps' = h
   for r = h/2. Damping (Hunt & Crossley 1975): force times (1 + v/(DAMPING u_ref)), v the speed of approach, never
   attractive. It takes the energy out and vanishes with the speed, so that the resting gap is that of the law.

   Spring (Cundall & Strack 1979): k (r - gap) + c v with the damping c = 2 zeta sqrt(k m), zeta = -ln e/sqrt(pi^2 +
   ln^2 e), which gives the restitution coefficient e exactly, m the mass of the pair along the normal. k from a stop
   within half the range: k = 4 m u_ref^2/r^2. Friction: a tangential spring of stiffness 2/7 k that moves with the pair
   and slides at mu times the normal force.

   Lubrication: squeezed film between two surfaces. 2D: 3 sqrt(2) pi mu v (R/gap)^(3/2) a unit depth, 1/R the sum of
   both curvatures. 3D, with k1 and k2 the principal curvatures of the gap: 12 pi mu v/((k1 + k2) sqrt(k1 k2) gap),
   which is 6 pi mu v R^2/gap for spheres (the pressure 6 mu v/((k1 + k2) gap^2) solves Reynolds' equation), and the
   next term, 6 pi mu v R/5 (1 + 5 ci cj R^2) ln(1/gap), that of spheres of curvatures ci and cj (Jeffrey & Onishi
   1984; a wall: Brenner 1961). For approach and separation; minus what the mesh resolves, so that it blends in: in 2D
   its value at the gap from which the mesh resolves it; in 3D its value at the larger gap at which the mesh resists as
   it does (measured: rung penalty resolves films of a quarter of a cell at a wall, of a whole one between two spheres,
   and a closed one counts as .14 and .27 cells). Gaps below the roughness count as the roughness. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

/* Measured, spheres with 8 cells a diameter under rung penalty: runs/studies/contact, "Films" */
#define FILM_CLOSED 0.136 /* what the mesh makes of a closed film at a wall, in ranges; twice that between bodies */
#define FILM_POWER  2.8   /* how that blends with the true gap */

/* ---- repulsive ---- */

static PetscErrorCode read_repulsive(Contact c)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_stiffness", &c->multiple));
  PetscCall(OptReal("-contact_eps", &c->eps));
  PetscCall(OptReal("-contact_eps_overlap", &c->eps_overlap));
  PetscCall(OptReal("-contact_wall_factor", &c->wall_factor));
  PetscCall(OptReal("-contact_damping", &c->damping_speed));
  PetscCheck(c->eps > 0 || c->eps_overlap <= 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_eps_overlap %g needs -contact_eps: the two stiffness parameters of the law belong together", (double)c->eps_overlap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A force; with -contact_eps that of two such bodies is the sum */
static PetscReal repulsive_stiffness(Contact c, const Kind *k)
{
  if (c->eps > 0) return k->radius * PetscSqr(c->range) / c->eps;
  return k->moves ? c->multiple * 1.5 * k->mass * PetscSqr(k->speed) / c->range : 0;
}

/* The stiffness of a body that is faster than its scale grows with the square of its speed, as the energy does that is
   to be stored */
static PetscReal stiffen(const Kind *k, PetscReal speed)
{
  return speed > k->speed && k->speed > 0 ? k->stiffness * PetscSqr(speed / k->speed) : k->stiffness;
}

static PetscReal repulsive_combine(Contact c, const Kind *i, const Kind *j, PetscReal speed)
{
  if (c->eps > 0) return j ? i->stiffness + j->stiffness : 2 * c->wall_factor * i->stiffness;
  return j ? PetscMax(stiffen(i, speed), stiffen(j, speed)) : c->wall_factor * stiffen(i, speed);
}

/* Overlap in which the force doubles, s r */
static PetscReal overlap_scale(Contact c)
{
  return c->eps_overlap > 0 ? PetscSqr(c->range) * c->eps_overlap / c->eps : 0.5 * c->range;
}

static PetscReal repulsive_force(Contact c, const Meeting *m)
{
  const PetscReal gap   = m->gap;
  const PetscReal value = m->stiffness * m->weight * (gap >= 0 ? PetscSqr(1 - gap / c->range) : 1 - gap / overlap_scale(c));
  const PetscReal rate  = c->damping_speed * m->speed > 0 ? value / (c->damping_speed * m->speed) : 0;

  if (gap >= c->range) return 0;
  if (m->h <= 0) return value;
  /* all pairs at once: a force that the damping of its own pair lessens could not carry what lies on the body */
  if (m->together > 0) return PetscMax(0, value + rate * m->approach / (1 + m->h * rate * m->together * m->inverse_mass));
  return PetscMax(0, (value + rate * m->approach) / (1 + m->h * rate * m->inverse_mass));
}

static PetscReal repulsive_energy(Contact c, const Meeting *m)
{
  const PetscReal gap = m->gap, r = c->range;

  if (gap >= r) return 0;
  if (gap >= 0) return m->stiffness * m->weight * r / 3 * PetscPowRealInt(1 - gap / r, 3);
  return m->stiffness * m->weight * (r / 3 - gap + 0.5 * gap * gap / overlap_scale(c));
}

static PetscReal repulsive_time(Contact c, PetscReal stiffness, PetscReal mass)
{
  return PetscSqrtReal(mass * PetscMin(0.5 * c->range, overlap_scale(c)) / stiffness);
}

/* ---- spring ---- */

static PetscErrorCode read_spring(Contact c)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_spring_stiffness", &c->spring));
  PetscCall(OptReal("-contact_restitution", &c->restitution));
  PetscCall(OptReal("-contact_friction", &c->friction));
  PetscCall(OptReal("-contact_tangential", &c->tangential));
  c->damping_ratio = -PetscLogReal(c->restitution) / PetscSqrtReal(PetscSqr(PETSC_PI) + PetscSqr(PetscLogReal(c->restitution)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal spring_stiffness(Contact c, const Kind *k)
{
  if (c->spring > 0) return c->spring;
  /* not from the present speed: a spring that softens during a collision would make energy */
  return k->moves ? 4 * k->mass * PetscSqr(PetscMax(k->terminal, c->spring_speed) / c->range) : 0;
}

static PetscReal spring_combine(Contact c, const Kind *i, const Kind *j, PetscReal speed)
{
  (void)c;
  (void)speed;
  return j ? PetscMax(i->stiffness, j->stiffness) : i->stiffness;
}

static PetscReal spring_force(Contact c, const Meeting *m)
{
  const PetscReal value = m->stiffness * m->weight * (c->range - m->gap);
  const PetscReal rate  = m->weight * 2 * c->damping_ratio * PetscSqrtReal(m->stiffness / m->inverse_mass);

  if (m->gap >= c->range) return 0;
  if (m->h <= 0 || m->inverse_mass <= 0) return value;
  /* damped by the mean speed of the sub-step: second order */
  return (value + rate * m->approach) / (1 + 0.5 * m->h * rate * m->inverse_mass);
}

static PetscReal spring_energy(Contact c, const Meeting *m)
{
  return m->gap >= c->range ? 0 : 0.5 * m->stiffness * m->weight * PetscSqr(c->range - m->gap);
}

static PetscReal spring_time(Contact c, PetscReal stiffness, PetscReal mass)
{
  (void)c;
  return PetscSqrtReal(0.5 * mass / stiffness); /* two equal bodies */
}

/* ---- the registry ---- */

static const ContactLaw law_repulsive = {"repulsive",   2, read_repulsive, repulsive_stiffness, repulsive_combine, repulsive_force, repulsive_energy,
                                         repulsive_time};
static const ContactLaw law_spring    = {"spring", 1, read_spring, spring_stiffness, spring_combine, spring_force, spring_energy, spring_time};
static const ContactLaw law_none      = {.name = "none"};

const ContactLaw *const contact_laws[] = {&law_repulsive, &law_spring, &law_none, NULL};

PetscErrorCode ContactReadLaws(Contact c)
{
  const char *names[16] = {NULL};
  PetscInt    which     = 0;

  PetscFunctionBeginUser;
  c->range    = 0.5 * c->h;
  c->multiple = c->wall_factor = 1;
  c->damping_speed             = 0.1;
  c->restitution               = 0.5;
  c->tangential                = 2. / 7.;
  for (PetscInt i = 0; contact_laws[i]; i++) names[i] = contact_laws[i]->name;
  PetscCall(OptChoice("-contact_law", names, &which));
  c->law = contact_laws[which];
  PetscCall(OptReal("-contact_range", &c->range));
  if (c->law->options) PetscCall(c->law->options(c));
  c->horizon = c->range;
  PetscCall(OptBool("-contact_lubrication", &c->lubricate));
  if (!c->lubricate) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(c->law->lookahead, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_lubrication needs a law of contact: give another -contact_law than %s", c->law->name);
  c->lubrication_range = c->h;
  PetscCall(OptReal("-contact_lubrication_range", &c->lubrication_range));
  c->roughness = 0.02 * c->lubrication_range;
  PetscCall(OptReal("-contact_roughness", &c->roughness));
  PetscCheck(c->roughness <= c->lubrication_range, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_roughness %g exceeds -contact_lubrication_range %g, from which on the mesh resolves the film: lower it", (double)c->roughness,
             (double)c->lubrication_range);
  c->horizon = PetscMax(c->range, c->lubrication_range);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the force of a pair ---- */

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

/* Inverse of the mass that body k opposes to a force along n at lever r. */
static PetscReal inverse_mass_along(Contact c, PetscInt k, const PetscReal r[3], const PetscReal n[3])
{
  const Kind *kind = ContactKind(c, k);
  PetscReal   rn[3], irn[3], sum = 0;

  cross(r, n, rn);
  ContactSpin(c, k, rn, irn);
  for (PetscInt a = 0; a < 3; a++) sum += kind->inverse_mass[a] * n[a] * n[a];
  return sum + dot3(rn, irn);
}

/* Velocity of i relative to j where they touch. */
static void relative_velocity(Contact c, PetscInt i, PetscInt j, const Touch *t, PetscReal v[3])
{
  PetscReal wr[3];

  cross(c->w[i], t->ri, wr);
  for (PetscInt a = 0; a < 3; a++) v[a] = c->u[i][a] + wr[a];
  if (j < 0) return;
  cross(c->w[j], t->rj, wr);
  for (PetscInt a = 0; a < 3; a++) v[a] -= c->u[j][a] + wr[a];
}

static PetscReal pair_inverse_mass(Contact c, PetscInt i, PetscInt j, const Touch *t, const PetscReal n[3])
{
  return inverse_mass_along(c, i, t->ri, n) + (j >= 0 ? inverse_mass_along(c, j, t->rj, n) : 0);
}

/* One touch in place of many, weighted with `share`. */
static void average_touch(PetscInt n, const Touch t[], const PetscReal share[], Touch *mean)
{
  PetscReal total = 0, length;

  *mean = (Touch){.gap = PETSC_MAX_REAL, .weight = 1};
  for (PetscInt k = 0; k < n; k++) {
    total += share[k];
    mean->gap = PetscMin(mean->gap, t[k].gap);
    for (PetscInt a = 0; a < 3; a++) {
      mean->normal[a] += share[k] * t[k].normal[a];
      mean->ri[a] += share[k] * t[k].ri[a];
      mean->rj[a] += share[k] * t[k].rj[a];
    }
  }
  length = PetscSqrtReal(dot3(mean->normal, mean->normal));
  for (PetscInt a = 0; a < 3; a++) {
    mean->normal[a] /= length;
    mean->ri[a] /= total;
    mean->rj[a] /= total;
  }
}

/* Tangential spring with sliding; normal is the force pressing the bodies together. Spring and damper act at the end of
   the sub-step (implicit), so that a body at rest on a slope does not creep. */
static void add_friction(Contact c, const Pair *p, const Touch *t, PetscReal normal, PetscReal stiffness, PetscReal h, PetscReal slip[3],
                         Impulse *sum)
{
  const PetscReal k = c->tangential * stiffness;
  PetscReal       v[3], f[3], unit[3], along, size, rate, inverse;

  relative_velocity(c, p->i, p->j, t, v);
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
  if (inverse <= 0) return;
  rate = 2 * c->damping_ratio * PetscSqrtReal(k / inverse);
  for (PetscInt a = 0; a < 3; a++) f[a] = -(k * slip[a] + (k * h + rate) * v[a]) / (1 + h * inverse * (k * h + rate));
  size = PetscSqrtReal(dot3(f, f));
  if (size > c->friction * normal) {
    for (PetscInt a = 0; a < 3; a++) {
      f[a] *= c->friction * normal / size;
      slip[a] = -f[a] / k; /* it slides: the spring keeps what it can hold */
    }
  } else
    for (PetscInt a = 0; a < 3; a++) slip[a] += h * (v[a] + h * inverse * f[a]);
  add_force(sum, f, t->ri, t->rj);
}

/* The gap at which the mesh resists as it does at this one (runs/studies/contact, "Films") */
static PetscReal resolved_gap(Contact c, const Pair *p, PetscReal gap)
{
  const PetscReal closed = (p->j < 0 ? 1 : 2) * FILM_CLOSED * c->lubrication_range;

  if (c->dim == 2) return c->lubrication_range;
  return PetscPowReal(PetscPowReal(gap, FILM_POWER) + PetscPowReal(closed, FILM_POWER), 1 / FILM_POWER);
}

/* Resistance of the film at a gap less what the mesh resolves of it */
static PetscReal film_resistance(Contact c, const Pair *pair, PetscReal gap, const Curvature *k)
{
  const PetscReal open = resolved_gap(c, pair, gap), *p = k->principal, R = 2 / (p[0] + p[1]);

  if (c->dim == 2) {
    const PetscReal scale = 3 * PetscSqrtReal(2) * PETSC_PI * c->viscosity;

    return scale * PetscPowReal(R / gap, 1.5) - scale * PetscPowReal(R / open, 1.5);
  }
  return 6 * PETSC_PI * c->viscosity *
         (R / PetscSqrtReal(p[0] * p[1]) * (1 / gap - 1 / open) + R / 5 * (1 + 5 * k->of[0] * k->of[1] * R * R) * PetscLogReal(open / gap));
}

static PetscErrorCode add_lubrication(Contact c, const Pair *p, Touch *t, PetscReal h, Impulse *sum)
{
  Curvature curvature;
  PetscReal rate, v[3], f[3], value;

  PetscFunctionBeginUser;
  if (c->viscosity <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFindNarrowest(c, p->i, p->j, t, &curvature));
  if (t->gap >= c->lubrication_range) PetscFunctionReturn(PETSC_SUCCESS);
  rate = film_resistance(c, p, PetscMax(t->gap, c->roughness), &curvature);
  relative_velocity(c, p->i, p->j, t, v);
  value = -rate * dot3(v, t->normal) / (1 + h * rate * PetscMax(1, c->together) * pair_inverse_mass(c, p->i, p->j, t, t->normal));
  for (PetscInt a = 0; a < 3; a++) f[a] = value * t->normal[a];
  add_force(sum, f, t->ri, t->rj);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void fill_meeting(Contact c, const Pair *p, PetscReal h, Meeting *m)
{
  const Kind     *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  const PetscReal speed = ContactPairSpeed(c, p);

  m->stiffness = c->law->combine(c, ki, kj, speed);
  m->speed     = PetscMax(speed, kj && kj->stiffness > ki->stiffness ? kj->speed : ki->speed);
  m->h         = h;
  m->together  = c->together;
}

PetscBool ContactDiscForce(Contact c, const Pair *p, PetscReal h, PetscReal f[3], PetscReal *gap)
{
  const Kind *ki = ContactKind(c, p->i), *kj = p->j >= 0 ? ContactKind(c, p->j) : NULL;
  PetscReal   n[3], approach = 0, inverse = 0, value;
  Meeting     m;

  if (ki->disc <= 0 || (kj && kj->disc <= 0) || c->slip || c->lubricate) return PETSC_FALSE;
  f[0] = f[1] = f[2] = 0;
  ContactDiscGap(c, p->i, ki->disc, p->j, kj ? kj->disc : 0, n, gap);
  if (*gap >= c->range) return PETSC_TRUE;
  for (PetscInt a = 0; a < 3; a++) {
    approach -= (c->u[p->i][a] - (kj ? c->u[p->j][a] : 0)) * n[a];
    inverse += (ki->inverse_mass[a] + (kj ? kj->inverse_mass[a] : 0)) * n[a] * n[a];
  }
  fill_meeting(c, p, h, &m);
  m.gap          = *gap;
  m.weight       = 1;
  m.approach     = approach;
  m.inverse_mass = inverse;
  value          = c->law->force(c, &m);
  for (PetscInt a = 0; a < 3; a++) f[a] = value * n[a];
  return PETSC_TRUE;
}

PetscErrorCode ContactPairForce(Contact c, PetscInt number, PetscReal h, Impulse *sum, PetscReal *gap)
{
  const Pair *p = &c->pair[number];
  PetscReal   share[2 * CONTACT_MAX_POINTS], pressing = 0;
  PetscInt    n;
  Meeting     m;
  Touch       mean;

  PetscFunctionBeginUser;
  *sum = (Impulse){{0}, {0}, {0}};
  if (ContactDiscForce(c, p, h, sum->f, gap)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactFindTouch(c, p->i, p->j, &n, gap));
  if (*gap >= c->range && c->slip) c->slip[number][0] = c->slip[number][1] = c->slip[number][2] = 0;
  if (*gap >= c->horizon) PetscFunctionReturn(PETSC_SUCCESS);
  fill_meeting(c, p, h, &m);
  for (PetscInt k = 0; k < n; k++) {
    const Touch *t = &c->touch[k];
    PetscReal    v[3], f[3], value;

    share[k] = 0;
    if (t->weight <= 0 || t->gap >= c->range) continue;
    relative_velocity(c, p->i, p->j, t, v);
    m.gap          = t->gap;
    m.weight       = t->weight;
    m.approach     = -dot3(v, t->normal);
    m.inverse_mass = pair_inverse_mass(c, p->i, p->j, t, t->normal);
    value          = c->law->force(c, &m);
    for (PetscInt a = 0; a < 3; a++) f[a] = value * t->normal[a];
    add_force(sum, f, t->ri, t->rj);
    share[k] = PetscMax(0, value);
    pressing += share[k];
  }
  if (c->slip && pressing > 0 && h > 0) {
    average_touch(n, c->touch, share, &mean);
    add_friction(c, p, &mean, pressing, m.stiffness, h, c->slip[number], sum);
  }
  if (c->lubricate) {
    for (PetscInt k = 0; k < n; k++) share[k] = c->touch[k].weight;
    average_touch(n, c->touch, share, &mean);
    PetscCall(add_lubrication(c, p, &mean, h, sum));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPairEnergy(Contact c, PetscInt number, PetscReal *energy)
{
  const Pair *p = &c->pair[number];
  PetscInt    n;
  PetscReal   gap;
  Meeting     m;

  PetscFunctionBeginUser;
  *energy = 0;
  PetscCall(ContactFindTouch(c, p->i, p->j, &n, &gap));
  if (gap >= c->range) PetscFunctionReturn(PETSC_SUCCESS);
  fill_meeting(c, p, 0, &m);
  for (PetscInt k = 0; k < n; k++) {
    m.gap    = c->touch[k].gap;
    m.weight = c->touch[k].weight;
    if (m.weight > 0) *energy += c->law->energy(c, &m);
  }
  if (c->slip) *energy += 0.5 * c->tangential * m.stiffness * dot3(c->slip[number], c->slip[number]);
  PetscFunctionReturn(PETSC_SUCCESS);
}
