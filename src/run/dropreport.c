/* DropReport: see dropreport.h. */
#include "compat.h"
#include "dropreport.h"
#include "ellipse.h"
#include "report/dropfields.h"
#include "report/eventtable.h"
#include "base/log.h"

/* Of the range of angles, which count modulo pi: that of a drop that stands is not to jump when it leans a little to
   one side or the other. */
#define BEGIN      (-PETSC_PI / 2 + 0.1)
#define REMARKABLE 1e-3 /* error of a volume, */
#define AFTER      10   /* so many steps after an event */

enum {
  DROPS,
  MERGED,
  BROKEN,
  VOLUME_ERROR,
  LOST,
  LEFT,
  LEFT_VOLUME,
  SHIFT,
  NCOLUMN
};
static const char *const COLUMNS[NCOLUMN] =
  {"drops",      "drops_merged",     "drops_broken",     "drop_volume_error", "drop_volume_lost",
   "drops_left", "drop_volume_left", "drop_volume_shift"};

struct _p_DropReport {
  MPI_Comm    comm;
  DropsState *s;
  Monitor     monitor;
  PetscMPIInt rank;
  PetscInt    dim, ncell, *phase; /* [ncell] own cells */
  Fields      fields;

  const MeshLocal *loc;
  PetscInt         column[NCOLUMN];
  PetscReal        worst; /* error of a volume so far */
  PetscBool        opened, remarked;
  PetscInt         events, event; /* so far; step of the last one */
  EventTable       table;
  char             dir[PETSC_MAX_PATH_LEN];
};

