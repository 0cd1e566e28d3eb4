/* ScalarLayer: how thick the layer is across which a scalar changes around a body that moves against the fluid. */
#pragma once
#include <petscsys.h>

/* Of a body of that size: size/N, N = min(Pe^(1/2), Pe^(1/3) max(1, Re)^(1/6)), at least 1: the powers of laminar
   layers, slow (Pe^(1/3)), at large Prandtl numbers (Re^(1/2) Pr^(1/3)) and at small ones (Pe^(1/2)). A disc has a
   mean Nusselt number of about .65 N. */
static inline PetscReal ScalarLayerThickness(PetscReal size, PetscReal reynolds, PetscReal peclet)
{
  const PetscReal thin = PetscCbrtReal(peclet) * PetscPowReal(PetscMax(1, reynolds), 1. / 6);

  return size / PetscMax(1, PetscMin(PetscSqrtReal(peclet), thin));
}
