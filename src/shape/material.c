/* What the particles of a group are made of. See include/shape/material.h. */
#include "compat.h"
#include "shape/material.h"
#include "base/algebra.h"
#include "base/expr.h"
#include "base/opt.h"

#define MAX_GROUPS 257

PetscErrorCode MaterialRead(const char group[], Material *material)
{
  static const char *const WORDS[] = {"rigid", "neo_hookean", "st_venant_kirchhoff", "membrane", "fluid", NULL};
  char                     name[OPT_NAME];
  PetscInt                 index = MATERIAL_RIGID;

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_material", name), WORDS, &index));
  *material = (Material)index;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleListGroups(Material first, Material last, PetscInt *n, ParticleGroup *group[])
{
  char    *list[MAX_GROUPS];
  PetscInt all = MAX_GROUPS;

  PetscFunctionBeginUser;
  PetscCall(OptStringArray("-particle_groups", &all, list));
  PetscCall(PetscCalloc1(all, group));
  *n = 0;
  for (PetscInt g = 0; g < all; g++) {
    ParticleGroup *to = *group + *n;

    PetscCall(MaterialRead(list[g], &to->material));
    PetscCall(PetscStrncpy(to->name, list[g], sizeof(to->name)));
    *n += to->material >= first && to->material <= last;
    PetscCall(PetscFree(list[g]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleCreateShape(const char group[], PetscInt dim, Shape *shape)
{
  char name[OPT_NAME], type[64] = "", prefix[128];

  PetscFunctionBeginUser;
  PetscCall(OptString(OptJoin("-particle_", group, "_shape", name), type, sizeof(type)));
  PetscCheck(type[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no shape: give %s", group, name);
  (void)snprintf(prefix, sizeof(prefix), "particle_%s_", group);
  PetscCall(ShapeCreate(type, prefix, dim, shape));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleReadPosition(const char group[], const char what[], PetscInt dim, PetscReal x[],
                                    PetscReal *angle)
{
  char      name[OPT_NAME];
  PetscInt  place = PLACE_SINGLE;
  PetscBool found;

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_place", name), PLACE_NAMES, &place));
  PetscCheck(place == PLACE_SINGLE, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s %s: %s are placed one a group, at -particle_%s_position: remove it, or give each its own group", name,
             PLACE_NAMES[place], what, group);
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_position", name), dim, x, &found));
  PetscCheck(found, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no position: give %s", group, name);
  *angle = 0;
  PetscCall(OptReal(OptJoin("-particle_", group, "_angle", name), angle));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleReadTurn(const char group[], PetscReal axis[3], PetscBool *has_axis, PetscReal q[4],
                                PetscBool *has_q)
{
  char      name[OPT_NAME];
  PetscReal length;

  PetscFunctionBeginUser;
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_axis", name), 3, axis, has_axis));
  length = PetscSqrtReal(dot3(axis, axis));
  PetscCheck(length > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s has no length: give an axis that is not zero",
             name);
  for (PetscInt a = 0; a < 3; a++) axis[a] /= length;
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_quaternion", name), 4, q, has_q));
  PetscCheck(q[0] != 0 || q[1] != 0 || q[2] != 0 || q[3] != 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s is zero: give w,x,y,z with w = cos(a/2) and x,y,z = sin(a/2) times the axis", name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- many ---- */

/* Velocities at the start, the same for all, to base; *moves: some are given */
static PetscErrorCode read_velocities(const char group[], const char what[], PetscInt dim, Placement *base,
                                      PetscBool *moves)
{
  const char *const word[] = {"given", "fluid", NULL};
  char              name[2][OPT_NAME], start[OPT_NAME];
  PetscInt          with_fluid = 0;
  PetscBool         has[2], said;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    const PetscInt n    = i && dim == 2 ? 1 : dim;
    Expr           expr = NULL;

    PetscCall(ExprRead(OptJoin("-particle_", group, i ? "_angular_velocity" : "_velocity", name[i]), dim, n,
                       i ? base->omega + 3 - n : base->u, &expr, &has[i]));
    PetscCheck(!expr, PETSC_COMM_SELF, PETSC_ERR_SUP,
               "%s %s: the motion of %s is not prescribed: give numbers, with which group '%s' starts", name[i],
               ExprText(expr), what, group);
  }
  *moves = (PetscBool)(has[0] || has[1]);
  PetscCall(OptHas(OptJoin("-particle_", group, "_initial_velocity", start), &said));
  PetscCall(OptChoice(start, word, &with_fluid));
  PetscCheck(!*moves || !with_fluid, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s fluid sets the velocities at the start, and %s gives one: remove one of them", start, name[!has[0]]);
  *moves = (PetscBool)(*moves || (said && !with_fluid));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_table(const char group[], PetscInt dim, const Placement *base, PetscInt *n, Placement **p,
                                 PetscBool *moves)
{
  char      name[OPT_NAME], file[PETSC_MAX_PATH_LEN] = "";
  PetscBool sizes, densities, angles;

  PetscFunctionBeginUser;
  PetscCall(OptString(OptJoin("-particle_", group, "_table", name), file, sizeof(file)));
  PetscCheck(file[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "Group '%s' has no table: give %s", group, name);
  PetscCall(PlaceTable(file, dim, base, n, p, &sizes, &densities, &angles));
  PetscCheck(!sizes && !densities, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "The table %s gives sizes or densities, and particles of group '%s' are all alike: remove these columns, or give each kind its own group",
             file, group);
  for (PetscInt i = 0; i < *n; i++)
    for (PetscInt a = 0; a < 3; a++) *moves = (PetscBool)(*moves || (*p)[i].u[a] != 0 || (*p)[i].omega[a] != 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode place_on_lattice(const PlaceBox *box, PetscInt n, Placement p[])
{
  PetscInt split[3];

  PetscFunctionBeginUser;
  PetscCall(PlaceLattice(box, n, split));
  for (PetscInt i = 0; i < n; i++) PlaceOnLattice(box, split, n, i, p[i].x);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Those of place lattice and random, in a box of their own or the domain */
static PetscErrorCode place_many(const char group[], PetscBool random, PlaceBox *box, const Placement *base,
                                 const ParticlesPlaced *placed, PetscInt *n, Placement **p)
{
  char      name[OPT_NAME];
  PetscReal lower[3], upper[3];
  PetscInt  seed = 0;

  PetscFunctionBeginUser;
  *n = 1;
  PetscCall(PetscArraycpy(lower, box->lower, 3));
  PetscCall(PetscArraycpy(upper, box->upper, 3));
  PetscCall(OptInt(OptJoin("-particle_", group, "_count", name), n));
  PetscCheck(*n > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "%s is %" PetscInt_FMT ": it is to be one at least", name,
             *n);
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_lower", name), box->dim, lower, NULL));
  PetscCall(OptRealArray(OptJoin("-particle_", group, "_upper", name), box->dim, upper, NULL));
  PetscCall(OptReal(OptJoin("-particle_", group, "_margin", name), &box->margin));
  PetscCall(OptInt(OptJoin("-particle_", group, "_seed", name), &seed));
  box->lower = lower;
  box->upper = upper;
  PetscCall(PetscMalloc1(*n, p));
  for (PetscInt i = 0; i < *n; i++) (*p)[i] = *base;
  if (random) PetscCall(PlaceRandom(box, seed, placed, *n, *p));
  else PetscCall(place_on_lattice(box, *n, *p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ParticleReadPlacements(const char group[], const char what[], PetscInt dim, PetscReal radius,
                                      const PetscReal lower[3], const PetscReal upper[3], ParticlesPlaced *placed,
                                      PetscInt *n, Placement **p, PetscBool *moves)
{
  char      name[OPT_NAME];
  PetscInt  place = PLACE_SINGLE;
  Placement base  = {.scale = 1, .density = 1};
  PlaceBox  box   = {.name = group, .dim = dim, .lower = lower, .upper = upper, .radius = radius};

  PetscFunctionBeginUser;
  PetscCall(OptChoice(OptJoin("-particle_", group, "_place", name), PLACE_NAMES, &place));
  PetscCheck(place != PLACE_PACK, PETSC_COMM_SELF, PETSC_ERR_SUP,
             "%s pack is for rigid bodies, not %s: use lattice or random", name, what);
  PetscCall(read_velocities(group, what, dim, &base, moves));
  if (place == PLACE_SINGLE) {
    PetscCall(PetscMalloc1(1, p));
    **p = base;
    *n  = 1;
    PetscCall(ParticleReadPosition(group, what, dim, (*p)->x, &(*p)->angle));
  } else {
    PetscCall(OptReal(OptJoin("-particle_", group, "_angle", name), &base.angle));
    if (place == PLACE_TABLE) PetscCall(read_table(group, dim, &base, n, p, moves));
    else PetscCall(place_many(group, (PetscBool)(place == PLACE_RANDOM), &box, &base, placed, n, p));
  }
  PetscCall(ParticlesPlacedAdd(placed, radius, *n, *p));
  PetscFunctionReturn(PETSC_SUCCESS);
}
