/* Bodies, for writing: the arrays of the state for contact, which moves bodies in place, and for tests. All others
   write through the functions of bodies.h. */
#pragma once
#include "bodies/bodies.h"

/* The fields of BodyState; what is written here is read there. */
typedef struct {
  BODY_STATE()
} BodyArrays;

/* Borrowed, always the same pointer. Local. */
PetscErrorCode BodiesGetArrays(Bodies, BodyArrays **);
