/* Small levels of an algebraic hierarchy on every rank: below some thousand rows a level is nothing but waiting for
   other ranks, five exchanges a cycle and level; with all of its rows on every rank all levels below cost one gathering. */
#pragma once
#include <petscpc.h>

/* Of a BoomerAMG that is not set up yet; anything else, or one rank, stays as it is. Not collective. */
PetscErrorCode SmallLevelsGather(PC);
