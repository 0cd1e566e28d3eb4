/* Contact, laws of cohesion (see cohesion.h), attraction of like bodies whose surfaces are s apart.

   van_der_waals, in space A R/(6 h^2) (Hamaker 1937; two equal spheres of radius a: A a/(12 h^2)), in the plane of two
     cylinders, a unit of length, A sqrt(R)/(8 sqrt(2) h^(5/2)) (Israelachvili 2011), with h the separation, but at
     least the cut-off, below which surfaces touch. Beyond -contact_cohesion_range there is none.
   jkr (Johnson, Kendall, Roberts 1971): with the radius a of the area of contact, E* = E/(2 (1 - nu^2)) and the work of
     adhesion w = 2 surface energies,
       F = 4 E* a^3/(3 R) - sqrt(8 pi w E* a^3),   -s = a^2/R - sqrt(2 pi w a/E*).
     A contact forms at s = 0, where it pulls with 8/9 of the largest pull 1.5 pi w R, and tears where s grows no more
     with a: both jumps take energy (Thornton & Ning 1998). It is the repulsion of the pair as well.
   dmt (Derjaguin, Muller, Toporov 1975): Hertz' 4/3 E* sqrt(R) (-s)^(3/2) less 2 pi w R, and beyond contact
     2 pi w R (z/(z + s))^2 with z the cut-off (0: nothing there), which is the van der Waals attraction of w = A/(12 pi
     z^2).
   bridge, in space (Willett, Adams, Johnson, Seville 2000, Langmuir 16, 9396, closed form for small volumes):
       F = 4 pi R T cos(theta)/(1 + 2.1 x + 10 x^2),   x = s/2 sqrt(2 R/V),
     up to (1 + theta/2)(V^(1/3) + V^(2/3)/(20 R)) (Lian 1993; Willett 2000). In the plane, for thin ones, the pressure
     2 T cos(theta)/H(b) in the meniscus at the half-width b of a gap H(x) = s + x^2/(2 R): F = 4 T cos(theta) b/H(b),
     2 b s + b^3/(3 R) = V; up to (1 + theta/2) sqrt(V). It forms where bodies touch. Viscosity and flow of the liquid
     are not in it, nor is its mass.

   In the plane jkr and dmt have no force of their own: how far two cylinders approach depends on the bodies' far sides
   (its logarithm), and the pull of a thin zone on its thickness. */
#include "compat.h"
#include "cohesion.h"
#include "base/opt.h"

#define RANGE   50 /* of attracting surfaces, in cut-offs */
#define POISSON 0.3
#define FAST    15 /* four sticking speeds, of sqrt(14.18) each */
#define NEWTON  60 /* steps at most, of which some ten are taken */

/* ---- van der Waals ---- */

