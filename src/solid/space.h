/* What solids in space have of their own: a layer of cells on the surface, principal stretches. For files of this
   room. */
#pragma once
#include "solid/reference.h"

/* Cells with two or three faces on a smooth surface are flat there: a mesh that has such cells moves back from the
   surface, and gets a layer of cells with one face on it each; vertices inside are smoothed. The nodes X [*nnode][3]
   and cells [*ncell][27] of that mesh, the caller's to free (PetscFree2); *ncell 0: it stays as it is. */
PetscErrorCode SolidAddLayer(const SolidMesh *, PetscInt *nnode, PetscReal **X, PetscInt *ncell, PetscInt **cell_node);
/* Largest singular value of F [dim][nd] */
PetscReal SolidLargestStretch(PetscInt dim, PetscInt nd, const PetscReal F[]);
