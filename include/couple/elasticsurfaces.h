/* ElasticSurfaces: outlines of elastic solids at given positions of their nodes, as the surfaces that a mesh is lined
   up with. Closed curves of Q2 edges in the plane, the solid on their left; distance and closest point by Newton's
   method on the edges that may be nearest, the sign by the normal there (at a node that of both edges). In space
   surfaces of Q2 faces (elasticfaces.h). All ranks know all. */
#pragma once
#include "align/surfaces.h"
#include "solid/solid.h"

#define ELASTIC_SIDE 9 /* nodes of a side, at most */

typedef struct _p_ElasticSurfaces *ElasticSurfaces;

PetscErrorCode ElasticSurfacesCreate(const SolidsState *, ElasticSurfaces *);
PetscErrorCode ElasticSurfacesDestroy(ElasticSurfaces *);
/* From now on with the nodes at x [nnode][dim], copied. Collective. */
PetscErrorCode ElasticSurfacesSet(ElasticSurfaces, const PetscReal x[]);
/* A point x [dim] on outline k: nodes of the side that it is on, 3 or 9, and their parts in it. */
PetscErrorCode ElasticSurfacesEvaluate(ElasticSurfaces, PetscInt k, const PetscReal x[], PetscInt node[ELASTIC_SIDE],
                                       PetscReal weight[ELASTIC_SIDE]);
/* Length (area) that belongs to each node of a side, `node` of all solids: by Simpson's rule. */
void ElasticSurfacesGetSizes(ElasticSurfaces, const PetscInt node[], PetscReal weight[ELASTIC_SIDE]);
/* Nodes where the outlines have corners, of all solids; borrowed. */
PetscErrorCode ElasticSurfacesGetCorners(ElasticSurfaces, PetscInt *n, const PetscInt *node[]);
/* Borrowed; valid after the first ElasticSurfacesSet. */
const AlignSurfaces *ElasticSurfacesGet(ElasticSurfaces);
