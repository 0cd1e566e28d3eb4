/* Inside of Solids; for its files only. solids.c: groups and state. place.c: where solids start, one a group. alone.c:
   steps without flow. reference.c, element.c, law.c: what a solid is made of. */
#pragma once
#include "solid/solid.h"
#include "shape/material.h"
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
  PetscInt    *start;  /* [ranks + 1] first own solid of a rank */
  SolidNewton *newton; /* [n] NULL: none so far */
};

/* Nodes X [count][mesh.nnode][dim] of the solids of a group that start there. */
PetscErrorCode SolidGroupPlace(const SolidGroup *, PetscInt dim, const Placement place[], PetscReal X[]);
PetscErrorCode SolidNewtonDestroy(Solids);
