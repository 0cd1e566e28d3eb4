/* DropReport: drops.csv, a line a step and drop (phase/drops.h), and columns of series.csv. */
#pragma once
#include "sim.h"

typedef struct _p_DropReport *DropReport;

/* *report is NULL where no particle is a fluid. Before MonitorOpen. Collective. */
PetscErrorCode DropReportCreate(const SimComponents *, DropReport *);
PetscErrorCode DropReportDestroy(DropReport *);
/* The values of the step that was taken, and ends at this time; the first one begins a file. */
PetscErrorCode DropReportStep(DropReport, PetscInt step, PetscReal time);
/* Before a snapshot of the fields: which drop its cells lie in. Not collective. */
PetscErrorCode DropReportMarkCells(DropReport);
