/* Torus about the z axis, centred on the body origin. 3D only (the shape ring is its plane sister). All but surface
   points in closed form. */
#include "shape.h"

typedef struct {
  PetscReal radius, tube; /* of the centre line, of the tube around it, m */
} Torus;

static PetscErrorCode ShapeCreate_Torus(Shape s)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  PetscCall(ShapeSetData(s, t));
  t->radius = 0.5;
  t->tube   = 0.2;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Torus(Shape s)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCall(
    ShapeOptionReal(s, "radius", "Radius of the centre line", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &t->radius));
  PetscCall(ShapeOptionReal(s, "tube", "Radius of the tube, below that of the centre line", "length", SHAPE_POSITIVE,
                            PETSC_MAX_REAL, &t->tube));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Torus(Shape s)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCheck(t->tube < t->radius, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Radius %g of the tube of shape 'torus' is not below the radius %g of its centre line: lower its option tube or raise radius",
             (double)t->tube, (double)t->radius);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Torus(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal q = PetscSqrtReal(x[3 * i] * x[3 * i] + x[3 * i + 1] * x[3 * i + 1]) - t->radius;

    d[i] = PetscSqrtReal(q * q + x[3 * i + 2] * x[3 * i + 2]) - t->tube;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* On the axis and on the centre line every direction across them is right. */
static PetscErrorCode ShapeNormal_Torus(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *p = x + 3 * i, rho = PetscSqrtReal(p[0] * p[0] + p[1] * p[1]), q = rho - t->radius,
                    len = PetscSqrtReal(q * q + p[2] * p[2]);

    normal[3 * i]     = (len > 0 ? q / len : 0) * (rho > 0 ? p[0] / rho : 1);
    normal[3 * i + 1] = (len > 0 ? q / len : 0) * (rho > 0 ? p[1] / rho : 0);
    normal[3 * i + 2] = len > 0 ? p[2] / len : 1;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Torus(Shape s, PetscReal *r)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  *r = t->radius + t->tube;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeMass_Torus(Shape s, ShapeMass *m)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  m->volume     = 2 * PetscSqr(PETSC_PI * t->tube) * t->radius;
  m->inertia[0] = m->inertia[1] = m->volume * (0.5 * PetscSqr(t->radius) + 0.625 * PetscSqr(t->tube));
  m->inertia[2]                 = m->volume * (PetscSqr(t->radius) + 0.75 * PetscSqr(t->tube));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Torus(Shape s, PetscViewer viewer)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCall(PetscViewerASCIIPrintf(viewer, "radius %g m of the centre line, %g m of the tube\n", (double)t->radius,
                                   (double)t->tube));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Torus(Shape s)
{
  Torus *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCall(PetscFree(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "torus",
  .description = "torus about z",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 2,
  .ops         = {.create   = ShapeCreate_Torus,
                  .options  = ShapeOptions_Torus,
                  .setup    = ShapeSetUp_Torus,
                  .distance = ShapeDistance_Torus,
                  .radius   = ShapeRadius_Torus,
                  .normal   = ShapeNormal_Torus,
                  .mass     = ShapeMass_Torus,
                  .view     = ShapeView_Torus,
                  .destroy  = ShapeDestroy_Torus},
};
