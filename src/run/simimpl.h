/* The inside of Sim, for sim.c, simlimits.c, giveup.c and finish.c. */
#pragma once
#include "sim.h"
#include "adapt.h"
#include "bondreport.h"
#include "books.h"
#include "cores.h"
#include "dropreport.h"
#include "solidreport.h"
#include "stepcheck.h"
#include "steplimits.h"
#include "timeerror.h"

struct _p_Sim {
  SimComponents      components;
  BodyState         *s;
  PetscReal          dt, dt_old, time_end, time; /* dt_old: the step before, with sub-steps the part before */
  PetscInt           steps_max, step, substeps;  /* substeps: of bodies alone, altogether */
  Limits             limits;
  PetscInt           contact_row; /* of these */
  const CoupleBound *bound;       /* of the coupling, NULL: none; its row, and what has been counted there */
  PetscInt           bound_row, bound_exceeded;
  Adapt              adapt;           /* NULL: fixed steps */
  Books              books;           /* NULL: not wanted */
  BondReport         bond_report;     /* NULL: there are no bonds */
  SolidReport        solid_report;    /* NULL: nothing is elastic */
  DropReport         drop_report;     /* NULL: nothing is a fluid */
  StepCheck          check;           /* NULL: no time steps of a flow */
  PetscInt           fields_good;     /* step of the last fields before any doubt, -1: none */
  PetscReal          interval, until; /* -output_interval; the time that steps must not pass */
  PetscBool          hits, snapshot;  /* the step ends there; fields are written there */
  PetscInt           spring_column;   /* of series.csv; -1: no springs */
  PetscInt           its;             /* outer iterations of the time step so far */
  FlowDiagnostics    diag;
  CoupleBalance      balance;
  PetscReal (*a)[3], (*alpha)[3];        /* acceleration of the bodies without contact, for the sub-steps of contact */
  PetscBool        trial;                /* writes and tells nothing: SimRunTrial */
  PetscBool        local_bodies_updated; /* bodies that are spread have gone to the ranks that need them */
  PetscBool        has_acceleration, renew;
  PetscBool        ended; /* a signal ended a solve: the step has not been taken */
  Cores            cores;
  const PetscReal *eta;   /* [own cells] error of the steady solution, NULL: not known */
  MonitorPhase     phase; /* begun at the clock `since` */
  PetscLogDouble   since;
};

/* The solve of a step dt failed: stops, with what to do. Fields of the state before it have been written. Collective.
   */
PetscErrorCode SimStopUnsolved(Sim, KSPConvergedReason, PetscInt its, PetscReal dt);
/* Stops when too many steps in a row were out of bounds; last: the run is at its end. Collective. */
PetscErrorCode SimStopDoubted(Sim, PetscReal dt, PetscBool last);
/* Creates the limits with the rows of the loop, of the controller (-sim_adapt) and of the checks. Collective. */
PetscErrorCode SimCreateLimits(Sim);
PetscBool      SimIsAtEnd(Sim);
/* Length of the next step, and whether it ends at the time s->until: the end of the run, or that of a snapshot.
   Collective. */
PetscErrorCode SimChooseStep(Sim, PetscReal *dt);
/* The step was taken: whose length it had, what it exceeded. Collective. */
PetscErrorCode SimCountLimits(Sim, PetscReal dt);
