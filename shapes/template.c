/* Template of a shape: a square (cube in 3D) with rounded edges.

   To make your own shape:
     1. tools/new-shape <name> makes shapes/<name>.c from this file, with a test and a scene;
     2. write distance and radius, which are required; everything else may be left out of the record at the end of the
        file:
        normal, mass properties and surface points then come from the distance (write them when you have a formula: it
        is faster and exact);
     3. make shapes && make test-shape SHAPE=build/shapes/<name>.so
     4. use it in a scene: particle_<group>_shape: <name>, and its options as particle_<group>_side and so on.

   Points are in the body frame, which is yours to choose: here its origin is the centre of the square. */
#include "shape.h"

/* What the shape needs to know. One record per group of bodies, made in create, freed in destroy. */
typedef struct {
  PetscInt  dim;
  PetscReal side;   /* of the square, rounding included, m */
  PetscReal corner; /* radius of the rounded edges, m */
} Template;

/* Allocate the record and set defaults. */
static PetscErrorCode ShapeCreate_Template(Shape s)
{
  Template *t;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  PetscCall(ShapeSetData(s, t));
  PetscCall(ShapeGetDimension(s, &t->dim));
  t->side   = 1.0;
  t->corner = 0.1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Read options: name without prefix, meaning, unit, range, value. Values outside the range are refused for you. */
static PetscErrorCode ShapeOptions_Template(Shape s)
{
  Template *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCall(ShapeOptionReal(s, "side", "Side of the square, rounding included", "length", SHAPE_POSITIVE,
                            PETSC_MAX_REAL, &t->side));
  PetscCall(ShapeOptionReal(s, "corner", "Radius of the rounded edges, at most side/2", "length", 0.0, PETSC_MAX_REAL,
                            &t->corner));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What depends on several options: check them against each other here, and compute whatever distance should not compute
   again. */
static PetscErrorCode ShapeSetUp_Template(Shape s)
{
  Template *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCheck(t->corner <= 0.5 * t->side, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Corner radius %g exceeds half the side %g of shape 'template': lower its option corner or raise side",
             (double)t->corner, (double)t->side);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* REQUIRED. Signed distance of n points x [n][dim]: negative inside, positive outside, and its size the true distance
   to the surface. Called with many points at a time and very often: no allocation, no options, a plain loop. n may be
   0. */
static PetscErrorCode ShapeDistance_Template(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Template *t;
  PetscReal flat;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  flat = 0.5 * t->side - t->corner; /* half width of the square without its rounding */
  for (PetscInt i = 0; i < n; i++) {
    PetscReal out2 = 0, in = -PETSC_MAX_REAL;

    for (PetscInt a = 0; a < t->dim; a++) {
      const PetscReal q = PetscAbsReal(x[i * t->dim + a]) - flat; /* symmetric: one corner is enough */

      out2 += PetscSqr(PetscMax(q, 0.0));
      in = PetscMax(in, q);
    }
    d[i] = PetscSqrtReal(out2) + PetscMin(in, 0.0) - t->corner; /* rounding a shape by r lowers its distance by r */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* REQUIRED. No point of the body is farther than this from the body origin. */
static PetscErrorCode ShapeRadius_Template(Shape s, PetscReal *r)
{
  Template *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  *r = PetscSqrtReal((PetscReal)t->dim) * (0.5 * t->side - t->corner) + t->corner;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One line for the log of a run. */
static PetscErrorCode ShapeView_Template(Shape s, PetscViewer viewer)
{
  Template *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCall(PetscViewerASCIIPrintf(viewer, "side %g m, corner radius %g m\n", (double)t->side, (double)t->corner));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Template(Shape s)
{
  Template *t;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &t));
  PetscCall(PetscFree(t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The record the program looks for. dims: 1 = 2D only, 2 = 3D only, 3 = both. The type must be the name of the file. */
TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "template",
  .description = "square (2D) or cube (3D) with rounded edges",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create   = ShapeCreate_Template,
                  .options  = ShapeOptions_Template,
                  .setup    = ShapeSetUp_Template,
                  .distance = ShapeDistance_Template,
                  .radius   = ShapeRadius_Template,
                  .view     = ShapeView_Template,
                  .destroy  = ShapeDestroy_Template},
};
