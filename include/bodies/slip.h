/* Slip: velocity of a body's surface in its own frame, beside its rigid motion: swimmers (squirmers), bodies that
   pump. Called by couple (slip.c, phoretic.c). Options -particle_<g>_slip_*: one of

     modes      B_1, B_2, ... of a disc or sphere of radius a about the direction e of swimming, theta the angle from e:
                u_theta = sum B_n sin(n theta) in the plane, sum B_n V_n in space, V_n = 2 sin(theta) P_n'(cos theta)
                /(n (n + 1)), so V_1 = sin(theta), V_2 = sin(theta) cos(theta) (Lighthill 1952; Blake 1971). A free body
                swims along e at B_1/2 in the plane and 2 B_1/3 in space; B_2 > 0 pulls, B_2 < 0 pushes
     velocity   of any shape, an expression of the position in the frame of the shape and of t. Its tangential part acts
     mobility   of any shape, an expression as above: slip -mobility (I - n n) grad T, T the scalar that `scalar` names
                (phoretic bodies, Janus particles: Anderson 1989); couple evaluates T

   Modes are continued beyond the surface without divergence, for methods that have fluid inside of bodies: by the
   Stokes flow inside, a polynomial. Others are known at the surface alone. */
#pragma once
#include "bodies/bodies.h"

typedef struct _p_BodySlip *BodySlip;

/* ---- options of a group: group.c ---- */

/* Read the options of a group whose shape has the radius `disc` (0: no disc or sphere); *slip NULL: has none. The same
   on all ranks. Errors: modes of other shapes, several of them, no direction. */
PetscErrorCode BodySlipRead(const char group[], PetscInt dim, PetscReal disc, BodySlip *slip);
/* Frees it and sets it to NULL. Local. */
PetscErrorCode BodySlipDestroy(BodySlip *);
/* Name of the scalar of a mobility, NULL: has none. Borrowed. Local. */
const char *BodySlipScalar(BodySlip);
/* Is it given by modes, and so known beyond the surface? Local. */
PetscBool BodySlipHasModes(BodySlip);

/* ---- one step: couple ---- */

/* Has any group slip? Local. */
PetscBool BodiesHaveSlip(Bodies);
/* Does the slip of any depend on t? Local. */
PetscBool BodiesSlipChanges(Bodies);
/* Velocity v [dim] of the surface of body k drawn at X, q, relative to its rigid motion, in space, at a time. surface:
   at the point of the surface next to x, with the outward normal n [dim] there; else as continued to x, n not set. A
   body without slip: zero. Not collective. Error: an expression that is not finite. */
PetscErrorCode BodiesGetSlip(Bodies, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal time,
                             PetscBool surface, const PetscReal x[], PetscReal v[], PetscReal n[]);
/* Mobility at x in space of a body that has one, likewise at the surface */
PetscErrorCode BodiesGetSlipMobility(Bodies, PetscInt k, const PetscReal X[3], const PetscReal q[4], PetscReal time,
                                     const PetscReal x[], PetscReal *mobility);
/* Direction of swimming in space at orientation q [4] */
PetscErrorCode BodiesGetSwimDirection(Bodies, PetscInt k, const PetscReal q[4], PetscReal e[3]);
/* Power that a fluid of unit viscosity dissipates in the flow inside that modes are continued by, 2 pi sum n B_n^2 in
   the plane, 16 pi a sum B_n^2/(n (n + 1)) in space; 0 without modes. */
PetscErrorCode BodiesGetSlipInside(Bodies, PetscInt k, PetscReal time, PetscReal *power);
