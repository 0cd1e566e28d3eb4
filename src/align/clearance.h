/* Clearance: how far a point on the wall of a surface is from the next other wall, that of another surface or a side of
   the domain.

   Pairs of surfaces that may come within reach are found by a sweep over their bounding circles, so that the cost
   follows the pairs, not the square of the surfaces. The sides of the domain are those of its bounding box. */
#pragma once
#include "align/surfaces.h"
#include "mesh/mesh.h"

typedef struct _p_Clearance *Clearance;

/* reach: walls farther apart need not be seen. Not collective. */
PetscErrorCode ClearanceCreate(Mesh, const AlignSurfaces *, PetscReal reach, Clearance *);
PetscErrorCode ClearanceDestroy(Clearance *);
/* Surfaces are at X [n][3] from now on, and pass through sides of the domain [n] (bits 2 axis + (upper one);
   kept), which do not count for them; along the axes
   joined [n] (bits; kept) a surface is one with its images. Not collective. */
PetscErrorCode ClearanceUpdate(Clearance, const PetscInt passes[], const PetscInt joined[]);
/* Distances of point y of surface k from the next other surface (gap[0]) and from the next side of the domain (gap[1]);
   negative where walls overlap, large where none is in reach. Surfaces j count if counts[j]. Not collective. */
PetscErrorCode ClearanceMeasure(Clearance, const PetscBool counts[], PetscInt k, const PetscReal y[], PetscReal gap[2]);
