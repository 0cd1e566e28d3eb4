/* Spread: what differs from body to body of a group: size, density, orientation.

   Sizes are those of the group's shape times a number: uniform scaling keeps every shape exact (distances grow with s,
   volumes with s^dim, second moments with s^(dim + 2)). Numbers come from the seed of the group alone: not from the
   number of ranks, and not from where the bodies are placed. */
#pragma once
#include "shape/place.h"

typedef enum {
  SPREAD_SAME,
  SPREAD_UNIFORM,
  SPREAD_NORMAL,
  SPREAD_LOGNORMAL,
  SPREAD_BIMODAL
} SpreadKind;

typedef struct {
  PetscInt   kind;
  PetscReal  mean, deviation, range[2], weight;
  PetscInt64 state; /* of the random numbers */
} Distribution;

typedef struct {
  Distribution size, density;
  PetscBool    turned; /* random orientations */
  PetscInt64   state;
} Spread;

/* Read -particle_<g>_sizes*, _densities*, _orientation. Not collective, same result on every rank. Errors: no positive
   range, a deviation that is not positive. */
PetscErrorCode SpreadRead(const char group[], PetscReal density, PetscInt seed, Spread *);
/* Size, density and orientation of the next body; what is not spread is left as it is. Error: a range that the
   distribution does not meet. */
PetscErrorCode SpreadNext(const char group[], PetscInt dim, Spread *, Placement *);
