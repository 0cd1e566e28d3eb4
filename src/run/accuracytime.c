/* Accuracy of runs in time: see accuracy.h. */
#include "compat.h"
#include "accuracy.h"
#include "accuracyimpl.h"
#include "base/agree.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/opt.h"
#include "coarser.h"
#include "failure.h"
#include "gauge.h"
#include "promise.h"
#include "start.h"
#include "timeerror.h"

#define HALF      2.0 /* cells of the trials, times those of the run */
#define BETWEEN   1.5 /* likewise, where half as many would not be SEEN across a body: errors are of no order there */
#define SEEN      4
#define LONGER    2.0  /* steps of the second trial, likewise */
#define LARGE     0.2  /* of the largest force (or velocity): components smaller than that are not judged */
#define STEPS_MIN 5    /* steps that must have been gauged */
#define ERROR_MIN 1e-4 /* estimate: what is claimed at best */
#define CLASSES   3

/* The run, and its trials on a mesh half as fine: with the same steps, with longer ones */
typedef struct {
  SimComponents components[2];
  Sim           sim[2];
  Gauge         gauge[3];
  PetscReal     factor, ratio; /* of the trials' cells: wanted, what it came to be */
  PetscInt      n;
} Runs;

/* ---- trials ---- */

static PetscErrorCode run_trial(SimComponents *components, Sim *sim, PetscReal end, Gauge *gauge)
{
  PetscReal from, time;
  PetscInt  order, steps;

  PetscFunctionBeginUser;
  PetscCall((*components->make)(components));
  PetscCall(SimCreate(components, sim));
  PetscCall(StartSolve(components));
  PetscCall(SimSetUp(*sim));
  PetscCall(SimRunTrial(*sim, gauge));
  GaugeGetEnd(*gauge, &from, &time, &order, &steps);
  PetscCheck(steps >= STEPS_MIN && PetscAbsReal(time - end) <= 1e-6 * end, components->comm, PETSC_ERR_NOT_CONVERGED,
             "A trial run stopped before its end");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Run once more, with steps `longer` times as long as those of the first run */
static PetscErrorCode add_run(const SimComponents *p, PetscReal longer, Runs *r)
{
  const PetscInt i    = r->n - 1;
  Coarser        kept = {0};
  PetscReal      from, end;
  PetscInt       order, steps;
  PetscErrorCode failed;

  PetscFunctionBeginUser;
  GaugeGetEnd(r->gauge[0], &from, &end, &order, &steps);
  PetscCall(CoarserMesh(&kept, r->factor, &r->ratio));
  if (r->ratio == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoarserSteps(&kept, longer, r->ratio, order, from, end));
  r->components[i] = (SimComponents){.comm    = p->comm,
                                     .scene   = p->scene,
                                     .make    = p->make,
                                     .destroy = p->destroy,
                                     .timed   = PETSC_TRUE};
  LogMute(PETSC_TRUE);
  PetscCall(AgreeBegin(FailureAbort));
  failed = run_trial(&r->components[i], &r->sim[i], end, &r->gauge[i + 1]); /* too coarse, too long a step */
  PetscCall(AgreeEnd());
  LogMute(PETSC_FALSE);
  PetscCall(CoarserPutBack(&kept, 0));
  if (!failed) r->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode end_runs(const SimComponents *p, Runs *r)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(SimDestroy(&r->sim[i]));
    PetscCall((*p->destroy)(&r->components[i])); /* as far as it was made */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- errors ---- */

/* Space and time, as shares of the size of a subject; the worst of all bodies and of what is gauged of them. By one
   change at a time: where both change at once their errors may cancel. Time -1: not known. */
static void estimate_error(const Runs *r, PetscInt subject, PetscReal size, PetscReal order, PetscReal error[2])
{
  PetscReal from, end, worst = -1;
  PetscInt  scheme, steps;

  GaugeGetEnd(r->gauge[0], &from, &end, &scheme, &steps);
  for (PetscInt k = 0; k < GaugeCount(r->gauge[0], subject); k++) {
    for (PetscInt kind = 0; kind < GAUGE_KINDS; kind++) {
      PetscReal v[3] = {0, 0, 0}, space, time = 0;

      for (PetscInt i = 0; i < r->n; i++) v[i] = GaugeValue(r->gauge[i], subject, k, kind) / size;
      space = PetscAbsReal(v[1] - v[0]) / (PetscPowReal(r->ratio, order) - 1);
      if (r->n == 3) time = PetscAbsReal(v[2] - v[1]) / (PetscPowReal(LONGER, (PetscReal)scheme) - 1);
      if (space + time <= worst) continue;
      worst    = space + time;
      error[0] = space;
      error[1] = r->n == 3 ? time : -1;
    }
  }
}

static PetscInt get_class(PetscInt subject)
{
  return subject < 6 ? 0 : subject < 12 ? 1 : 2;
}

static PetscErrorCode estimate_errors(const SimComponents *p, const Runs *r)
{
  PetscReal size, scale, largest[CLASSES] = {0, 0, 0}, order, worst[2] = {0, 0};
  char      name[32], worst_name[32] = "";

  PetscFunctionBeginUser;
  PetscCall(AccuracyFindOrder(p, &order));
  for (PetscInt i = 0; i < GAUGE_SUBJECTS; i++) {
    PetscCall(GaugeGetSize(r->gauge[0], i, &size, &scale));
    largest[get_class(i)] = PetscMax(largest[get_class(i)], scale);
  }
  for (PetscInt i = 0; i < GAUGE_SUBJECTS; i++) {
    PetscReal error[2] = {0, 0}, sum;

    PetscCall(GaugeGetSize(r->gauge[0], i, &size, &scale));
    if (size == 0 || scale < LARGE * largest[get_class(i)]) continue;
    GaugeGetName(i, name);
    estimate_error(r, i, size, order, error);
    sum = error[0] + PetscMax(0, error[1]);
    PetscCall(AccuracyReport(p, name, PetscMax(ERROR_MIN, sum), PETSC_FALSE, error));
    if (sum <= worst[0] + PetscMax(0, worst[1])) continue;
    PetscCall(PetscArraycpy(worst, error, 2));
    PetscCall(PetscStrncpy(worst_name, name, sizeof(worst_name)));
  }
  if (worst_name[0]) PetscCall(AccuracyCompare(worst_name, worst[0] + PetscMax(0, worst[1]), worst, order));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- doors ---- */

/* A preset that promises so much, and nobody asked whether it keeps that */
static PetscErrorCode report_no_estimate(const SimComponents *p)
{
  char       preset[64];
  BodyState *s;
  PetscBool  accurate;
  PetscReal  steps;

  PetscFunctionBeginUser;
  PetscCall(OptPeek("-preset", preset, sizeof(preset)));
  PetscCall(PetscStrcasecmp(preset, PROMISE_PRESETS[PROMISE_ACCURATE], &accurate));
  PetscCall(BodiesGetState(p->bodies, &s));
  if (!accurate || p->steady || p->deform || s->nall > GAUGE_BODIES) PetscFunctionReturn(PETSC_SUCCESS);
  TimeErrorGet(p->time_error, &steps);
  PetscCall(PetscPrintf(p->comm, "estimated error: "));
  if (steps >= 0) PetscCall(PetscPrintf(p->comm, "%.2g %% of the steps, of the mesh ", (double)(100 * steps)));
  PetscCall(
    PetscPrintf(p->comm,
                "not known; -monitor_accuracy true tells whether the %g %% hold here, for about half of the time more\n",
                (double)PromisePercent(PROMISE_ACCURATE)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AccuracyEstimateInTime(const SimComponents *p)
{
  Runs      r = {.n = 1};
  PetscReal from, end;
  PetscInt  order, steps;
  PetscBool thin;

  PetscFunctionBeginUser;
  if (!p->gauge) PetscCall(report_no_estimate(p));
  if (!p->gauge || !p->make || InterruptHeard()) PetscFunctionReturn(PETSC_SUCCESS);
  r.gauge[0] = p->gauge;
  GaugeGetEnd(p->gauge, &from, &end, &order, &steps);
  PetscCall(AccuracyIsThin(p, HALF * SEEN, &thin));
  r.factor = thin ? BETWEEN : HALF;
  if (steps >= LONGER * STEPS_MIN) PetscCall(add_run(p, 1, &r));
  if (r.n == 2) PetscCall(add_run(p, LONGER, &r));
  if (r.n > 1 && !InterruptHeard()) PetscCall(estimate_errors(p, &r));
  else
    PetscCall(PetscPrintf(p->comm, "estimated error: not known, since %s\n",
                          steps < LONGER * STEPS_MIN ? "there are too few steps" : "a mesh half as fine does not do"));
  PetscCall(end_runs(p, &r));
  PetscFunctionReturn(PETSC_SUCCESS);
}
