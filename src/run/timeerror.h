/* TimeError: how far a run is off because its steps are as long as they are.

   A scheme of order p leaves out the force c dt^p (d/dt)^(p+1) u (c: 1/2, 1/3, 1/12 for be, bdf2, cn). The error e that
   this makes, de/dt + r e = c dt^p (d/dt)^(p+1) u, is c dt^p times the derivative of order p, less a mean of that over
   the time 1/r: what is so slow that friction has settled it. r is the rate at which friction takes the derivative
   away, viscosity |grad|^2/| |^2 of it. In a linear flow of one rate that is the error: where a force swings the fluid,
   with bdf2, (omega dt)^2/3 times the share of the inertia in the forces. A jump leaves nothing, as e is no sum over
   steps. Nodes that a body or a mesh has moved over within three steps do not count.

   The estimate is the root mean square of e over the fluid, over that of the speed, both as means over the latter half
   of the steps or more of them. At 32, 64, 128 ... steps (accurate: from 64 on), where a preset promises less, a remark
   says which step would do. A preset that was asked for takes that step from there on (row `promise` of the limits) if
   friction forgets within half of the run what the longer ones made, else the run stops while it is young, as it does
   where a flow without bodies swings and its layer at walls is too thin for the cells; of a layer that becomes so later
   a remark tells. runs/studies/steps has errors and estimates. Costs a look at all nodes a step. Not for steady runs,
   runs on a device, drops and elastic particles, whose fields have kinks that travel. */
#pragma once
#include "sim.h"
#include "steplimits.h"

/* NULL where nothing is judged; else adds its row to the limits. end: of the run. Collective. */
PetscErrorCode TimeErrorCreate(const SimComponents *, Limits, PetscReal end, TimeError *);
PetscErrorCode TimeErrorDestroy(TimeError *);
/* A step or a part of one was accepted; before CoupleAdvance. NULL: nothing happens. Collective. Errors: a promise that
   cannot be kept any more. */
PetscErrorCode TimeErrorStep(TimeError);
/* Into the summary: estimated_error_time, a share, where it is known. Collective. */
PetscErrorCode TimeErrorFinish(TimeError);
/* The same share, -1: not known. Local. */
void TimeErrorGet(TimeError, PetscReal *error);
/* StateVisit of a TimeError. */
PetscErrorCode TimeErrorVisitState(void *timeerror, State);
