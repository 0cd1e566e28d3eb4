/* Sim: how long steps are. Whoever knows a limit has a row in one table (steplimits.h); here are those of the loop. */
#include "compat.h"
#include "simimpl.h"

static PetscErrorCode want_fixed(void *sim, PetscReal *dt)
{
  PetscFunctionBeginUser;
  *dt = ((Sim)sim)->dt;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimCreateLimits(Sim s)
{
  const SimComponents *p = &s->components;
  const Limit fixed   = {LIMIT_GIVEN, "dt", "the length that is given", "-sim_dt", "time", "every step has it", s->dt,
                         want_fixed,  s};
  const Limit contact = {LIMIT_CHECK,     "contact",      "the time in which a contact force changes",
                         "-contact_law",  "of that time", "contact takes sub-steps",
                         CONTACT_SUBSTEP, NULL,           NULL};

  PetscFunctionBeginUser;
  PetscCall(LimitsCreate(&s->limits));
  if (p->steady) PetscFunctionReturn(PETSC_SUCCESS);
  if (p->couple) PetscCall(CoupleSetStep(p->couple, s->dt));
  if (p->flow)
    PetscCall(AdaptCreate(p->flow, p->bodies, p->couple, p->contact, p->monitor, s->limits, s->dt, &s->adapt));
  if (!s->adapt) PetscCall(LimitsAdd(s->limits, &fixed, NULL));
  if (!s->trial)
    PetscCall(TimeErrorCreate(p, s->limits, s->time_end < PETSC_MAX_REAL ? s->time_end : s->steps_max * s->dt,
                              &s->components.time_error));
  if (p->flow) PetscCall(LimitsAddParticipants(s->limits, p->couple));
  if (p->flow) PetscCall(StepCheckCreate(p->flow, p->bodies, p->couple, s->limits, &s->check));
  if (s->s->nall) PetscCall(LimitsAdd(s->limits, &contact, &s->contact_row));
  if (p->flow) PetscCall(CoupleGetBound(p->couple, &s->bound));
  if (s->bound)
    PetscCall(LimitsAdd(s->limits,
                        &(Limit){.stage  = LIMIT_CHECK,
                                 .name   = s->bound->name,
                                 .what   = s->bound->what,
                                 .option = s->bound->option,
                                 .unit   = s->bound->unit,
                                 .then   = s->bound->then,
                                 .value  = s->bound->value},
                        &s->bound_row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool SimIsAtEnd(Sim s)
{
  return (PetscBool)(s->step >= s->steps_max || s->time >= s->time_end * (1 - 1e-12) - 1e-9 * s->dt);
}

PetscErrorCode SimChooseStep(Sim s, PetscReal *dt)
{
  PetscReal left;

  PetscFunctionBeginUser;
  s->until    = s->time_end;
  s->snapshot = PETSC_FALSE;
  if (s->interval > 0) {
    const PetscReal next = (PetscFloorReal(s->time / s->interval + 1e-9) + 1) * s->interval;

    s->snapshot = (PetscBool)(next <= s->time_end * (1 + 1e-12));
    s->until    = PetscMin(next, s->time_end);
  }
  left = s->until - s->time;
  if (s->adapt) PetscCall(AdaptGetStep(s->adapt, s->time, s->until, dt, &s->hits));
  else {
    PetscBool shared;

    PetscCall(LimitsAsk(s->limits, dt));
    s->hits = (PetscBool)(left < *dt * (1 + 1e-6));
    /* no step so short that the next one is long beside it */
    shared = (PetscBool)(s->snapshot && left < *dt * (2 - 1e-6));
    if (s->hits ? left < *dt * (1 - 1e-6) : shared) PetscCall(LimitsSetDeciding(s->limits, LIMITS_TIME));
    if (s->hits || shared) *dt = s->hits ? left : 0.5 * left;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SimCountLimits(Sim s, PetscReal dt)
{
  PetscInt substeps;

  PetscFunctionBeginUser;
  if (s->components.steady) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(LimitsAccept(s->limits, dt));
  if (s->bound && s->bound->exceeded > s->bound_exceeded) PetscCall(LimitsExceed(s->limits, s->bound_row));
  if (s->bound) s->bound_exceeded = s->bound->exceeded;
  if (!s->s->nall) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ContactGetWork(s->components.contact, NULL, NULL, &substeps));
  if (substeps > 1) PetscCall(LimitsExceed(s->limits, s->contact_row));
  PetscFunctionReturn(PETSC_SUCCESS);
}
