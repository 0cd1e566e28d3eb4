/* A disc of radius 1/2 whose operations crash or never come back, chosen by the option `how`; 0 and until `after` calls
   of distance it is correct. For testing what the program says then. */
#include "shape.h"
#include <stdlib.h>

enum {
  HOW_NOT,
  HOW_MEMORY,    /* writes where there is nothing */
  HOW_LOOP,      /* never comes back */
  HOW_RECURSION, /* calls itself until the stack is used up */
  HOW_ABORT,
  HOW_SQUARED, /* no crash: r^2 - R^2 */
  HOW_COUNT
};

typedef struct {
  PetscInt dim, how, after, calls;
} Crashing;

static PetscErrorCode ShapeCreate_Crashing(Shape s)
{
  Crashing *c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(ShapeSetData(s, c));
  PetscCall(ShapeGetDimension(s, &c->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Crashing(Shape s)
{
  Crashing *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(ShapeOptionInt(s, "how", "How to fail", 0, HOW_COUNT - 1, &c->how));
  PetscCall(ShapeOptionInt(s, "after", "Calls of distance before that", 0, 1000000, &c->after));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static volatile PetscInt sink;

__attribute__((noinline)) static PetscInt call_again(volatile PetscInt depth)
{
  volatile char use[4096];

  use[depth % 4096] = (char)depth;
  return call_again(depth + 1) + use[0];
}

static void fail(PetscInt how)
{
  if (how == HOW_MEMORY) *(volatile int *)(size_t)8 = 1;
  while (how == HOW_LOOP) sink++;
  if (how == HOW_RECURSION) sink = call_again(0);
  if (how == HOW_ABORT) abort();
}

static PetscErrorCode ShapeDistance_Crashing(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Crashing *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  if (c->calls++ >= c->after) fail(c->how);
  for (PetscInt i = 0; i < n; i++) {
    PetscReal square = 0;

    for (PetscInt a = 0; a < c->dim; a++) square += PetscSqr(x[i * c->dim + a]);
    d[i] = c->how == HOW_SQUARED ? square - 0.25 : PetscSqrtReal(square) - 0.5;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Crashing(Shape s, PetscReal *r)
{
  PetscFunctionBeginUser;
  (void)s;
  *r = 0.5;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Crashing(Shape s)
{
  Crashing *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscFree(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "crashing",
  .description = "disc that crashes",
  .author      = "tests",
  .version     = "1",
  .dims        = 3,
  .ops =
    {
      .create   = ShapeCreate_Crashing,
      .options  = ShapeOptions_Crashing,
      .distance = ShapeDistance_Crashing,
      .radius   = ShapeRadius_Crashing,
      .destroy  = ShapeDestroy_Crashing,
    },
};