static PetscErrorCode read_surfaces(Cohesion c)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_cohesion_cutoff", &c->cutoff));
  c->range = RANGE * c->cutoff;
  if (c->cutoff > 0) PetscCall(OptReal("-contact_cohesion_range", &c->range));
  PetscCheck(c->range >= c->cutoff, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion_range %g is below -contact_cohesion_cutoff %g, from which on the attraction falls: raise it",
             (double)c->range, (double)c->cutoff);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_van_der_waals(Cohesion c)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_cohesion_hamaker", &c->hamaker));
  PetscCall(read_surfaces(c));
  PetscCheck(c->hamaker > 0 && c->cutoff > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion van_der_waals needs -contact_cohesion_hamaker and -contact_cohesion_cutoff: Hamaker's constant and the separation below which the attraction grows no more");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal van_der_waals_pull(const struct _p_Cohesion *c, PetscReal R)
{
  if (c->dim == 3) return c->hamaker * R / (6 * PetscSqr(c->cutoff));
  return c->hamaker * PetscSqrtReal(R) / (8 * PetscSqrtReal(2) * PetscPowReal(c->cutoff, 2.5));
}

static PetscReal van_der_waals_force(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  return -van_der_waals_pull(c, R) * (s <= c->cutoff ? 1 : PetscPowReal(c->cutoff / s, c->dim == 3 ? 2 : 2.5));
}

/* Work of the attraction from h >= cut-off to far away */
static PetscReal van_der_waals_depth(const struct _p_Cohesion *c, PetscReal R, PetscReal h)
{
  const PetscReal power = c->dim == 3 ? 1 : 1.5;

  return van_der_waals_pull(c, R) * c->cutoff / power * PetscPowReal(c->cutoff / h, power);
}

static PetscReal van_der_waals_energy(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  return van_der_waals_depth(c, R, c->range) - van_der_waals_depth(c, R, PetscMax(s, c->cutoff)) -
         van_der_waals_pull(c, R) * PetscMax(0, c->cutoff - s);
}

static PetscReal surfaces_reach(const struct _p_Cohesion *c, PetscReal R)
{
  (void)R;
  return c->range;
}

static PetscReal van_der_waals_slope(const struct _p_Cohesion *c, PetscReal R)
{
  return (c->dim == 3 ? 2 : 2.5) * van_der_waals_pull(c, R) / c->cutoff;
}

/* ---- jkr ---- */

static PetscErrorCode read_elastic(Cohesion c)
{
  PetscReal surface = 0, young = 0, poisson = POISSON;

  PetscFunctionBeginUser;
  PetscCheck(c->dim == 3, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion %s is for bodies in space: in the plane the approach of two cylinders depends on their far sides. Give -contact_cohesion van_der_waals or bridge",
             c->law->name);
  PetscCall(OptReal("-contact_cohesion_surface_energy", &surface));
  PetscCall(OptReal("-contact_cohesion_young", &young));
  PetscCall(OptReal("-contact_cohesion_poisson", &poisson));
  PetscCheck(surface > 0 && young > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion %s needs -contact_cohesion_surface_energy and -contact_cohesion_young: of the bodies",
             c->law->name);
  c->adhesion = 2 * surface;
  c->modulus  = young / (2 * (1 - PetscSqr(poisson)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* -s = x^4/R - c x with x = sqrt(a): c, and the x at which it is least */
static PetscReal jkr_stretch(const struct _p_Cohesion *c)
{
  return PetscSqrtReal(2 * PETSC_PI * c->adhesion / c->modulus);
}

static PetscReal jkr_smallest(const struct _p_Cohesion *c, PetscReal R)
{
  return PetscPowReal(0.25 * R * jkr_stretch(c), 1. / 3);
}

static PetscReal jkr_reach(const struct _p_Cohesion *c, PetscReal R)
{
  const PetscReal x = jkr_smallest(c, R);

  return 3 * PetscPowRealInt(x, 4) / R;
}

/* sqrt(a), by Newton's method from above, where the curve is convex */
static PetscReal jkr_root(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  const PetscReal stretch = jkr_stretch(c), smallest = jkr_smallest(c, R), target = PetscMax(-s, -jkr_reach(c, R));
  PetscReal       x = PetscPowReal(R * stretch + PetscPowReal(R * PetscMax(0, target), 0.75), 1. / 3);

  x = PetscMax(x, PetscPowReal(2 * R * PetscMax(0, target), 0.25)) + smallest;
  for (PetscInt i = 0; i < NEWTON; i++) {
    const PetscReal slope = 4 * x * x * x / R - stretch,
                    step  = (PetscPowRealInt(x, 4) / R - stretch * x - target) / slope;

    if (!(slope > 0) || x - step <= smallest) return x - step <= smallest ? smallest : x;
    x -= step;
    if (PetscAbsReal(step) < 1e-15 * x) break;
  }
  return x;
}

static PetscReal jkr_force(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  const PetscReal x = jkr_root(c, R, s);

  return 4 * c->modulus * PetscPowRealInt(x, 6) / (3 * R) -
         PetscSqrtReal(8 * PETSC_PI * c->adhesion * c->modulus) * PetscPowRealInt(x, 3);
}

/* Integral of F d(-s) up to a = x^2 */
static PetscReal jkr_work(const struct _p_Cohesion *c, PetscReal R, PetscReal x)
{
  const PetscReal alpha = 4 * c->modulus / (3 * R), beta = PetscSqrtReal(8 * PETSC_PI * c->adhesion * c->modulus),
                  stretch = jkr_stretch(c);

  return 0.4 * alpha / R * PetscPowRealInt(x, 10) -
         (0.5 * alpha * stretch + 2 * beta / R) / 3.5 * PetscPowRealInt(x, 7) +
         0.25 * beta * stretch * PetscPowRealInt(x, 4);
}

static PetscReal jkr_energy(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  return jkr_work(c, R, jkr_root(c, R, s)) - jkr_work(c, R, jkr_smallest(c, R));
}

static PetscReal jkr_pull(const struct _p_Cohesion *c, PetscReal R)
{
  return 1.5 * PETSC_PI * c->adhesion * R;
}

/* Of the area that carries no load */
static PetscReal rest_stiffness(const struct _p_Cohesion *c, PetscReal R)
{
  return 2 * c->modulus * PetscPowReal(4.5 * PETSC_PI * c->adhesion * R * R / c->modulus, 1. / 3);
}

/* ---- dmt ---- */

static PetscErrorCode read_dmt(Cohesion c)
{
  PetscFunctionBeginUser;
  PetscCall(read_elastic(c));
  PetscCall(read_surfaces(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal dmt_pull(const struct _p_Cohesion *c, PetscReal R)
{
  return 2 * PETSC_PI * c->adhesion * R;
}

static PetscReal dmt_force(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  if (s > 0) return c->cutoff > 0 ? -dmt_pull(c, R) * PetscSqr(c->cutoff / (c->cutoff + s)) : 0;
  return 4. / 3 * c->modulus * PetscSqrtReal(R) * PetscPowReal(-s, 1.5) - dmt_pull(c, R);
}

static PetscReal dmt_energy(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  const PetscReal z = c->cutoff, far = z > 0 ? z * z / (z + c->range) : 0;

  if (s > 0) return z > 0 ? dmt_pull(c, R) * (far - z * z / (z + s)) : 0;
  return 8. / 15 * c->modulus * PetscSqrtReal(R) * PetscPowReal(-s, 2.5) + dmt_pull(c, R) * (far - z + s);
}

static PetscReal dmt_slope(const struct _p_Cohesion *c, PetscReal R)
{
  return PetscMax(rest_stiffness(c, R), c->cutoff > 0 ? 2 * dmt_pull(c, R) / c->cutoff : 0);
}

/* ---- liquid bridges ---- */

static PetscErrorCode read_bridge(Cohesion c)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_cohesion_tension", &c->tension));
  PetscCall(OptReal("-contact_cohesion_volume", &c->volume));
  PetscCall(OptReal("-contact_cohesion_angle", &c->angle));
  PetscCall(OptReal("-contact_cohesion_rupture", &c->rupture));
  PetscCheck(c->tension > 0 && c->volume > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion bridge needs -contact_cohesion_tension and -contact_cohesion_volume: surface tension, and volume of liquid between two bodies (in the plane a unit of depth)");
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal bridge_reach(const struct _p_Cohesion *c, PetscReal R)
{
  const PetscReal root = PetscPowReal(c->volume, 1. / 3);

  if (c->rupture > 0) return c->rupture;
  if (c->dim == 2) return (1 + 0.5 * c->angle) * PetscSqrtReal(c->volume);
  return (1 + 0.5 * c->angle) * (root + root * root / (20 * R));
}

/* Half-width of a bridge in the plane: 2 b s + b^3/(3 R) = V, growing and convex in b */
static PetscReal bridge_width(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  PetscReal b = PetscPowReal(3 * R * c->volume, 1. / 3);

  for (PetscInt i = 0; i < NEWTON; i++) {
    const PetscReal step = (2 * b * s + b * b * b / (3 * R) - c->volume) / (2 * s + b * b / R);

    b -= step;
    if (PetscAbsReal(step) < 1e-15 * b) break;
  }
  return b;
}

/* (1 + a x + b x^2), x = s/(2 length) */
#define WILLETT_A 2.1
#define WILLETT_B 10.

static PetscReal bridge_length(const struct _p_Cohesion *c, PetscReal R)
{
  return PetscSqrtReal(c->volume / (2 * R));
}

static PetscReal bridge_force(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  const PetscReal wets = c->tension * PetscCosReal(c->angle), apart = PetscMax(s, 0);
  PetscReal       x = 0.5 * apart / bridge_length(c, R), b;

  if (c->dim == 3) return -4 * PETSC_PI * R * wets / (1 + WILLETT_A * x + WILLETT_B * x * x);
  b = bridge_width(c, R, apart);
  return -4 * wets * b / (apart + b * b / (2 * R));
}

static PetscReal bridge_pull(const struct _p_Cohesion *c, PetscReal R)
{
  return -bridge_force(c, R, 0);
}

static PetscReal bridge_integral(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  const PetscReal root = PetscSqrtReal(4 * WILLETT_B - PetscSqr(WILLETT_A)), x = 0.5 * s / bridge_length(c, R);

  return 4 * bridge_length(c, R) / root * PetscAtanReal((2 * WILLETT_B * x + WILLETT_A) / root);
}

static PetscReal bridge_energy(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  const PetscReal reach = bridge_reach(c, R), apart = PetscMax(s, 0), inside = bridge_pull(c, R) * PetscMin(s, 0);

  if (c->dim == 3) return inside - bridge_pull(c, R) * (bridge_integral(c, R, reach) - bridge_integral(c, R, apart));
  return inside - 4 * c->tension * PetscCosReal(c->angle) * (bridge_width(c, R, apart) - bridge_width(c, R, reach));
}

/* In the plane the pull is flat at s = 0 and falls by some R/b^2 of itself from there on */
static PetscReal bridge_slope(const struct _p_Cohesion *c, PetscReal R)
{
  if (c->dim == 3) return bridge_pull(c, R) * 0.5 * WILLETT_A / bridge_length(c, R);
  return bridge_pull(c, R) * 6 * R / PetscSqr(bridge_width(c, R, 0));
}

/* ---- what is common ---- */

static const CohesionLaw LAWS[] = {{.name    = "van_der_waals",
                                    .options = read_van_der_waals,
                                    .force   = van_der_waals_force,
                                    .energy  = van_der_waals_energy,
                                    .reach   = surfaces_reach,
                                    .pull    = van_der_waals_pull,
                                    .slope   = van_der_waals_slope},
                                   {.name    = "jkr",
                                    .elastic = PETSC_TRUE,
                                    .latches = PETSC_TRUE,
                                    .options = read_elastic,
                                    .force   = jkr_force,
                                    .energy  = jkr_energy,
                                    .reach   = jkr_reach,
                                    .pull    = jkr_pull,
                                    .slope   = rest_stiffness},
                                   {.name    = "dmt",
                                    .elastic = PETSC_TRUE,
                                    .options = read_dmt,
                                    .force   = dmt_force,
                                    .energy  = dmt_energy,
                                    .reach   = surfaces_reach,
                                    .pull    = dmt_pull,
                                    .slope   = dmt_slope},
                                   {.name    = "bridge",
                                    .latches = PETSC_TRUE,
                                    .options = read_bridge,
                                    .force   = bridge_force,
                                    .energy  = bridge_energy,
                                    .reach   = bridge_reach,
                                    .pull    = bridge_pull,
                                    .slope   = bridge_slope}};

/* Work from separation s on, of a pair that holds on or not before: 0 beyond its reach, or where it has not touched */
static PetscReal work_at(const struct _p_Cohesion *c, PetscReal R, PetscReal s, PetscBool holds)
{
  if (holds) return s < (*c->law->reach)(c, R) ? (*c->law->energy)(c, R, s) : 0;
  return s > 0 ? 0 : (*c->law->energy)(c, R, s) - (*c->law->energy)(c, R, 0);
}

PetscReal CohesionMeanForce(const struct _p_Cohesion *c, PetscReal R, PetscReal s, PetscReal s0, PetscReal s1,
                            PetscBool *holds)
{
  const PetscReal low = PetscMin(s0, s1), high = PetscMax(s0, s1), reach = (*c->law->reach)(c, R);
  const PetscBool held = (PetscBool)(!c->law->latches || *holds || s0 <= 0); /* where the way begins */

  *holds = (PetscBool)((held || low <= 0) && s1 < reach);
  if (held ? low >= reach : low > 0) return 0;
  /* jumps and a kink: at the reach, where the pair begins to hold on, and where surfaces touch */
  if (!(high > reach) && !(low < 0 && high > 0)) return (*c->law->force)(c, R, s);
  if (high - low <= 0) return s < reach ? (*c->law->force)(c, R, s) : 0;
  return -(work_at(c, R, s1, held) - work_at(c, R, s0, held)) / (s1 - s0);
}

PetscReal CohesionEnergy(const struct _p_Cohesion *c, PetscReal R, PetscReal s, PetscBool holds)
{
  return work_at(c, R, s, (PetscBool)(holds || s <= 0));
}

PetscReal CohesionStiffness(const struct _p_Cohesion *c, PetscReal R, PetscReal s)
{
  if (c->law->latches) return 2 * c->modulus * PetscSqr(jkr_root(c, R, s));
  return s < 0 ? 2 * c->modulus * PetscSqrtReal(-R * s) : 0;
}

PetscReal CohesionLargestStiffness(const struct _p_Cohesion *c, PetscReal R, PetscReal inverse, PetscReal speed)
{
  /* below some sticking speeds the same: sub-steps that grow as bodies come to rest would not keep the energy */
  const PetscReal smallest = FAST * PetscSqrtReal(inverse) *
                             PetscPowReal(PetscPowRealInt(c->adhesion, 5) * PetscPowRealInt(R, 4) /
                                            PetscSqr(c->modulus),
                                          1. / 6);
  /* Hertz: v^2/(2 inverse) = 8/15 E* sqrt(R) d^(5/2) */
  const PetscReal largest = PetscPowReal(15. / 16 * PetscSqr(PetscMax(speed, smallest)) /
                                           (inverse * c->modulus * PetscSqrtReal(R)),
                                         0.4);

  return PetscSqrtReal(PetscSqr(2 * c->modulus * PetscSqrtReal(R * largest)) + PetscSqr(rest_stiffness(c, R)));
}

/* ---- options ---- */

PetscErrorCode ContactCreateCohesion(Contact c)
{
  const char *names[] = {"none", LAWS[0].name, LAWS[1].name, LAWS[2].name, LAWS[3].name, NULL};
  PetscInt    which   = 0;
  Cohesion    co;

  PetscFunctionBeginUser;
  if (!c->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptChoice("-contact_cohesion", names, &which));
  if (!which) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(c->law->lookahead, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion %s needs a law of contact that bears it: give another -contact_law than %s",
             names[which], c->law->name);
  PetscCheck(!LAWS[which - 1].elastic || c->law->impulses, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion %s is elastic and keeps its energy, which -contact_law %s does not: give -contact_law spring",
             names[which], c->law->name);
  PetscCheck(c->law->impulses || c->repulsive.implicit, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_cohesion %s is solved with the flow: remove -contact_coupling explicit, or give -contact_law spring",
             names[which]);
  PetscCall(PetscNew(&co));
  co->law     = &LAWS[which - 1];
  co->dim     = c->dim;
  c->cohesion = co;
  PetscCall((*co->law->options)(co));
  c->list.remembers = (PetscBool)(c->list.remembers || co->law->latches);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactCheckCohesion(Contact c)
{
  const struct _p_Cohesion *co    = c->cohesion;
  PetscReal                 reach = 0;

  PetscFunctionBeginUser;
  if (!co) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < c->kinds.n; i++) {
    const PetscReal R = c->kinds.kind[i].radius, pull = (*co->law->pull)(co, R);

    reach = PetscMax(reach, PetscMax((*co->law->reach)(co, R), (*co->law->reach)(co, 0.5 * R))); /* wall, like body */
    PetscCheck(co->law->elastic || !c->law->impulses || c->spring.stiffness <= 0 ||
                 pull <= 0.5 * c->spring.stiffness * c->range,
               PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-contact_cohesion %s pulls a body of radius %g to a wall with %g, and -contact_spring_stiffness %g bears that with %g of -contact_range %g: raise the stiffness, at least to %g",
               co->law->name, (double)R, (double)pull, (double)c->spring.stiffness,
               (double)(pull / c->spring.stiffness), (double)c->range, (double)(2 * pull / c->range));
  }
  PetscCall(BodiesMax(c->bodies, 1, &reach));
  c->horizon = PetscMax(c->horizon, c->range + reach);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool ContactHasCohesion(Contact c)
{
  return (PetscBool)(c->cohesion != NULL);
}
