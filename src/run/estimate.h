/* Estimate: what a scene will be like, before its first step: Reynolds numbers, cells across the bodies, cells a step,
   and in SI what its units make of its numbers.

   A free body is taken to fall at the speed at which drag balances its weight less its buoyancy and
   -particle_<g>_force, in a fluid without walls, with c_D = 1 + 10/Re^(2/3) for a cylinder and 24/Re + 6/(1 + sqrt(Re))
   + 0.4 for a sphere of its bounding radius (White, Viscous Fluid Flow, 1974). Others have the speed of their start, or
   the largest of their prescribed motion. The fluid has that of its boundaries, of its start, and of what -flow_force
   drives between walls. */
#pragma once
#include "sim.h"

/* Lines for -scene_dry_run. Collective. */
PetscErrorCode EstimateView(const SimComponents *, Sim, PetscViewer);
/* A remark where bodies or fluid go many cells in a step that the run does not choose by itself. Collective. */
PetscErrorCode EstimateRemark(const SimComponents *, Sim);
