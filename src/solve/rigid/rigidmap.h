/* RigidMap: maps of rigid velocities that are linear in the place, kept as sums of entries m and of m times the place
   from the centre of the body. */
#pragma once
#include "base/inline.h"
#include <petscsys.h>

/* M [dim][nr]: M (V, w) = m V + w x r, for rigid velocities of dim + 1 or 6 numbers; dim as a constant */
INLINE void RigidMapFill(const PetscInt dim, const PetscReal m, const PetscReal *restrict r, PetscReal *restrict M)
{
  const PetscInt nr = dim == 2 ? 3 : 6;

  for (PetscInt a = 0; a < dim; a++) {
    PetscReal *row = M + a * nr;

    for (PetscInt d = 0; d < dim; d++) row[d] = d == a ? m : 0;
    if (dim == 2) row[2] = a == 0 ? -r[1] : r[0];
    else {
      row[3 + a]           = 0; /* (w x r)_a = w_{a+1} r_{a+2} - w_{a+2} r_{a+1} */
      row[3 + (a + 1) % 3] = r[(a + 2) % 3];
      row[3 + (a + 2) % 3] = -r[(a + 1) % 3];
    }
  }
}
