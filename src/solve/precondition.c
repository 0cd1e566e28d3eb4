/* FlowSolver: the preconditioner of solvers fast, balanced and accurate: the fields one after the other, then
   projection, commutator or what twostage.h has (see system.h). The fields are solved where they stand in vectors of
   the whole system; PETSc's fieldsplit would copy them and keep lists of where they are. */
#include "compat.h"
#include "impl.h"
#include "solidblock.h"
#include "krylov/lean.h"
#include "base/log.h"

/* Of the tolerances of inner solves, in a step with bodies that move: in the first velocity solve; in the plane in both
   solves of the second iteration, which is mostly the last one; with solver fast in space, where no body is light,
   in the pressure's first solves (runs/studies/following) */
#define FIRST_FACTOR  0.3
#define SECOND_FACTOR 3
#define FAST_FACTOR   3

/* t_p = x_p - B u */
static PetscErrorCode take_divergence(FlowSolver fs, Vec u)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->op.B, u, fs->vec.t_p));
  PetscCall(VecAYPX(fs->vec.t_p, -1, fs->vec.x_p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* p += factor mu theta Mp^{-1} (x_p - B u); has_residual: t_p is x_p - B u still */
static PetscErrorCode add_viscous(FlowSolver fs, PetscReal factor, PetscBool has_residual, Vec u, Vec p)
{
  PetscFunctionBeginUser;
  if (!has_residual) PetscCall(take_divergence(fs, u));
  PetscCall(FlowSolverAddPressureMass(fs, factor * fs->step.viscous, fs->vec.t_p, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u += M_r^{-1} P^T B^T p, and the viscous part with the u before: the projection step with the rotational pressure
   update */
static PetscErrorCode project(FlowSolver fs, Vec u, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->op.G, p, fs->vec.t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->vec.t_u, fs->vec.t_u2));
  if (fs->choice.pressure_fraction < 1) PetscCall(VecScale(p, fs->choice.pressure_fraction));
  PetscCall(add_viscous(fs, 1, (PetscBool)(fs->nbodies == 0), u, p)); /* make_consistent changes it */
  PetscCall(VecAXPY(u, -1, fs->vec.t_u2));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* p <- S_p^{-1} (B M_r^{-1} A_r M_r^{-1} P^T B^T + C) p, the least-squares commutator, or a mean of that and of the
   mass of the pressure over the viscosity */
static PetscErrorCode commute(FlowSolver fs, Vec u, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->op.G, p, fs->vec.t_u));
  PetscCall(VecScale(fs->vec.t_u, -1));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->vec.t_u, fs->vec.t_u2));
  PetscCall(MatMult(fs->op.Ar, fs->vec.t_u2, fs->vec.t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->vec.t_u, fs->vec.t_u2));
  PetscCall(MatMult(fs->op.B, fs->vec.t_u2, fs->vec.t_p));
  if (fs->op.C) {
    PetscCall(MatMult(fs->op.C, p, fs->vec.t_p2));
    PetscCall(VecAXPY(fs->vec.t_p, 1, fs->vec.t_p2));
  }
  PetscCall(KSPSolve(fs->sub[1], fs->vec.t_p, p));
  if (fs->choice.mass_fraction > 0) {
    PetscCall(VecScale(p, 1 - fs->choice.mass_fraction));
    PetscCall(add_viscous(fs, fs->choice.mass_fraction, PETSC_FALSE, u, p));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inner solves that ended at their largest number of iterations without meeting their tolerance. KSPGCR says
   KSP_CONVERGED_ITS then, as do solves of a fixed number of iterations, which have no convergence test. */
static PetscErrorCode count_limited(FlowSolver fs)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    KSPConvergedReason reason;
    PetscInt           its, max_it;
    PetscErrorCode (*test)(KSP, PetscInt, PetscReal, KSPConvergedReason *, void *);

    PetscCall(KSPGetConvergedReason(fs->sub[i], &reason));
    PetscCall(KSPGetIterationNumber(fs->sub[i], &its));
    PetscCall(KSPGetTolerances(fs->sub[i], NULL, NULL, NULL, &max_it));
    PetscCall(KSPGetConvergenceTest(fs->sub[i], &test, NULL, NULL));
    if (reason < 0 || (reason == KSP_CONVERGED_ITS && its >= max_it && test != KSPConvergedSkip)) fs->limited[i]++;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By what tolerances are multiplied in this iteration. Around bodies that move the residual of a start value is mostly
   slip in cells that they cut now, which a first solve must end well below what bodies feel
   (runs/studies/flow-solver, "Residual carried to the next step"). A second iteration that is to make velocities
   good enough begins with far less than they may err by; not with bodies lighter than the fluid, whose errors count
   more. */
static PetscErrorCode get_factors(FlowSolver fs, PetscReal factor[2])
{
  PetscInt it;

  PetscFunctionBeginUser;
  PetscCall(KSPGetIterationNumber(fs->ksp, &it));
  factor[0] = fs->stop.first_velocity_solve ? FIRST_FACTOR : 1;
  factor[1] = fs->choice.loose_pressure && fs->stop.is_time_step ? FAST_FACTOR : 1;
  if (fs->stop.is_time_step && fs->stop.velocity_tol > 0 && fs->stop.once_max > 0 && it == 1 && !fs->stop.light &&
      fs->loc->dim == 2)
    factor[0] = factor[1] = SECOND_FACTOR;
  fs->stop.first_velocity_solve = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve_field(KSP ksp, PetscReal factor, Vec r, Vec x)
{
  PetscReal rtol;

  PetscFunctionBeginUser;
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, NULL));
  if (factor != 1) PetscCall(KSPSetTolerances(ksp, factor * rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(KSPSolve(ksp, r, x));
  if (factor != 1) PetscCall(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* u ~ A_r^{-1} x_u, p ~ S_p^{-1} (x_p - B u), then projection or commutator, see the header */
static PetscErrorCode solve_fields(FlowSolver fs, Vec x_u, Vec u, Vec p)
{
  PetscReal factor[2] = {1, 1};

  PetscFunctionBeginUser;
  PetscCall(get_factors(fs, factor));
  PetscCall(solve_field(fs->sub[0], factor[0], x_u, u));
  PetscCall(take_divergence(fs, u));
  PetscCall(solve_field(fs->sub[1], factor[1], fs->vec.t_p, p));
  PetscCall(count_limited(fs));
  switch (fs->choice.schur) {
  case SCHUR_TWO_STAGE: PetscCall(TwoStageApply(fs->two, fs, u, p)); break;
  case SCHUR_MASS:
    PetscCall(add_viscous(fs, 1, PETSC_TRUE, u, p)); /* without bodies */
    break;
  case SCHUR_COMMUTATOR: PetscCall(commute(fs, u, p)); break;
  default: PetscCall(project(fs, u, p));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The outer iteration's residual x has balanced rows; everything below works on the rows of the blocks. */
static PetscErrorCode apply_projection(PC pc, Vec x, Vec y)
{
  FlowSolver         fs;
  const DeviceQueue *q;
  const PetscReal   *xa;
  PetscReal         *ya;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  q = FlowGetQueue(fs->flow);
  PetscCall(DeviceVecGetRead(q, x, &xa));
  PetscCall(DeviceVecGet(q, y, &ya));
  PetscCall(FlowSolverPlaceFields(fs, xa, ya));
  PetscCall(VecCopy(fs->vec.from[1], fs->vec.x_p));
  PetscCall(VecScale(fs->vec.x_p, 1 / fs->step.continuity_scale));
  PetscCall(solve_fields(fs, fs->vec.from[0], fs->vec.to[0], fs->vec.to[1]));
  PetscCall(FlowSolverResetFields(fs));
  PetscCall(VecRestoreArrayAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view_projection(PC pc, PetscViewer viewer)
{
  FlowSolver fs;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  velocity, pressure, then %s\n",
                                   FlowSolverTwoStages(fs) ? "two-stage pressure and relaxation of cut cells"
                                   : fs->choice.schur == SCHUR_COMMUTATOR ? "least-squares commutator"
                                                                          : "projection with the lumped mass"));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  for (PetscInt i = 0; i < 2; i++) PetscCall(KSPView(fs->sub[i], viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode make_consistent(KSP ksp, Vec rhs, Vec x, void *pressure)
{
  PetscReal *r;

  PetscFunctionBeginUser;
  (void)ksp;
  (void)x;
  PetscCall(VecGetArrayAndMemType(rhs, &r, NULL));
  PetscCall(PressureMakeConsistent((Pressure)pressure, r));
  PetscCall(VecRestoreArrayAndMemType(rhs, &r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Only the preconditioner of the velocity may see an assembled matrix */
static PetscErrorCode set_up_projection(PC pc)
{
  FlowSolver fs;
  Mat        Sp, Sp_pre;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  PetscCall(SolidBlockRestorePC(fs));
  PetscCall(PressureGetMats(fs->pressure, &Sp, &Sp_pre));
  PetscCall(KSPSetOperators(fs->sub[0], fs->op.Ar, fs->set.need_Ar ? fs->op.Ar_assembled : fs->op.Ar));
  PetscCall(KSPSetOperators(fs->sub[1], Sp, Sp_pre));
  PetscCall(PressureSetUpPC(fs->pressure, fs->sub[1]));
  PetscCall(SolidBlockSetUpPC(fs));
  for (PetscInt i = 0; i < 2; i++) PetscCall(KSPSetUp(fs->sub[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCreateProjection(FlowSolver fs, PC pc)
{
  const char *const prefix[] = {"flow_fieldsplit_velocity_", "flow_fieldsplit_pressure_"};

  PetscFunctionBeginUser;
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetContext(pc, fs));
  PetscCall(PCShellSetName(pc, "projection"));
  PetscCall(PCShellSetSetUp(pc, set_up_projection));
  PetscCall(PCShellSetApply(pc, apply_projection));
  PetscCall(PCShellSetView(pc, view_projection));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(KSPCreate(fs->comm, &fs->sub[i]));
    PetscCall(KSPSetOptionsPrefix(fs->sub[i], prefix[i]));
    PetscCall(KSPSetFromOptions(fs->sub[i]));
  }
  PetscCall(LeanSetWork(fs->sub[0], fs->vec.t_u2, fs->vec.t_u)); /* which neither A_r nor its sweep uses */
  if (fs->nbodies) PetscCall(KSPSetPreSolve(fs->sub[1], make_consistent, fs->pressure));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Fields are solved for by iterations, and how many differs from one application to the next */
PetscErrorCode FlowSolverRemarkMethod(FlowSolver fs)
{
  PetscBool   fit, direct[2];
  const char *type;

  PetscFunctionBeginUser;
  if (fs->set.need_whole || fs->set.single_projection) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 2; i++) PetscCall(PetscObjectTypeCompare((PetscObject)fs->sub[i], KSPPREONLY, &direct[i]));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)fs->ksp, &fit, LEAN_FGMRES, KSPFGMRES, KSPGCR, KSPFCG, KSPPIPEFGMRES,
                                      KSPPIPEGCR, KSPFBCGS, KSPRICHARDSON, KSPPREONLY, ""));
  if (fit || (direct[0] && direct[1])) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPGetType(fs->ksp, &type));
  PetscCall(
    LogRemark("-flow_ksp_type %s takes the preconditioner for fixed, and it varies: it iterates itself (-flow_fieldsplit_velocity_ksp_type, "
              "_pressure_ksp_type). What it takes for converged may not be: use fgmres, gcr, or preonly for both fields",
              type));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetLimited(FlowSolver fs, PetscInt limited[2])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(limited, fs->limited, 2));
  PetscFunctionReturn(PETSC_SUCCESS);
}
