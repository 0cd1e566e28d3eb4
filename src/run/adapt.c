/* Adapt: see adapt.h. Every decision comes from numbers that are the same on all ranks. */
#include "compat.h"
#include "adaptimpl.h"
#include "base/rigid.h"
#include "base/log.h"
#include "base/opt.h"
#include "bodies/slip.h"
#include <string.h>

#define SAFETY  0.9
#define REJECT  2.0 /* error of a rejected step in tolerances */
#define SHRINK  0.2 /* of a rejected step, at most */
#define FAILED  0.25
#define SHORTER 0.8 /* a first step that is too long, until it is not */
#define FAR     2.0 /* way of a body in a rejected step, over the one allowed: its speed was not to be foreseen */
#define RESUME  2.0 /* largest ratio of a step to the one before where that was shortened by a limit */
#define HALVED  0.5 /* second attempt at the first step, which tells its error */
#define JUMP    0.5 /* an error that a shorter step leaves larger than this part is no error in time */

/* ---- limits ---- */

static PetscErrorCode want_error(void *adapt, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = ((Adapt)adapt)->wanted;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit_length(void *adapt, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = PetscMin(*dt, ((Adapt)adapt)->o.max);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit_cfl(void *adapt, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = PetscMin(*dt, ((Adapt)adapt)->by_cfl);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit_gap(void *adapt, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = PetscMin(*dt, ((Adapt)adapt)->by_gap);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Not below -sim_adapt_min, whoever wants it */
static PetscErrorCode keep_floor(void *adapt, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = PetscMax(((Adapt)adapt)->o.min, *dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode limit_growth(void *adapt, PetscReal *dt)
{
  const struct _p_Adapt *a = adapt;

  PetscFunctionBeginUser;
  if (a->last > 0) *dt = PetscMin(*dt, RESUME * a->last);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Time in which the fastest point of a body goes `move` cells, under its velocity extrapolated to the middle of the
   step. Collective. */
static PetscErrorCode limit_displacement(void *adapt, PetscReal *dt)
{
  Adapt            a        = adapt;
  const BodyState *s        = a->s;
  PetscReal        smallest = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal u = BodiesFastestPoint(s, k, s->dt_old > 0 ? 0.5 * a->dt / s->dt_old : 0);

    if (!s->removed[k] && u > 0) smallest = PetscMin(smallest, a->o.move * a->l->h / u);
  }
  PetscCall(BodiesMin(a->bodies, 1, &smallest));
  *dt = PetscMin(*dt, smallest);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The same for the first step, in which bodies gather speed under gravity: *dt is made shorter. */
static PetscErrorCode limit_start(void *adapt, PetscReal *dt)
{
  Adapt a = adapt;

  PetscFunctionBeginUser;
  if (a->last > 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < a->s->n; k++) {
    while (*dt > a->o.min) {
      PetscReal start[3], distance = 0;

      PetscCall(ContactGetStart(a->contact, k, *dt, start));
      for (PetscInt d = 0; d < 3; d++)
        if (BodiesIsFree(a->bodies, k, d)) distance += PetscSqr(start[d] * *dt * *dt);
      if (PetscSqrtReal(distance) <= a->o.move * a->l->h) break;
      *dt = PetscMax(a->o.min, SHORTER * *dt);
    }
  }
  PetscCall(BodiesMin(a->bodies, 1, dt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest way in the step that was solved, of the fastest point of a body, over the one that is allowed; likewise of
   other participants */
static PetscErrorCode measure_displacement(Adapt a, PetscReal dt, PetscReal *ratio)
{
  const PetscInt dim = a->l->dim, nr = RigidSize(dim);
  PetscReal     *U, others;

  PetscFunctionBeginUser;
  *ratio = 0;
  PetscCall(CoupleGetSystem(a->couple, NULL, NULL, &U, NULL, NULL));
  for (PetscInt k = 0; k < a->s->n; k++) {
    PetscReal u[3] = {0, 0, 0}, w[3] = {0, 0, 0};

    for (PetscInt i = 0; i < nr; i++) *RigidComponent(dim, u, w, i) = U[k * nr + i];
    if (!a->s->removed[k]) *ratio = PetscMax(*ratio, BodiesPointSpeed(a->s, k, u, w) * dt / (a->o.move * a->l->h));
  }
  PetscCall(BodiesMax(a->bodies, 1, ratio));
  PetscCall(CoupleOverstep(a->couple, &others, NULL));
  *ratio = PetscMax(*ratio, others);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Time in which a body closes `gap` of its gap at the rate of the last step; where it met no gap before, at twice its
   speed */
static PetscErrorCode limit_approach(Adapt a, PetscReal dt, PetscReal *smallest)
{
  const BodyState *s = a->s;
  PetscReal        range;

  PetscFunctionBeginUser;
  PetscCall(ContactGetRange(a->contact, &range));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal closing;

    if (!s->own[k] || s->removed[k] || s->gap[k] >= PETSC_MAX_REAL) continue;
    closing = a->gap_last[k] < PETSC_MAX_REAL
              ? (a->gap_last[k] - s->gap[k]) / dt
              : 2 * PetscSqrtReal(PetscSqr(s->u[k][0]) + PetscSqr(s->u[k][1]) + PetscSqr(s->u[k][2]));
    if (closing > 0) *smallest = PetscMin(*smallest, a->o.gap * PetscMax(s->gap[k], range) / closing);
  }
  PetscCall(BodiesMin(a->bodies, 1, smallest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- control ---- */

/* Bodies that the penalty holds because the mesh cannot follow them. What such a body and the flow do where that
   changes is a jump of the method, and no error in time. */
static PetscErrorCode count_penalty_bodies(Adapt a, PetscInt *penalty_bodies)
{
  const CoupleCount *count;
  PetscInt           n;

  PetscFunctionBeginUser;
  *penalty_bodies = 0;
  PetscCall(CoupleGetCounts(a->couple, &n, &count));
  for (PetscInt i = 0; i < n; i++)
    if (!strcmp(count[i].name, "aligned_penalty_bodies")) *penalty_bodies = count[i].value;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptGetStep(Adapt a, PetscReal time, PetscReal until, PetscReal *dt, PetscBool *hits)
{
  const PetscReal left = until - time;

  PetscFunctionBeginUser;
  PetscCall(LimitsAsk(a->limits, dt));
  *hits = (PetscBool)(left <= *dt * (1 + 1e-6));
  if (*hits || left < 2 * *dt) PetscCall(LimitsSetDeciding(a->limits, LIMITS_TIME));
  if (*hits) *dt = left;
  else if (left < 2 * *dt) *dt = 0.5 * left;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void want(Adapt a, PetscReal dt)
{
  a->wanted = dt;
  a->dt     = PetscMin(a->o.max, PetscMax(a->o.min, dt));
}

/* Length of the next step after one of length dt with the error of a */
static PetscReal control(const struct _p_Adapt *a, const FlowStep *step)
{
  const PetscReal factor = SAFETY * PetscPowReal(a->o.tolerance / PetscMax(a->error, 1e-30), 1. / (step->order + 1));

  if (a->error > a->o.tolerance) return step->dt * PetscMax(SHRINK, factor);
  /* it was shortened for a limit or a time to hit, and need not have been */
  if (step->dt < a->dt && step->dt * factor >= a->dt) return a->dt;
  return factor < a->o.hysteresis ? step->dt : step->dt * PetscMin(factor, a->o.growth);
}

/* Is it the first step, and are there bodies that gather speed in it? Where a body has a velocity at once, or slip, the
   flow around it begins with a layer that no step resolves. */
static PetscErrorCode is_start(Adapt a, const FlowStep *step, PetscBool *start)
{
  const BodyState *s       = a->s;
  PetscReal        nmoving = 0;

  PetscFunctionBeginUser;
  *start = PETSC_FALSE;
  if (a->accepted > 0 || step->dt_old > 0 || BodiesHaveSlip(a->bodies)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt g = 0; g < s->ngroups; g++)
    *start = (PetscBool)(*start || (s->group[g].count && s->group[g].free && !s->group[g].motion.has_pivot));
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt i = 0; i < 3; i++)
      if (s->own[k] && !BodiesGetGroup(s, k)->with_fluid && (s->u[k][i] != 0 || s->w[k][i] != 0)) nmoving = 1;
  PetscCall(BodiesSum(a->bodies, 1, &nmoving));
  if (nmoving > 0) *start = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A first step that no history tells the error of: by one half as long, until it is small enough */
static PetscErrorCode check_start(Adapt a, const FlowStep *step, PetscBool estimated, PetscBool *accept)
{
  PetscReal shrink = HALVED;

  PetscFunctionBeginUser;
  *accept = (PetscBool)(step->dt <= a->o.min * (1 + 1e-6) || (estimated && a->error <= REJECT * a->o.tolerance));
  if (estimated) shrink = PetscMin(HALVED, PetscMax(SHRINK, SAFETY * PetscSqrtReal(a->o.tolerance / a->error)));
  if (!*accept) PetscCall(AdaptKeepStart(a, step->dt));
  want(a, *accept ? step->dt : shrink * step->dt);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptCheck(Adapt a, KSPConvergedReason reason, PetscBool *accept)
{
  const FlowStep *step;
  PetscBool       estimated = PETSC_FALSE, start;
  PetscReal       distance  = 0;
  PetscInt        penalty_bodies, by = ROW_ERROR; /* who refuses */

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(a->flow, &step));
  a->error = 0;
  if (reason >= 0) PetscCall(measure_displacement(a, step->dt, &distance));
  PetscCall(is_start(a, step, &start));
  if (reason >= 0 && start) PetscCall(AdaptEstimateStart(a, step->dt, &estimated));
  else if (reason >= 0) PetscCall(AdaptEstimateError(a, step, &estimated));
  PetscCall(count_penalty_bodies(a, &penalty_bodies));
  if (reason < 0 || PetscIsInfOrNanReal(a->error)) {
    *accept = (PetscBool)(step->dt <= a->o.min * (1 + 1e-6));
    by      = ROW_SOLVE;
    want(a, FAILED * step->dt);
  } else if (distance > FAR && step->dt > a->o.min * (1 + 1e-6)) {
    *accept = PETSC_FALSE;
    by      = ROW_DISPLACEMENT;
    want(a, step->dt / distance);
  } else if (start) {
    PetscCall(check_start(a, step, estimated, accept));
  } else if (penalty_bodies != a->penalty_bodies && a->error > a->o.tolerance) {
    *accept   = PETSC_TRUE;
    a->smooth = -1;
  } else if (a->first_error > 0 && a->error > JUMP * a->first_error) {
    *accept = PETSC_TRUE;
    a->dt = a->wanted = a->first_dt;
    a->smooth         = -1;
  } else {
    *accept = (PetscBool)(a->error <= REJECT * a->o.tolerance || step->dt <= a->o.min * (1 + 1e-6));
    if (!*accept && a->first_error == 0) {
      a->first_dt    = step->dt;
      a->first_error = a->error;
    }
    if (estimated) want(a, control(a, step));
  }
  if (!*accept) a->rejected++;
  if (!*accept) PetscCall(LimitsRefuse(a->limits, a->row[by]));
  PetscCall(MonitorSetColumn(a->monitor, a->column[COLUMN_ERROR], a->error));
  PetscCall(MonitorSetColumn(a->monitor, a->column[COLUMN_REJECTED], a->rejected));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode remember_nodes(Adapt a)
{
  const PetscInt *body;
  PetscReal      *old;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetNodeBody(a->couple, &body));
  PetscCall(FlowGetFields(a->flow, NULL, &old, NULL));
  PetscCall(PetscArraycpy(a->u_older, old, a->l->nnode_all * a->l->dim));
  CalmStep(a->l, body, a->age);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptAccept(Adapt a, PetscReal cfl)
{
  const FlowStep  *step;
  const BodyState *s = a->s;
  PetscInt         deciding;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(a->flow, &step));
  a->by_cfl = a->o.cfl > 0 && cfl > 0 ? step->dt * a->o.cfl / cfl : PETSC_MAX_REAL;
  a->by_gap = PETSC_MAX_REAL;
  if (a->o.gap > 0) PetscCall(limit_approach(a, step->dt, &a->by_gap));
  PetscCall(LimitsGetDeciding(a->limits, &deciding, NULL));
  PetscCall(MonitorSetColumn(a->monitor, a->column[COLUMN_LIMIT], deciding));
  PetscCall(count_penalty_bodies(a, &a->penalty_bodies));
  PetscCall(remember_nodes(a));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal contact = 0;

    for (PetscInt d = 0; d < 3; d++) {
      a->U_older[k][d]     = s->u_old[k][d];
      a->U_older[k][3 + d] = s->w_old[k][d];
      contact += PetscAbsReal(s->contact_force[k][d]);
    }
    a->calm[k]     = contact > 0 ? 0 : PetscMin(CALM_STEPS, a->calm[k] + 1);
    a->gap_last[k] = s->gap[k];
  }
  a->dt_older = step->dt_old;
  a->last     = step->dt;
  a->shortest = a->accepted ? PetscMin(a->shortest, step->dt) : step->dt;
  a->longest  = PetscMax(a->longest, step->dt);
  a->accepted++;
  a->smooth++;
  a->first_error = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptFinish(Adapt a)
{
  PetscFunctionBeginUser;
  PetscCall(MonitorQuantity(a->monitor, "rejected_steps", a->rejected));
  PetscCall(MonitorQuantity(a->monitor, "dt_min", a->shortest));
  PetscCall(MonitorQuantity(a->monitor, "dt_max", a->longest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode read_options(Adapt a)
{
  PetscFunctionBeginUser;
  a->o.tolerance  = 1e-4;
  a->o.cfl        = 5;
  a->o.move       = 0.5;
  a->o.gap        = 0.5;
  a->o.min        = 1e-2 * a->dt;
  a->o.max        = PETSC_MAX_REAL;
  a->o.growth     = 1.5;
  a->o.hysteresis = 1.2;
  PetscCall(OptReal("-sim_adapt_tolerance", &a->o.tolerance));
  PetscCall(OptReal("-sim_adapt_speed", &a->o.speed));
  PetscCall(OptReal("-sim_adapt_cfl", &a->o.cfl));
  PetscCall(OptReal("-sim_adapt_displacement", &a->o.move));
  PetscCall(OptReal("-sim_adapt_gap", &a->o.gap));
  PetscCall(OptReal("-sim_adapt_min", &a->o.min));
  PetscCall(OptReal("-sim_adapt_max", &a->o.max));
  PetscCall(OptReal("-sim_adapt_growth", &a->o.growth));
  PetscCall(OptReal("-sim_adapt_hysteresis", &a->o.hysteresis));
  PetscCheck(a->o.min <= PetscMin(a->dt, a->o.max), a->comm, PETSC_ERR_USER_INPUT,
             "The first step, the smaller one of -sim_dt %g and -sim_adapt_max %g, is below -sim_adapt_min %g: change one of them",
             (double)a->dt, (double)a->o.max, (double)a->o.min);
  a->dt = PetscMin(a->dt, a->o.max);
  PetscCheck(a->o.hysteresis <= a->o.growth, a->comm, PETSC_ERR_USER_INPUT,
             "-sim_adapt_hysteresis %g exceeds -sim_adapt_growth %g: no step could ever grow. Lower the first or raise the second",
             (double)a->o.hysteresis, (double)a->o.growth);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_rows(Adapt a)
{
  const Limit row[NROWS] = {[ROW_ERROR] = {LIMIT_WANTED, "error", "the error of a step", "-sim_adapt_tolerance", "",
                                           "shorter, or taken again", a->o.tolerance, want_error, a},
                            [ROW_MAX]   = {LIMIT_BOUND, "max", "the largest step", "-sim_adapt_max", "time", "shorter",
                                           a->o.max, limit_length, a},
                            [ROW_CFL]   = {LIMIT_BOUND, "cfl", "the CFL number", "-sim_adapt_cfl", "", "shorter",
                                           a->o.cfl, limit_cfl, a},
                            [ROW_GAP]   = {LIMIT_BOUND, "gap", "bodies that close their gaps", "-sim_adapt_gap", "gaps",
                                           "shorter", a->o.gap, limit_gap, a},
                            [ROW_DISPLACEMENT] = {LIMIT_BOUND, "displacement", "the displacement of bodies",
                                                  "-sim_adapt_displacement", "cells", "shorter, or taken again",
                                                  a->o.move, limit_displacement, a},
                            [ROW_MIN]          = {LIMIT_FLOOR, "min", "the smallest step", "-sim_adapt_min", "time",
                                                  "no shorter, whoever asks for it", a->o.min, keep_floor, a},
                            [ROW_GROWTH] = {LIMIT_CHANGE, "growth", "growth after a step that was shortened", NULL,
                                            "steps before", "shorter", RESUME, limit_growth, a},
                            [ROW_START]  = {LIMIT_CHANGE, "start", "the displacement of bodies in the first step",
                                            "-sim_adapt_displacement", "cells", "shorter", a->o.move, limit_start, a},
                            [ROW_SOLVE]  = {LIMIT_CHECK, "solve", "a solve that fails", NULL, "",
                                            "taken again, a quarter as long", 0, NULL, NULL}};

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NROWS; i++) PetscCall(LimitsAdd(a->limits, &row[i], &a->row[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptCreate(Flow flow, Bodies bodies, Couple couple, Contact contact, Monitor monitor, Limits limits,
                           PetscReal dt, Adapt *adapt)
{
  Adapt     a;
  PetscBool on = PETSC_FALSE;
  Mesh      mesh;
  PetscInt  n, substeps;

  PetscFunctionBeginUser;
  *adapt = NULL;
  PetscCall(OptBool("-sim_adapt", &on));
  if (!on) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetSubsteps(flow, &substeps, NULL));
  PetscCheck(substeps == 1, MonitorComm(monitor), PETSC_ERR_USER_INPUT,
             "-sim_adapt takes steps again, which -flow_time fstheta with its parts of a step cannot: use bdf2, cn or be");
  PetscCall(PetscNew(&a));
  a->comm    = MonitorComm(monitor);
  a->flow    = flow;
  a->bodies  = bodies;
  a->couple  = couple;
  a->contact = contact;
  a->monitor = monitor;
  a->limits  = limits;
  a->dt      = dt;
  a->by_cfl = a->by_gap = PETSC_MAX_REAL;
  PetscCall(read_options(a));
  a->wanted = a->dt;
  PetscCall(LimitsExpect(limits, a->dt));
  PetscCall(add_rows(a));
  PetscCall(BodiesGetState(bodies, &a->s));
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &a->l));
  n = a->s->n;
  PetscCall(PetscCalloc2(a->l->nnode_all * a->l->dim, &a->u_older, a->l->nnode_all, &a->age));
  PetscCall(BodiesAttach(bodies, sizeof(*a->U_older), (void **)&a->U_older));
  PetscCall(BodiesAttach(bodies, sizeof(*a->calm), (void **)&a->calm));
  PetscCall(BodiesAttach(bodies, sizeof(*a->gap_last), (void **)&a->gap_last));
  CalmBegin(a->l, a->age);
  for (PetscInt k = 0; k < n; k++) {
    a->calm[k]     = CALM_STEPS;
    a->gap_last[k] = PETSC_MAX_REAL;
  }
  PetscCall(MonitorAddColumn(monitor, "step_error", &a->column[COLUMN_ERROR]));
  PetscCall(MonitorAddColumn(monitor, "rejected_steps", &a->column[COLUMN_REJECTED]));
  PetscCall(MonitorAddColumn(monitor, "step_limit", &a->column[COLUMN_LIMIT]));
  *adapt = a;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptDestroy(Adapt *adapt)
{
  PetscFunctionBeginUser;
  if (!*adapt) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2((*adapt)->u_older, (*adapt)->age));
  PetscCall(BodiesDetach((*adapt)->bodies, (void **)&(*adapt)->U_older));
  PetscCall(BodiesDetach((*adapt)->bodies, (void **)&(*adapt)->calm));
  PetscCall(BodiesDetach((*adapt)->bodies, (void **)&(*adapt)->gap_last));
  PetscCall(PetscFree(*adapt));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptView(Adapt a, PetscViewer viewer)
{
  PetscFunctionBeginUser;
  if (!a) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(
    PetscViewerASCIIPrintf(viewer,
                           "  adaptive: local error %g, CFL number at most %g, bodies move at most %g cells and %g of their gap, steps from %g",
                           (double)a->o.tolerance, (double)a->o.cfl, (double)a->o.move, (double)a->o.gap,
                           (double)a->o.min));
  if (a->o.max < PETSC_MAX_REAL) PetscCall(PetscViewerASCIIPrintf(viewer, " to %g", (double)a->o.max));
  PetscCall(PetscViewerASCIIPrintf(viewer, "\n"));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptRemesh(Adapt a, Mesh old)
{
  Mesh now;

  PetscFunctionBeginUser;
  PetscCall(FlowGetMesh(a->flow, &now));
  PetscCall(CalmCarry(old, now, &a->u_older, &a->age));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AdaptVisitState(void *adapt, State state)
{
  Adapt      a        = adapt;
  PetscInt   count[3] = {a->accepted, a->rejected, a->smooth};
  PetscReal  limit = PetscMin(a->by_cfl, a->by_gap), by[3] = {a->by_cfl, a->by_gap, a->wanted};
  PetscReal *number[7] = {&a->dt, &limit, &a->speed_max, &a->dt_older, &a->shortest, &a->longest, &a->last}, value[7];
  PetscBool  has;
  BodyRows   rows;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, "numbers", &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS); /* of a run with fixed steps: begins here as at the start */
  for (PetscInt i = 0; i < 7; i++) value[i] = *number[i];
  PetscCall(StateReals(state, "numbers", 7, value));
  PetscCall(StateInts(state, "steps", 3, count));
  for (PetscInt i = 0; i < 7; i++) *number[i] = value[i];
  a->accepted = count[0];
  a->rejected = count[1];
  a->smooth   = count[2];
  PetscCall(StateHas(state, "limits", &has)); /* older files have the smaller one alone */
  if (has) PetscCall(StateReals(state, "limits", 3, by));
  a->by_cfl = has ? by[0] : limit;
  a->by_gap = has ? by[1] : PETSC_MAX_REAL;
  a->wanted = has ? by[2] : a->dt;
  PetscCall(StateHas(state, "held", &has)); /* not in older files */
  if (has) PetscCall(StateInts(state, "held", 1, &a->penalty_bodies));
  PetscCall(StateNodes(state, "velocity_older", a->l->dim, a->u_older));
  PetscCall(StateNodes(state, "age", 1, a->age));
  PetscCall(BodiesBeginRows(a->bodies, &rows));
  PetscCall(BodiesVisitReals(a->bodies, &rows, state, "U_older", 6, (PetscReal *)a->U_older));
  PetscCall(BodiesVisitReals(a->bodies, &rows, state, "calm", 1, a->calm));
  PetscCall(BodiesVisitReals(a->bodies, &rows, state, "gap_last", 1, a->gap_last));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}
