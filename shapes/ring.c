/* Ring: what lies between two circles about the body origin; fluid fills its hollow. A container that turns, for
   instance. */
#include "shape.h"

typedef struct {
  PetscReal inner, outer; /* radii, m */
} Ring;

static PetscErrorCode ShapeCreate_Ring(Shape s)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(ShapeSetData(s, c));
  c->inner = 0.5;
  c->outer = 1.0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Ring(Shape s)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(ShapeOptionReal(s, "inner", "Inner radius, below the outer one", "length", SHAPE_POSITIVE, PETSC_MAX_REAL,
                            &c->inner));
  PetscCall(ShapeOptionReal(s, "outer", "Outer radius", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &c->outer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Ring(Shape s)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCheck(c->inner < c->outer, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Inner radius %g of shape 'ring' is not below its outer radius %g: lower its option inner or raise outer",
             (double)c->inner, (double)c->outer);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Ring(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Ring     *c;
  PetscReal inner, outer;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  inner = c->inner;
  outer = c->outer;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal r = PetscSqrtReal(x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1]);

    d[i] = PetscMax(r - outer, inner - r);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Ring(Shape s, PetscReal *r)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  *r = c->outer;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Ring(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal r    = PetscSqrtReal(x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1]),
                    sign = r - c->outer > c->inner - r ? 1 : -1;

    normal[2 * i]     = r > 0 ? sign * x[2 * i] / r : 1;
    normal[2 * i + 1] = r > 0 ? sign * x[2 * i + 1] / r : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeMass_Ring(Shape s, ShapeMass *m)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  m->volume     = PETSC_PI * (c->outer - c->inner) * (c->outer + c->inner);
  m->inertia[2] = 0.5 * m->volume * (c->outer * c->outer + c->inner * c->inner);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points at equal angles on the outer circle, then on the inner one (the body on the left: clockwise), in numbers as
   their lengths */
static PetscErrorCode ShapeSurface_Ring(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Ring    *c;
  PetscInt m;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  m = (PetscInt)((PetscReal)n * c->outer / (c->outer + c->inner) + 0.5);
  m = PetscMin(PetscMax(m, 1), n);
  for (PetscInt i = 0; i < n; i++) {
    const PetscBool outside = (PetscBool)(i < m);
    const PetscInt  count   = outside ? m : n - m;
    const PetscReal r       = outside ? c->outer : c->inner,
                    phi     = 2 * PETSC_PI * (PetscReal)(outside ? i : m - i) / (PetscReal)count;

    x[2 * i]     = r * PetscCosReal(phi);
    x[2 * i + 1] = r * PetscSinReal(phi);
    w[i]         = 2 * PETSC_PI * (n == m ? c->outer + c->inner : r) / (PetscReal)count;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Ring(Shape s, PetscViewer viewer)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscViewerASCIIPrintf(viewer, "radii %g and %g m\n", (double)c->inner, (double)c->outer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Ring(Shape s)
{
  Ring *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscFree(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "ring",
  .description = "ring between two circles (2D), fluid in its hollow",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 1,
  .ops         = {.create   = ShapeCreate_Ring,
                  .options  = ShapeOptions_Ring,
                  .setup    = ShapeSetUp_Ring,
                  .distance = ShapeDistance_Ring,
                  .radius   = ShapeRadius_Ring,
                  .normal   = ShapeNormal_Ring,
                  .mass     = ShapeMass_Ring,
                  .surface  = ShapeSurface_Ring,
                  .view     = ShapeView_Ring,
                  .destroy  = ShapeDestroy_Ring},
};
