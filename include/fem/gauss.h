/* Gauss: quadrature on [-1, 1]. Of 3 points, of which the element's 3^dim points are products; a loop over cells that a
   compiler is to unroll has constants of its own (src/fem/batch.c, src/device/cell.h). Of 4 points, for what is no
   polynomial on curved cells. Of 5 on edges: fem/edge.h. */
#pragma once
#include <petscsys.h>

static const PetscReal GAUSS3_POINT[3]  = {-0.77459666924148337704, 0, 0.77459666924148337704}, /* sqrt(3/5) */
  GAUSS3_WEIGHT[3]                      = {5. / 9, 8. / 9, 5. / 9};
static const PetscReal GAUSS4_POINT[4]  = {-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                           0.8611363115940526},
                       GAUSS4_WEIGHT[4] = {0.3478548451374538, 0.6521451548625461, 0.6521451548625461,
                                           0.3478548451374538};
