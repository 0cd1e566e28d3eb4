/* Monitor: what a run says about itself while it goes on and at its end.

   Files of the output directory: options.txt (versions and every option, written before the first step), series.csv
   (one line a reported step), bodies.csv (one line a body and reported step) and summary.json (at the end). Standard
   output: progress lines with the estimated time left, and a one-page summary. The files grow line by line and are
   flushed, so that a running or killed job can be read.
   Units are those of the scene, which may name them (-units_length, -units_time, -units_mass): headings and the entry
   "units" of summary.json then say so, and tools/plot labels with them; nothing is converted. The suffixes _s and _rad
   of columns are names that scripts rely on: time and angle, the former in seconds only if the scene's time is.

   The columns of the tables are MONITOR_SERIES and MONITOR_BODIES below; further ones of series.csv come from
   MonitorAddColumn, see diagnostics.h.
   Options: -units_length, -units_time, -units_mass, -output_series, -output_progress,
   -output_progress_solver, -output_bodies first,last, -output_bandwidth. */
#pragma once
#include "bodies/bodies.h"
#include "base/state.h"
#include <petscmat.h>
#include <stdio.h>

typedef struct _p_Monitor *Monitor;

typedef struct {
  PetscInt  step;
  PetscReal time, dt; /* time at the end of the step */
  PetscReal cfl;
  PetscInt  outer_iterations;
  PetscReal divergence, kinetic_energy, momentum_error;
  PetscReal gradient, speed; /* of the fluid, for lines of progress: what its divergence is compared with, in the same
                                norm; largest velocity */
  PetscReal bodies_energy, contact_energy,
    contact_work;    /* kinetic energy of the bodies; energy stored in contacts; work of contact on the bodies since the
                        beginning */
  PetscReal seconds; /* wall clock of this step */
} MonitorStep;

typedef enum {
  MONITOR_SETUP,    /* everything before the first step */
  MONITOR_NSE,      /* the flow equations */
  MONITOR_FORCE,    /* forces on bodies */
  MONITOR_PARTICLE, /* marking of nodes, motion and contact of bodies */
  MONITOR_OUTPUT,
  MONITOR_MESH, /* cells rebuilt, with all that stands on them; shown where the mesh has levels of refinement */
  MONITOR_NPHASES
} MonitorPhase;

/* A column of a table: unit "" for numbers; `digits` as printed, 0: text; meaning "": as the one before. The tables
   end with name NULL. */
typedef struct {
  const char *name, *unit;
  PetscInt    digits;
  const char *meaning;
} MonitorColumn;
extern const MonitorColumn MONITOR_SERIES[], MONITOR_BODIES[];
/* What further columns of series.csv may be called: a <word> stands for any text. */
extern const MonitorColumn MONITOR_FURTHER[];
/* Is there a row of that table for this name? */
PetscBool MonitorExplains(const char name[]);
/* All tables of columns and of datasets as runs/reference/OUTPUT.md. */
void MonitorPrintTables(FILE *);

/* Reads the options; touches no file. The bodies are not owned and must live as long as the monitor. Collective on
   the communicator of the run.
   Errors: -output_bodies outside of the bodies there are. */
PetscErrorCode MonitorCreate(MPI_Comm, Bodies, Monitor *);
/* Of all ranks that take part in the run */
MPI_Comm MonitorComm(Monitor);
/* Units of length, time and mass that the scene names ("" where it does not), and what they are in metres, seconds and
   kilograms (0). Borrowed. */
PetscErrorCode MonitorGetUnits(Monitor, const char *unit[3], PetscReal si[3]);
/* A further column of series.csv, after those above; columns are numbered from 0. Before MonitorOpen, same calls on
   all ranks. Its value is 0 until it is set; the value of the last MonitorSetColumn is printed. Not collective.
   Error: no row of MONITOR_FURTHER explains it. */
