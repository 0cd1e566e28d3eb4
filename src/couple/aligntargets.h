/* AlignTargets: own nodes that get other old values as a mesh is lined up again: where they will be, and what they get.
   For those who move nodes by an AlignResult (aligned.h, elasticalign.h). */
#pragma once
#include "align/align.h"

#define ALIGN_PATIENCE 10 /* steps in a row in which the mesh could have followed a surface that it once could not */

typedef struct {
  const MeshLocal *loc;
  PetscInt         nfield;     /* fields of dim components */
  PetscInt        *stamp, now; /* [nnode_all] */
  PetscInt         n, capacity;
  PetscInt        *node, *side; /* [n] local node; RemapCells */
  PetscReal       *x, *value;   /* [n][dim] where it will be, [n][nfield][dim] */
} AlignTargets;

/* With no targets. Not collective, as all here. */
PetscErrorCode AlignTargetsCreate(const MeshLocal *, PetscInt nfield, AlignTargets *);
PetscErrorCode AlignTargetsDestroy(AlignTargets *);
/* From now on none. */
void AlignTargetsBegin(AlignTargets *);
/* Local node i, which will be at x [dim], once: not if it is another rank's or inside a surface. Nodes on a path have
   fluid on both sides, which had two velocities where the path is now: they come twice, one after the other, with the
   side + and - (number[k] + 1); number NULL: no surface is a path. */
PetscErrorCode AlignTargetsAdd(AlignTargets *, const AlignResult *, const PetscInt number[], PetscInt i,
                               const PetscReal x[]);
/* The nodes that move, or were inside a surface until now, of those that are still aligned alone (NULL: of all): inside
   a body that the mesh no longer follows the fluid begins with the velocity of the body. */
PetscErrorCode AlignTargetsFind(AlignTargets *, const AlignResult *, const PetscInt number[],
                                const PetscBool aligned[]);
