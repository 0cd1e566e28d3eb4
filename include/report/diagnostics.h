/* Diagnostics: numbers that a scene reads from the solution of a step: drag and lift coefficients, a pressure
   difference, the balance of momentum.

   They become further columns of series.csv, and at the end quantities of summary.json. But for sums that the balance
   of momentum makes anyway nothing is computed that no option asks for.

   Always: mean_velocity_<x|y|z>; flow_rate_<boundary> of every inflow and outflow, wall_force_<boundary>_<x|y|z> of
   every wall (CoupleBoundary).

   -particle_<g>_reference_speed U (group of one body) asks for coefficients, with -particle_<g>_reference_length L
   (default: the diameter of the bounding circle):
       columns cd, cl = 2 F / (rho U^2 L) from force x and y as -couple_force says (in 3D L^2 in place of L);
       cd_residual, cl_residual, cd_volume, cl_volume: both forms of the force;
       with several such groups the names end with _<g>.
       quantities cd, cl (last step), cd_max, cd_max_time, cl_max, cl_max_time, cl_min; force_difference: largest
       |F_volume - F_residual| over the largest |F_residual|;
       strouhal = L/(U T), where cl has at least two upward crossings of its middle, T the mean period.
   -monitor_dp x1,y1[,z1],x2,y2[,z2]: column and quantity dp = p(1) - p(2); the mean over the cells that hold the
   point (within a thousandth of their size, so that points on walls
       and edges are seen by all their cells), cells with their centre inside a body left out where there are others.
       With a Strouhal number also dp_half_period = dp half a period after cl_max (DFG benchmark 2D-2), if the run
       goes on so long.
   -monitor_momentum: columns momentum_<fluid|bodies|walls|openings|volume>_<x|y|z>, see CoupleBalance.
   The counts of the boundary method (CoupleGetCounts): a column each.
   -monitor_from t: extrema and periods count from this time on (default 0).

   Under -flow_time cn and fstheta forces and pressure hold at t - (1 - theta) dt; the times of extrema take that into
   account, the lines of series.csv do not. */
#pragma once
#include "couple/couple.h"
#include "report/monitor.h"

typedef struct _p_Diagnostics *Diagnostics;

/* Reads the options and adds the columns; before MonitorOpen. Nothing is owned. Collective. Errors: a group of
   several bodies, points outside the mesh. */
PetscErrorCode DiagnosticsCreate(Flow, Bodies, Couple, Monitor, Diagnostics *);
PetscErrorCode DiagnosticsDestroy(Diagnostics *);
/* From the solution of the step, after CoupleForce and before CoupleAdvance. balance may be NULL without
   -monitor_momentum. Collective. */
PetscErrorCode DiagnosticsStep(Diagnostics, const CoupleBalance *balance);
/* The quantities of the run; before MonitorFinish. */
PetscErrorCode DiagnosticsFinish(Diagnostics);
