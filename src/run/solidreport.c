/* SolidReport: see solidreport.h. */
#include "compat.h"
#include "solidreport.h"
#include "ellipse.h"

enum {
  OF_X,
  OF_Y,
  OF_U,
  OF_V,
  OF_VOLUME,
  OF_ENERGY,
  OF_STRETCH,
  OF_TAYLOR,
  OF_INCLINATION,
  OF_FORCE_X,
  OF_FORCE_Y,
  OF_KEPT,
  NPLANE,
  OF_Z = NPLANE,
  OF_W,
  OF_FORCE_Z,
  OF_AXIS_X,
  OF_AXIS_Y,
  OF_AXIS_Z,
  OF_AREA,
  OF_TENSION,
  NGROUP
};

static const char *const NAMES[NGROUP] = {"x",       "y",           "u",      "v",           "volume_error",
                                          "energy",  "stretch",     "taylor", "inclination", "force_x",
                                          "force_y", "volume_kept", "z",      "w",           "force_z",
                                          "axis_x",  "axis_y",      "axis_z", "area_error",  "tension"};

/* In space a direction takes the place of the angle */
static PetscBool has_column(const SolidGroup *g, PetscInt dim, PetscInt i)
{
  if (i == OF_AREA) return g->membrane;
  if (i == OF_TENSION) return (PetscBool)(g->material.global > 0);
  if (i == OF_KEPT) return (PetscBool)!g->compressible;
  return (PetscBool)(dim == 2 ? i < NPLANE : i != OF_INCLINATION);
}

struct _p_SolidReport {
  Solids       solids;
  SolidsState *s;
  Couple       couple;
  Monitor      monitor;
  PetscInt (*column)[NGROUP]; /* [ngroups] */
  PetscInt *watch;            /* columns of all watched points, dim each */
  PetscReal worst, kept;      /* largest error of an incompressible volume so far; one that was put right */
};

PetscErrorCode SolidReportCreate(const SimComponents *sim, SolidReport *report)
{
  SolidReport r;
  PetscInt    nwatch = 0;
  char        name[128];

  PetscFunctionBeginUser;
  *report = NULL;
  if (!sim->solids) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&r));
  r->solids  = sim->solids;
  r->couple  = sim->couple;
  r->monitor = sim->monitor;
  PetscCall(SolidsGetState(sim->solids, &r->s));
  PetscCall(PetscMalloc1(r->s->ngroups, &r->column));
  for (PetscInt g = 0; g < r->s->ngroups; g++) nwatch += r->s->group[g].nwatch;
  PetscCall(PetscMalloc1(nwatch * r->s->dim, &r->watch));
  nwatch = 0;
  for (PetscInt g = 0; g < r->s->ngroups; g++) {
    const SolidGroup *group = r->s->group + g;

    for (PetscInt i = 0; i < NGROUP; i++) {
      if (!has_column(group, r->s->dim, i)) continue;
      PetscCall(PetscSNPrintf(name, sizeof(name), "solid_%s_%s", NAMES[i], group->name));
      PetscCall(MonitorAddColumn(r->monitor, name, &r->column[g][i]));
    }
    for (PetscInt w = 0; w < group->nwatch; w++)
      for (PetscInt a = 0; a < r->s->dim; a++) {
        PetscCall(PetscSNPrintf(name, sizeof(name), "watch_%c_%s_%" PetscInt_FMT, (char)('x' + a), group->name, w + 1));
        PetscCall(MonitorAddColumn(r->monitor, name, &r->watch[nwatch++]));
      }
  }
  *report = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidReportDestroy(SolidReport *report)
{
  PetscFunctionBeginUser;
  if (!*report) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*report)->column));
  PetscCall(PetscFree((*report)->watch));
  PetscCall(PetscFree(*report));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One of the solids of a group */
