/* DropDistance: how far places are from the interface of drops, for meshes that are refined around it (bodydistance.h)
   and follow it: at the start, and then as it was, or will be, when cells were last made. All ranks know all of it. */
#pragma once
#include "phase/drops.h"

typedef struct _p_DropDistance *DropDistance;

/* Of drops where they start (borrowed), in a box with cells of h. Collective. */
PetscErrorCode DropDistanceCreate(Drops, PetscInt dim, const PetscReal lower[], const PetscReal upper[],
                                  const PetscReal period[], PetscReal h, DropDistance *);
PetscErrorCode DropDistanceDestroy(DropDistance *);
/* *d becomes the distance of x to the interface less the margin, 0 at least, if that is less; looked for within reach.
   Not collective. */
PetscErrorCode DropDistanceAt(DropDistance, const PetscReal x[3], PetscReal reach, PetscReal margin, PetscReal *d);
/* From now on the interface that drops have, every drop as far ahead as it goes in this time, but no farther than
   `most`. The same on all ranks, as what follows. */
PetscErrorCode DropDistanceSet(DropDistance, PetscReal time, PetscReal most);
/* The largest distance from it of the interface that drops will have after this time; 0: there was no step yet. */
PetscErrorCode DropDistanceMoved(DropDistance, PetscReal time, PetscReal *way);
/* StateVisit */
PetscErrorCode DropDistanceVisit(DropDistance, State);
