/* PhaseSurfaces: the interface of all drops as the surface that a mesh is lined up with. It is one surface, since what
   of it is one drop the cells say; its inside stays in the mesh. */
#pragma once
#include "align/surfaces.h"
#include "phase/curve.h"

typedef struct _p_PhaseSurfaces *PhaseSurfaces;

/* largest: radius that the interface will never exceed */
PetscErrorCode PhaseSurfacesCreate(PetscReal largest, PhaseSurfaces *);
PetscErrorCode PhaseSurfacesDestroy(PhaseSurfaces *);
/* The interface may end on these sides of the domain: bits 2 axis + (upper one). Not collective. */
PetscErrorCode PhaseSurfacesSetWalls(PhaseSurfaces, PetscInt sides);
/* Own cells of the mesh [ncell] that are no drop's in any fit from now on, borrowed. Not collective. */
PetscErrorCode PhaseSurfacesSetClosed(PhaseSurfaces, const PetscBool closed[]);
/* From now on this curve, borrowed. Not collective. */
PetscErrorCode PhaseSurfacesSet(PhaseSurfaces, const PhaseCurve *);
/* Borrowed; valid after the first PhaseSurfacesSet. */
const AlignSurfaces *PhaseSurfacesGet(PhaseSurfaces);
