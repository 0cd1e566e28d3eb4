/* Drive: the uniform force on fluid and bodies that a scene does not give but asks for.

   -flow_rate holds the mean velocity along axes: the force is one more unknown of the linear system (FlowHeld in
   solve/system.h). -couple_backflow says what the weight of bodies less their buoyancy, w, meets along periodic axes,
   where no bottom carries it: `none`, no force but -flow_force (walls and bodies that stand still carry w; without any,
   fluid and bodies are accelerated for ever); `flux`, the force that holds the mean velocity of fluid and bodies at
   zero; `force`, the force - sum w/volume, under which nothing accelerates fluid and bodies as a whole (the pressure
   gradient of a suspension at rest). In a box that is periodic along every axis `force` keeps the mean momentum, `flux`
   the mean velocity. */
#pragma once
#include "couple/couple.h"

typedef struct _p_Drive *Drive;

/* Reads -couple_backflow. NULL: there is nothing to drive. Collective. Errors: no periodic axis along gravity; held by
   -flow_rate too. */
PetscErrorCode DriveCreate(Couple, Drive *);
PetscErrorCode DriveDestroy(Drive *);
/* Tell a new solver what is held. Collective. */
PetscErrorCode DriveSetSolver(Drive, FlowSolver);
/* Bodies are drawn: weights of the rows, force that balances the weights. Collective. */
PetscErrorCode DriveDraw(Drive);
/* The system is solved: its forces count from now on, in the rigid rows g too. Not collective. */
PetscErrorCode DriveTake(Drive);
/* From the balance of the step. Collective. */
PetscErrorCode DriveMeasure(Drive, const CoupleBalance *);
PetscErrorCode DriveView(Drive, PetscViewer);
PetscErrorCode DriveGet(Drive, const CoupleDrive **);
/* StateVisit of a Drive */
PetscErrorCode DriveVisitState(void *drive, State);
