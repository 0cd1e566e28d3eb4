/* Leaflet: a straight flap with rounded ends, along x; in 3D a rod with round cross-section (a capsule).

   length is tip to tip, so the axis between the centres of the two round ends has length - thickness. The body origin
   lies on the axis: origin = 0 at the centre of the hinged end (default), 0.5 in the middle, 1 at the free end. The
   rest is closed forms; surface points are left to the default. */
#include "shape.h"

typedef struct {
  PetscInt  dim;
  PetscReal length, thickness; /* m */
  PetscReal origin;            /* fraction of the axis */
  PetscReal x0, x1, r;         /* ends of the axis and radius, m */
} Leaflet;

static PetscErrorCode ShapeCreate_Leaflet(Shape s)
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&l));
  PetscCall(ShapeSetData(s, l));
  PetscCall(ShapeGetDimension(s, &l->dim));
  l->length    = 1.0;
  l->thickness = 0.1;
  l->origin    = 0.0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeOptions_Leaflet(Shape s)
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  PetscCall(
    ShapeOptionReal(s, "length", "Length from tip to tip", "length", SHAPE_POSITIVE, PETSC_MAX_REAL, &l->length));
  PetscCall(ShapeOptionReal(s, "thickness", "Thickness, at most the length", "length", SHAPE_POSITIVE, PETSC_MAX_REAL,
                            &l->thickness));
  PetscCall(ShapeOptionReal(s, "origin", "Body origin along the axis: 0 hinged end, 0.5 middle, 1 free end", "", 0.0,
                            1.0, &l->origin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeSetUp_Leaflet(Shape s)
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  PetscCheck(l->thickness <= l->length, ShapeComm(), PETSC_ERR_USER_INPUT,
             "Thickness %g of shape 'leaflet' exceeds its length %g: lower its option thickness or raise length",
             (double)l->thickness, (double)l->length);
  l->r  = 0.5 * l->thickness;
  l->x0 = -l->origin * (l->length - l->thickness);
  l->x1 = l->x0 + l->length - l->thickness;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDistance_Leaflet(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  Leaflet  *l;
  PetscReal x0, x1, r;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  x0 = l->x0;
  x1 = l->x1;
  r  = l->r;
  if (l->dim == 2) {
    for (PetscInt i = 0; i < n; i++) {
      const PetscReal dx = x[2 * i] - PetscMin(PetscMax(x[2 * i], x0), x1), dy = x[2 * i + 1];

      d[i] = PetscSqrtReal(dx * dx + dy * dy) - r;
    }
  } else {
    for (PetscInt i = 0; i < n; i++) {
      const PetscReal dx = x[3 * i] - PetscMin(PetscMax(x[3 * i], x0), x1), dy = x[3 * i + 1], dz = x[3 * i + 2];

      d[i] = PetscSqrtReal(dx * dx + dy * dy + dz * dz) - r;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeRadius_Leaflet(Shape s, PetscReal *r)
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  *r = PetscMax(-l->x0, l->x1) + l->r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeNormal_Leaflet(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *p = x + i * l->dim;
    PetscReal       *g = normal + i * l->dim, len2 = 0;

    for (PetscInt a = 0; a < l->dim; a++) {
      g[a] = a ? p[a] : p[0] - PetscMin(PetscMax(p[0], l->x0), l->x1);
      len2 += g[a] * g[a];
    }
    /* on the axis: either side */
    for (PetscInt a = 0; a < l->dim; a++) g[a] = len2 > 0 ? g[a] / PetscSqrtReal(len2) : (PetscReal)(a == 1);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A bar (cylinder) of length axis and two half discs (half balls) whose centroids lie 4r/(3 pi) (3r/8) beyond its
   ends. */
static PetscErrorCode ShapeMass_Leaflet(Shape s, ShapeMass *m)
{
  Leaflet  *l;
  PetscReal axis, r, bar, caps, about_axis, across;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  axis           = l->x1 - l->x0;
  r              = l->r;
  m->centroid[0] = 0.5 * (l->x0 + l->x1);
  if (l->dim == 2) {
    bar           = 2.0 * r * axis;
    caps          = PETSC_PI * r * r;
    m->inertia[2] = bar * (axis * axis + 4.0 * r * r) / 12.0 +
                    caps * (0.5 * r * r + 0.25 * axis * axis + axis * 4.0 * r / (3.0 * PETSC_PI));
  } else {
    bar        = PETSC_PI * r * r * axis;
    caps       = 4.0 / 3.0 * PETSC_PI * r * r * r;
    about_axis = 0.5 * bar * r * r + 0.4 * caps * r * r;
    across = bar * (axis * axis / 12.0 + 0.25 * r * r) + caps * (0.4 * r * r + 0.25 * axis * axis + 0.375 * r * axis);
    m->inertia[0] = about_axis;
    m->inertia[1] = m->inertia[2] = across;
  }
  m->volume = bar + caps;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeView_Leaflet(Shape s, PetscViewer viewer)
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  PetscCall(PetscViewerASCIIPrintf(viewer, "length %g m, thickness %g m, origin at %g of the axis\n", (double)l->length,
                                   (double)l->thickness, (double)l->origin));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode ShapeDestroy_Leaflet(Shape s)
{
  Leaflet *l;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetData(s, &l));
  PetscCall(PetscFree(l));
  PetscFunctionReturn(PETSC_SUCCESS);
}

TUMBLE_SHAPE_REGISTER = {
  .interface   = SHAPE_INTERFACE,
  .type        = "leaflet",
  .description = "straight flap with rounded ends, hinged at one of them",
  .author      = "tumble",
  .version     = "1.0",
  .dims        = 3,
  .ops         = {.create   = ShapeCreate_Leaflet,
                  .options  = ShapeOptions_Leaflet,
                  .setup    = ShapeSetUp_Leaflet,
                  .distance = ShapeDistance_Leaflet,
                  .radius   = ShapeRadius_Leaflet,
                  .normal   = ShapeNormal_Leaflet,
                  .mass     = ShapeMass_Leaflet,
                  .view     = ShapeView_Leaflet,
                  .destroy  = ShapeDestroy_Leaflet},
};
