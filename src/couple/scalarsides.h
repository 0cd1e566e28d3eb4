/* ScalarSides: sides of cells of the fluid that lie on surfaces of bodies which the mesh is lined up with. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"

/* Of local cells, those of a cell in a row: its body in body [*n], cell and side in side [*n], q and h zero; both freed
   by the caller. Collective. */
PetscErrorCode ScalarSidesFind(Couple, PetscInt *n, PetscInt *body[], ScalarSide *side[]);
