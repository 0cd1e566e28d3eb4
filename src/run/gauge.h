/* Gauge: what a run in time tells of itself for an estimate of its error (accuracy.h): mean over time, largest and
   smallest value of what bodies feel that are held or led (force, torque), of how those that are free move (velocity,
   angular velocity), of the mean velocity of a fluid that -flow_force drives past bodies that are held, and of the
   kinetic energy where there are none. From -monitor_from on, else in the second half of the run. */
#pragma once
#include "sim.h"

#define GAUGE_BODIES   64 /* at most */
#define GAUGE_KINDS    3  /* of values: mean, largest, smallest */
#define GAUGE_SUBJECTS 16 /* force_x .. z, torque, velocity, omega, mean_velocity, kinetic_energy */

/* end: when the run ends; NULL: there are more bodies than that. Collective. */
PetscErrorCode GaugeCreate(const SimComponents *, PetscReal end, Gauge *);
PetscErrorCode GaugeDestroy(Gauge *);
/* After the step dt that ended at time. Collective; NULL: nothing. */
PetscErrorCode GaugeStep(Gauge, const FlowDiagnostics *, PetscReal time, PetscReal dt);
/* From which time on, to the last step; the order of the scheme in that, and how many were gauged. Not collective. */
void           GaugeGetEnd(Gauge, PetscReal *from, PetscReal *time, PetscInt *order, PetscInt *steps);
PetscErrorCode GaugeVisitState(void *gauge, State);

/* How large a subject gets, over all bodies that have it, 0: none; *scale: over all bodies, as a force or a velocity,
   torques over a radius and angular velocities times it. Not collective. */
PetscErrorCode GaugeGetSize(Gauge, PetscInt subject, PetscReal *size, PetscReal *scale);
/* Name as that of the column: "force_x" */
void GaugeGetName(PetscInt subject, char name[32]);
/* How many bodies it may be of (the fluid: 1), and its value of one: 0 where that has none. Not collective. */
PetscInt  GaugeCount(Gauge, PetscInt subject);
PetscReal GaugeValue(Gauge, PetscInt subject, PetscInt body, PetscInt kind);
