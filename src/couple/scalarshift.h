/* ScalarShiftInside: on a mesh that is lined up with bodies, nodes that lie in no cell of the fluid stay where they
   were, while those of the surface have moved. Where something is solved for inside, they go along: vertices by a few
   sweeps of averaging, other nodes in between. */
#pragma once
#include "couple/couple.h"

/* *shift [nnode_all][dim] from where nodes are to where they are to be, allocated if NULL. Collective. */
PetscErrorCode ScalarShiftInside(Couple, PetscReal *shift[]);
