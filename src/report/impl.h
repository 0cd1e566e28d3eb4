/* Monitor from inside: its struct, and its three trades: tables (series.c), lines (progress.c), summary (summary.c). */
#pragma once
#include "report/monitor.h"
#include "bandwidth.h"
#include <stdio.h>

#define MAX_QUANTITIES 64
#define MAX_COLUMNS    128
#define MAX_BALANCES   8
#define MAX_FILES      8

/* What the scene calls its units, "" where it does not say */
enum {
  UNIT_LENGTH,
  UNIT_TIME,
  UNIT_MASS,
  NUNITS
};

typedef struct {
  char      name[64];
  PetscReal value;
} Quantity;

typedef struct {
  char      name[32];
  PetscReal min, mean, max; /* over the ranks */
} Balance;

struct _p_Monitor {
  MPI_Comm    comm; /* of all that takes part in the run */
  Bodies      all;
  BodyState  *bodies;
  PetscMPIInt rank, size;
  char        dir[PETSC_MAX_PATH_LEN];
  const char *further[MAX_FILES]; /* tables of others, up to the first NULL */
  const char *unit[NUNITS];
  PetscReal   si[NUNITS];         /* in metres, seconds, kilograms; 0: not said */
  FILE       *series, *body_file; /* rank 0 */
  struct {
    PetscBool restarted; /* a state has been loaded; then the next two count */
    PetscReal length[2]; /* of series.csv and bodies.csv then, bytes */
    PetscReal wall;
  } before;
  PetscInt       series_every, progress_every, first_body, last_body;
  PetscBool      solver;  /* its columns in lines of progress */
  PetscBool      bar;     /* on a terminal, on rank 0 */
  PetscLogDouble bar_at;  /* when it was drawn */
  PetscBool      tables;  /* bodies in table_<step>.h5 in place of bodies.csv */
  PetscBool      started; /* MonitorWrite has been called; then the next two are set */
  PetscReal      time_start;
  PetscLogDouble wall_start;
  /* until now; until the last call of MonitorWrite */
  PetscReal seconds[MONITOR_NPHASES], seconds_before[MONITOR_NPHASES];
  struct {
    PetscReal fall_speed, speed, overlap; /* PETSC_MIN_REAL: no such body */
  } max;
  struct {
    PetscInt  n, max; /* most, sum: of iterations */
    PetscReal sum;
  } solves;
  PetscInt nquantity, ncolumn;
  Quantity column[MAX_COLUMNS]; /* further ones of series.csv */
  Quantity quantity[MAX_QUANTITIES];
  struct {
    PetscInt n;
    Balance  row[MAX_BALANCES];
  } balances;
  struct {
    PetscInt     n;
    MonitorLimit row[MONITOR_LIMITS];
  } limits;
  PetscBool      measure, measured; /* -output_bandwidth; the rest is set then */
  Bandwidth      bandwidth;
  PetscReal      memory_mb;
  PetscLogDouble wall_end;
};

/* Open and close the two tables; append a step, seconds [MONITOR_NPHASES] of it. Collective. */
PetscErrorCode SeriesOpen(Monitor);
PetscErrorCode SeriesClose(Monitor);
PetscErrorCode SeriesAppend(Monitor, const MonitorStep *, const PetscReal seconds[]);
/* A file of the run with its heading: *file is open on rank 0 afterwards, NULL on the others. Collective. */
PetscErrorCode SeriesOpenFile(Monitor, const char name[], const char heading[], PetscBool append, FILE **file);

/* 1, 2, 5, 10, ... steps between two lines, so that a run to time_end prints at most some 50 */
PetscInt       ProgressChoose(const MonitorStep *, PetscReal time_end);
PetscErrorCode ProgressHeading(Monitor);
PetscErrorCode ProgressPrint(Monitor, const MonitorStep *, PetscReal time_end);
/* "42 s", "1:02:03" (h:m:s) */
PetscErrorCode ProgressFormat(PetscReal seconds, char text[], size_t len);
/* The bar below the lines, where there is a terminal: drawn anew a few times a second; taken away. Not collective. */
PetscErrorCode ProgressBar(Monitor, const MonitorStep *, PetscReal time_end);
void           ProgressClear(Monitor);
