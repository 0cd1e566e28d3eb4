/* Gauss: the 3-point quadrature on [-1, 1], of which the element's 3^dim points are products; a loop over cells that a
   compiler is to unroll has constants of its own (src/fem/batch.c, src/device/cell.h). */
#pragma once
#include <petscsys.h>

static const PetscReal GAUSS3_POINT[3] = {-0.77459666924148337704, 0, 0.77459666924148337704}, /* sqrt(3/5) */
  GAUSS3_WEIGHT[3]                     = {5. / 9, 8. / 9, 5. / 9};
