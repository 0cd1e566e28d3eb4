/* Limits: see steplimits.h. Nothing here communicates but the rows themselves: every rank has the same numbers. */
#include "compat.h"
#include "steplimits.h"
#include "base/log.h"

#define SHORT   10 /* times shorter than expected: steps that are counted, and remarked when they are MANY of all */
#define MANY    0.1
#define BEYOND  1.1 /* length of a step over what a participant stands, that counts: speeds are extrapolated */
#define SEVERAL 20  /* steps, of which a run has more: a sudden start makes the first ones short */

typedef struct {
  Limit     limit;
  PetscInt  steps, refused, exceeded;
  PetscInt  brief;  /* short steps that it is the cause of, of this process */
  PetscReal dt_min; /* shortest step that it gave its length */
} Row;

struct _p_Limits {
  PetscInt  n, accepted;
  PetscInt  deciding, cause; /* of the step that is tried */
  PetscInt  speaker;         /* the row for which the one that is asked has shortened the step, -1: itself */
  Couple    couple;          /* of LimitsAddParticipants */
  PetscReal expected, dt_min;
  Row       row[MONITOR_LIMITS];
};

PetscErrorCode LimitsCreate(Limits *limits)
{
  const Limit time = {.stage  = LIMIT_CHECK,
                      .name   = "time",
                      .what   = "times that steps meet",
                      .option = "-sim_time, -output_interval",
                      .unit   = "",
                      .then   = "the last two steps before it share what is left"};

  PetscFunctionBeginUser;
  PetscCall(PetscNew(limits));
  (*limits)->speaker = -1;
  PetscCall(LimitsAdd(*limits, &time, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsDestroy(Limits *limits)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(*limits));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscInt find_row(Limits l, const char name[])
{
  for (PetscInt i = 0; i < l->n; i++)
    if (!strcmp(l->row[i].limit.name, name)) return i;
  return -1;
}

PetscErrorCode LimitsAdd(Limits l, const Limit *limit, PetscInt *row)
{
  PetscFunctionBeginUser;
  PetscCheck(l->n < MONITOR_LIMITS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "Limit '%s' of a step: there is room for %d",
             limit->name, MONITOR_LIMITS);
  PetscCheck(find_row(l, limit->name) < 0, PETSC_COMM_SELF, PETSC_ERR_PLIB,
             "Limit '%s' of a step is in the table already", limit->name);
  l->row[l->n].limit = *limit;
  if (row) *row = l->n;
  l->n++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_participant(Limits l, const char name[], PetscInt *row)
{
  PetscFunctionBeginUser;
  PetscCall(
    LimitsAdd(l, &(Limit){.stage = LIMIT_BOUND, .name = name, .what = name, .unit = "", .then = "shorter"}, row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ask_participants(void *limits, PetscReal *dt)
{
  Limits      l = limits;
  const char *who;

  PetscFunctionBeginUser;
  PetscCall(CoupleLimitStep(l->couple, dt, &who));
  if (!who) PetscFunctionReturn(PETSC_SUCCESS);
  l->speaker = find_row(l, who);
  if (l->speaker < 0) PetscCall(add_participant(l, who, &l->speaker));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsAddParticipants(Limits l, Couple couple)
{
  const char *name;

  PetscFunctionBeginUser;
  l->couple = couple;
  PetscCall(LimitsAdd(l,
                      &(Limit){.stage = LIMIT_BOUND,
                               .name  = "participants",
                               .what  = "participants of the coupling",
                               .unit  = "",
                               .then  = "shorter",
                               .apply = ask_participants,
                               .ctx   = l},
                      NULL));
  for (PetscInt i = 0; (name = CoupleLimitName(couple, i)); i++) PetscCall(add_participant(l, name, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

PetscErrorCode LimitsSetDeciding(Limits l, PetscInt row)
{
  PetscFunctionBeginUser;
  l->deciding = row;
  if (l->row[row].limit.stage <= LIMIT_BOUND) l->cause = row;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsAsk(Limits l, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = PETSC_MAX_REAL;
  for (int stage = 0; stage < LIMIT_CHECK; stage++)
    for (PetscInt i = 0; i < l->n; i++) {
      const Limit    *row    = &l->row[i].limit;
      const PetscReal before = *dt;

      if ((int)row->stage != stage || !row->apply) continue;
      l->speaker = -1;
      PetscCall((*row->apply)(row->ctx, dt));
      if (*dt != before) PetscCall(LimitsSetDeciding(l, l->speaker < 0 ? i : l->speaker));
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsGetDeciding(Limits l, PetscInt *row, PetscInt *cause)
{
  PetscFunctionBeginUser;
  if (row) *row = l->deciding;
  if (cause) *cause = l->cause;
  PetscFunctionReturn(PETSC_SUCCESS);
}

const char *LimitsName(Limits l, PetscInt row)
{
  return l->row[row].limit.name;
}

PetscErrorCode LimitsRefuse(Limits l, PetscInt row)
{
  PetscFunctionBeginUser;
  l->row[row].refused++;
  PetscCall(PetscInfo(NULL, "the step is refused: %s\n", l->row[row].limit.what));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsExceed(Limits l, PetscInt row)
{
  PetscFunctionBeginUser;
  if (l) l->row[row].exceeded++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsAccept(Limits l, PetscReal dt)
{
  Row        *deciding = &l->row[l->deciding];
  PetscReal   ratio    = 0;
  const char *who;

  PetscFunctionBeginUser;
  deciding->dt_min = deciding->steps ? PetscMin(deciding->dt_min, dt) : dt;
  l->dt_min        = l->accepted ? PetscMin(l->dt_min, dt) : dt;
  deciding->steps++;
  l->accepted++;
  if (dt * SHORT < l->expected) l->row[l->cause].brief++;
  if (l->couple) PetscCall(CoupleOverstep(l->couple, &ratio, &who));
  if (ratio > BEYOND) PetscCall(LimitsExceed(l, find_row(l, who)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the end ---- */

PetscErrorCode LimitsExpect(Limits l, PetscReal dt)
{
  PetscFunctionBeginUser;
  l->expected = dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsCount(Limits l, const char name[], PetscInt *steps, PetscInt *refused, PetscInt *exceeded)
{
  const PetscInt i = find_row(l, name);

  PetscFunctionBeginUser;
  if (steps) *steps = i < 0 ? -1 : l->row[i].steps;
  if (refused) *refused = i < 0 ? -1 : l->row[i].refused;
  if (exceeded) *exceeded = i < 0 ? -1 : l->row[i].exceeded;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What a run that takes many times as long as its first step promised is told */
static PetscErrorCode remark_short(Limits l)
{
  PetscInt     all = 0, max_row = 0;
  const Limit *why;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->n; i++) {
    all += l->row[i].brief;
    if (l->row[i].brief > l->row[max_row].brief) max_row = i;
  }
  why = &l->row[max_row].limit;
  if (l->accepted > SEVERAL && all > MANY * (PetscReal)l->accepted)
    PetscCall(LogRemark("%" PetscInt_FMT " of %" PetscInt_FMT
                        " steps were less than a tenth of the first, %g, down to %g; most of them for %s%s%s%s",
                        all, l->accepted, (double)l->expected, (double)l->dt_min, why->what, why->option ? " (" : "",
                        why->option ? why->option : "", why->option ? ")" : ""));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsFinish(Limits l, Monitor monitor)
{
  PetscFunctionBeginUser;
  PetscCall(remark_short(l));
  for (PetscInt i = 0; i < l->n; i++) {
    const Row   *row = &l->row[i];
    const Limit *of  = &row->limit;

    PetscCall(MonitorAddLimit(monitor,
                              &(MonitorLimit){.name   = of->name,
                                              .what   = of->what,
                                              .option = of->option,
                                              .unit   = of->unit,
                                              .then   = of->then,
                                              .value  = of->value,
                                              .chosen = (PetscBool)(of->stage > LIMIT_GIVEN && of->stage < LIMIT_CHECK),
                                              .steps  = row->steps,
                                              .refused  = row->refused,
                                              .exceeded = row->exceeded,
                                              .dt_min   = row->dt_min}));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LimitsVisitState(void *limits, State state)
{
  Limits    l = limits;
  PetscBool has;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < l->n; i++) {
    Row      *row      = &l->row[i];
    PetscInt  count[3] = {row->steps, row->refused, row->exceeded};
    PetscReal dt       = row->dt_min;
    char      name[64];

    PetscCall(StateHas(state, row->limit.name, &has));
    if (!has) continue;
    PetscCall(PetscSNPrintf(name, sizeof(name), "%s_dt", row->limit.name));
    PetscCall(StateInts(state, row->limit.name, 3, count));
    PetscCall(StateReals(state, name, 1, &dt));
    row->steps    = count[0];
    row->refused  = count[1];
    row->exceeded = count[2];
    row->dt_min   = dt;
  }
  PetscCall(StateHas(state, "accepted", &has));
  if (has) PetscCall(StateInts(state, "accepted", 1, &l->accepted));
  if (has) PetscCall(StateReals(state, "dt_min", 1, &l->dt_min));
  PetscFunctionReturn(PETSC_SUCCESS);
}
