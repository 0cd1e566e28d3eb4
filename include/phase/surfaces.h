/* PhaseSurfaces: the interface of all drops as the surface that a mesh is lined up with. It is one surface, since what
   of it is one drop the cells say; its inside stays in the mesh. */
#pragma once
#include "align/surfaces.h"
#include "phase/drops.h"

typedef struct _p_PhaseSurfaces *PhaseSurfaces;

/* largest: radius that the interface will never exceed */
PetscErrorCode PhaseSurfacesCreate(PetscInt dim, PetscReal largest, PhaseSurfaces *);
PetscErrorCode PhaseSurfacesDestroy(PhaseSurfaces *);
/* The interface may end on these sides of the domain: bits 2 axis + (upper one). Not collective. */
PetscErrorCode PhaseSurfacesSetWalls(PhaseSurfaces, PetscInt sides);
/* In the plane: films of the fluid around that are thinner count as inside from now on. Not collective. */
PetscErrorCode PhaseSurfacesSetFilm(PhaseSurfaces, PetscReal film);
/* Own cells of the mesh [ncell] that are no drop's in any fit from now on, borrowed. Not collective. */
PetscErrorCode PhaseSurfacesSetClosed(PhaseSurfaces, const PetscBool closed[]);
/* From now on this interface, borrowed; in space, until then, what the drops are at the start. Not collective. */
PetscErrorCode PhaseSurfacesSet(PhaseSurfaces, const PhaseInterface *);
PetscErrorCode PhaseSurfacesSetStart(PhaseSurfaces, Drops);
/* Borrowed; valid after the first PhaseSurfacesSet. */
const AlignSurfaces *PhaseSurfacesGet(PhaseSurfaces);
