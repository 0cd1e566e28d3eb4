/* ScalarSides: sides of cells of the fluid that lie on surfaces of bodies which the mesh is lined up with. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"

/* Of local cells, those of a cell in a row: cell, side and body in side [*n], q and h zero; freed by the caller.
   Collective. */
PetscErrorCode ScalarSidesFind(Couple, PetscInt *n, ScalarSide *side[]);
