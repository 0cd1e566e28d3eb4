/* Probes: velocity at places (-monitor_probes), as columns of series.csv; see report/statistics.h. */
#pragma once
#include "flow/flow.h"
#include "report/monitor.h"

typedef struct _p_Probes *Probes;

/* NULL without the option. Collective. Errors: numbers that do not fit the dimension, a place outside of the mesh. */
PetscErrorCode ProbesCreate(Flow, Monitor, Probes *);
PetscErrorCode ProbesDestroy(Probes *);
/* Columns of the accepted step. Collective. */
PetscErrorCode ProbesStep(Probes);
