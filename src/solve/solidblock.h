/* SolidBlock: the nodes that operators of others hold (FlowAddOperator: elastic solids) as one block of the
   preconditioner, for solvers other than direct.

   A of these nodes, S and E together, is factorised in every step, and stands for the mass there in X, with which the
   pressure operator is S_p = B X^{-1} B^T and the second stage of twostage.h commutes. Stiff solids move as they can,
   which no lumped mass knows of. The factors serve
     the velocity: block, sweep over all nodes, block;
     X^{-1} in all products (FlowSolverApplyMassInverse);
     the pressure: the pressures of cells around the block, exactly, by the factors of [X, -B^T; B, 0] of these cells
     and their nodes, before and after the cycle of the pressure on all cells.
   Nodes that are tied to a rigid body are in the block, the pressures of their cells are not: they are the cycle's.
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
/* Operators and preconditioners of both inner solvers; before: what they were without, taken back first. Collective. */
PetscErrorCode SolidBlockSetUpPC(FlowSolver);
PetscErrorCode SolidBlockRestorePC(FlowSolver);
