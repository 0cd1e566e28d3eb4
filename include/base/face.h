/* Face: a second-order face in space (9 nodes by lattice position) or edge in the plane (3 nodes), and where it is
   nearest to a point. Coordinates s are in [-1, 1]. Local. */
#pragma once
#include <petscsys.h>

/* A place of a face: coordinates, place, first derivatives, second ones (00, 11, 01); its distance from the point asked
   for. side: which coordinates are at an end, -1, 1, or 0 */
typedef struct {
  PetscReal s[2], x[3], t[2][3], tt[3][3], distance;
  PetscInt  side[2];
} FacePoint;

void FaceEvaluate(PetscInt dim, const PetscReal x[][3], const PetscReal s[2], FacePoint *);
/* The nearest place to p: Newton's method from the nearest node, coordinates kept within their ends and steps shortened
   until the distance falls */
void FaceNearest(PetscInt dim, const PetscReal x[][3], const PetscReal p[3], FacePoint *);
/* Of the nearest places of two faces of about that size to one point: is a nearer than b? Not if that is for round-off
   to say, as where a point is as far from both sides of a symmetric body. */
PetscBool FaceIsNearer(const FacePoint *a, const FacePoint *b, PetscReal size);
/* Unit normal of a place, to the side that tangents and lattice say (right-handed in space; in the plane t turned to
   the left) */
void FaceNormal(PetscInt dim, const FacePoint *, PetscReal n[3]);
/* In space: that normal at s; at a corner that is flat, as where three faces of a cell are on a smooth surface, of a
   place beside it. FaceNodeNormal: at node j. */
void FaceNormalAt(PetscReal (*const x)[3], const PetscReal s[2], PetscReal n[3]);
void FaceNodeNormal(PetscReal (*const x)[3], PetscInt j, PetscReal n[3]);
/* K [3][3]: gradient of that normal along the face */
void FaceCurvature(PetscInt dim, const FacePoint *, const PetscReal n[3], PetscReal K[9]);
