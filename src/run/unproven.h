/* Unproven: what presets know of scalars, and what of materials they do not.

   Promises (promise.h, solidpromise.h, dropcells.h) are of the flow, of rigid bodies, of elastic particles that touch
   nothing and of drops in the plane. Of scalars one thing is: the boundary layer of heat that drives the flow in a
   closed box, without bodies or with bodies held at a value, H/Ra^(1/4) (Gill 1966), H the height along gravity, Ra =
   g expansion difference H^3/(kinematic viscosity diffusivity) with the largest difference of values at boundaries
   and of bodies; where the Prandtl number is below 1, that of the flow, H/(Ra/Pr)^(1/4). */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"
#include "solid/solid.h"

/* A preset, asked for or the default one. Where the layer is known to be too thin for it: refusal [len], unless that
   says something, if it was asked for, else a remark. A remark of what a preset that was asked for knows nothing of.
   Collective. */
PetscErrorCode UnprovenCheck(const MeshLocal *, Bodies, Solids, PetscInt preset, PetscBool asked, char refusal[],
                             size_t len);
