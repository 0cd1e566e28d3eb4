/* Stream: the fastest flow that a scene gives by numbers, and the boundary layer of bodies that are held in it.

   The layer of a body of size d is d / sqrt(Re) = sqrt(d nu / U) thick. What lies along the stream has a layer that
   grows over the length of its thick part: the lines across it that are at least FRACTION as wide as the widest (an
   airfoil at no incidence; of a cylinder with a flag the cylinder alone, which its layer leaves). Where the
   stream goes around edges, the body being seen twice as wide as it is thick or more, they are as fine as it is thick
   (an ellipse at 45 degrees: .9 % off with a layer of .7 cells by its thickness, .02 % with 1.4, lined up). Between
   these in proportion, except for edges too sharp for a mesh to be lined up with. A disc has its diameter. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct {
  PetscReal speed, direction[3]; /* unit vector; speed 0: none is known */
} Stream;

/* Of the fastest inflow or moving wall, as far as it is given by numbers. Collective. */
PetscErrorCode StreamFind(Mesh, Stream *);
/* That size of body k, which this rank knows, as it is turned now; *sharp: the stream also goes around an edge, in the
   plane, that is too sharp for a mesh to be lined up with it. Not collective. */
PetscErrorCode StreamMeasureBody(Bodies, PetscInt k, const PetscReal direction[3], PetscReal *size, PetscBool *sharp);
/* Cells in the thinnest layer of the bodies of a group (of its first ones, if they are not round) that is held in the
   stream, in meshes that are not fitted to bodies; PETSC_MAX_REAL: it has none, or nothing is known;
   *sharp: of any of them. Collective. */
PetscErrorCode StreamMeasureLayer(const MeshLocal *, Bodies, PetscInt group, const Stream *, PetscReal *cells,
                                  PetscBool *sharp);
