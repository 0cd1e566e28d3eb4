/* Joint: what a scene ties a body with, and what it pulls at it: springs and dampers at hinges, moorings, external
   force and torque, also as expressions of t and of the body's motion.

   A spring turns a body to its rest angle, T = -spring (angle - spring_angle) - spring_damping omega, about z or, in
   space, the hinge. A mooring is a line from a point of the body to one in space, at the distance r along the unit
   vector e away from that: F = -(stiffness (r - length) + damping dr/dt) e, with -particle_<g>_mooring_slack never
   positive; of length 0 it acts along every axis by itself, F = -stiffness r e - damping v. Along periodic axes of the
   domain the nearest image of the point counts. */
#pragma once
#include "bodies/bodies.h"

/* Read the options of a group into its motion, whose other parts are read. Collective. Errors: a number of values that
   fits no number of moorings, a spring in space without hinge, a value that is negative. */
PetscErrorCode JointRead(const char group[], PetscInt dim, Motion *);
PetscErrorCode JointDestroy(Motion *);
/* The ends of moorings on the body from its centroid in the frame of the shape; until then in that frame. */
void JointSetCentre(Motion *, const PetscReal centroid[3]);
/* Refuse what does nothing: springs of a body that does not turn, moorings of one that is not free. free: BodyFree
   bits. */
PetscErrorCode JointCheck(const char group[], const Motion *, PetscInt free);
/* Does anything but weight act on the bodies? */
PetscBool JointActs(const Motion *);
/* A line for each of them. Collective on the viewer. */
PetscErrorCode JointView(const Motion *, PetscViewer);
