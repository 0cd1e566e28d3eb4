/* Figure, for the files of this room: a shape in its own frame, as the surface that a mesh is lined up with. */
#pragma once
#include "shape.h"
#include "align/surfaces.h"

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
