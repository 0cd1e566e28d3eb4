/* Boundaries: what walls feel and what flows through openings, of every named boundary.

   The force of a wall is the momentum residual summed over its nodes, as in the balance of momentum. Where
   boundaries meet, a node counts for the one whose velocity holds there, but for the pressure, which each gets for
   its own share of the surface (that of an inflow would be seen in the friction of the wall beside it). What penalty
   bodies that reach a wall exert on it is not in it.
   The flow through an opening is int u.n = sum of u over its nodes with the weights int phi n, the column sums of the
   divergence, so that the flows through all openings add up to the integral of div u. */
#pragma once
#include "couple/couple.h"
#include "fitted.h"

typedef struct _p_Boundaries *Boundaries;

PetscErrorCode BoundariesCreate(Flow, Fitted, Boundaries *);
PetscErrorCode BoundariesDestroy(Boundaries *);
/* Weights anew, for a mesh that has moved. Collective. */
PetscErrorCode BoundariesUpdate(Boundaries);
/* Begin a sum; what the node of a wall supplies to component a; the flow of u [nnode_all][dim], and the sum over ranks.
   Only Finish is collective. */
PetscErrorCode BoundariesBegin(Boundaries);
/* Divide the pressure on node j of cell c among the boundaries that meet there. */
PetscErrorCode BoundariesShare(Boundaries, PetscInt c, PetscInt j, const PetscReal p[]);
void           BoundariesAdd(Boundaries, PetscInt node, PetscInt a, PetscReal residual);
PetscErrorCode BoundariesFinish(Boundaries, const PetscReal u[]);
PetscErrorCode BoundariesGet(Boundaries, PetscInt *n, const CoupleBoundary *boundary[]);
