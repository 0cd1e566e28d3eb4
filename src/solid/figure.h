/* Figure, for the files of this room: a shape in its own frame, as the surface that a mesh is lined up with. And what
   meshes of solids and of membranes are made alike. */
#pragma once
#include "shape.h"
#include "align/surfaces.h"
#include "solid/reference.h"

typedef struct {
  Shape         shape;
  PetscInt      number;
  PetscBool     own, inactive;
  PetscReal     centre[1][3], radius, round, volume;
  AlignSurfaces table; /* with pointers to the figure: it may not be copied */
} Figure;

PetscErrorCode FigureDescribe(Shape, PetscInt dim, Figure *);
/* The box around the shape. */
PetscErrorCode FigureFindBox(const Figure *, PetscInt dim, PetscReal lower[], PetscReal upper[]);

/* Room for a mesh whose cells have nd directions; what of it follows from the numbers is set, the rest empty. */
PetscErrorCode SolidMeshAllocate(PetscInt dim, PetscInt nd, PetscInt nnode, PetscInt ncell, SolidMesh *);
/* Its radius by its nodes. */
void SolidMeshFindRadius(SolidMesh *);
/* around, neighbour of its cells */
PetscErrorCode SolidMeshFindNeighbours(SolidMesh *);
