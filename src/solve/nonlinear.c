/* FlowSolver: what nonlinear solvers need beside the solve of a step (see system.h): another velocity matrix,
   corrections. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

PetscErrorCode FlowSolverCreateVec(FlowSolver fs, Vec *x)
{
  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(fs->vec.x, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetOperator(FlowSolver fs, Mat *K)
{
  PetscFunctionBeginUser;
  *K = fs->op.K;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverIsDirect(FlowSolver fs, PetscBool *direct)
{
  PetscFunctionBeginUser;
  *direct = fs->set.need_whole;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetVelocity(FlowSolver fs, Mat A)
{
  PetscFunctionBeginUser;
  if (!A) PetscCall(FlowGetComponents(fs->flow, &A));
  fs->op.A       = A ? A : fs->op.S_all;
  fs->op.A_outer = NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetShift(FlowSolver fs, PetscReal rate, Mat A)
{
  PetscFunctionBeginUser;
  PetscCall(FlowSolverSetVelocity(fs, NULL));
  fs->op.A_outer = A;
  fs->step.shift = rate;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCanShift(FlowSolver fs, PetscBool *can)
{
  PetscFunctionBeginUser;
  *can = (PetscBool)(!FlowHasSymmetricStress(fs->flow) && fs->set.schur == SCHUR_AUTO && !fs->set.need_whole &&
                     !fs->set.need_Ar && !fs->set.single_projection);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* t_p2 = C p in the rows of continuity, p the pressure of x */
static PetscErrorCode take_gap_rows(FlowSolver fs, Vec x)
{
  const PetscReal *xa;
  PetscReal       *p;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArrayWrite(fs->vec.t_p, &p));
  PetscCall(PetscArraycpy(p, xa + fs->nur, fs->np));
  PetscCall(VecRestoreArrayWrite(fs->vec.t_p, &p));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(MatMult(fs->op.C, fs->vec.t_p, fs->vec.t_p2));
  PetscCall(VecScale(fs->vec.t_p2, fs->step.continuity_scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverForgive(FlowSolver fs, Vec x, PetscBool *any)
{
  PetscBool shared = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (fs->nbodies) PetscCall(PressureHasShared(fs->pressure, &shared));
  if (any) *any = shared;
  if (!x || !shared) PetscCall(VecDestroy(&fs->vec.gap_reference));
  if (!x || !shared) PetscFunctionReturn(PETSC_SUCCESS);
  if (!fs->vec.gap_reference) PetscCall(VecDuplicate(fs->vec.t_p2, &fs->vec.gap_reference));
  PetscCall(take_gap_rows(fs, x));
  PetscCall(VecCopy(fs->vec.t_p2, fs->vec.gap_reference));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverResidual(FlowSolver fs, const PetscReal r[], const PetscReal g[], Vec x, Vec f)
{
  const PetscReal *gap_reference;
  PetscReal       *fa;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverUpdateMatrix(fs));
  PetscCall(FlowSolverBuildRhs(fs, r, g));
  PetscCall(MatMult(fs->op.K, x, f));
  PetscCall(VecAXPY(f, -1, fs->vec.b));
  if (!fs->vec.gap_reference) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecGetArrayRead(fs->vec.gap_reference, &gap_reference));
  PetscCall(VecGetArray(f, &fa));
  for (PetscInt i = 0; i < fs->np; i++) fa[fs->nur + i] -= gap_reference[i];
  PetscCall(VecRestoreArray(f, &fa));
  PetscCall(VecRestoreArrayRead(fs->vec.gap_reference, &gap_reference));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetRhsNorm(FlowSolver fs, PetscReal *norm)
{
  PetscFunctionBeginUser;
  PetscCall(VecNorm(fs->vec.b, NORM_2, norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Newton's method needs no more of a linear solve: near its end round-off may leave that more than its tolerance */
#define NEWTON_RTOL 1e-3

PetscErrorCode FlowSolverCorrect(FlowSolver fs, Vec f, PetscReal atol, Vec y, PetscInt *its, KSPConvergedReason *reason)
{
  PetscReal abstol, first, last;

  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscCall(VecCopy(f, fs->vec.b));
  PetscCall(FlowSolverMakeConsistent(fs, fs->vec.b));
  PetscCall(VecZeroEntries(y));
  PetscCall(KSPGetTolerances(fs->ksp, NULL, &abstol, NULL, NULL));
  PetscCall(KSPSetTolerances(fs->ksp, fs->stop.rtol, PetscMax(abstol, atol), PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(FlowSolverIterate(fs, fs->vec.b, y));
  PetscCall(KSPGetIterationNumber(fs->ksp, its));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  PetscCall(KSPSetTolerances(fs->ksp, fs->stop.rtol, abstol, PETSC_DEFAULT, PETSC_DEFAULT));
  if (*reason == KSP_DIVERGED_ITS) {
    PetscCall(VecNorm(fs->vec.b, NORM_2, &first));
    PetscCall(KSPGetResidualNorm(fs->ksp, &last));
    if (last <= NEWTON_RTOL * first) *reason = KSP_CONVERGED_ITS;
  }
  PetscCall(PetscLogEventEnd(TB_FLOW_SOLVE, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}
