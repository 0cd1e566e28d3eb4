/* Check of a new shape, see impl.h. A sample, not a proof: the conformance suite (make test-shape) asks everything. */
#include "compat.h"
#include "guard.h"
#include "impl.h"

#define SIDE       9      /* points of the sample along an axis */
#define REACH      1.25   /* of the sample, in bounding radii */
#define SHIFT      0.0173 /* of the sample off its symmetric position, in spacings: no line along an edge of a box */
#define MAX_POINTS (SIDE * SIDE * SIDE)
#define STEEP      1e-6 /* by which a distance may grow faster than the way, relative */
#define SLOPE      0.1  /* by which its slope across the surface may differ from 1 */

#define WHERE(s, x) (double)(x)[0], (double)(x)[1], (s)->dim == 3 ? (double)(x)[2] : 0.0

static PetscErrorCode CheckInside(Shape s, PetscInt n, const PetscReal x[], const PetscReal d[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    PetscReal r2 = 0;

    for (PetscInt a = 0; a < s->dim; a++) r2 += PetscSqr(x[i * s->dim + a]);
    PetscCheck(d[i] > 0 || r2 < PetscSqr(1.0001 * s->radius), ShapeComm(), PETSC_ERR_USER_INPUT,
               "Shape '%s' has distance %g at (%g, %g, %g), which is outside its bounding radius %g: correct its operation radius or distance ('make test-shape SHAPE=%s')",
               s->loaded->type, (double)d[i], WHERE(s, x + i * s->dim), (double)s->radius, s->loaded->file);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Between neighbours of the sample the distance must not change by more than the way */
static PetscErrorCode CheckSteepness(Shape s, PetscInt n, PetscReal h, const PetscReal x[], const PetscReal d[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0, stride = 1; a < s->dim; a++, stride *= SIDE) {
      if (i / stride % SIDE == SIDE - 1) continue;
      PetscCheck(PetscAbsReal(d[i + stride] - d[i]) <= h * (1 + STEEP), ShapeComm(), PETSC_ERR_USER_INPUT,
                 "The distance of shape '%s' is no distance: from (%g, %g, %g) to a point %g away it changes by %g. It must be 1-Lipschitz, and "
                 "Euclidean near the surface: correct its operation distance ('make test-shape SHAPE=%s')",
                 s->loaded->type, WHERE(s, x + i * s->dim), (double)h, (double)PetscAbsReal(d[i + stride] - d[i]),
                 s->loaded->file);
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Length of the gradient at x, by differences over 2 h */
static PetscErrorCode TakeGradient(Shape s, const PetscReal x[], PetscReal h, PetscReal *slope)
{
  PetscReal square = 0;

  PetscFunctionBeginUser;
  for (PetscInt b = 0; b < s->dim; b++) {
    PetscReal y[3] = {x[0], x[1], s->dim == 3 ? x[2] : 0}, before, after;

    y[b] = x[b] - h;
    PetscCall(ShapeDistance(s, 1, y, &before));
    y[b] = x[b] + h;
    PetscCall(ShapeDistance(s, 1, y, &after));
    square += PetscSqr((after - before) / (2 * h));
  }
  *slope = PetscSqrtReal(square);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Length of the gradient where the surface crosses the edge from x (d <= 0) along axis a; x becomes that point */
static PetscErrorCode MeasureSlope(Shape s, PetscReal x[], PetscInt a, PetscReal edge, PetscReal *slope)
{
  PetscReal       low = 0, high = 1, d;
  const PetscReal start = x[a];

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < 30; k++) {
    const PetscReal middle = 0.5 * (low + high);

    x[a] = start + middle * edge;
    PetscCall(ShapeDistance(s, 1, x, &d));
    if (d <= 0) low = middle;
    else high = middle;
  }
  PetscCall(TakeGradient(s, x, 1e-4 * s->radius, slope));
  if (PetscAbsReal(*slope - 1) > SLOPE) PetscCall(TakeGradient(s, x, 1e-6 * s->radius, slope)); /* a thin body */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Across the surface the slope is 1, except at corners: most of the places where edges of the sample cross it must say
   so. Bodies between the points of the sample are not found. */
static PetscErrorCode CheckSlope(Shape s, PetscInt n, PetscReal h, const PetscReal x[], const PetscReal d[])
{
  PetscInt  crossings = 0, wrong = 0;
  PetscReal worst[3] = {0, 0, 0}, slope_worst = 1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0, stride = 1; a < s->dim; a++, stride *= SIDE) {
      PetscReal y[3] = {0, 0, 0}, slope = 1;

      if (i / stride % SIDE == SIDE - 1 || (d[i] <= 0) == (d[i + stride] <= 0)) continue;
      const PetscBool forward = (PetscBool)(d[i] <= 0);

      PetscCall(PetscArraycpy(y, x + (forward ? i : i + stride) * s->dim, s->dim));
      PetscCall(MeasureSlope(s, y, a, forward ? h : -h, &slope));
      crossings++;
      if (PetscAbsReal(slope - 1) <= SLOPE) continue;
      wrong++;
      if (PetscAbsReal(slope - 1) <= PetscAbsReal(slope_worst - 1)) continue;
      slope_worst = slope;
      PetscCall(PetscArraycpy(worst, y, 3));
    }
  PetscCheck(2 * wrong <= crossings, ShapeComm(), PETSC_ERR_USER_INPUT,
             "The distance of shape '%s' is no distance: on the surface, at (%g, %g, %g), its slope is %g, and it must be 1 (such as r - R for a "
             "circle, not r^2 - R^2): correct its operation distance ('make test-shape SHAPE=%s')",
             s->loaded->type, WHERE(s, worst), (double)slope_worst, s->loaded->file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscBool trusted = PETSC_FALSE;

PetscErrorCode ShapeTrustDistances(void)
{
  PetscFunctionBeginUser;
  trusted = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeCheck(Shape s)
{
  const PetscInt n = s->dim == 2 ? SIDE * SIDE : MAX_POINTS;
  PetscReal      x[MAX_POINTS * 3], d[MAX_POINTS], h;

  PetscFunctionBeginUser;
  GUARDED(s, radius, (s, &s->radius));
  PetscCheck(s->radius > 0 && s->radius < PETSC_MAX_REAL, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Shape '%s' has bounding radius %g, which must be positive and finite: check its options -%s* and its operation radius",
             s->loaded->type, (double)s->radius, s->prefix);
  h = 2 * REACH * s->radius / (SIDE - 1);
  for (PetscInt i = 0; i < n; i++) {
    PetscInt k = i;

    for (PetscInt a = 0; a < s->dim; a++, k /= SIDE)
      x[i * s->dim + a] = s->radius * REACH * ((PetscReal)(k % SIDE) * 2.0 / (PetscReal)(SIDE - 1) - 1.0) +
                          (PetscReal)(a + 1) * SHIFT * h;
  }
  PetscCall(ShapeDistance(s, n, x, d));
  PetscCall(CheckInside(s, n, x, d));
  if (trusted) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CheckSteepness(s, n, h, x, d));
  PetscCall(CheckSlope(s, n, h, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}
