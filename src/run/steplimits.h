/* Limits: what bounds the length of a time step, in one table.

   A row says who limits (name, what, option), by how much (value, unit), and what happens (then). Rows come from those
   who know: the controller of the step (adapt.h), the checks of a step (stepcheck.h), meshes that are rebuilt
   (refine.h), contact, the participants of the coupling (CoupleLimitStep), the time loop. Rows with `apply` are asked
   before every step, stage by stage, and make *dt what they stand; all others say when a step was too long for them.
   One more row is one more LimitsAdd, in the file that knows the number.

   The table counts: whose word the length of a step was (the row that changed it last), who refused a step, so that it
   was taken again, and whose bound a step exceeded. At the end of a run it stands in summary.json ("step_limits"), and
   rows that shortened or refused steps stand in the summary that is printed. */
#pragma once
#include "base/state.h"
#include "couple/couple.h"
#include "report/monitor.h"

/* In this order rows are asked */
typedef enum {
  LIMIT_GIVEN,  /* the length that the user gives: no news */
  LIMIT_WANTED, /* the length that a controller wants */
  LIMIT_BOUND,  /* no longer than this */
  LIMIT_FLOOR,  /* but no shorter than that */
  LIMIT_CHANGE, /* beside the step before */
  LIMIT_CHECK,  /* not asked: of steps that were taken */
  LIMIT_NSTAGES
} LimitStage;

typedef struct {
  LimitStage  stage;
  const char *name;   /* a word, for summary.json: "cfl" */
  const char *what;   /* as part of a sentence: "the CFL number" */
  const char *option; /* that sets the value; NULL: none */
  const char *unit;   /* of the value, "" for none */
  const char *then;   /* what happens: "the step is shortened" */
  PetscReal   value;
  /* *dt becomes what this row stands, the same on all ranks; NULL: it is never asked. Collective. */
  PetscErrorCode (*apply)(void *ctx, PetscReal *dt);
  void *ctx;
} Limit;

typedef struct _p_Limits *Limits;

/* With row 0, the times that steps must meet (-sim_time, -output_interval). Not collective. */
#define LIMITS_TIME 0
PetscErrorCode LimitsCreate(Limits *);
PetscErrorCode LimitsDestroy(Limits *);
/* The texts are borrowed. *row: its number, for what follows (NULL: not wanted). A name that is there already is a
   mistake of the program. */
PetscErrorCode LimitsAdd(Limits, const Limit *, PetscInt *row);

/* A row for all participants of the coupling (CoupleParticipant.limit), and one by name for each that has a limit, from
   the beginning, so that its counts survive a restart. Once, before the first step. */
PetscErrorCode LimitsAddParticipants(Limits, Couple);

/* Length of the next step as the rows want it, but for times to meet. Collective, the same on all ranks. */
PetscErrorCode LimitsAsk(Limits, PetscReal *dt);
/* The same after LimitsAsk: this row has made the step what it is */
PetscErrorCode LimitsSetDeciding(Limits, PetscInt row);
/* Whose word the length is, and who of those that shorten steps was the last to (up to LIMIT_BOUND): the cause
   where the step only grows back. Either may be NULL. */
PetscErrorCode LimitsGetDeciding(Limits, PetscInt *row, PetscInt *cause);

const char *LimitsName(Limits, PetscInt row);

/* The step that was tried is refused by this row, and will be taken again */
PetscErrorCode LimitsRefuse(Limits, PetscInt row);
/* The step was longer than this row's bound (LIMIT_CHECK). `limits` may be NULL. */
PetscErrorCode LimitsExceed(Limits, PetscInt row);
/* The step of length dt was taken: counts it, also as beyond what a participant stands (CoupleOverstep). Collective.
   */
PetscErrorCode LimitsAccept(Limits, PetscReal dt);

/* Steps are expected to be as long as this: where many become shorter than a tenth, LimitsFinish remarks why. */
PetscErrorCode LimitsExpect(Limits, PetscReal dt);
/* Counts of the row of that name, -1 if there is none. Any may be NULL. */
PetscErrorCode LimitsCount(Limits, const char name[], PetscInt *steps, PetscInt *refused, PetscInt *exceeded);
/* At the end of the run: remarks, and the table for the summary. Collective. */
PetscErrorCode LimitsFinish(Limits, Monitor);
/* StateVisit of Limits: the counts. Rows that a file does not have begin at 0. */
PetscErrorCode LimitsVisitState(void *limits, State);
