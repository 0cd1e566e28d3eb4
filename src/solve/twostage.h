/* TwoStage: what follows the velocity solve and the first pressure solve, u = A_r^{-1} x_u and p1 = S_p^{-1} g:

   v = X^{-1} P^T B^T p1,  q = S_p^{-1} B X^{-1} (A_r - X) v,  p = p1 + (1 - om) q + om mu theta Mp^{-1} g,  u += v

   with g = x_p - B u; then one relaxation of the cells that bodies cut (cellrelax.h). X is the projected lumped
   mass with the share th of the lumped penalty, S_p = B X^{-1} B^T and what keeps it definite (pressure.h).

   p1 is the projection's pressure and q what the least-squares commutator adds to it: as a correction its solve may
   be loose, and the softness of S_p drops out of the product. X v is at hand. The commutator knows walls and
   surfaces, which mu Mp^{-1} does not; under a penalty it overshoots in cut cells, hence th, om and the relaxation
   (runs/studies/flow-solver). For time steps only: u += v needs the pressure of a projection.

   Where the viscosity varies, om is each cell's own, the mass in X is multiplied by its weight
   (FlowSolverMassWeight), and the share om of p1 is divided by that: the pressure of a projection knows densities
   alone (runs/studies/rheology). */
#pragma once
#include "solve/system.h"

typedef struct _p_TwoStage *TwoStage;

/* Share th of the lumped penalty in X */
#define TWO_STAGE_WEIGHT 0.5

/* Collective. */
PetscErrorCode TwoStageCreate(FlowSolver, TwoStage *);
PetscErrorCode TwoStageDestroy(TwoStage *);
/* For the operators of the step. After PressureUpdate. Collective. */
PetscErrorCode TwoStageSetUp(TwoStage, FlowSolver);
/* u and p1 on entry, as the solvers of both fields have just left them; u and p on exit. Collective. */
PetscErrorCode TwoStageApply(TwoStage, FlowSolver, Vec u, Vec p);