static PetscErrorCode measure(SolidReport r, PetscInt k, PetscReal v[NGROUP])
{
  const SolidGroup *group = r->s->group + r->s->group_of[k];
  const PetscInt    at    = r->s->dim * r->s->first[k];
  PetscReal         u[3], force[3] = {0};
  SolidSums         sums;

  PetscFunctionBeginUser;
  SolidsMeasure(r->solids, k, &sums);
  SolidMeanVelocity(&group->mesh, r->s->x + at, r->s->u + at, u);
  if (r->couple) PetscCall(CoupleGetSolidForce(r->couple, k, force));
  v[OF_X]       = sums.centroid[0];
  v[OF_Y]       = sums.centroid[1];
  v[OF_U]       = u[0];
  v[OF_V]       = u[1];
  v[OF_VOLUME]  = sums.volume / group->mesh.volume - 1;
  v[OF_ENERGY]  = sums.strain_energy;
  v[OF_STRETCH] = sums.stretch_max;
  if (r->s->dim == 2) EllipseFind(sums.second[0], sums.second[1], sums.second[3], &v[OF_TAYLOR], &v[OF_INCLINATION]);
  else EllipsoidFind(sums.second, &v[OF_TAYLOR], &v[OF_AXIS_X]);
  v[OF_Z]       = sums.centroid[2];
  v[OF_W]       = u[2];
  v[OF_FORCE_Z] = force[2];
  v[OF_FORCE_X] = force[0];
  v[OF_FORCE_Y] = force[1];
  v[OF_KEPT]    = r->couple ? CoupleGetVolumeKept(r->couple, k) : 0;
  v[OF_AREA]    = group->membrane ? sums.area / group->mesh.area - 1 : 0;
  v[OF_TENSION] = r->s->tension[k];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of several: energy and force of all, the largest stretch and the volume that is furthest off, means of the rest */
static PetscErrorCode set_group(SolidReport r, PetscInt g, const PetscReal value[][NGROUP])
{
  const SolidGroup *group       = r->s->group + g;
  PetscReal         all[NGROUP] = {0};

  PetscFunctionBeginUser;
  for (PetscInt k = group->first; k < group->first + group->count; k++) {
    const PetscReal *v = value[k];

    r->kept = PetscMax(r->kept, PetscAbsReal(v[OF_KEPT]));
    if (!group->compressible) r->worst = PetscMax(r->worst, PetscAbsReal(v[OF_VOLUME]));
    for (PetscInt i = 0; i < NGROUP; i++) {
      if (i == OF_VOLUME || i == OF_KEPT) all[i] = PetscAbsReal(v[i]) > PetscAbsReal(all[i]) ? v[i] : all[i];
      else if (i == OF_STRETCH) all[i] = PetscMax(all[i], v[i]);
      else
        all[i] += i == OF_ENERGY || i == OF_FORCE_X || i == OF_FORCE_Y || i == OF_FORCE_Z
                  ? v[i]
                  : v[i] / (PetscReal)group->count;
    }
  }
  for (PetscInt i = 0; i < NGROUP; i++)
    if (has_column(group, r->s->dim, i)) PetscCall(MonitorSetColumn(r->monitor, r->column[g][i], all[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidReportStep(SolidReport r)
{
  PetscInt  nwatch = 0, immersed = -1;
  PetscReal carried = -1;
  PetscReal(*value)[NGROUP]; /* of all solids */

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc1(r->s->n, &value));
  for (PetscInt k = r->s->own[0]; k < r->s->own[1]; k++) PetscCall(measure(r, k, value[k]));
  PetscCall(SolidsExchange(r->s, NGROUP, value[0]));
  for (PetscInt g = 0; g < r->s->ngroups; g++) {
    const SolidGroup *group = r->s->group + g;

    PetscCall(set_group(r, g, (const PetscReal(*)[NGROUP])value));
    for (PetscInt w = 0; w < group->nwatch; w++)
      for (PetscInt a = 0; a < r->s->dim; a++, nwatch++) {
        const PetscInt i = r->s->dim * (r->s->first[group->first] + group->watch[w]) + a;

        PetscCall(MonitorSetColumn(r->monitor, r->watch[nwatch], r->s->x[i] - r->s->X[i]));
      }
  }
  PetscCall(PetscFree(value));
  PetscCall(MonitorQuantity(r->monitor, "solid_volume_error_max", r->worst));
  PetscCall(MonitorQuantity(r->monitor, "solid_volume_kept_max", r->kept));
  if (r->couple) immersed = CoupleCountImmersed(r->couple);
  if (immersed >= 0) PetscCall(MonitorQuantity(r->monitor, "solid_immersed_steps", (PetscReal)immersed));
  if (r->couple) carried = CoupleGetMomentumCarried(r->couple);
  if (carried >= 0) PetscCall(MonitorQuantity(r->monitor, "solid_momentum_carried_max", carried));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidAdvanceAlone(const SimComponents *sim, PetscReal time, PetscReal dt)
{
  PetscReal gravity[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(gravity, sim->gravity_start, 3));
  if (sim->gravity) PetscCall(ExprEvaluate(sim->gravity, time + dt, 1, NULL, gravity));
  PetscCall(SolidsAdvance(sim->solids, dt, gravity));
  PetscFunctionReturn(PETSC_SUCCESS);
}