PetscErrorCode DropReportCreate(const SimComponents *sim, DropReport *report)
{
  DropReport  r;
  const char *dir;

  PetscFunctionBeginUser;
  *report = NULL;
  if (!sim->drops || !sim->flow) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscNew(&r));
  r->comm    = sim->comm;
  r->monitor = sim->monitor;
  PetscCall(DropsGetState(sim->drops, &r->s));
  PetscCallMPI(MPI_Comm_rank(r->comm, &r->rank));
  for (PetscInt i = 0; i < NCOLUMN; i++) PetscCall(MonitorAddColumn(sim->monitor, COLUMNS[i], &r->column[i]));
  PetscCall(FieldsGetDirectory(sim->fields, &dir));
  PetscCall(PetscStrncpy(r->dir, dir, sizeof(r->dir)));
  PetscCall(MeshGetLocal(sim->mesh, &r->loc));
  r->dim    = r->loc->dim;
  r->fields = sim->fields;
  PetscCall(DropReportMarkCells(r));
  PetscCall(MonitorAddFile(sim->monitor, "drops.csv"));
  *report = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropReportDestroy(DropReport *report)
{
  PetscFunctionBeginUser;
  if (!*report) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(EventTableClose(&(*report)->table));
  PetscCall(PetscFree((*report)->phase));
  PetscCall(PetscFree(*report));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void write_drop(const DropReport r, PetscReal time, const Drop *d)
{
  FILE            *file  = r->table.file;
  const PhaseSums *s     = &d->sums;
  const PetscReal  round = r->dim == 2 ? 2 * PetscSqrtReal(PETSC_PI * PetscMax(0, s->area))
                                       : PetscCbrtReal(36 * PETSC_PI * s->area * s->area); /* `length` of one that is */
  PetscReal        deformation, angle, axis[3];

  (void)fprintf(file, "%.12g,%" PetscInt_FMT ",%s,%.12g,%.6g,", (double)time, d->number, r->s->group[d->group].name,
                (double)s->area, (double)(s->area / d->target - 1));
  for (PetscInt a = 0; a < r->dim; a++) (void)fprintf(file, "%.12g,", (double)s->centre[a]);
  for (PetscInt a = 0; a < r->dim; a++) (void)fprintf(file, "%.12g,", (double)d->velocity[a]);
  (void)fprintf(file, "%.12g,%.12g,", (double)s->length, s->length > 0 ? (double)(round / s->length) : 0.);
  if (r->dim == 3) {
    EllipsoidFind(s->second, &deformation, axis);
    (void)fprintf(file, "%.9g,%.9g,%.9g,%.9g\n", (double)deformation, (double)axis[0], (double)axis[1],
                  (double)axis[2]);
    return;
  }
  EllipseFind(s->second[0], s->second[1], s->second[2], &deformation, &angle);
  if (angle < BEGIN) angle += PETSC_PI;
  (void)fprintf(file, "%.9g,%.9g,%.12g\n", (double)deformation, (double)angle, (double)s->wet);
}

PetscErrorCode DropReportMarkCells(DropReport r)
{
  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  if (!r->phase || r->ncell != r->loc->ncell) { /* cells may be rebuilt */
    PetscCall(PetscFree(r->phase));
    r->ncell = r->loc->ncell;
    PetscCall(PetscCalloc1(r->ncell, &r->phase));
    PetscCall(FieldsSetPhase(r->fields, r->phase));
  }
  DropFieldsPhase(r->s, r->ncell, r->phase);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* That a volume is off, once: not after an event, which takes some steps to make good; that a drop leaves through an
   opening is none for the others */
static PetscErrorCode remark_volume(DropReport r, PetscInt step, PetscReal time, PetscReal error)
{
  const PetscInt events = r->s->merged + r->s->broken;

  PetscFunctionBeginUser;
  if (events != r->events) r->event = step;
  r->events = events;
  if (error <= REMARKABLE || r->remarked || (events && step - r->event <= AFTER)) PetscFunctionReturn(PETSC_SUCCESS);
  r->remarked = PETSC_TRUE;
  PetscCall(
    LogRemark("the volume of a drop is off by %.2g %% at t = %g (column drop_volume_error of series.csv), more than a step can make good: lower -sim_dt, or use smaller "
              "cells (-mesh_cells)",
              (double)(100 * error), (double)time));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropReportStep(DropReport r, PetscInt step, PetscReal time)
{
  PetscReal error = 0;

  PetscFunctionBeginUser;
  if (!r) PetscFunctionReturn(PETSC_SUCCESS);
  if (!r->opened)
    PetscCall(EventTableOpen(r->comm, r->dir, "drops.csv", r->dim == 2 ? EVENT_DROPS : EVENT_DROPS_SPACE,
                             step > 1 ? time : 0, &r->table));
  r->opened = PETSC_TRUE;
  for (PetscInt k = 0; k < r->s->n; k++) {
    if (!r->rank) write_drop(r, time, r->s->drop + k);
    error = PetscMax(error, PetscAbsReal(r->s->drop[k].sums.area / r->s->drop[k].target - 1));
  }
  PetscCall(EventTableFlush(&r->table));
  r->worst = PetscMax(r->worst, error);
  PetscCall(remark_volume(r, step, time, error));
  PetscCall(MonitorSetColumn(r->monitor, r->column[DROPS], (PetscReal)r->s->n));
  PetscCall(MonitorSetColumn(r->monitor, r->column[MERGED], (PetscReal)r->s->merged));
  PetscCall(MonitorSetColumn(r->monitor, r->column[BROKEN], (PetscReal)r->s->broken));
  PetscCall(MonitorSetColumn(r->monitor, r->column[VOLUME_ERROR], error));
  PetscCall(MonitorSetColumn(r->monitor, r->column[LOST], r->s->lost));
  PetscCall(MonitorSetColumn(r->monitor, r->column[LEFT], (PetscReal)r->s->left));
  PetscCall(MonitorSetColumn(r->monitor, r->column[LEFT_VOLUME], r->s->left_volume));
  PetscCall(MonitorSetColumn(r->monitor, r->column[SHIFT], r->s->shift));
  PetscCall(MonitorQuantity(r->monitor, "drops", (PetscReal)r->s->n));
  PetscCall(MonitorQuantity(r->monitor, "drops_merged", (PetscReal)r->s->merged));
  PetscCall(MonitorQuantity(r->monitor, "drops_broken", (PetscReal)r->s->broken));
  PetscCall(MonitorQuantity(r->monitor, "drops_left", (PetscReal)r->s->left));
  PetscCall(MonitorQuantity(r->monitor, "drop_volume_left", r->s->left_volume));
  PetscCall(MonitorQuantity(r->monitor, "drop_volume_error_max", r->worst));
  PetscFunctionReturn(PETSC_SUCCESS);
}
