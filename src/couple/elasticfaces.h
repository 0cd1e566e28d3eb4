/* ElasticFaces: surfaces of elastic solids in space at given positions of their nodes, for elasticsurfaces.h: faces of
   Q2 cells, the solid behind them. The closest point by Newton's method on the faces that may be nearest (base/face.h);
   the sign by the normal there, on an edge or at a node of faces by the normals of all that meet there (Baerentzen &
   Aanaes 2005, without their angles). All ranks know all; nothing is collective. */
#pragma once
#include "base/face.h"
#include "solid/solid.h"

typedef struct _p_ElasticFaces *ElasticFaces;

PetscErrorCode ElasticFacesCreate(const SolidsState *, ElasticFaces *);
PetscErrorCode ElasticFacesDestroy(ElasticFaces *);
/* From now on with the nodes at x [nnode][3], borrowed. */
void ElasticFacesSet(ElasticFaces, const PetscReal x[]);
/* The place of the surface of solid k that is nearest to p; the face it is on [9], nodes of all solids; returns the
   signed distance, negative inside. */
PetscReal ElasticFacesNearest(ElasticFaces, PetscInt k, const PetscReal p[3], FacePoint *, const PetscInt **face);
/* Area that belongs to each node of face [9], of all solids: weights of Simpson's rule */
void ElasticFacesGetAreas(ElasticFaces, const PetscInt face[9], PetscReal area[9]);
