/* Domain: places in a box that may be periodic along its axes. A period of 0 says that the axis is not. */
#pragma once
#include <petscsys.h>

/* The periodic image of x that is nearest to y, along one axis; of a difference x, the nearest image to y = 0. */
static inline PetscReal DomainNearest(PetscReal period, PetscReal x, PetscReal y)
{
  return period > 0 ? x - period * PetscFloorReal((x - y) / period + 0.5) : x;
}

/* The periodic image of x in [lower, lower + period). */
static inline PetscReal DomainWrap(PetscReal period, PetscReal x, PetscReal lower)
{
  return period > 0 ? x - period * PetscFloorReal((x - lower) / period) : x;
}
