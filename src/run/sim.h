/* Sim: the time loop.

   A steady scene solves once, without time: it is reported as one step of length 0.

   Options: -sim_steady (read by the scene), or -sim_dt, -sim_time (end), -sim_steps (at most; whichever comes first);
   for steps of varying length adapt.h. */
#pragma once
#include "report/outlines.h"
#include "bodies/outflow.h"
#include "report/checkpoint.h"
#include "contact/contact.h"
#include "couple/couple.h"
#include "mesh/deform.h"
#include "flow/flow.h"
#include "report/monitor.h"
#include "report/fields.h"
#include "report/diagnostics.h"
#include "report/statistics.h"
#include "solid/solid.h"
#include "phase/drops.h"
#include "report/suspension.h"
#include "refine.h"
#include "frame.h"
#include "meshadapt.h"
#include "steady.h"

typedef struct _p_Gauge        *Gauge;
typedef struct _p_ScalarLayers *ScalarLayers;
typedef struct _p_TimeError    *TimeError;

/* The parts of a simulation, built by the scene; contact and bodies may be inactive but exist. Without a flow: flow
   and couple are NULL. Not owned. */
typedef struct SimComponents SimComponents;
struct SimComponents {
  MPI_Comm      comm; /* of the run */
  const char   *scene;
  Mesh          mesh;
  Frame         frame;     /* NULL: the box stays */
  Deform        deform;    /* NULL: the mesh stays */
  Refine        refine;    /* NULL: cells stay */
  MeshAdapt     meshadapt; /* NULL: not refined by the flow */
  Flow          flow;
  Bodies        bodies;
  Couple        couple;
  Solids        solids; /* NULL: none is elastic */
  Drops         drops;  /* NULL: none is a fluid */
  Contact       contact;
  Border        border; /* of the domain */
  BodiesOutflow outflow;
  Fields        fields;
  Outlines      outlines;
  Monitor       monitor;
  Diagnostics   diagnostics;
  Statistics    statistics;   /* NULL: not wanted */
  Suspension    suspension;   /* NULL: not wanted */
  Steady        steady;       /* NULL: time steps */
  Steady        steady_start; /* NULL, or the solver of the flow at the start (-flow_initial steady) */
  Checkpoint    checkpoint;
  ScalarLayers  scalar_layers; /* NULL: nothing is carried around bodies */
  /* makes what a run of the options as they are now needs that writes nothing, for accuracy.h; NULL: no such run */
  PetscErrorCode (*make)(SimComponents *), (*destroy)(SimComponents *);
  PetscBool timed;            /* make: of a run in time, not of a steady one */
  Gauge     gauge;            /* NULL: no run in time whose error is estimated */
  TimeError time_error;       /* NULL: not known */
  Expr      gravity;          /* without a flow: gravity that changes in time, or NULL */
  PetscReal gravity_start[3]; /* likewise: gravity at the start */
};

typedef struct _p_Sim *Sim;

/* Reads the -sim_ options and adds the states of all parts to the checkpoint. Collective. Errors: neither end time
   nor steps given. */
PetscErrorCode SimCreate(const SimComponents *, Sim *);
PetscErrorCode SimDestroy(Sim *);
PetscErrorCode SimView(Sim, PetscViewer);
/* Length of the first step; when the run ends, by its time or its steps of that length; *adapted: the run chooses those
   after it. */
PetscErrorCode SimGetStep(Sim, PetscReal *dt, PetscReal *end, PetscBool *adapted);
/* Set up every solver on the initial state, so that all options are read before the first step. Collective. */
PetscErrorCode SimSetUp(Sim);
/* The output directory is open and the run goes on: what it has of later steps goes. Collective. */
PetscErrorCode SimRewind(Sim);
/* Run to the end, or until SIGTERM. A failed solve stops with an error after the last good state has been written.
   Collective. */
PetscErrorCode SimRun(Sim);
/* After it: estimates of the error, quantities, the summary, the last checkpoint. Collective. */
PetscErrorCode SimFinish(Sim);
/* The same for parts without monitor and checkpoint (SimComponents.make), from start to end: nothing is written or told
   but to the gauge, borrowed. A signal ends it early. Collective. Errors: a failed solve, a flow that is not to be
   believed. */
PetscErrorCode SimRunTrial(Sim, Gauge *);
