/* A disc of radius 1/2 (ball in 3D) with one fault on purpose, chosen by the option `fault`; 0 is correct. For testing
   the loader's checks and the conformance suite. */
#include "shape.h"

enum {
  FAULT_NONE,
  FAULT_NAN,       /* distance not a number left of the body */
  FAULT_SCALED,    /* distance twice too large */
  FAULT_SQUARED,   /* |x|^2 - r^2: right sign, not Euclidean */
  FAULT_SHRUNK,    /* 0.9 of the distance: 1-Lipschitz but not Euclidean */
  FAULT_NORMAL,    /* normals point inwards */
  FAULT_LENGTH,    /* normals are not unit */
  FAULT_RADIUS,    /* bounding radius too small for the body, not for the probe at load */
  FAULT_MASS,      /* inertia 2 % off */
  FAULT_CLOCKWISE, /* surface points run the wrong way round */
  FAULT_WEIGHTS,   /* weights are fractions of 1 instead of lengths */
  FAULT_RANDOM,    /* distance changes from call to call */
  FAULT_SIGN,      /* a region inside claims to be outside */
  FAULT_LEAK,      /* data never freed */
  FAULT_RANGE,     /* an option whose allowed values do not all work */
  FAULT_EMPTY,     /* an empty batch is an error */
  FAULT_ALONE,     /* 32 normals are an error while another object is alive */
  FAULT_COUNT
};

static PetscInt alive; /* objects */

typedef struct {
  PetscInt  dim, fault, calls;
  PetscReal radius;
} Faulty;

static PetscErrorCode ShapeCreate_Faulty(Shape s)
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&f));
  PetscCall(ShapeSetData(s, f));
  PetscCall(ShapeGetDimension(s, &f->dim));
  f->radius = 0.5;
  alive++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Faulty(Shape s)
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCall(ShapeOptionInt(s, "fault", "Which fault to commit", 0, FAULT_COUNT - 1, &f->fault));
  if (f->fault == FAULT_RANGE)
    PetscCall(ShapeOptionReal(s, "spare", "Radius, of which 0 is said to be allowed", "", 0.0, 1.0, &f->radius));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal Norm(const Faulty *f, const PetscReal x[])
{
  return PetscSqrtReal(x[0] * x[0] + x[1] * x[1] + (f->dim == 3 ? x[2] * x[2] : 0.0));
}

static PetscErrorCode ShapeDistance_Faulty(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCheck(n > 0 || f->fault != FAULT_EMPTY, PETSC_COMM_SELF, PETSC_ERR_ARG_SIZ, "No points");
  f->calls++;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *p = x + i * f->dim, r = Norm(f, p);

    d[i] = r - f->radius;
    switch (f->fault) {
    case FAULT_NAN:
      if (p[0] < -0.55) d[i] = PetscSqrtReal(-1.0 - r);
      break;
    case FAULT_SCALED: d[i] *= 2.0; break;
    case FAULT_SQUARED: d[i] = 0.3 * (r * r - f->radius * f->radius) / (1.0 + r); break;
    case FAULT_SHRUNK: d[i] *= 0.9; break;
    case FAULT_RANDOM: d[i] += 1e-9 * (PetscReal)(f->calls % 3); break;
    case FAULT_SIGN:
      if (r < 0.2) d[i] = -d[i];
      break;
    default: break;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Faulty(Shape s, PetscReal *r)
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  *r = f->fault == FAULT_RADIUS ? 0.95 * f->radius : f->radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Faulty(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  PetscCheck(alive == 1 || n != 32 || f->fault != FAULT_ALONE, PETSC_COMM_SELF, PETSC_ERR_SUP, "Another one is alive");
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal r = Norm(f, x + i * f->dim), factor = f->fault == FAULT_NORMAL ? -1.0
                                                        : f->fault == FAULT_LENGTH ? 1.001
                                                                                   : 1.0;

    for (PetscInt a = 0; a < f->dim; a++)
      normal[i * f->dim + a] = r > 0 ? factor * x[i * f->dim + a] / r : (PetscReal)(a == 0);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeMass_Faulty(Shape s, ShapeMass *m)
{
  Faulty         *f;
  const PetscReal pi = PETSC_PI;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  m->volume = f->dim == 2 ? pi * f->radius * f->radius : 4.0 / 3.0 * pi * f->radius * f->radius * f->radius;
  for (PetscInt a = f->dim == 2 ? 2 : 0; a < 3; a++)
    m->inertia[a] = (f->dim == 2 ? 0.5 : 0.4) * m->volume * f->radius * f->radius *
                    (f->fault == FAULT_MASS ? 1.02 : 1.0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSurface_Faulty(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal z   = f->dim == 2 ? 0.0 : 1.0 - (2.0 * (PetscReal)i + 1.0) / (PetscReal)n,
                    rho = f->radius * PetscSqrtReal(1.0 - z * z);
    const PetscReal phi = (PetscReal)i * (f->dim == 2 ? 2.0 * PETSC_PI / (PetscReal)n : 2.399963229728653) *
                          (f->fault == FAULT_CLOCKWISE ? -1.0 : 1.0);

    x[i * f->dim]     = rho * PetscCosReal(phi);
    x[i * f->dim + 1] = rho * PetscSinReal(phi);
    if (f->dim == 3) x[i * 3 + 2] = f->radius * z;
    w[i] = (f->dim == 2 ? 2.0 * PETSC_PI * f->radius : 4.0 * PETSC_PI * f->radius * f->radius) / (PetscReal)n;
    if (f->fault == FAULT_WEIGHTS) w[i] = 1.0 / (PetscReal)n;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Faulty(Shape s)
{
  Faulty *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &f));
  alive--;
  if (f->fault != FAULT_LEAK) PetscCall(PetscFree(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface = SHAPE_INTERFACE,
  .type      = "faulty",
  .dims      = 3,
  .ops       = {.create   = ShapeCreate_Faulty,
                .options  = ShapeOptions_Faulty,
                .distance = ShapeDistance_Faulty,
                .radius   = ShapeRadius_Faulty,
                .normal   = ShapeNormal_Faulty,
                .mass     = ShapeMass_Faulty,
                .surface  = ShapeSurface_Faulty,
                .destroy  = ShapeDestroy_Faulty},
};
