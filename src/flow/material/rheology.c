/* Rheology: see rheology.h. */
#include "compat.h"
#include "rheology.h"
#include "base/opt.h"
#include "base/runcomm.h"

struct _p_Rheology {
  const char *name;
  void (*law)(const struct _p_Rheology *, PetscReal g, PetscReal *mu, PetscReal *slope);
  PetscReal viscosity, infinity, time, index, yasuda, yield, papanastasiou;
  PetscReal min, max; /* of a power law */
  PetscReal round;    /* e^2 */
  PetscReal whole[2]; /* papanastasiou and max of the options */
};

#define TINY_RATE 1e-12 /* fraction of 1/time below which slopes are those at this rate: slope g^2 is round-off there */

/* ---- laws: mu and (dmu/dg)/g at g > 0 ---- */

static void power(const struct _p_Rheology *r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  const PetscReal square = g * g + r->round;

  *mu    = r->viscosity * PetscPowReal(r->time * PetscSqrtReal(square), r->index - 1);
  *slope = (r->index - 1) * *mu / square;
  if (*mu >= r->min && *mu <= r->max) return;
  *mu    = PetscMin(r->max, PetscMax(r->min, *mu));
  *slope = 0;
}

static void carreau(const struct _p_Rheology *r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  const PetscReal x       = PetscPowReal(r->time * g, r->yasuda);
  const PetscReal varying = (r->viscosity - r->infinity) * PetscPowReal(1 + x, (r->index - 1) / r->yasuda);

  *mu    = r->infinity + varying;
  *slope = varying * (r->index - 1) * x / ((1 + x) * g * g);
}

static void cross(const struct _p_Rheology *r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  const PetscReal x       = PetscPowReal(r->time * g, 1 - r->index);
  const PetscReal varying = (r->viscosity - r->infinity) / (1 + x);

  *mu    = r->infinity + varying;
  *slope = varying * (r->index - 1) * x / ((1 + x) * g * g);
}

/* t_0 (1 - exp(-m g))/g */
static void add_yield(const struct _p_Rheology *r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  const PetscReal x = r->papanastasiou * g, fraction = -expm1(-x) / x; /* of m t_0 */

  *mu += r->yield * r->papanastasiou * fraction;
  /* x exp(-x) - (1 - exp(-x)) loses all digits at small x */
  *slope += x > 1e-4 ? r->yield * (PetscExpReal(-x) - fraction) * r->papanastasiou / (g * g)
                     : r->yield * PetscSqr(r->papanastasiou) * (-0.5 + x / 3) / g;
}

static void bingham(const struct _p_Rheology *r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  *mu    = r->viscosity;
  *slope = 0;
  add_yield(r, g, mu, slope);
}

static void herschel_bulkley(const struct _p_Rheology *r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  power(r, g, mu, slope);
  add_yield(r, g, mu, slope);
}

void RheologyEvaluate(Rheology r, PetscReal g, PetscReal *mu, PetscReal *slope)
{
  PetscReal unused;

  (*r->law)(r, PetscMax(g, TINY_RATE / r->time), mu, slope ? slope : &unused);
}

/* ---- options ---- */

typedef enum {
  NEWTON,
  POWER_LAW,
  CARREAU,
  CROSS,
  BINGHAM,
  HERSCHEL_BULKLEY,
  OLDROYD_B,
  GIESEKUS,
  FENE_P,
  SMAGORINSKY,
  WALE
} Law;

static const char *const LAWS[] = {"newton",    "power_law", "carreau", "cross",       "bingham", "herschel_bulkley",
                                   "oldroyd_b", "giesekus",  "fene_p",  "smagorinsky", "wale",    NULL};

