/* Spread: see spread.h.

   Normal and log-normal numbers are cut at the range (three deviations unless it is given) by drawing again. The mean
   and deviation of a log-normal distribution are those of the numbers themselves, not of their logarithms. Random
   orientations are uniform over the angle, in 3D over all rotations (Shoemake 1992, Uniform random rotations). */
#include "compat.h"
#include "spread.h"
#include "base/opt.h"

#define MAX_DRAWS 100000 /* of one number before the range counts as out of reach */
#define CUT       3      /* deviations */

static const char *const spread_names[] = {"same", "uniform", "normal", "lognormal", "bimodal", NULL};
static const char *const turn_names[]   = {"given", "random", NULL};

/* ---- options ---- */

/* Mean and deviation of the logarithm */
static void take_logarithm(const Distribution *d, PetscReal *mean, PetscReal *deviation)
{
  const PetscReal square = PetscLogReal(1 + PetscSqr(d->deviation / d->mean));

  *mean      = PetscLogReal(d->mean) - 0.5 * square;
  *deviation = PetscSqrtReal(square);
}

static void set_default_range(Distribution *d)
{
  PetscReal mean = d->mean, deviation = d->deviation;

  if (d->kind == SPREAD_LOGNORMAL) take_logarithm(d, &mean, &deviation);
  for (PetscInt side = 0; side < 2; side++) {
    const PetscReal at = mean + (side ? CUT : -CUT) * deviation;

    d->range[side] = d->kind == SPREAD_LOGNORMAL ? PetscExpReal(at) : at;
  }
}

/* what: "sizes" or "densities"; choice: the option that names the distribution */
static PetscErrorCode read_distribution(const char group[], const char what[], const char choice[], PetscReal mean,
                                        Distribution *d)
{
  char      option[64], name[OPT_NAME], range[OPT_NAME];
  PetscBool bell, has_range, has_deviation = PETSC_FALSE;

  PetscFunctionBeginUser;
  d->mean   = mean;
  d->weight = 0.5;
  PetscCall(OptChoice(choice, spread_names, &d->kind));
  if (d->kind == SPREAD_SAME) PetscFunctionReturn(PETSC_SUCCESS);
  bell = (PetscBool)(d->kind == SPREAD_NORMAL || d->kind == SPREAD_LOGNORMAL);
  if (bell) {
    (void)snprintf(option, sizeof(option), "_%s_mean", what);
    PetscCall(OptReal(OptJoin("-particle_", group, option, name), &d->mean));
    (void)snprintf(option, sizeof(option), "_%s_deviation", what);
    PetscCall(OptHas(OptJoin("-particle_", group, option, name), &has_deviation));
    PetscCheck(has_deviation, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "-particle_%s_%s %s needs %s, the standard deviation", group, what, spread_names[d->kind], name);
    PetscCall(OptReal(name, &d->deviation));
    set_default_range(d);
  }
  (void)snprintf(option, sizeof(option), "_%s_range", what);
  PetscCall(OptRealArray(OptJoin("-particle_", group, option, range), 2, d->range, &has_range));
  PetscCheck(has_range || bell, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT, "-particle_%s_%s %s needs %s, %s", group, what,
             spread_names[d->kind], range,
             d->kind == SPREAD_BIMODAL ? "the two values" : "the lowest and the highest value");
  PetscCheck(has_range || d->range[0] > 0, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s %g reaches below zero at three deviations from the mean %g: lower it, or cut the distribution by %s",
             name, (double)d->deviation, (double)d->mean, range);
  PetscCheck(d->range[0] > 0 && d->range[1] >= d->range[0], PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "%s %g,%g: both must be positive, the smaller one first", range, (double)d->range[0], (double)d->range[1]);
  (void)snprintf(option, sizeof(option), "_%s_fraction", what);
  if (d->kind == SPREAD_BIMODAL) PetscCall(OptReal(OptJoin("-particle_", group, option, name), &d->weight));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SpreadRead(const char group[], PetscReal density, PetscInt seed, Spread *s)
{
  char     name[OPT_NAME];
  PetscInt turn = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(s, sizeof(*s)));
  PetscCall(read_distribution(group, "sizes", OptJoin("-particle_", group, "_sizes", name), 1, &s->size));
  PetscCall(
    read_distribution(group, "densities", OptJoin("-particle_", group, "_densities", name), density, &s->density));
  PetscCall(OptChoice(OptJoin("-particle_", group, "_orientation", name), turn_names, &turn));
  s->turned        = (PetscBool)(turn == 1);
  s->size.state    = PlaceStream(seed, 1);
  s->density.state = PlaceStream(seed, 2);
  s->state         = PlaceStream(seed, 3);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- numbers ---- */

/* Standard normal (Box & Muller 1958) */
static PetscReal next_normal(PetscInt64 *state)
{
  const PetscReal r     = PetscSqrtReal(-2 * PetscLogReal(1 - PlaceUniform(state))),
                  angle = 2 * PETSC_PI * PlaceUniform(state);

  return r * PetscCosReal(angle);
}

static PetscErrorCode next_value(const char group[], const char what[], Distribution *d, PetscReal *value)
{
  PetscReal mean = d->mean, deviation = d->deviation;

  PetscFunctionBeginUser;
  if (d->kind == SPREAD_SAME) PetscFunctionReturn(PETSC_SUCCESS);
  if (d->kind == SPREAD_UNIFORM) *value = d->range[0] + (d->range[1] - d->range[0]) * PlaceUniform(&d->state);
  if (d->kind == SPREAD_BIMODAL) *value = d->range[PlaceUniform(&d->state) >= d->weight];
  if (d->kind == SPREAD_UNIFORM || d->kind == SPREAD_BIMODAL) PetscFunctionReturn(PETSC_SUCCESS);
  if (d->kind == SPREAD_LOGNORMAL) take_logarithm(d, &mean, &deviation);
  for (PetscInt t = 0; t < MAX_DRAWS; t++) {
    const PetscReal z = mean + deviation * next_normal(&d->state);

    *value = d->kind == SPREAD_LOGNORMAL ? PetscExpReal(z) : z;
    if (*value >= d->range[0] && *value <= d->range[1]) PetscFunctionReturn(PETSC_SUCCESS);
  }
  SETERRQ(PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
          "-particle_%s_%s_range %g,%g lies where the distribution has next to nothing (mean %g, deviation %g): widen it",
          group, what, (double)d->range[0], (double)d->range[1], (double)d->mean, (double)d->deviation);
}

static void next_turn(PetscInt dim, PetscInt64 *state, Placement *p)
{
  if (dim == 2) p->angle = 2 * PETSC_PI * PlaceUniform(state);
  else {
    const PetscReal u = PlaceUniform(state), a = 2 * PETSC_PI * PlaceUniform(state),
                    b = 2 * PETSC_PI * PlaceUniform(state);

    p->turned = PETSC_TRUE;
    p->q[0]   = PetscSqrtReal(u) * PetscCosReal(b);
    p->q[1]   = PetscSqrtReal(1 - u) * PetscSinReal(a);
    p->q[2]   = PetscSqrtReal(1 - u) * PetscCosReal(a);
    p->q[3]   = PetscSqrtReal(u) * PetscSinReal(b);
  }
}

PetscErrorCode SpreadNext(const char group[], PetscInt dim, Spread *s, Placement *p)
{
  PetscFunctionBeginUser;
  PetscCall(next_value(group, "sizes", &s->size, &p->scale));
  PetscCall(next_value(group, "densities", &s->density, &p->density));
  if (s->turned) next_turn(dim, &s->state, p);
  PetscFunctionReturn(PETSC_SUCCESS);
}
