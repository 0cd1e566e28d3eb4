/* SolidReport: columns of series.csv about elastic solids, by the group. */
#pragma once
#include "sim.h"

typedef struct _p_SolidReport *SolidReport;

/* *report is NULL where no particle is elastic. Before MonitorOpen. Collective. */
PetscErrorCode SolidReportCreate(const SimComponents *, SolidReport *);
PetscErrorCode SolidReportDestroy(SolidReport *);
/* The values of the step that was taken. */
PetscErrorCode SolidReportStep(SolidReport);
/* Solids without a flow: a step from this time, under the weight at its end. Collective. */
PetscErrorCode SolidAdvanceAlone(const SimComponents *, PetscReal time, PetscReal dt);
