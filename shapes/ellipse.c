/* Ellipse in 2D, ellipsoid in 3D, axes along the body axes, centred on the body origin.

   Closest point by the Lagrange condition: c_i = e_i^2 x_i/(t + e_i^2) with F(t) = sum (e_i x_i/(t + e_i^2))^2 - 1 = 0,
   t > -min e^2 (the root function of D. Eberly, Distance from a Point to an Ellipse, an Ellipsoid, or a
   Hyperellipsoid). F is convex and falling, so Newton started on its positive side never overshoots; the largest single
   term brackets the root within a factor sqrt(dim), so a few steps suffice everywhere. Then d = t |x_i/(t + e_i^2)|,
   which carries its sign. Works in s = t + min e^2 so that points next to the long axis keep their digits. */
#include "shape.h"

typedef struct {
  PetscInt  dim;
  PetscReal e[3];     /* semi-axes, m */
  PetscReal delta[3]; /* e_i^2 - min e^2 */
  PetscReal min2;     /* min e^2 */
} Ellipse;

static PetscErrorCode ShapeCreate_Ellipse(Shape s)
{
  Ellipse *p;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&p));
  PetscCall(ShapeSetData(s, p));
  PetscCall(ShapeGetDimension(s, &p->dim));
  p->e[0] = 1.0;
  p->e[1] = 0.5;
  p->e[2] = 0.5;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Ellipse(Shape s)
{
  Ellipse *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCall(ShapeOptionReal(s, "a", "Semi-axis along x", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &p->e[0]));
  PetscCall(ShapeOptionReal(s, "b", "Semi-axis along y", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &p->e[1]));
  if (p->dim == 3)
    PetscCall(ShapeOptionReal(s, "c", "Semi-axis along z", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &p->e[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Ellipse(Shape s)
{
  Ellipse  *p;
  PetscReal shortest;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  shortest = p->e[0];
  for (PetscInt a = 1; a < p->dim; a++) shortest = PetscMin(shortest, p->e[a]);
  p->min2 = shortest * shortest;
  for (PetscInt a = 0; a < p->dim; a++) p->delta[a] = (p->e[a] - shortest) * (p->e[a] + shortest);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Root s and the vector g_i = x_i/(s + delta_i), which is normal to the surface at the closest point. */
static PetscReal FindRoot(const Ellipse *p, const PetscReal x[], PetscReal g[])
{
  PetscReal y[3], s = 0;

  for (PetscInt a = 0; a < p->dim; a++) {
    y[a] = PetscMax(PetscAbsReal(x[a]), 1e-100 * p->e[a]); /* a point on an axis: any tiny offset selects one of its two
                                                              closest points */
    s    = PetscMax(s, p->e[a] * y[a] - p->delta[a]);
  }
  for (int it = 0; it < 100; it++) {
    PetscReal f = -1.0, slope = 0, step;

    for (PetscInt a = 0; a < p->dim; a++) {
      const PetscReal z = 1.0 / (s + p->delta[a]), q = p->e[a] * y[a] * z;

      f += q * q;
      slope += 2.0 * q * q * z;
    }
    step = f / slope;
    if (!(step > 1e-16 * s)) break; /* also when round-off turns f negative */
    s += step;
  }
  for (PetscInt a = 0; a < p->dim; a++) g[a] = (x[a] < 0 ? -y[a] : y[a]) / (s + p->delta[a]);
  return s;
}

static PetscReal Length(PetscInt dim, const PetscReal g[])
{
  return PetscSqrtReal(g[0] * g[0] + g[1] * g[1] + (dim == 3 ? g[2] * g[2] : 0.0));
}

static PetscErrorCode ShapeDistance_Ellipse(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Ellipse  *p;
  PetscReal g[3];

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal root = FindRoot(p, x + i * p->dim, g);

    d[i] = (root - p->min2) * Length(p->dim, g);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Ellipse(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Ellipse *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal *g = normal + i * p->dim, len;

    FindRoot(p, x + i * p->dim, g);
    len = Length(p->dim, g);
    for (PetscInt a = 0; a < p->dim; a++) g[a] /= len;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Ellipse(Shape s, PetscReal *r)
{
  Ellipse *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  *r = PetscMax(p->e[0], p->e[1]);
  if (p->dim == 3) *r = PetscMax(*r, p->e[2]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeMass_Ellipse(Shape s, ShapeMass *m)
{
  Ellipse  *p;
  PetscReal a2, b2, c2;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  a2 = p->e[0] * p->e[0];
  b2 = p->e[1] * p->e[1];
  c2 = p->e[2] * p->e[2];
  if (p->dim == 2) {
    m->volume     = PETSC_PI * p->e[0] * p->e[1];
    m->inertia[2] = 0.25 * m->volume * (a2 + b2);
  } else {
    m->volume     = 4.0 / 3.0 * PETSC_PI * p->e[0] * p->e[1] * p->e[2];
    m->inertia[0] = 0.2 * m->volume * (b2 + c2);
    m->inertia[1] = 0.2 * m->volume * (a2 + c2);
    m->inertia[2] = 0.2 * m->volume * (a2 + b2);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Ellipse(Shape s, PetscViewer viewer)
{
  Ellipse *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  if (p->dim == 2)
    PetscCall(PetscViewerASCIIPrintf(viewer, "semi-axes a %g m, b %g m\n", (double)p->e[0], (double)p->e[1]));
  else
    PetscCall(PetscViewerASCIIPrintf(viewer, "semi-axes a %g m, b %g m, c %g m\n", (double)p->e[0], (double)p->e[1],
                                     (double)p->e[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Ellipse(Shape s)
{
  Ellipse *p;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &p));
  PetscCall(PetscFree(p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "ellipse",
  .description = "ellipse (2D) or ellipsoid (3D)",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create   = ShapeCreate_Ellipse,
                  .options  = ShapeOptions_Ellipse,
                  .setup    = ShapeSetUp_Ellipse,
                  .distance = ShapeDistance_Ellipse,
                  .radius   = ShapeRadius_Ellipse,
                  .normal   = ShapeNormal_Ellipse,
                  .mass     = ShapeMass_Ellipse,
                  .view     = ShapeView_Ellipse,
                  .destroy  = ShapeDestroy_Ellipse},
};
