/* Domain: positions in a box that may be periodic along its axes. A period of 0 says that the axis is not. */
#pragma once
#include <petscsys.h>

/* Names of the faces of a box: 2 axis for the lower, 2 axis + 1 for the upper one */
static const char *const DOMAIN_SIDE[6] = {"left", "right", "bottom", "top", "back", "front"};

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

/* The periodic images of a point x that reach the domain [lower, upper], if something of half-width `half` sits there;
   x itself is always one: for (DomainImages i = {0}; DomainNextImage(period, lower, upper, x, half, &i);) use i.at */
typedef struct {
  PetscInt  next;            /* number of the image to look at, 0 .. 26 */
  PetscReal at[3], shift[3]; /* its position; at - x */
} DomainImages;

static inline PetscBool DomainNextImage(const PetscReal period[3], const PetscReal lower[3], const PetscReal upper[3],
                                        const PetscReal x[3], PetscReal half, DomainImages *i)
{
  for (; i->next < 27; i->next++) {
    const PetscInt step[3] = {i->next % 3 - 1, i->next / 3 % 3 - 1, i->next / 9 - 1};
    PetscInt       a       = 0;

    for (; a < 3 && (!step[a] || period[a] > 0); a++) {
      i->shift[a] = step[a] * period[a];
      i->at[a]    = x[a] + i->shift[a];
      if (step[a] && (i->at[a] + half < lower[a] || i->at[a] - half > upper[a])) break;
    }
    if (a == 3) return (PetscBool)(i->next++ >= 0);
  }
  return PETSC_FALSE;
}
