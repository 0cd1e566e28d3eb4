/* Ellipse: the shape of a drop or an elastic particle in one number and an angle. */
#pragma once
#include <petscsys.h>

/* Half axes a > b of the ellipse with these second moments over its area: *deformation (a - b)/(a + b), and the angle
   of a from x, in (-pi/2, pi/2]. */
static inline void EllipseFind(PetscReal xx, PetscReal yy, PetscReal xy, PetscReal *deformation, PetscReal *angle)
{
  const PetscReal mean = 0.5 * (xx + yy), diff = 0.5 * (xx - yy), half = PetscHypotReal(diff, xy);
  const PetscReal a = PetscSqrtReal(PetscMax(0, mean + half)), b = PetscSqrtReal(PetscMax(0, mean - half));

  *deformation = a + b > 0 ? (a - b) / (a + b) : 0;
  *angle       = 0.5 * PetscAtan2Real(xy, diff);
}
