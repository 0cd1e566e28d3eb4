/* FlowSolver: what nonlinear solvers need beside the solve of a step (see system.h): another velocity matrix,
   corrections. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

PetscErrorCode FlowSolverCreateVec(FlowSolver fs, Vec *x)
{
  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(fs->x, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetOperator(FlowSolver fs, Mat *K)
{
  PetscFunctionBeginUser;
  *K = fs->K;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetVelocity(FlowSolver fs, Mat A)
{
  PetscFunctionBeginUser;
  if (!A) PetscCall(FlowGetComponents(fs->flow, &A));
  fs->A = A ? A : fs->S_all;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetRest(FlowSolver fs, PetscReal *norm)
{
  PetscFunctionBeginUser;
  PetscCall(VecNorm(fs->b, NORM_2, norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Newton's method needs no more of a linear solve: near its end round-off may leave that more than its tolerance */
#define ENOUGH 1e-3

PetscErrorCode FlowSolverCorrect(FlowSolver fs, Vec f, PetscReal enough, Vec y, PetscInt *its, KSPConvergedReason *reason)
{
  PetscReal least, first, last;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscCall(VecCopy(f, fs->b));
  PetscCall(FlowSolverMakeConsistent(fs, fs->b));
  PetscCall(VecZeroEntries(y));
  PetscCall(KSPGetTolerances(fs->ksp, NULL, &least, NULL, NULL));
  PetscCall(KSPSetTolerances(fs->ksp, fs->rtol, PetscMax(least, enough), PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(FlowSolverIterate(fs, fs->b, y));
  PetscCall(KSPGetIterationNumber(fs->ksp, its));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  PetscCall(KSPSetTolerances(fs->ksp, fs->rtol, least, PETSC_DEFAULT, PETSC_DEFAULT));
  if (*reason == KSP_DIVERGED_ITS) {
    PetscCall(VecNorm(fs->b, NORM_2, &first));
    PetscCall(KSPGetResidualNorm(fs->ksp, &last));
    if (last <= ENOUGH * first) *reason = KSP_CONVERGED_ITS;
  }
  PetscCall(PetscLogEventEnd(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
