/* Inside of Solids; for its files only. solids.c: groups and state. place.c: where solids start, one a group. alone.c:
   steps without flow. reference.c, element.c, law.c: what a solid is made of. */
#pragma once
#include "solid/solid.h"
#include <petscksp.h>

typedef struct {
  Mat J; /* of one solid, sequential */
  Vec r, d;
  KSP ksp;
} SolidNewton;

struct _p_Solids {
  MPI_Comm     comm;
  SolidsState  s;
  SolidGroup  *group;
  PetscInt    *group_of, *first;
  SolidNewton *newton; /* [n] NULL: none so far */
};

/* Position x [dim] of the centroid of the solid of a group, and what turns its frame into space, R [3][3]. */
PetscErrorCode SolidGroupPlace(const SolidGroup *, PetscInt dim, PetscReal x[], PetscReal R[9]);
PetscErrorCode SolidNewtonDestroy(Solids);
