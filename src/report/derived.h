/* Derived: nodal fields for pictures that are computed from those of the flow.

   Vorticity is the average of the cells around a node, weighted with the Jacobian there, so that a degenerate cell
   counts for nothing; the nodal pressure is the average of the cells around a node, leaving out cells that lie wholly
   inside a body (their pressure means nothing). Ghosts of the results are up to date. Collective. */
#pragma once
#include "mesh/mesh.h"

/* u [nnode_all][dim], ghosts up to date -> curl u, w [nnode_all][3] */
PetscErrorCode DerivedVorticity(Mesh, const PetscReal u[], PetscReal w[]);
/* p [ncell][dim + 1] (value at the centre, gradient) -> q [nnode_all]; body [nnode_all] body that a node lies in or
   -1, may be NULL */
PetscErrorCode DerivedPressure(Mesh, const PetscReal p[], const PetscInt body[], PetscReal q[]);
