/* Small levels of an algebraic hierarchy on one rank: below some thousand rows a level is nothing but waiting for other
   ranks, five exchanges a cycle and level; with all rows there, all levels below cost a gathering and a scattering. */
#pragma once
#include <petscpc.h>

/* Of a BoomerAMG that is not set up yet; anything else, or one rank, stays as it is. Not collective. */
PetscErrorCode SmallLevelsGather(PC);
