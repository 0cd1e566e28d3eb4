/* Gaps: the narrowest gap that lasts, between a body and a wall, another body or its own image, in cells.

   Those last whose both sides stay: a body stays that travels nowhere (held, or free to turn about its centre), and
   every body keeps its distance from its own images. What a body that travels comes near is not known at the start.
   Surfaces that touch or overlap have no gap. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct {
  PetscReal cells;        /* in cells of the smallest size; PETSC_MAX_REAL: none within reach */
  PetscInt  group;        /* of the body */
  char      between[192]; /* "body 0 of group 'disc' and boundary 'outer'" */
} LastingGap;

/* The narrowest between bodies or images of one, and that from walls, where bodies are now. Gaps wider than reach
   cells are not looked for. Openings are no walls. The same on all ranks. Collective. */
PetscErrorCode GapsFindNarrowest(Mesh, Bodies, PetscBool steady, PetscReal reach, LastingGap narrowest[2]);