PetscErrorCode MonitorAddColumn(Monitor, const char name[], PetscInt *column);
PetscErrorCode MonitorSetColumn(Monitor, PetscInt column, PetscReal value);
/* StateVisit of a Monitor: what it has tracked, and how long its files are. */
PetscErrorCode MonitorVisitState(void *monitor, State);
/* Open the files in the existing directory `dir` (old ones are replaced) and write options.txt: call it after
   everything else is set up. Once a state has been loaded, files that are there are cut at the loaded length and
   continued, options.txt is appended to. Collective. Errors: directory not writable, files that are not those of the
   run. */
PetscErrorCode MonitorOpen(Monitor, const char dir[]);
PetscErrorCode MonitorDestroy(Monitor *);

/* After every step (and, if wanted, once before the first with step 0 and dt 0): tracks iterations and, from the
   state of the bodies, the quantities
     fall_speed_max (largest -v, in 3D -w) and speed_max (largest |u|) of bodies that are free to move,
     overlap_max (largest -gap in diameters of the bounding circle, at least 0);
   every -output_series steps (1) it appends to the files, every -output_progress steps (0: so that some 20 to 50
   lines are printed) it prints.
   The last step before time_end is always reported. Collective. Errors: files that cannot be written (disk full).
   A line: step, time, step length, CFL, largest velocity, divergence over velocity gradient, wall clock of the step,
   how much is done and the time left; -output_progress_solver: iterations, kinetic energy, momentum error too. On a
   terminal a bar stands below the lines while the run goes on. */
PetscErrorCode MonitorWrite(Monitor, const MonitorStep *, PetscReal time_end);

/* Will MonitorWrite print a line of this step? What is for lines alone need not be set else. Same on all ranks. */
PetscBool MonitorPrints(Monitor, const MonitorStep *, PetscReal time_end);

/* Add wall clock seconds of this rank to a phase; the summary shows the largest over all ranks. Not collective. */
PetscErrorCode MonitorPhaseSeconds(Monitor, MonitorPhase, PetscReal seconds);

/* Set a quantity of summary.json (again: the new value holds); values that are not finite become null. Same calls on
   all ranks. */
PetscErrorCode MonitorQuantity(Monitor, const char name[], PetscReal value);

/* A limit of the time step as the summary tells it: src/run/steplimits.h */
#define MONITOR_LIMITS 32
typedef struct {
  const char *name, *what, *option, *unit, *then; /* borrowed until MonitorFinish; option may be NULL */
  PetscReal   value;
  PetscBool   chosen;                   /* the run chose its steps by it: neither a length that is given, nor a check */
  PetscInt    steps, refused, exceeded; /* steps that it gave their length; refused; beyond it */
  PetscReal   dt_min;                   /* shortest of the first */
} MonitorLimit;
/* One more row of summary.json's step_limits; where the run chose steps or refused one, the page shows them. Same
   calls on all ranks. */
PetscErrorCode MonitorAddLimit(Monitor, const MonitorLimit *);

/* What this rank has to do (cells, bodies, ...): summary.json holds smallest, mean and largest over the ranks under
   balance.<name>. Again: the new value holds. core_share and core_wait are processor time over wall time of a rank,
   and the share of time that it was ready to run and another ran: the summary has a line where a rank got little.
   Collective. */
#define CORE_FRACTION 0.7 /* of a core: less is told, */
#define CORE_WAIT     0.1 /* where so much was lost to others (and was not sleep), */
#define CORE_WALL     2.0 /* s: in a run that is long enough to tell */
PetscErrorCode MonitorBalance(Monitor, const char name[], PetscReal mine);

/* After the last step, with -output_bandwidth (*wanted): memory and wall clock of the run are taken, before
   MonitorBandwidth measures memory bandwidth and one product with S (bandwidth.h) for summary.json. Collective. */
PetscErrorCode MonitorEnd(Monitor, PetscBool *wanted);
PetscErrorCode MonitorBandwidth(Monitor, Mat S);

/* Write summary.json and print the summary. seconds.total is the set-up plus the wall clock from the beginning of the
   first step until now; memory_mb is the sum of the peak memory of all ranks (getrusage), in 2^20 bytes. cells and
   unknowns are those of the whole mesh. Collective. */
PetscErrorCode MonitorFinish(Monitor, const char scene[], PetscInt cells, PetscInt unknowns, PetscInt steps,
                             PetscReal time_end);
