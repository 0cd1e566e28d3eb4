/* ScalarFields: scalars as nodal fields that are carried to other nodes. A field is [nnode_all][dim] and holds T and
   T_old of a scalar as its first two components. */
#pragma once
#include "mesh/mesh.h"
#include "scalar/scalar.h"

/* field [ScalarsCount], the caller's to free. Local. */
PetscErrorCode ScalarFieldsPack(Scalars, const MeshLocal *, PetscReal *field[]);
/* Node i has the values v [ScalarsCount][dim] of those fields, of a place that it has come from by way [dim]: of a mean
   gradient G, T = G.x + T' is carried, not T'. Local. */
PetscErrorCode ScalarFieldsSet(Scalars, PetscInt dim, PetscInt i, const PetscReal way[], const PetscReal v[]);
/* Collective. */
PetscErrorCode ScalarFieldsSync(Scalars, Mesh);
