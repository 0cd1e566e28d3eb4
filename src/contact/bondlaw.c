/* Contact, laws of bonds: stiffness and strength (see contact/bonds.h). The forces of all laws are those of
   bondforce.c.

   Parallel, in space: A = pi R^2, I = pi R^4/4, J = pi R^4/2; in the plane a strip of unit depth and width 2 R: A = 2
   R,
   I = 2 R^3/3. */
#include "compat.h"
#include "bond.h"
#include "base/opt.h"

const char *const BOND_CAUSES[] = {"start", "contact", "tension", "shear", "moment", "energy", "time", "left"};

/* ---- spring ---- */

static PetscErrorCode read_spring(Bonds b)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_bond_stiffness", &b->par.stiffness));
  PetscCheck(b->par.stiffness > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_law spring needs -contact_bond_stiffness: the force that parts the ends of a bond by a unit of length");
  PetscCall(OptReal("-contact_bond_tangential", &b->par.tangential));
  PetscCall(OptReal("-contact_bond_bending", &b->par.bending));
  PetscCall(OptReal("-contact_bond_twisting", &b->par.twisting));
  PetscCall(OptReal("-contact_bond_moment", &b->strength.moment));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void spring_stiffness(const struct _p_Bonds *b, PetscInt dim, const BondRecord *r, PetscReal k[4])
{
  (void)dim;
  (void)r;
  k[0] = b->par.stiffness;
  k[1] = b->par.stiffness * b->par.tangential;
  k[2] = b->par.twisting;
  k[3] = b->par.bending;
}

static void spring_stress(PetscInt dim, const BondRecord *r, PetscReal *tension, PetscReal *shear)
{
  (void)dim;
  *tension = r->mean[0];
  *shear   = r->mean[1];
}

/* ---- parallel ---- */

static PetscErrorCode read_parallel(Bonds b)
{
  PetscFunctionBeginUser;
  PetscCall(OptReal("-contact_bond_young", &b->par.young));
  PetscCheck(b->par.young > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_law parallel needs -contact_bond_young: Young's modulus of the bonds");
  PetscCall(OptReal("-contact_bond_ratio", &b->par.ratio));
  PetscCall(OptReal("-contact_bond_radius", &b->par.radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Area, second moment of area, polar one, distance of the rim: of the cross-section */
static void get_section(PetscInt dim, PetscReal R, PetscReal *area, PetscReal *second, PetscReal *polar)
{
  *area   = dim == 3 ? PETSC_PI * R * R : 2 * R;
  *second = dim == 3 ? PETSC_PI * R * R * R * R / 4 : 2 * R * R * R / 3;
  *polar  = PETSC_PI * R * R * R * R / 2;
}

static void parallel_stiffness(const struct _p_Bonds *b, PetscInt dim, const BondRecord *r, PetscReal k[4])
{
  const PetscReal unit = b->par.young / r->length;
  PetscReal       area, second, polar;

  get_section(dim, r->radius, &area, &second, &polar);
  k[0] = unit * area;
  k[1] = unit * area / b->par.ratio;
  k[2] = unit * polar / b->par.ratio;
  k[3] = unit * second;
}

static void parallel_stress(PetscInt dim, const BondRecord *r, PetscReal *tension, PetscReal *shear)
{
  PetscReal area, second, polar;

  get_section(dim, r->radius, &area, &second, &polar);
  *tension = r->mean[0] / area + r->mean[3] * r->radius / second;
  *shear   = r->mean[1] / area + (dim == 3 ? PetscAbsReal(r->mean[2]) * r->radius / polar : 0);
}

/* ---- the registry ---- */

static const BondLaw law_spring   = {"spring", read_spring, spring_stiffness, spring_stress};
static const BondLaw law_parallel = {"parallel", read_parallel, parallel_stiffness, parallel_stress};

static const BondLaw *const LAWS[]  = {NULL, &law_spring, &law_parallel};
static const char *const    NAMES[] = {"none", "spring", "parallel", NULL};

PetscErrorCode BondReadLaw(Bonds b, PetscBool *wanted)
{
  PetscInt      which = 0;
  BondStrength *s     = &b->strength;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-contact_bond_law", NAMES, &which));
  *wanted = (PetscBool)(which > 0);
  if (!*wanted) PetscFunctionReturn(PETSC_SUCCESS);
  b->law = LAWS[which];
  b->par = (BondParameters){.ratio = 1, .radius = 1, .tangential = 1};
  *s     = (BondStrength){.tension  = PETSC_MAX_REAL,
                          .shear    = PETSC_MAX_REAL,
                          .moment   = PETSC_MAX_REAL,
                          .energy   = PETSC_MAX_REAL,
                          .lifetime = PETSC_MAX_REAL};
  PetscCall((*b->law->options)(b));
  PetscCall(OptReal("-contact_bond_damping", &b->par.damping));
  PetscCall(OptReal("-contact_bond_tension", &s->tension));
  PetscCall(OptReal("-contact_bond_shear", &s->shear));
  PetscCall(OptReal("-contact_bond_friction", &s->friction));
  PetscCheck(s->friction <= 0 || s->shear < PETSC_MAX_REAL, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "-contact_bond_friction %g raises -contact_bond_shear with the pressure: give that too",
             (double)s->friction);
  PetscCall(OptReal("-contact_bond_energy", &s->energy));
  PetscCall(OptReal("-contact_bond_lifetime", &s->lifetime));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool BondBreaks(const struct _p_Bonds *b, PetscInt dim, const BondRecord *r, PetscReal time, BondCause *cause)
{
  const BondStrength *s = &b->strength;
  PetscReal           tension, shear, mean, area, second, polar;

  (*b->law->stress)(dim, r, &tension, &shear);
  get_section(dim, r->radius, &area, &second, &polar);
  mean = b->law == &law_parallel ? r->mean[0] / area : r->mean[0]; /* that presses the whole section */
  if (tension > s->tension) *cause = BOND_TENSION;
  else if (s->shear < PETSC_MAX_REAL && shear > s->shear - s->friction * mean) *cause = BOND_SHEAR;
  else if (PetscMax(PetscAbsReal(r->mean[2]), r->mean[3]) > s->moment) *cause = BOND_MOMENT;
  else if (r->stored > s->energy) *cause = BOND_ENERGY;
  else if (time - r->formed > s->lifetime) *cause = BOND_TIME;
  else return PETSC_FALSE;
  return PETSC_TRUE;
}
