/* What solids in space have of their own: faces of the surface, principal stretches. For files of this room. */
#pragma once
#include "solid/reference.h"

/* m->side, m->nside, m->nb_side of cells in space: faces that one cell alone has. */
PetscErrorCode SolidFindFaces(SolidMesh *);
/* Largest singular value of F [dim][dim] */
PetscReal SolidLargestStretch(PetscInt dim, const PetscReal F[]);
