/* Contact, laws: the force at a touch, friction, lubrication. What they make of a pair: pairforce.c.

   Repulsive: see contact.h. A body of effective mass m that arrives with speed u_ref is to stop without overlap: K =
   1.5 m u_ref^2/r, because the work of the law over its range is K r/3. The slope in the overlap, 2 K/r, makes the law
   continuously differentiable; it is also the ratio of the two stiffnesses that FeatFlow uses, eps = h^2 and eps' = h
   for r = h/2. Damping (Hunt & Crossley 1975): force times (1 + v/(DAMPING u_ref)), v the speed of approach, never
   attractive. It takes the energy out and vanishes with the speed, so that the resting gap is that of the law.

   Spring (Cundall & Strack 1979): k (r - gap) + c v with the damping c = 2 zeta sqrt(k m), zeta = -ln e/sqrt(pi^2 +
   ln^2 e), which gives the restitution coefficient e exactly, m the mass of the pair along the normal (in a fluid with
   the larger added mass that discs and spheres have where they touch, so that e is not exceeded). Without a flow it may
   pull before the gap has opened to the range; in a flow it does not, since bodies would part faster than with e until
   they are pulled back. The zeta that then gives e: -ln e = tan(phi) (pi - 2 phi) with zeta = sin phi, and beyond e^-2
   2 psi/tanh(psi) with zeta = cosh psi (Schwager & Poeschel 2007). k from a stop
   within half the range: k = 4 m u_ref^2/r^2. Friction: a tangential spring of stiffness 2/7 k that moves with the pair
   and slides at mu times the normal force.

   Lubrication: squeezed film between two surfaces. 2D: 3 sqrt(2) pi mu v (R/gap)^(3/2) a unit depth, 1/R the sum of
   both curvatures. 3D, with k1 and k2 the principal curvatures of the gap: 12 pi mu v/((k1 + k2) sqrt(k1 k2) gap),
   which is 6 pi mu v R^2/gap for spheres (the pressure 6 mu v/((k1 + k2) gap^2) solves Reynolds' equation), and the
   next term, 6 pi mu v R/5 (1 + 5 ci cj R^2) ln(1/gap), that of spheres of curvatures ci and cj (Jeffrey & Onishi
   1984; a wall: Brenner 1961). For approach and separation; minus what the mesh resolves, so that it blends in: in 2D
   its value at the gap from which the mesh resolves it; in 3D its value at the larger gap at which the mesh resists as
   it does (measured: method penalty resolves films of a quarter of a cell at a wall, of a whole one between two
   spheres, and a closed one counts as .165 and .3 cells; films of 3/4 to 1 cell count as .035 cells wider, the recess,
   which fades away to .4 and to 2 cells, and with steps below h^2/nu). Gaps below the roughness count as the roughness.
   */
#include "compat.h"
#include "cohesion.h"
#include "base/opt.h"

#define MIN_RESTITUTION 2e-3 /* in a flow: less is as much */
#define BISECTIONS      60   /* of the damping ratio */
#define BEARS           10   /* force of law spring over the range, in the pull of cohesion at a wall */

/* ---- repulsive ---- */

