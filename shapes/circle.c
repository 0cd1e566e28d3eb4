/* Disc in 2D, sphere in 3D, centred on the body origin. All operations in closed form. */
#include "shape.h"

typedef struct {
  PetscInt  dim;
  PetscReal radius;
} Circle;

static PetscErrorCode ShapeCreate_Circle(Shape s)
{
  Circle *c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(ShapeSetData(s, c));
  PetscCall(ShapeGetDimension(s, &c->dim));
  c->radius = 0.5;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Circle(Shape s)
{
  Circle *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(ShapeOptionReal(s, "radius", "Radius", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &c->radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Circle(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Circle   *c;
  PetscReal r;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  r = c->radius;
  if (c->dim == 2) {
    for (PetscInt i = 0; i < n; i++) d[i] = PetscSqrtReal(x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1]) - r;
  } else {
    for (PetscInt i = 0; i < n; i++)
      d[i] = PetscSqrtReal(x[3 * i] * x[3 * i] + x[3 * i + 1] * x[3 * i + 1] + x[3 * i + 2] * x[3 * i + 2]) - r;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Circle(Shape s, PetscReal *r)
{
  Circle *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  *r = c->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Circle(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Circle *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal len = 0;

    for (PetscInt a = 0; a < c->dim; a++) len += PetscSqr(x[i * c->dim + a]);
    len = PetscSqrtReal(len);
    for (PetscInt a = 0; a < c->dim; a++) /* at the centre every direction is right */
      normal[i * c->dim + a] = len > 0 ? x[i * c->dim + a] / len : (PetscReal)(a == 0);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeMass_Circle(Shape s, ShapeMass *m)
{
  Circle   *c;
  PetscReal r;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  r = c->radius;
  if (c->dim == 2) {
    m->volume     = PETSC_PI * r * r;
    m->inertia[2] = 0.5 * m->volume * r * r;
  } else {
    m->volume = 4.0 / 3.0 * PETSC_PI * r * r * r;
    for (PetscInt a = 0; a < 3; a++) m->inertia[a] = 0.4 * m->volume * r * r;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* 2D: equal angles. 3D: Fibonacci lattice, equal areas to the accuracy of the lattice. */
static PetscErrorCode ShapeSurface_Circle(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Circle         *c;
  const PetscReal golden_angle = PETSC_PI * (3.0 - PetscSqrtReal(5.0));

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal z   = c->dim == 2 ? 0.0 : 1.0 - (2.0 * (PetscReal)i + 1.0) / (PetscReal)n;
    const PetscReal phi = (PetscReal)i * (c->dim == 2 ? 2.0 * PETSC_PI / (PetscReal)n : golden_angle),
                    rho = c->radius * PetscSqrtReal(1.0 - z * z);

    x[i * c->dim]     = rho * PetscCosReal(phi);
    x[i * c->dim + 1] = rho * PetscSinReal(phi);
    if (c->dim == 3) x[i * 3 + 2] = c->radius * z;
    w[i] = (c->dim == 2 ? 2.0 * PETSC_PI * c->radius : 4.0 * PETSC_PI * c->radius * c->radius) / (PetscReal)n;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Circle(Shape s, PetscViewer viewer)
{
  Circle *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscViewerASCIIPrintf(viewer, "radius %g m\n", (double)c->radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Circle(Shape s)
{
  Circle *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscFree(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "circle",
  .description = "disc (2D) or sphere (3D)",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create   = ShapeCreate_Circle,
                  .options  = ShapeOptions_Circle,
                  .distance = ShapeDistance_Circle,
                  .radius   = ShapeRadius_Circle,
                  .normal   = ShapeNormal_Circle,
                  .mass     = ShapeMass_Circle,
                  .surface  = ShapeSurface_Circle,
                  .view     = ShapeView_Circle,
                  .destroy  = ShapeDestroy_Circle},
};
