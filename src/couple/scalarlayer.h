/* ScalarLayer, measured: how many cells the layer of a scalar has around bodies that move against the fluid
   (scalar/layer.h), by the fastest fluid within a radius of their surfaces, as both move now. */
#pragma once
#include "couple/scalars.h"

/* open [ngroups]: bodies that are another material than the fluid; layer [ngroups]: of the body with the fewest cells,
   cells PETSC_MAX_REAL without one. Collective. */
PetscErrorCode ScalarLayerMeasure(Couple, const ScalarParameters *, const PetscBool open[], ScalarLayer layer[]);
