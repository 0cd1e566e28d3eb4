/* Agree: errors that one rank finds alone, where all are to go on after them.

   An error of one rank ends a run: the others wait for it somewhere, and failure.h ends them. What is only tried, such
   as a mesh that may be too coarse for the scene, must fail on all ranks together. Between AgreeBegin and AgreeEnd
   errors say nothing, and where one may be found alone all ranks meet:

     AgreeEnter();
     PetscCall(AgreeReturn(look_at_own_cells(m)));   nothing collective after the error in there

   Elsewhere, outside of a trial, these do nothing but pass the error on. A rank that fails alone somewhere else in a
   trial ends the run by `abort`, rather than have the others wait for ever. */
#pragma once
#include <petscsys.h>

/* Collective. abort(message) does not return. */
PetscErrorCode AgreeBegin(void (*abort)(const char message[]));
PetscErrorCode AgreeEnd(void);
void           AgreeEnter(void);
/* The error of this rank, or one of another. Collective in a trial. */
PetscErrorCode AgreeReturn(PetscErrorCode mine);
