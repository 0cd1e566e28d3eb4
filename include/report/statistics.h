/* Statistics: means and Reynolds stresses of an unsteady flow over time and over planes, with -output_statistics
   <axis>, and the velocity at probes. Called by run.

   Every plane of nodes across the axis has a mean in each step, weighted with the lumped mass of the nodes; these means
   are averaged over the time from -output_statistics_from on, weighted with the length of the step. So the directions
   along the planes count as homogeneous, and bodies as fluid. At the end, and at every snapshot, statistics.csv
   (columns in runs/reference/OUTPUT.md) has mean velocity, Reynolds stresses <u u> - <u><u> and eddy viscosity over the
   position.
   Where both ends of the axis are walls, summary.json has friction_velocity_lower, _upper, from the slope of the mean
   velocity along the wall (of the element's parabola), and re_tau, by their mean square and half the distance of the
   walls.
   A restart goes on with the sums of the checkpoint.

   Probes: -monitor_probes, positions one after another; columns probe_<number>_<u|v|w> of series.csv; tools/spectrum
   makes spectra of them. */
#pragma once
#include "flow/flow.h"
#include "report/monitor.h"

typedef struct _p_Statistics *Statistics;
extern const MonitorColumn    STATISTICS[];

/* NULL without the options. Collective. Errors: an axis that there is not, a mesh without planes of nodes across it, a
   probe outside of the mesh. */
PetscErrorCode StatisticsCreate(Flow, Monitor, Statistics *);
/* Frees it and sets it to NULL. Local. */
PetscErrorCode StatisticsDestroy(Statistics *);
/* After every accepted step, which ended at `time` and had length dt. Collective. */
PetscErrorCode StatisticsStep(Statistics, PetscReal time, PetscReal dt);
/* Write the table; numbers for summary.json. Nothing before anything was averaged. Collective. */
PetscErrorCode StatisticsWrite(Statistics, const char dir[]);
/* StateVisit: the sums. Collective. */
PetscErrorCode StatisticsVisitState(void *statistics, State);
