/* Frame: the box of a scene travels through the laboratory.

   The mesh moves as a whole, X_f its displacement since the start; velocities stay those of the laboratory, and with
   them boundary conditions, pressure, forces, gravity and all that is reported. What changes is that convection carries
   u - v, v = c_t X_f^{n+1} - d(X_f) as the scheme differentiates (arbitrary Lagrangian-Eulerian form of a rigid
   motion), and that bodies have places relative to the box: x = laboratory - X_f. No inertial force is needed, however
   the box accelerates: as a uniform force on fluid and bodies it is a gradient that moves nothing. A frame of constant
   velocity is the same discrete problem as a box at rest in which everything is given the velocity -v.

   `body`: the box goes where body -sim_frame_body goes, along the axes of -sim_frame_axes, so that it is drawn at one
   place of the mesh. `velocity`: the box travels at -sim_frame_velocity. What depends on the place, such as formulas of
   x, y, z, profiles and points of -monitor_dp, sees places in the box. */
#pragma once
#include "bodies/bodies.h"
#include "flow/flow.h"

typedef struct _p_Frame *Frame;

/* Reads the options. NULL: the box stays. Before anything asks whether bodies stand still. Collective. Errors: no such
   body; walls across the way; no convection, where the velocity of the box acts. */
PetscErrorCode FrameCreate(Flow, Bodies, const MeshLocal *, Frame *);
PetscErrorCode FrameDestroy(Frame *);
PetscErrorCode FrameView(Frame, PetscViewer);
/* After FlowBeginStep and before anything is drawn: where the box will be at the end of the step. Not collective.
   Error: the body has left the domain. */
PetscErrorCode FrameBegin(Frame);
/* The step is taken. */
PetscErrorCode FrameAccept(Frame);
/* StateVisit of a Frame */
PetscErrorCode FrameVisitState(void *frame, State);