static PetscErrorCode read_repulsive(Contact c)
{
  static const char *const COUPLINGS[] = {"implicit", "explicit", NULL};
  PetscInt                 coupling    = 0;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-contact_coupling", COUPLINGS, &coupling));
  c->repulsive.implicit = (PetscBool)(coupling == 0);
  PetscCall(OptReal("-contact_stiffness", &c->repulsive.multiple));
  PetscCall(OptReal("-contact_eps", &c->repulsive.eps));
  PetscCall(OptReal("-contact_eps_overlap", &c->repulsive.eps_overlap));
  PetscCall(OptReal("-contact_wall_factor", &c->repulsive.wall_factor));
  PetscCall(OptReal("-contact_damping", &c->repulsive.damping_speed));
  PetscCheck(c->repulsive.eps > 0 || c->repulsive.eps_overlap <= 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_eps_overlap %g needs -contact_eps: the two stiffness parameters of the law belong together",
             (double)c->repulsive.eps_overlap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A stiffness, at least so large that cohesion presses bodies by a fraction of the range; unit: that of its force */
static PetscReal bear_pull(Contact c, const Kind *k, PetscReal unit, PetscReal stiffness)
{
  const struct _p_Cohesion *co = c->cohesion;

  if (!co || co->law->elastic) return stiffness;
  return PetscMax(stiffness, BEARS * (*co->law->pull)(co, k->radius) * unit / c->range);
}

/* A force; with -contact_eps that of two such bodies is the sum */
static PetscReal repulsive_stiffness(Contact c, const Kind *k)
{
  if (c->repulsive.eps > 0) return k->radius * PetscSqr(c->range) / c->repulsive.eps;
  if (!k->moves) return 0;
  return bear_pull(c, k, c->range, c->repulsive.multiple * 1.5 * k->mass * PetscSqr(k->speed) / c->range);
}

/* The stiffness of a body that is faster than its scale grows with the square of its speed, as the energy does that is
   to be stored */
static PetscReal stiffen(const Kind *k, PetscReal speed)
{
  return speed > k->speed && k->speed > 0 ? k->stiffness * PetscSqr(speed / k->speed) : k->stiffness;
}

static PetscReal repulsive_combine(Contact c, const Kind *i, const Kind *j, PetscReal speed)
{
  if (c->repulsive.eps > 0) return j ? i->stiffness + j->stiffness : 2 * c->repulsive.wall_factor * i->stiffness;
  return j ? PetscMax(stiffen(i, speed), stiffen(j, speed)) : c->repulsive.wall_factor * stiffen(i, speed);
}

/* Overlap in which the force doubles, s r */
static PetscReal overlap_scale(Contact c)
{
  return c->repulsive.eps_overlap > 0 ? PetscSqr(c->range) * c->repulsive.eps_overlap / c->repulsive.eps
                                      : 0.5 * c->range;
}

static PetscReal repulsive_force(Contact c, const Meeting *m, PetscReal *rate)
{
  const PetscReal gap   = m->gap;
  const PetscReal value = m->stiffness * m->weight *
                          (gap >= 0 ? PetscSqr(1 - gap / c->range) : 1 - gap / overlap_scale(c));

  *rate = c->repulsive.damping_speed * m->speed > 0 ? value / (c->repulsive.damping_speed * m->speed) : 0;
  return value;
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

/* -log e of a spring that never pulls, zeta = sin phi up to 1 and cosh psi from there on */
static PetscReal log_loss(PetscReal zeta)
{
  const PetscReal phi = PetscAsinReal(PetscMin(1, zeta)),
                  psi = zeta > 1 ? PetscLogReal(zeta + PetscSqrtReal(zeta * zeta - 1)) : 0;

  if (zeta < 1) return PetscTanReal(phi) * (PETSC_PI - 2 * phi);
  return psi > 0 ? 2 * psi / PetscTanhReal(psi) : 2;
}

void ContactStopPulling(Contact c)
{
  const PetscReal loss = -PetscLogReal(PetscMax(c->spring.restitution, MIN_RESTITUTION));
  PetscReal       low = 0, high = 1 / PetscSqrtReal(MIN_RESTITUTION);

  if (!c->spring.pulls) return;
  for (PetscInt i = 0; i < BISECTIONS; i++) {
    const PetscReal zeta = 0.5 * (low + high);

    if (log_loss(zeta) < loss) low = zeta;
    else high = zeta;
  }
  c->spring.damping_ratio = c->spring.restitution < 1 ? 0.5 * (low + high) : 0;
  c->spring.pulls         = PETSC_FALSE;
}

static PetscErrorCode read_spring(Contact c)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_spring_stiffness", &c->spring.stiffness));
  PetscCall(OptReal("-contact_restitution", &c->spring.restitution));
  PetscCall(OptReal("-contact_friction", &c->spring.friction));
  PetscCall(OptReal("-contact_tangential", &c->spring.tangential));
  c->spring.damping_ratio = 1; /* e = 0: the limit */
  if (c->spring.restitution > 0)
    c->spring.damping_ratio = -PetscLogReal(c->spring.restitution) /
                              PetscSqrtReal(PetscSqr(PETSC_PI) + PetscSqr(PetscLogReal(c->spring.restitution)));
  c->spring.pulls = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal spring_stiffness(Contact c, const Kind *k)
{
  if (c->spring.stiffness > 0) return c->spring.stiffness;
  /* not from the present speed: a spring that softens during a collision would make energy */
  if (!k->moves) return 0;
  return bear_pull(c, k, 1, 4 * k->mass * PetscSqr(PetscMax(k->terminal, c->spring.speed) / c->range));
}

static PetscReal spring_combine(Contact c, const Kind *i, const Kind *j, PetscReal speed)
{
  if (c->cohesion && c->cohesion->law->elastic) {
    const PetscReal mass = j && j->moves && (!i->moves || j->mass < i->mass) ? j->mass : i->mass;

    return CohesionLargestStiffness(c->cohesion, CohesionRadius(i, j), 2 / mass,
                                    PetscMax(speed, PetscMax(i->terminal, j ? j->terminal : 0)));
  }
  return j ? PetscMax(i->stiffness, j->stiffness) : i->stiffness;
}

static PetscReal spring_force(Contact c, const Meeting *m, PetscReal *rate)
{
  *rate = m->inverse_mass > 0
          ? m->weight * 2 * c->spring.damping_ratio * PetscSqrtReal(m->heavier * m->stiffness / m->inverse_mass)
          : 0;
  return m->stiffness * m->weight * (c->range - m->gap);
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

/* The spring is damped by the mean speed of a sub-step: second order. The repulsive law by the speed after it, which
   keeps any damping stable, and comes to the same for a force that is zero where a collision begins and ends. */
static const ContactLaw law_repulsive = {.name      = "repulsive",
                                         .lookahead = 2,
                                         .implicit  = 1,
                                         .options   = read_repulsive,
                                         .stiffness = repulsive_stiffness,
                                         .combine   = repulsive_combine,
                                         .force     = repulsive_force,
                                         .energy    = repulsive_energy,
                                         .time      = repulsive_time};
static const ContactLaw law_spring    = {.name      = "spring",
                                         .lookahead = 1,
                                         .implicit  = 0.5,
                                         .impulses  = PETSC_TRUE,
                                         .options   = read_spring,
                                         .stiffness = spring_stiffness,
                                         .combine   = spring_combine,
                                         .force     = spring_force,
                                         .energy    = spring_energy,
                                         .time      = spring_time};
static const ContactLaw law_none      = {.name = "none"};

const ContactLaw *const contact_laws[] = {&law_repulsive, &law_spring, &law_none, NULL};

PetscErrorCode ContactReadLaws(Contact c)
{
  const char *names[16] = {NULL};
  PetscInt    which     = 0;

  PetscFunctionBeginUser;
  c->range              = 0.5 * c->h;
  c->repulsive.multiple = c->repulsive.wall_factor = 1;
  c->repulsive.damping_speed                       = 0.1;
  c->spring.restitution                            = 0.5;
  c->spring.tangential                             = 2. / 7.;
  for (PetscInt i = 0; contact_laws[i]; i++) names[i] = contact_laws[i]->name;
  PetscCall(OptChoice("-contact_law", names, &which));
  c->law = contact_laws[which];
  PetscCall(OptReal("-contact_range", &c->range));
  if (c->law->options) PetscCall(c->law->options(c));
  c->list.remembers = (PetscBool)(c->spring.friction > 0);
  c->horizon        = c->range;
  PetscCall(OptBool("-contact_lubrication", &c->film.wanted));
  if (!c->film.wanted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(c->law->lookahead, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_lubrication needs a law of contact: give another -contact_law than %s", c->law->name);
  c->film.range = c->h;
  PetscCall(OptReal("-contact_lubrication_range", &c->film.range));
  c->film.roughness = 0.02 * c->film.range;
  PetscCall(OptReal("-contact_roughness", &c->film.roughness));
  PetscCheck(c->film.roughness <= c->film.range, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_roughness %g exceeds -contact_lubrication_range %g, from which on the mesh resolves the film: lower it",
             (double)c->film.roughness, (double)c->film.range);
  c->film.begin = c->film.range;
  c->horizon    = PetscMax(c->range, c->film.begin);
  PetscFunctionReturn(PETSC_SUCCESS);
}
