/* AlignTargets: own nodes that get other old values as a mesh is lined up again: where they will be, and what they get.
   For aligned.h. */
#pragma once
#include "align/align.h"

#define ALIGN_PATIENCE 10 /* steps in a row in which the mesh could have followed a surface that it once could not */

typedef struct {
  const MeshLocal     *loc;
  const AlignSurfaces *surfaces;   /* that the mesh is lined up with */
  PetscInt             nfield;     /* fields of dim components */
  PetscInt            *stamp, now; /* [nnode_all] */
  PetscInt             n, capacity;
  PetscInt            *node, *side; /* [n] local node; RemapCells */
  PetscReal           *x, *value;   /* [n][dim] where it will be, [n][nfield][dim] */
} AlignTargets;

/* With no targets. Not collective, as all here. */
PetscErrorCode AlignTargetsCreate(const MeshLocal *, const AlignSurfaces *, PetscInt nfield, AlignTargets *);
PetscErrorCode AlignTargetsDestroy(AlignTargets *);
/* From now on none. */
void AlignTargetsBegin(AlignTargets *);
/* Local node i, which will be at x [dim], once: not if it is another rank's or inside a surface. Nodes on a path have
   fluid on both sides, which had two velocities where the path is now: they come twice, one after the other, with the
   side + and - (number + 1). */
PetscErrorCode AlignTargetsAdd(AlignTargets *, const AlignResult *, PetscInt i, const PetscReal x[]);
/* The nodes that move, or were inside a surface until now: not where cells inside had left the fluid, of a surface that
   is no longer aligned [n]. The fluid there begins with the velocity of the body. */
PetscErrorCode AlignTargetsFind(AlignTargets *, const AlignResult *, const PetscBool aligned[]);
