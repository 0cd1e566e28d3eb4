/* Rigid: the map between rigid velocities and velocities at points, V + w x r.

   A rigid velocity has `slots`: V along the dim axes, then w, in the plane the one number about z; 3 or 6 numbers. As
   3-vectors u, w (of bodies, of forces and torques) it is (V, 0) and (0, 0, w) in the plane. r is the arm from the
   point about which the velocity is meant. Everybody's arithmetic: bodies, the solver and the coupling. */
#pragma once
#include "base/inline.h"
#include <petscsys.h>

INLINE PetscInt RigidSize(const PetscInt dim)
{
  return dim == 2 ? 3 : 6;
}

/* Slot s as a component of u or w */
INLINE PetscReal *RigidComponent(const PetscInt dim, PetscReal u[3], PetscReal w[3], PetscInt s)
{
  return s < dim ? &u[s] : dim == 2 ? &w[2] : &w[s - dim];
}

INLINE PetscReal RigidValue(const PetscInt dim, const PetscReal u[3], const PetscReal w[3], PetscInt s)
{
  return s < dim ? u[s] : w[dim == 2 ? 2 : s - dim];
}

/* v [dim] = V + w x r, U the slots */
INLINE void RigidVelocityAt(const PetscInt dim, const PetscReal U[], const PetscReal r[3], PetscReal v[])
{
  if (dim == 2) {
    v[0] = U[0] - U[2] * r[1];
    v[1] = U[1] + U[2] * r[0];
  } else {
    for (PetscInt a = 0; a < 3; a++)
      v[a] = U[a] + U[3 + (a + 1) % 3] * r[(a + 2) % 3] - U[3 + (a + 2) % 3] * r[(a + 1) % 3];
  }
}

/* S [RigidSize - dim]: what w adds to component a, (w x r)_a = S w */
INLINE void RigidSpinRow(const PetscInt dim, PetscInt a, const PetscReal r[3], PetscReal S[])
{
  const PetscReal spin[3][3] = {{0, r[2], -r[1]}, {-r[2], 0, r[0]}, {r[1], -r[0], 0}};

  if (dim == 2) S[0] = a == 0 ? -r[1] : r[0];
  else
    for (PetscInt b = 0; b < 3; b++) S[b] = spin[a][b];
}

/* M [dim][RigidSize]: M (V, w) = m V + w x r. Maps that are linear in the arm are kept as sums of m and of m times the
   arm, so r may be such a sum. dim as a constant */
INLINE void RigidMapFill(const PetscInt dim, const PetscReal m, const PetscReal *restrict r, PetscReal *restrict M)
{
  for (PetscInt a = 0; a < dim; a++) {
    PetscReal *row = M + a * RigidSize(dim);

    for (PetscInt d = 0; d < dim; d++) row[d] = d == a ? m : 0;
    if (dim == 2) row[2] = a == 0 ? -r[1] : r[0];
    else {
      row[3 + a]           = 0; /* (w x r)_a = w_{a+1} r_{a+2} - w_{a+2} r_{a+1} */
      row[3 + (a + 1) % 3] = r[(a + 2) % 3];
      row[3 + (a + 2) % 3] = -r[(a + 1) % 3];
    }
  }
}
