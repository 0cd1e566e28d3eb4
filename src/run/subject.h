/* Subject: what of a steady flow is judged, and its value on several meshes (accuracy.h). */
#pragma once
#include "sim.h"

#define SUBJECT_BODIES 64 /* at most */

/* What is measured on a mesh: [3 body + axis]; torque of the fluid about the centre; velocity: of the fluid, over it */
typedef struct {
  PetscReal force[3 * SUBJECT_BODIES], torque[3 * SUBJECT_BODIES];
  PetscReal velocity[3], energy, speed; /* speed: largest of the fluid */
} Measured;

/* Values that are compared: along one axis, of all bodies; divided by size they are errors */
typedef struct {
  PetscReal (*of)(const Measured *, PetscInt);
  PetscInt  n, axis;
  PetscReal size;
  char      name[32];
} Subject;

/* After CoupleForce. Collective. */
PetscErrorCode SubjectMeasure(const SimComponents *, Measured *);
/* The largest force of all along its axis. One that is nearly nothing, as of a disc that turns in the middle of a
   circle, tells of errors alone: then the largest torque, if it is not nothing either. Where -flow_force drives the
   fluid, and so gives all forces, the mean velocity; else the kinetic energy. Collective. */
PetscErrorCode SubjectChoose(const SimComponents *, const Measured *, Subject *);
PetscReal      SubjectValue(const Subject *, const Measured *, PetscInt i); /* i < n, as a share of its size */
