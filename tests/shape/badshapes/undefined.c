/* Calls a function that no library has: cannot be loaded. */
#include "shape.h"

PetscErrorCode ShapeFunctionThatDoesNotExist(Shape);

static PetscErrorCode ShapeDistance_Undefined(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  PetscFunctionBeginUser;
  (void)n;
  (void)x;
  (void)d;
  PetscCall(ShapeFunctionThatDoesNotExist(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {.interface = SHAPE_INTERFACE,
                         .type      = "undefined",
                         .dims      = 3,
                         .ops       = {.distance = ShapeDistance_Undefined}};
