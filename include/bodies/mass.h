/* Rigid: inertia and loads of a body on its rigid slots (translation, then rotation about its reference point: 3
   numbers in 2D, 6 in 3D). Called by couple.

   The velocity of the centre is that of the reference point plus w x arm; T is that map from the slots to (velocity of
   the centre, w). All is per unit density and exact from the shape; the caller multiplies with a density. */
#pragma once
#include "bodies/bodies.h"

/* M [nr][nr] = T^T diag(Vol, I) T of body k with orientation q. Not collective. */
PetscErrorCode RigidGetMass(Bodies, PetscInt k, const PetscReal q[4], PetscReal M[]);
/* out [nr] = T^T (force, torque): generalised force of a force at the centre and a torque about it. Local. */
PetscErrorCode RigidReduceForce(Bodies, PetscInt k, const PetscReal q[4], const PetscReal force[3],
                                const PetscReal torque[3], PetscReal out[]);
/* out = w x (w x arm), acceleration of the centre relative to the reference point that is not in the time derivatives
   of the slots; rotation [nr - dim]: w. Local. */
PetscErrorCode RigidCentripetal(Bodies, PetscInt k, const PetscReal q[4], const PetscReal rotation[], PetscReal out[3]);
