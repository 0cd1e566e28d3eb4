/* ElasticInner: viscosity of the flow's cells where membranes enclose a fluid of another one
   (-particle_<group>_viscosity).

   A cell inside takes that of the enclosed fluid, one that a membrane cuts the mean by volume: of n x n (x n) sub-cells
   with an indicator that falls linearly over the width of a sub-cell about the surface, the signed distance of the
   cell's nodes interpolated. Where the mesh is lined up no cell is cut. Of membranes one inside the other the later in
   the list of solids is the inner one. */
#pragma once
#include "couple/elasticsurfaces.h"
#include "couple/couple.h"

/* viscosity [ncell_all] of all cells, own and ghost; outer: around the membranes. surfaces: where they are now; those
   with lined[k] (NULL: none) by the label of cells, cell_solid [ncell_all]. Not collective. */
PetscErrorCode ElasticInnerFind(Mesh, const SolidsState *, ElasticSurfaces, const PetscBool lined[],
                                const PetscInt cell_solid[], PetscReal outer, PetscReal viscosity[]);
