/* Align, thin: how thick is what a surface holds? In space no cell has its middle in a plate thinner than a cell, and
   there is no surface of faces that takes the place of the plane's path of edges (path.c). */
#include "compat.h"
#include "impl.h"

#define FINE 0.05 /* how exactly thickness is measured, of enough */

/* Largest depth, or more than enough: cubes in which there may be a deeper point are halved. The distance changes by no
   more than the way. */
static PetscErrorCode find_deepest(const AlignSurfaces *f, PetscInt k, const PetscReal x[3], PetscReal half,
                                   PetscReal depth_max, PetscReal *depth)
{
  PetscReal d;

  PetscFunctionBeginUser;
  PetscCall(f->distance(f->ctx, k, f->centre[k], 1, x, &d));
  *depth = PetscMax(*depth, -d);
  if (*depth >= depth_max || half < FINE * depth_max || PetscSqrtReal(3) * half - d <= *depth)
    PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt v = 0; v < 8; v++) {
    PetscReal y[3];

    for (PetscInt a = 0; a < 3; a++) y[a] = x[a] + (v >> a & 1 ? 0.5 : -0.5) * half;
    PetscCall(find_deepest(f, k, y, 0.5 * half, depth_max, depth));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignFindDepth(const AlignSurfaces *f, PetscInt k, PetscReal depth_max, PetscReal *depth)
{
  PetscFunctionBeginUser;
  *depth = 0;
  PetscCall(find_deepest(f, k, f->centre[k], f->radius[k], depth_max, depth));
  PetscFunctionReturn(PETSC_SUCCESS);
}
