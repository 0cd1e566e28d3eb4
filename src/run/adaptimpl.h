/* Adapt: what its files share. adapt.c: control, limits, life cycle. adapterror.c: the error of a step. */
#pragma once
#include "adapt.h"
#include "calm.h"
#include "bodies/local.h"

/* Rows of the table of limits */
enum {
  ROW_ERROR,
  ROW_MAX,
  ROW_CFL,
  ROW_GAP,
  ROW_DISPLACEMENT,
  ROW_MIN,
  ROW_GROWTH,
  ROW_START,
  ROW_SOLVE,
  NROWS
};

/* Columns of series.csv */
enum {
  COLUMN_ERROR,
  COLUMN_REJECTED,
  COLUMN_LIMIT,
  NCOLUMNS
};

/* -sim_adapt_<name> */
typedef struct {
  PetscReal tolerance, speed, cfl, move, gap, min, max, growth, hysteresis;
} AdaptOptions;

struct _p_Adapt {
  MPI_Comm         comm;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  Contact          contact;
  Monitor          monitor;
  Limits           limits;
  BodyState       *s;
  const MeshLocal *l;
  AdaptOptions     o;
  PetscReal        dt;                       /* next step, but for times to hit */
  PetscReal        wanted;                   /* the same, whatever the smallest and the largest step are */
  PetscReal        by_cfl, by_gap;           /* longest next step by the last accepted one: CFL number, approach */
  PetscReal        error;                    /* of the last step; 0: no estimate */
  PetscReal        speed_max;                /* so far */
  PetscReal        dt_older, last;           /* length of the step before the last; of the last; 0: none */
  PetscReal        shortest, longest;        /* taken so far */
  PetscInt         accepted, rejected;       /* steps */
  PetscInt         penalty_bodies;           /* bodies that the mesh did not follow in the last step */
  PetscInt         smooth;                   /* accepted steps since the last jump */
  PetscReal        first_dt, first_error;    /* of the first attempt at this step, 0: this is it */
  PetscReal        start_dt;                 /* of the last attempt at the first step of all, whose velocities are in
                                                u_older and U_older; 0: none */
  PetscReal       *u_older, *age;            /* [nnode_all][dim] u^{n-2}; [nnode_all] (calm.h) */
  PetscReal (*U_older)[6], *calm, *gap_last; /* [n] velocities at n-2; steps since contact; gap in the last step */
  PetscInt row[NROWS], column[NCOLUMNS];
};

/* The first step of a run, whose history is too short: its error by an attempt that was longer, start_dt, as a step of
   backward Euler that starts smoothly; of the flow only where no boundary moves. *estimated false: it takes another
   attempt. Collective. */
PetscErrorCode AdaptEstimateStart(Adapt, PetscReal dt, PetscBool *estimated);
/* Keep what this attempt at it came to, for the next. Local. */
PetscErrorCode AdaptKeepStart(Adapt, PetscReal dt);
/* The error of the step that was solved, into a->error, 0 where *estimated is false: the history is too short. Tells
   the largest speed so far, too. Collective. */
PetscErrorCode AdaptEstimateError(Adapt, const FlowStep *, PetscBool *estimated);
