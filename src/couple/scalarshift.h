/* ScalarShiftInside: on a mesh that is lined up with bodies, nodes that lie in no cell of the fluid stay where they
   were, while those of the surface have moved. Where something is solved for inside, they go along: vertices by a few
   sweeps of averaging, other nodes in between. */
#pragma once
#include "couple/couple.h"

/* Nodes at x [nnode_all][dim], cells inside with inactive [ncell_all] >= 0: *shift [nnode_all][dim] from there to where
   nodes are to be, allocated if NULL. Collective. */
PetscErrorCode ScalarShiftInside(Couple, const PetscReal x[], const PetscInt inactive[], PetscReal *shift[]);
/* inside [nnode_all]: 1 where a node lies in no cell of the fluid, inactive [ncell_all] < 0; else 0. Collective. */
PetscErrorCode ScalarMarkInside(Couple, const PetscInt inactive[], PetscInt inside[]);
