/* FlowSolver: the preconditioner of recipes fast, balanced and accurate: fieldsplit, then projection, commutator or
   what twostage.h has (see system.h). */
#include "compat.h"
#include "impl.h"

/* p += mu theta Mp^{-1} (x_p - B u) */
static PetscErrorCode add_viscous(FlowSolver fs, Vec x, Vec u, Vec p)
{
  const PetscReal *xa;
  PetscReal       *pa, *r;

  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->B, u, fs->t_p));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArray(p, &pa));
  PetscCall(VecGetArray(fs->t_p, &r));
  for (PetscInt i = 0; i < fs->np; i++) r[i] = xa[fs->nur + i] - r[i];
  PetscCall(FlowPressureMassSolve(fs->flow, fs->viscous, r, pa));
  PetscCall(VecRestoreArray(p, &pa));
  PetscCall(VecRestoreArray(fs->t_p, &r));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u += M_r^{-1} P^T B^T p, and the viscous part with the u before: the projection step with the rotational pressure
   update */
static PetscErrorCode project(FlowSolver fs, Vec x, Vec u, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->G, p, fs->t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  if (fs->share_of_pressure < 1) PetscCall(VecScale(p, fs->share_of_pressure));
  PetscCall(add_viscous(fs, x, u, p));
  PetscCall(VecAXPY(u, -1, fs->t_u2));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* p <- S_p^{-1} (B M_r^{-1} A_r M_r^{-1} P^T B^T + C) p, the least-squares commutator */
static PetscErrorCode commute(FlowSolver fs, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->G, p, fs->t_u));
  PetscCall(VecScale(fs->t_u, -1));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  PetscCall(MatMult(fs->Ar, fs->t_u2, fs->t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  PetscCall(MatMult(fs->B, fs->t_u2, fs->t_p));
  if (fs->C) {
    PetscCall(MatMult(fs->C, p, fs->t_p2));
    PetscCall(VecAXPY(fs->t_p, 1, fs->t_p2));
  }
  PetscCall(KSPSolve(fs->sub[1], fs->t_p, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inner solves that ended at their largest number of iterations without meeting their tolerance. KSPGCR says
   KSP_CONVERGED_ITS then, as do solves of a fixed number of iterations, which have no convergence test. */
static PetscErrorCode count_limited(FlowSolver fs)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    KSPConvergedReason reason;
    PetscInt           its, most;
    PetscErrorCode (*test)(KSP, PetscInt, PetscReal, KSPConvergedReason *, void *);

    PetscCall(KSPGetConvergedReason(fs->sub[i], &reason));
    PetscCall(KSPGetIterationNumber(fs->sub[i], &its));
    PetscCall(KSPGetTolerances(fs->sub[i], NULL, NULL, NULL, &most));
    PetscCall(KSPGetConvergenceTest(fs->sub[i], &test, NULL, NULL));
    if (reason < 0 || (reason == KSP_CONVERGED_ITS && its >= most && test != KSPConvergedSkip)) fs->limited[i]++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u ~ A_r^{-1} x_u, p = mu theta Mp^{-1} (x_p - B u): of a steady flow without convection, with the mu of every cell */
static PetscErrorCode apply_mass(FlowSolver fs, Vec x, Vec u, Vec p)
{
  const PetscReal *xa;
  Vec              x_u;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->nur, PETSC_DETERMINE, xa, &x_u));
  PetscCall(KSPSolve(fs->sub[0], x_u, u));
  PetscCall(count_limited(fs));
  PetscCall(VecDestroy(&x_u));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecZeroEntries(p));
  PetscCall(add_viscous(fs, x, u, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = fieldsplit (x), then projection or commutator, see the header */
static PetscErrorCode apply_unbalanced(FlowSolver fs, Vec x, Vec y)
{
  PetscReal *a;
  Vec        u, p;

  PetscFunctionBeginUser;
  if (!fs->mass_only) {
    PetscCall(PCApply(fs->split, x, y));
    PetscCall(count_limited(fs));
  }
  if (fs->two_stage) {
    PetscCall(TwoStageApply(fs->two, fs, y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecGetArray(y, &a));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->nur, PETSC_DETERMINE, a, &u));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->np, PETSC_DETERMINE, a + fs->nur, &p));
  if (fs->mass_only) PetscCall(apply_mass(fs, x, u, p));
  else if (fs->viscous_only) PetscCall(add_viscous(fs, x, u, p));
  else if (fs->commute) PetscCall(commute(fs, p));
  else PetscCall(project(fs, x, u, p));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&p));
  PetscCall(VecRestoreArray(y, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The outer iteration's residual x has balanced rows; everything below works on the rows of the blocks. */
static PetscErrorCode apply_projection(PC pc, Vec x, Vec y)
{
  FlowSolver fs;
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(VecCopy(x, fs->t_x));
  PetscCall(VecGetArray(fs->t_x, &a));
  FlowSolverBalance(fs, 1 / fs->balance, a);
  PetscCall(VecRestoreArray(fs->t_x, &a));
  PetscCall(apply_unbalanced(fs, fs->t_x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_projection(PC pc, PetscViewer viewer)
{
  FlowSolver fs;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  fieldsplit, then %s\n",
                                   fs->mass_only   ? "mass of the pressure over the viscosity"
                                   : fs->two_stage ? "two-stage pressure and relaxation of cut cells"
                                   : fs->commute   ? "least-squares commutator"
                                                   : "projection with the lumped mass"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(PCView(fs->split, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_consistent(KSP ksp, Vec rhs, Vec x, void *pressure)
{
  PetscReal *r;

  PetscFunctionBeginUser;
  (void)ksp;
  (void)x;
  PetscCall(VecGetArray(rhs, &r));
  PetscCall(PressureMakeConsistent((Pressure)pressure, r));
  PetscCall(VecRestoreArray(rhs, &r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Set up the inner fieldsplit and point its pressure solver at S_p instead of the true Schur complement. */
static PetscErrorCode set_up_projection(PC pc)
{
  FlowSolver fs;
  PetscInt   n;
  Mat        Sp, Sp_pre;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(PressureGetMats(fs->pressure, &Sp, &Sp_pre));
  PetscCall(PCFieldSplitSetSchurPre(fs->split, PC_FIELDSPLIT_SCHUR_PRE_USER, Sp_pre));
  PetscCall(PCSetUp(fs->split));
  PetscCall(PetscFree(fs->sub));
  PetscCall(PCFieldSplitSchurGetSubKSP(fs->split, &n, &fs->sub));
  PetscCall(KSPSetOperators(fs->sub[1], Sp, Sp_pre));
  if (fs->nbodies) PetscCall(KSPSetPreSolve(fs->sub[1], make_consistent, fs->pressure));
  PetscCall(PressureSetUpPC(fs->pressure, fs->sub[1]));
  PetscCall(KSPSetUp(fs->sub[0]));
  PetscCall(KSPSetUp(fs->sub[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCreateProjection(FlowSolver fs, PC pc)
{
  IS is[2];

  PetscFunctionBeginUser;
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetContext(pc, fs));
  PetscCall(PCShellSetName(pc, "projection"));
  PetscCall(PCShellSetSetUp(pc, set_up_projection));
  PetscCall(PCShellSetApply(pc, apply_projection));
  PetscCall(PCShellSetView(pc, view_projection));
  PetscCall(PCCreate(PETSC_COMM_WORLD, &fs->split));
  PetscCall(PCSetOptionsPrefix(fs->split, "flow_"));
  PetscCall(PCSetType(fs->split, PCFIELDSPLIT));
  PetscCall(MatNestGetISs(fs->nest, is, NULL));
  PetscCall(PCFieldSplitSetIS(fs->split, "velocity", is[0]));
  PetscCall(PCFieldSplitSetIS(fs->split, "pressure", is[1]));
  PetscCall(PCFieldSplitSetType(fs->split, PC_COMPOSITE_SCHUR));
  PetscCall(PCFieldSplitSetSchurFactType(fs->split, PC_FIELDSPLIT_SCHUR_FACT_LOWER));
  PetscCall(PCSetFromOptions(fs->split));
  PetscFunctionReturn(PETSC_SUCCESS);
}
