/* Walls: the border of the domain, made of the mesh and the conditions of the flow: what contact, and who looks
   whether bodies leave, need to know of them. Boundary b of the border is boundary b of the mesh. A boundary that is
   the surface of a body (its group has the same name) is no wall. */
#pragma once
#include "bodies/bodies.h"
#include "contact/contact.h"
#include "flow/flow.h"

/* flow NULL: all boundaries are solid. *border is the caller's to destroy, after the contact; sides: mask of solid
   sides of the box (ContactCreate); walls: for ContactSetWalls. Collective. */
PetscErrorCode WallsFind(Mesh, Flow, Bodies, Border *border, PetscInt *sides, ContactWalls *walls);
