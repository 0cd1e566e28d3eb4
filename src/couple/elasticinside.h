/* ElasticInside: what part of every cell of the flow lies within elastic solids or membranes.

   Of a cell that a surface cuts the mean of n x n (x n) sub-cells, with an indicator that falls linearly over the width
   of a sub-cell about the surface, the signed distance of the cell's nodes interpolated. Where the mesh is lined up no
   cell is cut. */
#pragma once
#include "couple/elasticsurfaces.h"
#include "couple/couple.h"

typedef struct _p_ElasticInside *ElasticInside;

/* surfaces: where they are now, and stay while it is asked; those with lined[k] (NULL: none) go by the label of cells,
   cell_solid [ncell_all]. All borrowed. Not collective. */
PetscErrorCode ElasticInsideCreate(Mesh, ElasticSurfaces, const PetscBool lined[], const PetscInt cell_solid[],
                                   ElasticInside *);
PetscErrorCode ElasticInsideDestroy(ElasticInside *);
/* *inside [ncell_all] the part of each cell, own and ghost, within surface k; borrowed until the next. Not
   collective. */
PetscErrorCode ElasticInsideFind(ElasticInside, PetscInt k, const PetscReal *inside[]);
