/* Flight: the motion of a body without a flow that a joint guides, springs and loads act on, or a scene prescribes
   (BodyGroup.guided).

   What is free is integrated by Gauss's collocation of three stages (order 6; Hairer, Lubich, Wanner, Geometric
   Numerical Integration, 2006, II.1), which keeps linear and quadratic invariants, so that the energy of a pendulum or
   of a spring does not drift: a plane body and one with a hinge by angle and angular velocity, others by their
   quaternion and the angular momentum about the reference point, in space axes. A step in which the stages do not
   converge at once is taken in parts, as fine as stiff springs need. A body that comes to a stop rebounds at the moment
   when it does, with the speed of the impact times the restitution, and rests there when a rebound would last less than
   a hundredth of a step.

   In a sub-step with contact velocities come first, then positions (symplectic Euler), as for all other bodies
   (contact/alone.c); stops are then kept at the end of the sub-step. */
#pragma once
#include "bodies/bodies.h"

/* What is around the body: fluid_density for buoyancy; added, added_spin: densities of the fluid that moves and turns
   with it (0 without) */
typedef struct {
  PetscReal gravity[3], fluid_density, added, added_spin;
} Surroundings;

/* Move body k from its state at `time` by h; it meets nothing. Not collective. Errors: not finite, or too stiff. */
PetscErrorCode FlightMove(Bodies, PetscInt k, const Surroundings *, PetscReal time, PetscReal h);
/* The two halves of a sub-step with contact: what its loads add to its velocities u, w within h, and, when contact has
   changed them too, where it goes. */
PetscErrorCode FlightAccelerate(Bodies, PetscInt k, const Surroundings *, PetscReal time, PetscReal h);
PetscErrorCode FlightSetPosition(Bodies, PetscInt k, const Surroundings *, PetscReal time, PetscReal h);
/* Inertia about the reference point in space axes, of the body and of what turns with it. */
PetscErrorCode FlightGetInertia(Bodies, PetscInt k, const PetscReal q[4], const Surroundings *, PetscReal inertia[6]);
/* Of a body with a pivot u becomes that of the centre for its w. */
PetscErrorCode FlightFollowPivot(Bodies, PetscInt k, PetscReal time);
