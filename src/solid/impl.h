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
  SolidNewton *newton; /* [n] NULL: none so far */
};

/* Where the solids of a group start, clear of those before (place random), and how many there are: g->count. *place is
   the caller's to free. */
PetscErrorCode SolidGroupReadPlacements(SolidGroup *, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                        ParticlesPlaced *, Placement **place);
/* Nodes X [count][mesh.nnode][dim] of the solids of a group there. */
PetscErrorCode SolidGroupPlace(const SolidGroup *, PetscInt dim, const Placement place[], PetscReal X[]);
PetscErrorCode SolidNewtonDestroy(Solids);
