/* Lacks the required operation distance. */
#include "shape.h"

static PetscErrorCode ShapeRadius_NoDistance(Shape s, PetscReal *r)
{
  PetscFunctionBeginUser;
  (void)s;
  *r = 1.0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {.interface = SHAPE_INTERFACE,
                         .type      = "nodistance",
                         .dims      = 3,
                         .ops       = {.radius = ShapeRadius_NoDistance}};
