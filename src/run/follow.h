/* Follow: bodies that start with the motion of the fluid (-particle_<g>_initial_velocity fluid). */
#pragma once
#include "bodies/bodies.h"
#include "flow/flow.h"

/* Give what is free of these bodies the rigid motion that has the momentum and the angular momentum of the fluid in
   their place, taken on 10^dim points of each cell: an ellipse in a linear flow then turns as in Jeffery's orbit.
   Before the Couple is made. Collective. Error: a body in which the mesh has no point. */
PetscErrorCode StartWithFlow(Mesh, Flow, Bodies);
