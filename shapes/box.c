/* Box: a rectangle in 2D, a cuboid in 3D, sides along the body axes, centred on the body origin, with edges rounded by
   a radius. Half the smallest side as radius gives a capsule. All but surface points in closed form. */
#include "shape.h"

typedef struct {
  PetscInt  dim;
  PetscReal size[3], rounding; /* m */
  PetscReal core[3];           /* half sides of what the rounding is put around, m */
} Box;

static PetscErrorCode ShapeCreate_Box(Shape s)
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&b));
  PetscCall(ShapeSetData(s, b));
  PetscCall(ShapeGetDimension(s, &b->dim));
  for (PetscInt a = 0; a < 3; a++) b->size[a] = 1.0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Box(Shape s)
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  PetscCall(ShapeOptionRealArray(s, "size", "Sides along x, y (, z), rounding included", "length", SHAPE_POSITIVE,
                                 PETSC_MAX_REAL, b->dim, b->size));
  PetscCall(ShapeOptionReal(s, "rounding", "Radius of the edges, at most half the smallest side", "length", 0.0,
                            PETSC_MAX_REAL, &b->rounding));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Box(Shape s)
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  for (PetscInt a = 0; a < b->dim; a++) {
    PetscCheck(b->rounding <= 0.5 * b->size[a], ShapeComm(), PETSC_ERR_USER_INPUT,
               "Rounding %g exceeds half the side %g of shape 'box': lower its option rounding or raise size",
               (double)b->rounding, (double)b->size[a]);
    b->core[a] = 0.5 * b->size[a] - b->rounding;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inside of the core the nearest side decides; elsewhere the nearest point of the core. */
static PetscErrorCode ShapeDistance_Box(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal out2 = 0, in = -PETSC_MAX_REAL;

    for (PetscInt a = 0; a < b->dim; a++) {
      const PetscReal q = PetscAbsReal(x[i * b->dim + a]) - b->core[a];

      out2 += PetscSqr(PetscMax(q, 0.0));
      in = PetscMax(in, q);
    }
    d[i] = PetscSqrtReal(out2) + PetscMin(in, 0.0) - b->rounding;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Box(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *p = x + i * b->dim;
    PetscReal       *g = normal + i * b->dim, len2 = 0;
    PetscInt         side = 0;

    for (PetscInt a = 0; a < b->dim; a++) {
      const PetscReal q = PetscAbsReal(p[a]) - b->core[a];

      g[a] = q > 0 ? PetscCopysignReal(q, p[a]) : 0;
      len2 += g[a] * g[a];
      if (q > PetscAbsReal(p[side]) - b->core[side]) side = a;
    }
    for (PetscInt a = 0; a < b->dim; a++)
      g[a] = len2 > 0 ? g[a] / PetscSqrtReal(len2) : a == side ? PetscCopysignReal(1.0, p[a]) : 0;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Box(Shape s, PetscReal *r)
{
  Box      *b;
  PetscReal r2 = 0;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  for (PetscInt a = 0; a < b->dim; a++) r2 += PetscSqr(b->core[a]);
  *r = PetscSqrtReal(r2) + b->rounding;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volume and integrals of x_a^2, region by region. A region is where the coordinates of a set of axes lie beyond the
   core: their excesses t fill the positive part of a ball of the rounding, in as many dimensions k; the other
   coordinates run over the core. m: integrals of 1, t_a, t_a^2 over that part of the ball. */
static PetscErrorCode ShapeMass_Box(Shape s, ShapeMass *mass)
{
  Box      *b;
  PetscReal xx[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  const PetscReal r = b->rounding, r2 = r * r;
  const PetscReal m[4][3] = {{1, 0, 0},
                             {r, r2 / 2, r2 * r / 3},
                             {PETSC_PI * r2 / 4, r2 * r / 3, PETSC_PI * r2 * r2 / 16},
                             {PETSC_PI * r2 * r / 6, PETSC_PI * r2 * r2 / 16, PETSC_PI * r2 * r2 * r / 30}};

  for (PetscInt set = 0; set < 1 << b->dim; set++) {
    PetscInt  k     = 0;
    PetscReal width = 1; /* of the core along the other axes, times the number of such regions */

    for (PetscInt a = 0; a < b->dim; a++) {
      k += set >> a & 1;
      width *= set >> a & 1 ? 2 : 2 * b->core[a];
    }
    mass->volume += width * m[k][0];
    for (PetscInt a = 0; a < b->dim; a++) {
      const PetscReal c = b->core[a];

      xx[a] += width * (set >> a & 1 ? c * c * m[k][0] + 2 * c * m[k][1] + m[k][2] : c * c / 3 * m[k][0]);
    }
  }
  mass->inertia[2] = xx[0] + xx[1];
  if (b->dim == 3) {
    mass->inertia[0] = xx[1] + xx[2];
    mass->inertia[1] = xx[0] + xx[2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rounded edges have none. */
static PetscErrorCode ShapeCorners_Box(Shape s, PetscInt max, PetscInt *n, PetscReal x[])
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  *n = b->rounding > 0 ? 0 : 1 << b->dim;
  for (PetscInt i = 0; i < PetscMin(*n, max); i++)
    for (PetscInt a = 0; a < b->dim; a++) x[i * b->dim + a] = (i >> a & 1 ? 1 : -1) * b->core[a];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Twelve triangles; rounded edges are left to the default. */
static PetscErrorCode ShapeTriangles_Box(Shape s, PetscInt max, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle,
                                         PetscInt *triangle[])
{
  const int face[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  Box      *b;

  PetscFunctionBeginUser;
  (void)max;
  PetscCall(ShapeGetData(s, &b));
  *ntriangle = 0;
  if (b->rounding > 0) PetscFunctionReturn(PETSC_SUCCESS);
  *npoint    = 8;
  *ntriangle = 12;
  PetscCall(PetscMalloc1(24, x));
  PetscCall(PetscMalloc1(36, triangle));
  for (int i = 0; i < 24; i++) (*x)[i] = (i / 3 >> i % 3 & 1 ? 1 : -1) * b->core[i % 3];
  for (int i = 0; i < 36; i++) (*triangle)[i] = face[i / 6][i % 3 ? i % 3 + i / 3 % 2 : 0];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Box(Shape s, PetscViewer viewer)
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  PetscCall(PetscViewerASCIIPrintf(viewer, "%g x %g", (double)b->size[0], (double)b->size[1]));
  if (b->dim == 3) PetscCall(PetscViewerASCIIPrintf(viewer, " x %g", (double)b->size[2]));
  PetscCall(PetscViewerASCIIPrintf(viewer, " m, edges rounded by %g m\n", (double)b->rounding));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Box(Shape s)
{
  Box *b;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &b));
  PetscCall(PetscFree(b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "box",
  .description = "rectangle (2D) or cuboid (3D) with rounded edges",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create    = ShapeCreate_Box,
                  .options   = ShapeOptions_Box,
                  .setup     = ShapeSetUp_Box,
                  .distance  = ShapeDistance_Box,
                  .radius    = ShapeRadius_Box,
                  .normal    = ShapeNormal_Box,
                  .mass      = ShapeMass_Box,
                  .view      = ShapeView_Box,
                  .destroy   = ShapeDestroy_Box,
                  .corners   = ShapeCorners_Box,
                  .triangles = ShapeTriangles_Box},
};
