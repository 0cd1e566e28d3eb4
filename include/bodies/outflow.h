/* BodiesOutflow: what happens to bodies that leave the domain. Called by run, after every step.

   In periodic directions a body whose centre passes a face comes in again at the other one. At any other face the run
   stops with a message, or the body is taken out of everything and counted, if -particle_remove names that boundary. */
#pragma once
#include "base/border.h"
#include "bodies/bodies.h"

typedef struct _p_BodiesOutflow *BodiesOutflow;

/* Domain lower .. upper; period: its length in periodic directions, 0 in the others; border (borrowed): its
   boundaries by their names, and what of them is not a side of that box. Reads -particle_remove. Collective. Errors:
   unknown or periodic boundary. */
PetscErrorCode BodiesOutflowCreate(Bodies, const PetscReal lower[3], const PetscReal upper[3],
                                   const PetscReal period[3], Border, BodiesOutflow *);
/* Frees it and sets it to NULL. Collective. */
PetscErrorCode BodiesOutflowDestroy(BodiesOutflow *);
/* After bodies have moved: wraps or removes bodies whose centre has passed a face. Bodies that cannot move are left
   alone. Local, with the same result on all ranks that know a body. Error: a body leaves through a boundary that
   -particle_remove does not name. */
PetscErrorCode BodiesOutflowApply(BodiesOutflow);
/* Number of bodies removed so far, on all ranks. Collective. */
PetscErrorCode BodiesOutflowGetRemoved(BodiesOutflow, PetscInt *n);
