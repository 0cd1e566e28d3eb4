/* ScalarStart: where bodies that are solved for inside begin with a value of their own, functions of the mesh cannot
   jump to that of the fluid. Nodes of cells on both sides of a surface begin with the mean of both, each by the heat
   that a unit at the node takes up on its side. So fluid and bodies begin with the heat that they are given, and no
   value beyond the two. Where surfaces cut cells, sides count by the part of the cell: heat right to some per cent. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"
#include "scalarcover.h"
#include "scalarmaterial.h"

/* T [nnode_all] of scalar i: values of the fluid everywhere on entry. Of each local cell [ncell_all] the part `inside`
   is of the material, NULL: none. Collective. */
PetscErrorCode ScalarStartInside(Couple, Scalars, PetscInt i, const ScalarMaterial *const material[],
                                 const PetscReal inside[], PetscReal T[]);
/* Of the cells that bodies cover; material [ngroups][n]. Collective. */
PetscErrorCode ScalarStartBodies(Couple, Scalars, PetscInt i, const ScalarCover *, const ScalarMaterial *material,
                                 PetscReal T[]);
