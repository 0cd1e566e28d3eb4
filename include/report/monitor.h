/* Monitor: tables, progress lines and the summary of a run. Called by run; other files of report add columns.

   Files of the output directory: options.txt (versions, every option; before the first step), series.csv (a line a
   reported step), bodies.csv (a line a body and reported step), summary.json (at the end). Standard output: progress
   lines, a one-page summary. Files are flushed line by line, so that a running or killed job can be read.
   Units are those of the scene, which may name them (-units_length, -units_time, -units_mass): headings and the entry
   "units" of summary.json then say so. Nothing is converted.
   Columns: runs/reference/OUTPUT.md (MONITOR_SERIES, MONITOR_BODIES, MONITOR_FURTHER below).

   Collective: on the communicator of the run. Borrowed arguments: Bodies, names of limits. */
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

/* ---- tables of columns ---- */

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
/* Is there a row of MONITOR_FURTHER for this name? Local. */
PetscBool MonitorExplains(const char name[]);
/* Prints all tables of columns and of datasets as runs/reference/OUTPUT.md. Local. */
void MonitorPrintTables(FILE *);

/* ---- set-up of a scene ---- */

/* Reads -output_series, _progress, _progress_solver, _bodies, _bandwidth and -units_*; touches no file. The bodies are
   not owned and must live as long as the monitor. Collective on the communicator of the run. Errors: -output_bodies
   outside of the bodies there are. */
PetscErrorCode MonitorCreate(MPI_Comm, Bodies, Monitor *);
/* Communicator of the run. Local. */
MPI_Comm MonitorComm(Monitor);
/* Units of length, time and mass that the scene names ("" where it does not), and what they are in metres, seconds and
   kilograms (0). Borrowed. Local. */
PetscErrorCode MonitorGetUnits(Monitor, const char *unit[3], PetscReal si[3]);
/* A further column of series.csv, after those above; columns are numbered from 0. Before MonitorOpen, same calls on
   all ranks. Its value is 0 until MonitorSetColumn; the last value is printed. Local.
   Error: no row of MONITOR_FURTHER explains it. */
PetscErrorCode MonitorAddColumn(Monitor, const char name[], PetscInt *column);
/* Sets the value of a column. Local. */
PetscErrorCode MonitorSetColumn(Monitor, PetscInt column, PetscReal value);
/* The run writes a further table of this name, which its last line is to tell (borrowed). Local. */
PetscErrorCode MonitorAddFile(Monitor, const char name[]);
/* StateVisit of a Monitor: what it has tracked, and how long its files are. */
PetscErrorCode MonitorVisitState(void *monitor, State);
/* Open the files in the existing directory `dir` (old ones are replaced) and write options.txt: call it after
   everything else is set up. Once a state has been loaded, files that are there are cut at the loaded length and
   continued, options.txt is appended to. Collective. Errors: directory not writable, files that are not those of the
   run. */
PetscErrorCode MonitorOpen(Monitor, const char dir[]);
/* Closes the files and sets it to NULL. Collective. */
PetscErrorCode MonitorDestroy(Monitor *);

/* ---- after every step ---- */

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

/* Will MonitorWrite print a line of this step? If not, what only lines show need not be set. Local, the same on
   all ranks. */
PetscBool MonitorPrints(Monitor, const MonitorStep *, PetscReal time_end);

/* Adds wall clock seconds of this rank to a phase; the summary shows the largest over all ranks. Local. */
PetscErrorCode MonitorPhaseSeconds(Monitor, MonitorPhase, PetscReal seconds);

/* ---- for the summary ---- */

/* Set a quantity of summary.json (a second call replaces it); values that are not finite become null. Same calls on
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

/* A rank that got less of its core than CORE_FRACTION, and waited for more than CORE_WAIT of the time while another
   ran, in a run of at least CORE_WALL seconds, has a line in the summary */
#define CORE_FRACTION 0.7
#define CORE_WAIT     0.1
#define CORE_WALL     2.0
/* Work of this rank (cells, bodies, ...): summary.json has smallest, mean and largest over the ranks in balance.<name>.
   A second call replaces the value. core_share: processor time over wall time; core_wait: fraction of the time that the
   rank was ready to run and another ran. Collective. */
PetscErrorCode MonitorBalance(Monitor, const char name[], PetscReal mine);

/* After the last step, with -output_bandwidth (*wanted): memory and wall clock of the run are taken, before
   MonitorBandwidth measures memory bandwidth and one product with S (bandwidth.h) for summary.json. Collective. */
PetscErrorCode MonitorEnd(Monitor, PetscBool *wanted);
/* Measures for summary.json; S: matrix of the flow. After MonitorEnd with *wanted. Collective. */
PetscErrorCode MonitorBandwidth(Monitor, Mat S);

/* Write summary.json and print the summary. seconds.total is the set-up plus the wall clock from the beginning of the
   first step until now; memory_mb is the sum of the peak memory of all ranks (getrusage), in 2^20 bytes. cells and
   unknowns are those of the whole mesh. Collective. */
PetscErrorCode MonitorFinish(Monitor, const char scene[], PetscInt cells, PetscInt unknowns, PetscInt steps,
                             PetscReal time_end);
