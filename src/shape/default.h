/* Defaults for what a shape plugin leaves out: normal, mass properties, surface points, bounding radius about the centroid.

   All of them see the shape only through ShapeDistance. A tree of square (cubic) cells over the box [-r, r]^dim is refined
   where the surface cuts it (|d| at the centre is less than half the diagonal: the distance is 1-Lipschitz), and in the
   smallest cells the distance is interpolated linearly on triangles (tetrahedra). Errors fall with the square of the smallest cell
   for smooth outlines. Internal to the shape module. */
#pragma once
#include "shape.h"

/* Central differences, normalised. Where the gradient vanishes (centre of a disc) some unit vector. r: size of the shape. Not collective. */
PetscErrorCode ShapeDefaultNormal(Shape, PetscReal r, PetscInt dim, PetscInt n, const PetscReal x[], PetscReal normal[]);

/* Moments by quadrature, refined until they change by less than 1e-6 (2D; 1e-4 in 3D) or the deepest level is reached.
   r: bounding radius about the body origin. Error: nothing inside. */
PetscErrorCode ShapeDefaultMass(Shape, PetscReal r, PetscInt dim, ShapeMass *m);

/* n surface points. 2D: evenly spaced in arc length along the zero contour, counter-clockwise, equal weights. 3D: spread over the
   surface by farthest-point selection, weights from the area nearest to each point. Parts thinner than r/2000 (3D: r/60) may be missed. */
PetscErrorCode ShapeDefaultSurface(Shape, PetscReal r, PetscInt dim, PetscInt n, PetscReal x[], PetscReal w[]);

/* An upper bound of the largest |x - c| over the body, at most 1e-4 r too large (3D with many equally far points: 2e-2 r). */
PetscErrorCode ShapeDefaultRadius(Shape, PetscReal r, PetscInt dim, const PetscReal c[3], PetscReal *radius);
