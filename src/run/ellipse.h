/* Ellipse: the shape of a drop or an elastic particle in one number and an angle. */
#pragma once
#include "base/algebra.h"

/* Half axes a > b of the ellipse with these second moments over its area: *deformation (a - b)/(a + b), and the angle
   of a from x, in (-pi/2, pi/2]. */
static inline void EllipseFind(PetscReal xx, PetscReal yy, PetscReal xy, PetscReal *deformation, PetscReal *angle)
{
  const PetscReal mean = 0.5 * (xx + yy), diff = 0.5 * (xx - yy), half = PetscHypotReal(diff, xy);
  const PetscReal a = PetscSqrtReal(PetscMax(0, mean + half)), b = PetscSqrtReal(PetscMax(0, mean - half));

  *deformation = a + b > 0 ? (a - b) / (a + b) : 0;
  *angle       = 0.5 * PetscAtan2Real(xy, diff);
}

/* Half axes a >= b >= c of the ellipsoid with these second moments over its volume (xx yy zz xy xz yz): *deformation
   (a - c)/(a + c), and the direction of a, its first part that is not zero positive. */
static inline void EllipsoidFind(const PetscReal s[6], PetscReal *deformation, PetscReal axis[3])
{
  const PetscReal mean = (s[0] + s[1] + s[2]) / 3, d[3] = {s[0] - mean, s[1] - mean, s[2] - mean};
  const PetscReal J[9] = {d[0], s[3], s[4], s[3], d[1], s[5], s[4], s[5], d[2]};
  PetscReal       size = PetscSqr(s[3]) + PetscSqr(s[4]) + PetscSqr(s[5]), angle, large, small, most = 0;

  for (PetscInt a = 0; a < 3; a++) size += 0.5 * PetscSqr(d[a]);
  size    = PetscSqrtReal(size / 3); /* eigenvalues: mean + 2 size cos(angle + 2 pi k/3) */
  axis[0] = 1;
  axis[1] = axis[2] = 0;
  *deformation      = 0;
  if (size <= 0) return;
  angle        = PetscAcosReal(PetscMax(-1, PetscMin(1, 0.5 * DenseDeterminant(3, J) / (size * size * size)))) / 3;
  large        = 2 * size * PetscCosReal(angle);
  small        = 2 * size * PetscCosReal(angle + 2 * PETSC_PI / 3);
  *deformation = PetscSqrtReal(PetscMax(0, mean + small)) / PetscSqrtReal(mean + large);
  *deformation = (1 - *deformation) / (1 + *deformation);
  for (PetscInt e = 0; e < 3; e++) { /* across two rows of the matrix without that eigenvalue */
    PetscReal row[2][3], n[3];

    for (PetscInt i = 0; i < 2; i++)
      for (PetscInt a = 0; a < 3; a++) row[i][a] = J[3 * ((e + i) % 3) + a] - (a == (e + i) % 3 ? large : 0);
    cross(row[0], row[1], n);
    if (dot3(n, n) <= most) continue;
    most = dot3(n, n);
    for (PetscInt a = 0; a < 3; a++) axis[a] = n[a] / PetscSqrtReal(most);
  }
  if (axis[0] < 0 || (axis[0] == 0 && axis[1] < 0))
    for (PetscInt a = 0; a < 3; a++) axis[a] = -axis[a];
}
