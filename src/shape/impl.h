/* The inside of a shape, for the files of this room: README.md says which does what. */
#pragma once
#include "shape/host.h"

#define SHAPE_MAX_OPTIONS 32
#define SHAPE_CHUNK       64 /* points or cells handled at a time on the stack */

typedef struct {
  char               type[64];
  char               file[PETSC_MAX_PATH_LEN];
  void              *handle;
  const ShapePlugin *plugin;
} Loaded;

typedef struct {
  char      name[64];
  PetscReal lower, upper;
} OptionRange;

struct _p_Shape {
  const Loaded *loaded;
  ShapeOps      ops;
  PetscInt      dim;
  char          prefix[128];
  void         *data;
  PetscReal     radius;    /* about the body origin */
  PetscBool     bound;     /* ShapeSetBound */
  PetscBool     from_file; /* ShapeOptionPath read a path */
  PetscBool     have_mass, have_centroid_radius, have_disc;
  ShapeMass     mass;
  PetscReal     centroid_radius, disc;
  PetscBool     have_corners;
  PetscInt      ncorner;
  PetscReal    *corner; /* [ncorner][dim] */
  PetscInt      noptions;
  OptionRange   option[SHAPE_MAX_OPTIONS];
};

/* Unit direction k of n spread over the circle (sphere: Fibonacci lattice). */
static inline void ShapeSpreadDirection(PetscInt dim, PetscInt k, PetscInt n, PetscReal e[])
{
  if (dim == 2) {
    e[0] = PetscCosReal(2.0 * PETSC_PI * (PetscReal)k / (PetscReal)n);
    e[1] = PetscSinReal(2.0 * PETSC_PI * (PetscReal)k / (PetscReal)n);
  } else {
    PetscReal z = 1.0 - (2.0 * (PetscReal)k + 1.0) / (PetscReal)n, rho = PetscSqrtReal(1.0 - z * z),
              phi = 2.399963229728653 * (PetscReal)k;

    e[0] = rho * PetscCosReal(phi);
    e[1] = rho * PetscSinReal(phi);
    e[2] = z;
  }
}

/* Ask a new shape for its radius and probe its distance around it: a plugin that is wrong everywhere should stop here,
   not in step 500. Errors, with plugin and point: no positive radius; inside beyond it; a distance that is not finite,
   grows by more than the way, or by another than the way across most of the surface. Not collective. */
PetscErrorCode ShapeCheck(Shape);

/* Central differences, normalised. Where the gradient vanishes (centre of a disc) some unit vector. r: size of the
   shape. Not collective. */
PetscErrorCode ShapeDefaultNormal(Shape, PetscReal r, PetscInt dim, PetscInt n, const PetscReal x[],
                                  PetscReal normal[]);

/* Moments by quadrature, refined until they are within 1e-6 or the deepest level is reached (3D: cells that bend are
   refined further, bend.c; a remark where more than 1e-6 is left). r: bounding radius about the body origin. Error:
   nothing inside. */
PetscErrorCode ShapeDefaultMass(Shape, PetscReal r, PetscInt dim, ShapeMass *m);

/* n surface points. 2D: evenly spaced in arc length along the zero contour, counter-clockwise, equal weights. 3D:
   spread over the surface by farthest-point selection, weights from the area nearest to each point. Parts thinner than
   r/2000 (3D: r/60) may be missed. */
PetscErrorCode ShapeDefaultSurface(Shape, PetscReal r, PetscInt dim, PetscInt n, PetscReal x[], PetscReal w[]);

/* Corners of the outline in 2D: where the normal turns by more than 26 degrees between neighbours of a dense trace, on
   the surface and with a wedge of the inside that is no half plane. *x [*n][2] is freed by the caller. */
PetscErrorCode ShapeDefaultCorners(Shape, PetscInt *n, PetscReal *x[]);

/* An upper bound of the largest |x - c| over the body, at most 1e-4 r too large (3D, many far points: 2e-2 r). */
PetscErrorCode ShapeDefaultRadius(Shape, PetscReal r, PetscInt dim, const PetscReal c[3], PetscReal *radius);

/* Give a triangulation, whose points lie on the surface, the edges and corners of the surface (see host.h for the
   arguments). */
PetscErrorCode ShapeSharpen(Shape, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle, PetscInt *triangle[]);
