/* PenaltyTerm: the part of a penalty that ties nodes to the rigid velocities of bodies.

   A penalty 1/2 sum_k int_k sigma |u - R_k U_k|^2 with u in the finite element space adds to the velocity operator in
   the unknowns (u, U)

     [  Pen    -G ]     Pen = sum_k Pen^k, scalar, part of the flow's matrix (FlowAddCellTerms)
     [ -G^T     H ]     G_ik = sum_j Pen^k_ij R_k(x_j),   H_k = sum_ij R_k(x_i)^T Pen^k_ij R_k(x_j)

   G and H are kept here as short lists. R is linear in the position, so G_ik is stored as sum_j Pen_ij and sum_j Pen_ij
   (x_j - X): dim + 1 numbers. A row of [Pen, -G] vanishes for a rigid velocity and the operator is symmetric, so what
   the flow receives is what the body gives. */
#pragma once
#include "solve/constraint.h"

typedef struct {
  PetscInt   dim, nr;
  PetscBool  any;         /* entries on any rank */
  PetscInt   n;           /* entries: pairs of own node and body */
  PetscInt  *node, *body; /* [n] */
  PetscReal *g;           /* [n][dim + 1] */
  PetscReal *H;           /* [nbodies][nr][nr] what own nodes have in every body */
  PetscReal *whole;       /* [nbodies][nr][nr] sums of H: those of this rank's slots, in their order */
  PetscReal  strength;    /* largest sigma over the viscosity in multiples of the parameters', on any rank */
  PetscReal *weight;      /* [nnode_all] lumped penalty of a node, over all bodies, synced; zero elsewhere */
  PetscInt  *relative_to; /* [nnode_all] the body that holds a node most, synced; -1 elsewhere */
  PetscInt   nmore;       /* bodies of entries that are not the one their node follows, repetitions allowed */
  PetscInt  *more;
} PenaltyTerm;

/* G of entry e as a matrix [dim][nr] */
void PenaltyTermGetBlock(const PenaltyTerm *, PetscInt e, PetscReal G[]);

/* whole = sum of H over ranks for the bodies whose slots are here; when H has changed, or ConstraintSetBodies says that
   something has. Collective. */
PetscErrorCode PenaltyTermSum(const PenaltyTerm *, Constraint);
/* Force and torque of the penalty on all bodies, out [nbodies][nr] += G^T u - H U, to be summed over ranks; u [own
   nodes][dim], U [nbodies][nr] all rigid velocities. Local. */
PetscErrorCode PenaltyTermAddForce(const PenaltyTerm *, Constraint, const PetscReal u[], const PetscReal U[],
                                   PetscReal out[]);
