/* EventTable: a text table in the output directory with lines for what happens now and then, so that it has no fixed
   number of lines a step. Its first column is the time, by which a run that goes on from a checkpoint finds the lines
   that it makes again. Rank 0 holds the file. Error of all: it cannot be written, with the reason (a full disk). */
#pragma once
#include "report/monitor.h"
#include <stdio.h>

typedef struct {
  MPI_Comm comm;
  char     path[PETSC_MAX_PATH_LEN];
  FILE    *file; /* rank 0: print to it; NULL on others and before EventTableOpen */
} EventTable;

/* The columns of drops.csv in the plane and in space, of bonds.csv and of aggregates.csv */
extern const MonitorColumn EVENT_DROPS[], EVENT_DROPS_SPACE[], EVENT_BONDS[], EVENT_AGGREGATES[];

/* dir/name, whose first line are the names of these columns. time > 0: one that is there with the same names is kept
   but for its lines from that time on. Collective. */
PetscErrorCode EventTableOpen(MPI_Comm, const char dir[], const char name[], const MonitorColumn[], PetscReal time,
                              EventTable *);
/* After lines were printed: they are in the file. Collective. */
PetscErrorCode EventTableFlush(EventTable *);
/* One that was never opened is fine. Collective. */
PetscErrorCode EventTableClose(EventTable *);
