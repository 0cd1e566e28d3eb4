/* Flight: motion of guided bodies (BodyGroup.guided: joint, springs, loads, prescribed motion) without a flow. Called
   by contact (alone.c).

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

/* Surroundings of a body: gravity, fluid_density for buoyancy; added, added_spin: densities of the added mass and added
   inertia (0: none) */
typedef struct {
  PetscReal gravity[3], fluid_density, added, added_spin;
} Surroundings;

/* ---- a step without contact ---- */

/* Moves body k from its state at `time` by h. Local. Errors: not finite, or too stiff. */
PetscErrorCode FlightMove(Bodies, PetscInt k, const Surroundings *, PetscReal time, PetscReal h);

/* ---- a sub-step with contact: accelerate, (contact changes u, w), set the position ---- */

/* u, w of body k change by its loads within h. Local. Errors: as FlightMove. */
PetscErrorCode FlightAccelerate(Bodies, PetscInt k, const Surroundings *, PetscReal time, PetscReal h);
/* The position of body k moves on by h with u, w; stops are kept. Local. */
PetscErrorCode FlightSetPosition(Bodies, PetscInt k, const Surroundings *, PetscReal time, PetscReal h);

/* ---- questions ---- */

/* Inertia of body k and of its added mass about the reference point at orientation q, in space axes: xx yy zz xy xz yz
   (2D: zz alone). Local. */
PetscErrorCode FlightGetInertia(Bodies, PetscInt k, const PetscReal q[4], const Surroundings *, PetscReal inertia[6]);
/* u of a body with a pivot becomes the velocity of the centre that belongs to w. Local. */
PetscErrorCode FlightMovePivot(Bodies, PetscInt k, PetscReal time);
