/* Motion: what a scene says about the motion of a group beyond "free": prescribed motion, pivot, angular stops,
   external force and torque.

   Every degree of freedom of a body that is not free is prescribed: position and velocity at any time are known in
   closed form. With s the (ramped) time,
     x(s) = start + velocity s + amplitude sin(2 pi s/period + phase)   an axis,
     angle(s) = start + angular_velocity s + swing sin(2 pi s/T + phase)
   s = t without ramp; with ramp R the motion gathers speed smoothly: ds/dt = (1 - cos(pi t/R))/2 until R, then 1.
   Where velocity or angular velocity are expressions of t, as for all bodies of the group, their integrals from 0 to s
   stand in place of velocity s and angular_velocity s (in 3D about an axis that stays).
   So the oscillation starts where its phase says; `position` is its middle. A file (track.h) adds its way and turn.

   With -particle_<g>_motion, a file, or a velocity with t, nothing is free unless _free says so. Without it, degrees
   of freedom that are not free keep the velocities of _velocity and _angular_velocity (or of the table). A pivot is
   placed by _position; translation is then never free. External force and torque act at the centre of mass. */
#pragma once
#include "bodies/bodies.h"
#include "shape/place.h"
#include "track.h"

/* Read the options of a group, and its velocities u [3], w [3] at the start. Collective: a file is read once. Errors:
   unknown word, a part without its parameters, stops that are not lower < upper, stops in 3D without hinge, a
   direction without length, pivot and slide, an axis that turns in time. */
PetscErrorCode MotionRead(const char group[], PetscInt dim, Motion *, PetscReal u[3], PetscReal w[3]);
PetscErrorCode MotionDestroy(Motion *);
/* Is the motion along axis a (0, 1, 2) or the turn (3) one that changes in time? For checks against what is free. */
PetscBool MotionChanges(const Motion *, PetscInt a);
/* Is it an oscillation? */
PetscBool MotionOscillates(const Motion *, PetscInt a);

/* Prescribed state at a time (of the scene): point x [3] that _position placed, its velocity u [3], the angle vector
   `turn` [3] since the angle of the start, angular velocity w [3]. In 3D a swing about z combines with a constant
   rotation about z only. */
PetscErrorCode MotionEvaluate(const Motion *, const Placement *start, PetscReal time, PetscReal x[3], PetscReal u[3],
                              PetscReal turn[3], PetscReal w[3]);
