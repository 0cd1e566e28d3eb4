/* Cylinder: round, finite, along the z axis, centred on the body origin, with rims rounded by a radius. 3D only (in 2D
   it is a circle, or a box).

   In the half plane of radius and |z| it is a box. */
#include "shape.h"

typedef struct {
  PetscReal radius, length, rounding; /* m */
  PetscReal core_radius, half;        /* without the rounding, m */
} Cylinder;

static PetscErrorCode ShapeCreate_Cylinder(Shape s)
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&c));
  PetscCall(ShapeSetData(s, c));
  c->radius = 0.5;
  c->length = 1.0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Cylinder(Shape s)
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(ShapeOptionReal(s, "radius", "Radius", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &c->radius));
  PetscCall(ShapeOptionReal(s, "length", "Length along z, rounding included", "length", SHAPE_POSITIVE, PETSC_MAX_REAL,
                            &c->length));
  PetscCall(ShapeOptionReal(s, "rounding", "Radius of the rims, at most the radius and half the length", "length", 0.0,
                            PETSC_MAX_REAL, &c->rounding));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Cylinder(Shape s)
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCheck(c->rounding <= PetscMin(c->radius, 0.5 * c->length), ShapeComm(), PETSC_ERR_USER_INPUT,
             "Rounding %g of shape 'cylinder' exceeds its radius %g or half its length %g: lower its option rounding",
             (double)c->rounding, (double)c->radius, (double)c->length);
  c->core_radius = c->radius - c->rounding;
  c->half        = 0.5 * c->length - c->rounding;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Cylinder(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal q = PetscSqrtReal(x[3 * i] * x[3 * i] + x[3 * i + 1] * x[3 * i + 1]) - c->core_radius,
                    z = PetscAbsReal(x[3 * i + 2]) - c->half;

    d[i] = PetscSqrtReal(PetscSqr(PetscMax(q, 0.0)) + PetscSqr(PetscMax(z, 0.0))) + PetscMin(PetscMax(q, z), 0.0) -
           c->rounding;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Cylinder(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *p = x + 3 * i, rho = PetscSqrtReal(p[0] * p[0] + p[1] * p[1]), q = rho - c->core_radius,
                    z   = PetscAbsReal(p[2]) - c->half;
    const PetscReal len = PetscSqrtReal(PetscSqr(PetscMax(q, 0.0)) + PetscSqr(PetscMax(z, 0.0)));
    const PetscReal out = len > 0 ? PetscMax(q, 0.0) / len : q > z, up = len > 0 ? PetscMax(z, 0.0) / len : q <= z;

    normal[3 * i]     = rho > 0 ? out * p[0] / rho : out; /* on the axis every direction is right */
    normal[3 * i + 1] = rho > 0 ? out * p[1] / rho : 0;
    normal[3 * i + 2] = PetscCopysignReal(up, p[2]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Cylinder(Shape s, PetscReal *r)
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  *r = PetscSqrtReal(PetscSqr(c->core_radius) + PetscSqr(c->half)) + c->rounding;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The straight part, and the rims as discs of radius core + r cos(t) at the height half + r sin(t): polynomials in sine
   and cosine, which a Gauss rule of 24 points integrates to round-off */
static PetscErrorCode ShapeMass_Cylinder(Shape s, ShapeMass *m)
{
  enum {
    N = 24
  };
  Cylinder *c;
  PetscReal t[N], w[N], rr, zz;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  m->volume = 2 * c->half * PETSC_PI * PetscSqr(c->radius);
  rr        = 0.5 * m->volume * PetscSqr(c->radius); /* integral of x^2 + y^2 */
  zz        = m->volume * PetscSqr(c->half) / 3;
  PetscCall(PetscDTGaussQuadrature(N, 0, 0.5 * PETSC_PI, t, w));
  for (PetscInt i = 0; i < N; i++) {
    const PetscReal rho2 = PetscSqr(c->core_radius + c->rounding * PetscCosReal(t[i])),
                    z    = c->half + c->rounding * PetscSinReal(t[i]);
    const PetscReal slab = 2 * w[i] * c->rounding * PetscCosReal(t[i]) * PETSC_PI * rho2;

    m->volume += slab;
    rr += 0.5 * slab * rho2;
    zz += slab * z * z;
  }
  m->inertia[0] = m->inertia[1] = 0.5 * rr + zz;
  m->inertia[2]                 = rr;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A prism of 96 sides, whose volume is that of the cylinder within 1e-3; rounded rims are left to the default. */
static PetscErrorCode ShapeTriangles_Cylinder(Shape s, PetscInt max, PetscInt *npoint, PetscReal *x[],
                                              PetscInt *ntriangle, PetscInt *triangle[])
{
  const PetscInt n = max < 384 ? 24 : 96; /* points of a rim; after the rims the middles of both ends */
  Cylinder      *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  *ntriangle = 0;
  if (c->rounding > 0) PetscFunctionReturn(PETSC_SUCCESS);
  *npoint    = 2 * n + 2;
  *ntriangle = 4 * n;
  PetscCall(PetscCalloc1(3 * *npoint, x));
  PetscCall(PetscMalloc1(3 * *ntriangle, triangle));
  for (PetscInt i = 0; i < *npoint; i++) {
    const PetscReal angle = 2 * PETSC_PI * (PetscReal)(i / 2) / (PetscReal)n, r = i < 2 * n ? c->radius : 0;

    (*x)[3 * i]     = r * PetscCosReal(angle);
    (*x)[3 * i + 1] = r * PetscSinReal(angle);
    (*x)[3 * i + 2] = i % 2 ? c->half : -c->half;
  }
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt a = 2 * i, b = 2 * ((i + 1) % n),
                   t[12] = {a, b, b + 1, a, b + 1, a + 1, 2 * n, b, a, 2 * n + 1, a + 1, b + 1};

    PetscCall(PetscArraycpy(*triangle + 12 * i, t, 12));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Cylinder(Shape s, PetscViewer viewer)
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscViewerASCIIPrintf(viewer, "radius %g m, length %g m along z, rims rounded by %g m\n",
                                   (double)c->radius, (double)c->length, (double)c->rounding));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Cylinder(Shape s)
{
  Cylinder *c;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &c));
  PetscCall(PetscFree(c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "cylinder",
  .description = "finite round cylinder along z with rounded rims",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 2,
  .ops         = {.create    = ShapeCreate_Cylinder,
                  .options   = ShapeOptions_Cylinder,
                  .setup     = ShapeSetUp_Cylinder,
                  .distance  = ShapeDistance_Cylinder,
                  .radius    = ShapeRadius_Cylinder,
                  .normal    = ShapeNormal_Cylinder,
                  .mass      = ShapeMass_Cylinder,
                  .view      = ShapeView_Cylinder,
                  .destroy   = ShapeDestroy_Cylinder,
                  .triangles = ShapeTriangles_Cylinder},
};