/* Error: an option is missing for which no default could stand */
static PetscErrorCode require(Rheology r, const char option[])
{
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(OptHas(option, &given));
  PetscCheck(given, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -flow_rheology %s needs %s: give it, or use -flow_rheology newton", r->name, option);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* e of the power of the rate by its limits */
static void round_power(Rheology r)
{
  const PetscReal at_rest = r->index < 1 ? r->max : r->min;

  if (r->index != 1) r->round = PetscSqr(PetscPowReal(at_rest / r->viscosity, 1 / (r->index - 1)) / r->time);
}

/* Limits of a power of the rate */
static PetscErrorCode read_power(Rheology r)
{
  PetscReal limits[2] = {1e-3, 1e3};

  PetscFunctionBeginUser;
  PetscCall(OptRealArray("-flow_rheology_viscosity_bounds", 2, limits, NULL));
  PetscCheck(limits[0] < 1 && limits[1] > 1, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -flow_rheology_viscosity_bounds %g,%g: least and largest viscosity in multiples of -flow_viscosity, which is to lie between them: give a number below 1 and "
             "one above 1, such as 1e-3,1e3",
             (double)limits[0], (double)limits[1]);
  r->min = limits[0] * r->viscosity;
  r->max = limits[1] * r->viscosity;
  round_power(r);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_bounded(Rheology r, PetscBool yasuda)
{
  PetscFunctionBeginUser;
  PetscCheck(yasuda || r->index < 1, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -flow_rheology_index %g: a Cross fluid falls from -flow_viscosity to -flow_rheology_viscosity_infinity, with an index from 0 to below 1: lower it, "
             "or use -flow_rheology carreau or power_law",
             (double)r->index);
  PetscCall(OptReal("-flow_rheology_viscosity_infinity", &r->infinity));
  if (yasuda) PetscCall(OptReal("-flow_rheology_yasuda", &r->yasuda));
  PetscCheck(r->infinity < r->viscosity || r->index >= 1, RunComm(), PETSC_ERR_USER_INPUT,
             "Option -flow_rheology_viscosity_infinity %g: it must be below -flow_viscosity %g, the viscosity at rest, for -flow_rheology_index %g: lower it, or raise "
             "-flow_viscosity",
             (double)r->infinity, (double)r->viscosity, (double)r->index);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode read_yield(Rheology r)
{
  PetscReal rigid = 1000;

  PetscFunctionBeginUser;
  PetscCall(require(r, "-flow_rheology_yield"));
  PetscCall(OptReal("-flow_rheology_yield", &r->yield));
  PetscCall(OptReal("-flow_rheology_papanastasiou", &r->papanastasiou));
  if (r->papanastasiou > 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OptReal("-flow_rheology_max_viscosity_ratio", &rigid));
  r->papanastasiou = rigid * r->viscosity / r->yield;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RheologyCreate(PetscReal viscosity, Rheology *rheology, Polymer *polymer, Eddy *eddy)
{
  static void (*const laws[])(const struct _p_Rheology *, PetscReal, PetscReal *,
                              PetscReal *) = {NULL, power, carreau, cross, bingham, herschel_bulkley};
  PetscInt  law                            = NEWTON;
  PetscReal time                           = 1;
  Rheology  r;

  PetscFunctionBeginUser;
  *rheology = NULL;
  PetscCall(OptChoice("-flow_rheology", LAWS, &law));
  *polymer = (Polymer){0};
  *eddy    = (Eddy){0};
  if (law >= SMAGORINSKY) {
    PetscCall(EddyCreate(LAWS[law], eddy));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (law != NEWTON && law != BINGHAM) PetscCall(OptReal("-flow_rheology_time", &time));
  if (law >= OLDROYD_B) PetscCall(PolymerCreate(LAWS[law], viscosity, time, polymer));
  if (law == NEWTON || law >= OLDROYD_B) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&r));
  r->name      = LAWS[law];
  r->law       = laws[law];
  r->viscosity = viscosity;
  r->time      = time;
  r->index     = 1;
  r->yasuda    = 2;
  if (law != BINGHAM) {
    PetscCall(require(r, "-flow_rheology_index"));
    PetscCall(OptReal("-flow_rheology_index", &r->index));
  }
  if (law == POWER_LAW || law == HERSCHEL_BULKLEY) PetscCall(read_power(r));
  if (law == CARREAU || law == CROSS) PetscCall(read_bounded(r, (PetscBool)(law == CARREAU)));
  if (law == BINGHAM || law == HERSCHEL_BULKLEY) PetscCall(read_yield(r));
  r->whole[0] = r->papanastasiou;
  r->whole[1] = r->max;
  *rheology   = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RheologySetRegularisation(Rheology r, PetscReal rigid, PetscBool *less)
{
  PetscReal m;

  PetscFunctionBeginUser;
  *less = PETSC_FALSE;
  if (r && r->yield > 0) {
    m                = rigid * r->viscosity / r->yield;
    *less            = (PetscBool)(m < r->whole[0]);
    r->papanastasiou = PetscMin(m, r->whole[0]);
  }
  if (r && r->max > 0 && r->index < 1) {
    *less  = (PetscBool)(*less || rigid * r->viscosity < r->whole[1]);
    r->max = PetscMin(rigid * r->viscosity, r->whole[1]);
    round_power(r);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool RheologyHasYield(Rheology r)
{
  return (PetscBool)(r && r->yield > 0);
}

PetscErrorCode RheologyDestroy(Rheology *rheology)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*rheology));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RheologyView(Rheology r, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  rheology: %s", r->name));
  if (r->law != bingham)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", index %g, time %g", (double)r->index, (double)r->time));
  if (r->law == carreau) PetscCall(PetscViewerASCIIPrintf(viewer, ", exponent a %g", (double)r->yasuda));
  if (r->law == carreau || r->law == cross)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", viscosity at infinity %g", (double)r->infinity));
  if (r->max > 0) PetscCall(PetscViewerASCIIPrintf(viewer, ", power within %g and %g", (double)r->min, (double)r->max));
  if (r->yield > 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, ", yield stress %g regularised with m = %g (viscosity at rest %g)",
                                     (double)r->yield, (double)r->papanastasiou,
                                     (double)(r->yield * r->papanastasiou)));
  PetscCall(PetscViewerASCIIPrintf(viewer, "; stress in symmetric form\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}
