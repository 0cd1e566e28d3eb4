/* Membrane, for the files of this room: laws at a point of a surface, those of the table in solid/law.h. */
#pragma once
#include "solid/law.h"
#include "solid/reference.h"
#include "base/algebra.h"

/* Normal outwards, as long as the area is over that of the reference */
static inline void MembraneNormal(PetscInt dim, const PetscReal F[], PetscReal normal[3])
{
  if (dim == 2) {
    normal[0] = F[1];
    normal[1] = -F[0];
    normal[2] = 0;
  } else {
    const PetscReal t[2][3] = {{F[0], F[2], F[4]}, {F[1], F[3], F[5]}};

    cross(t[0], t[1], normal);
  }
}

/* F [dim][dim - 1]; P, C as SolidLawStress; returns the area over that of the reference */
PetscReal MembraneLawStress(PetscInt dim, const SolidMaterial *, const PetscReal F[], PetscReal P[], PetscReal C[]);
/* J, the area over that of the reference, Q [dim][dim - 1] its derivative by F, D that of Q (NULL: not wanted), the
   inverse [dim - 1][dim - 1] of F^T F (NULL, too) */
PetscReal MembraneArea(PetscInt dim, const PetscReal F[], PetscReal Q[], PetscReal D[], PetscReal inverse[]);
/* What bending needs of a mesh: its nodes' neighbours, room for values */
PetscErrorCode BendingCreate(SolidMesh *);
PetscReal      MembraneLawEnergy(PetscInt dim, const SolidMaterial *, const PetscReal F[]);
