/* SolidBlock: the nodes that operators of others hold (FlowAddOperator: elastic solids) as one block of the
   preconditioner, for solvers other than direct.

   A of these nodes, S and E together, is factorised in every step, and stands for the mass there in X, with which the
   pressure operator is S_p = B X^{-1} B^T and the second stage of twostage.h commutes. Stiff solids move as they can,
   which no lumped mass knows of. The factors serve
     the velocity: block, sweep over all nodes, block;
     X^{-1} in all products (FlowSolverApplyMassInverse);
     where an operator is stiff, the pressure: the pressures of cells around the block, exactly, by the factors of
     [X, -B^T; B, 0] of these cells and their nodes, before and after the cycle of the pressure on all cells.
   Rigid bodies that nodes of the block are tied to are in it, too.
   Both factorisations are sparse ones of all solids and ranks together (MUMPS). Vectors as those of the solver: u_r and
   p. Multiplicative Schwarz, see Smith, Bjorstad & Gropp (1996), ch. 1. */
#pragma once
#include "impl.h"

typedef struct _p_SolidBlock *SolidBlock;

/* Of this step: nothing without operators of others or with empty ones, in steady flows, or where the whole matrix is
   factorised. After PressureUpdate. Collective. */
PetscErrorCode SolidBlockUpdate(FlowSolver);
PetscErrorCode SolidBlockDestroy(SolidBlock *);
/* y of the block = A^{-1} x, y elsewhere as it is. Collective. */
PetscErrorCode SolidBlockSolve(SolidBlock, Vec x, Vec y);
/* Does own node i belong to it? */
PetscBool SolidBlockHas(SolidBlock, PetscInt i);
/* For X^{-1} x: `from` is what SolidBlockSolve takes, x or what stays until the next call, with `rigid` (own bodies) at
   the bodies of the block, which is 0 afterwards. Local. */
PetscErrorCode SolidBlockTakeBodies(FlowSolver, Vec x, PetscReal rigid[], Vec *from);
/* Operators and preconditioners of both inner solvers; before: what they were without, taken back first. Collective. */
PetscErrorCode SolidBlockSetUpPC(FlowSolver);
PetscErrorCode SolidBlockRestorePC(FlowSolver);
