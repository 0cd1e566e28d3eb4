/* Diagnostics: quantities of a step that options ask for, as columns of series.csv and quantities of summary.json: drag
   and lift coefficients, pressure differences, flow rates, forces on walls, the balance of momentum. Called by run.

   Options, columns, definitions: src/report/README.md, "Diagnostics". Apart from sums that the balance of momentum
   makes anyway, nothing is computed that no option asks for. Flow, Bodies, Couple and Monitor are borrowed. */
#pragma once
#include "couple/couple.h"
#include "report/monitor.h"

typedef struct _p_Diagnostics *Diagnostics;

/* Reads the options and adds the columns; before MonitorOpen. Collective. Errors: a group of
   several bodies, points outside the mesh. */
PetscErrorCode DiagnosticsCreate(Flow, Bodies, Couple, Monitor, Diagnostics *);
/* Frees it and sets it to NULL. Local. */
PetscErrorCode DiagnosticsDestroy(Diagnostics *);
/* From the solution of the step, after CoupleForce and before CoupleAdvance. balance may be NULL without
   -monitor_momentum. Collective. */
PetscErrorCode DiagnosticsStep(Diagnostics, const CoupleBalance *balance);
/* Sets the quantities of the run; before MonitorFinish. Collective. */
PetscErrorCode DiagnosticsFinish(Diagnostics);
