/* Start: what a run starts from beyond numbers and formulas (FlowInitial): the fields of another run, bodies that move
   with the fluid, the steady solution with bodies held, and flows made free of divergence. A restart needs none of it:
   the caller leaves it out. */
#pragma once
#include "sim.h"

/* Read the fields of another run where the scene wants them, and let bodies follow the fluid (follow.h). Before
   the Couple is made. Collective. Errors: no such fields, those of StartWithFlow. */
PetscErrorCode StartRead(Mesh, Flow, Bodies);
/* With the Couple: scalars that start from a run (-scalar_<scalar>_initial_run). Collective. Errors: no such fields, a
   node that lies outside of their mesh. */
PetscErrorCode StartScalars(Couple);
/* With the Couple: solve for the steady flow past bodies that are held at rest (prescribed ones move), or take from a
   flow given by an expression or another run what has a divergence, bodies held at their velocities: the implicit step
   in the limit of no time, M (u - u*) + B^T q = 0, B u = 0. In other flows the fluid inside free bodies takes their
   velocity. Collective. */
PetscErrorCode StartSolve(const SimComponents *);
