/* BodySurfaces: rigid bodies as surfaces that a mesh is lined up with (align/surfaces.h), or at which its cells are
   concentrated (mesh/deform.h). Body k is surface k, with its permanent number; the inside of every body is
   inactive. */
#pragma once
#include "align/align.h"
#include "bodies/bodies.h"
#include "mesh/deform.h"

typedef struct _p_BodySurfaces *BodySurfaces;

/* Where the bodies are. Collective. */
PetscErrorCode BodySurfacesCreate(Bodies, BodySurfaces *);
PetscErrorCode BodySurfacesDestroy(BodySurfaces *);
/* The known bodies are at X [n][3], q [n][4], borrowed until the next call. Not collective. */
PetscErrorCode BodySurfacesSet(BodySurfaces, PetscReal (*X)[3], PetscReal (*q)[4]);
/* Points x [n][2] that are as corners to the bodies on whose surface they lie: others touch them there. In the plane;
   borrowed. Not collective. */
PetscErrorCode BodySurfacesSetPoints(BodySurfaces, PetscInt n, const PetscReal x[]);
/* Borrowed; true after every BodySurfacesSet until bodies move between ranks */
const AlignSurfaces *BodySurfacesGet(BodySurfaces);
/* The same for a Deform, which takes them over: it destroys them. Collective. */
PetscErrorCode BodySurfacesGiveDeform(BodySurfaces, const DeformSurfaces **);
/* DeformCreate for the bodies where they are; NULL if -mesh_deform does not ask for it. Collective. */
PetscErrorCode BodySurfacesCreateDeform(Mesh, Bodies, Deform *);

/* In space: error if a group has bodies that are wide and thinner than a cell. Collective. */
PetscErrorCode BodySurfacesRefusePlates(BodySurfaces, Mesh);
/* In the plane: groups with bodies that may be thinner than a cell, which all ranks are to know, are marked.
   Collective. */
PetscErrorCode BodySurfacesSpreadThin(Mesh, Bodies);
/* Mid-line of a shape of the plane, NULL: it has none. Not collective. */
PetscErrorCode BodyMidlineCreate(Shape, Midline *);
