/* AlignKept: a mesh that was lined up with surfaces, when its cells are made anew (mesh/carry.h): what it was, and the
   velocities there, until the new mesh is lined up for the first time. Nodes that this moves, or where the old mesh
   was lined up, take their values from there; elsewhere the flow has brought them over. For aligned.h and
   dropremesh.c. */
#pragma once
#include "align/align.h"
#include "aligntargets.h"
#include "mesh/remap.h"

#define ALIGN_FIELDS 4 /* at most (AlignTargets.nfield) */

typedef struct {
  Mesh       mesh; /* NULL until it arrives */
  PetscInt   done; /* had it been lined up? */
  Remap      remap;
  PetscReal *field[ALIGN_FIELDS]; /* [nnode_all][dim] of that mesh, NULL: no more; owned */
  PetscInt  *inactive, *side;     /* [ncell_all] of that mesh */
  PetscReal *near;                /* [nnode_all] of the new mesh: not 0 where the old one was lined up */
} AlignKept;

/* Of the mesh as it was lined up, NULL: not yet. Fields are the caller's to fill in. Not collective. */
PetscErrorCode AlignKeptCreate(const MeshLocal *, const AlignResult *, AlignKept *);
PetscErrorCode AlignKeptDestroy(AlignKept *);
/* The old mesh, taken over, and the new one. Collective. */
PetscErrorCode AlignKeptArrive(AlignKept *, Mesh *old, Mesh now);
/* Targets on the new mesh, as it will be, with their values: from there, or `now` [nfield], those of their nodes.
   Collective. */
PetscErrorCode AlignKeptEvaluate(const AlignKept *, const AlignResult *, Remap of_new, const PetscReal *const now[],
                                 AlignTargets *, RemapCount *);
