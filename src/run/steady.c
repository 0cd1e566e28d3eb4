/* Steady: see steady.h. SNES drives; its linear solver is a shell around the FlowSolver, whose operators are set up by
   the callback for the Jacobian. */
#include "compat.h"
#include "base/runcomm.h"
#include "steadyimpl.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/opt.h"

static const char *const LINEARIZATIONS[] = {"newton", "picard", NULL};

/* ---- Jacobian ---- */

/* A step of Picard's iteration for a viscosity that varies is taken whole: the residual may rise in it */
static PetscErrorCode choose_search(Steady s, SNES snes, PetscBool newton)
{
  SNESLineSearch search;

  PetscFunctionBeginUser;
  if (!FlowHasSymmetricStress(s->flow)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SNESGetLineSearch(snes, &search));
  PetscCall(SNESLineSearchSetType(search, newton ? SNESLINESEARCHBT : SNESLINESEARCHBASIC));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_up_jacobian(SNES snes, Vec x, Mat J, Mat pre, void *ctx)
{
  Steady          s      = (Steady)ctx;
  const PetscBool newton = SteadyUsesNewton(s, s->its);

  PetscFunctionBeginUser;
  (void)J;
  (void)pre;
  PetscCall(choose_search(s, snes, newton));
  PetscCall(SteadySetUpSolver(s, x, newton));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode apply_inverse(PC pc, Vec f, Vec y)
{
  Steady             s;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(SteadySolveLinear(s, f, y, &reason));
  if (reason < 0) PetscCall(PCSetFailedReason(pc, PC_SUBPC_ERROR));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what the user sees ---- */

static PetscErrorCode monitor(SNES snes, PetscInt it, PetscReal norm, void *ctx)
{
  Steady s = (Steady)ctx;

  PetscFunctionBeginUser;
  (void)snes;
  (void)it;
  if (SteadyUsesNewton(s, s->its)) PetscCall(FlowSetCutViscosity(s->flow, CUT_FROZEN, NULL));
  if (s->its != s->shown) PetscCall(SteadyPrint(s, SteadyUsesNewton(s, s->its - 1) ? "newton" : "picard", norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Norms of the velocities of nodes in the solution and its last correction */
static PetscErrorCode measure_velocity(Steady s, SNES snes, PetscReal norm[2])
{
  const PetscInt n      = s->loc->nnode * s->loc->dim;
  PetscReal      sum[2] = {0, 0};
  Vec            v[2];

  PetscFunctionBeginUser;
  PetscCall(SNESGetSolution(snes, v));
  PetscCall(SNESGetSolutionUpdate(snes, v + 1));
  for (PetscInt k = 0; k < 2; k++) {
    const PetscReal *x;

    PetscCall(VecGetArrayRead(v[k], &x));
    for (PetscInt i = 0; i < n; i++) sum[k] += PetscSqr(x[i]);
    PetscCall(VecRestoreArrayRead(v[k], &x));
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, s->comm));
  for (PetscInt k = 0; k < 2; k++) norm[k] = PetscSqrtReal(sum[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As PETSc's test, but that velocities alone tell how small a correction is: beside pressures, which have another unit,
   they would count by the units of the scene. */
static PetscErrorCode test_convergence(SNES snes, PetscInt it, PetscReal xnorm, PetscReal snorm, PetscReal fnorm,
                                       SNESConvergedReason *reason, void *ctx)
{
  PetscReal norm[2] = {xnorm, snorm};

  PetscFunctionBeginUser;
  if (it) PetscCall(measure_velocity((Steady)ctx, snes, norm));
  PetscCall(SNESConvergedDefault(snes, it, norm[0], norm[1], fnorm, reason, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode stop_unconverged(Steady s)
{
  SNESConvergedReason reason;
  PetscReal           norm;
  PetscInt            max_it;

  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(s->snes, NULL, NULL, NULL, &max_it, NULL));
  PetscCheck(s->unsettled == 0, s->comm, PETSC_ERR_NOT_CONVERGED,
             "The steady problem did not converge: the viscosity of cells that bodies cut still changes the stress there by %g of the largest after %" PetscInt_FMT
             " iterations. Use -couple_method aligned, raise -flow_snes_max_it (now %" PetscInt_FMT
             "), refine the mesh around the bodies (-dm_refine), or run in time without -sim_steady",
             (double)s->unsettled, s->its, max_it);
  PetscCall(SNESGetConvergedReason(s->snes, &reason));
  PetscCall(SNESGetFunctionNorm(s->snes, &norm));
  SETERRQ(s->comm, PETSC_ERR_NOT_CONVERGED,
          "The steady problem did not converge (%s, residual %g after %" PetscInt_FMT
          " iterations). Raise -flow_snes_max_it (now %" PetscInt_FMT ") or -flow_pseudo_steps (now %" PetscInt_FMT
          "), use -flow_solver direct, refine the mesh (-dm_refine), or, if the flow has no stable steady state, run in time without -sim_steady; "
          "-flow_snes_monitor and -flow_ksp_converged_reason show more",
          SNESConvergedReasons[reason], (double)norm, s->its, max_it, s->pseudo_steps);
}

/* ---- the solve ---- */

/* Residuals count beside that at the start, or at rest where that is larger, unless it starts near */
static PetscErrorCode set_scale(Steady s, PetscReal *norm)
{
  PetscReal rhs_norm;

  PetscFunctionBeginUser;
  PetscCall(SteadyMeasure(s, norm));
  PetscCall(FlowSolverGetRhsNorm(s->solver, &rhs_norm));
  s->scale = s->near ? *norm : PetscMax(*norm, rhs_norm);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A start value that solves the problem (*ok), such as one of a restart, leaves nothing to take a share of */
static PetscErrorCode measure_start(Steady s, PetscBool *ok)
{
  PetscReal norm;

  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(s->snes, NULL, &s->rel_tol, NULL, NULL, NULL));
  PetscCall(set_scale(s, &norm));
  *ok = (PetscBool)(norm <= s->rel_tol * s->scale);
  PetscCall(SteadyPrint(s, "", norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From rest the first correction of a fluid that is stiffer at rest is that of a fluid of one viscosity: its own would
   be that of a thin layer beside what moves, and of nothing else (runs/studies/rheology). For solvers that iterate it
   is that of a flow without convection: prescribed velocities beside rest convect with a divergence of their size over
   that of a cell, against which the viscosity of large cells is nothing, and no sweep of the velocity converges. */
static PetscErrorCode set_zero_velocity(Steady s)
{
  const FlowParameters *par;
  PetscReal             norm;
  KSPConvergedReason    reason;
  PetscBool             direct;

  PetscFunctionBeginUser;
  PetscCall(VecNorm(s->x, NORM_2, &norm));
  PetscCall(FlowGetParameters(s->flow, &par));
  PetscCall(FlowSolverIsDirect(s->solver, &direct));
  if (norm > 0 || !(FlowIsShearThinning(s->flow) || (par->convection && !direct))) PetscFunctionReturn(PETSC_SUCCESS);
  s->fresh = PETSC_FALSE;
  s->slow  = (PetscBool)!direct;
  PetscCall(PetscCalloc1(s->loc->nnode_all * s->loc->dim, &s->zero_velocity));
  PetscCall(SteadyEvaluate(s->snes, s->x, s->f, s));
  PetscCall(SteadySetUpSolver(s, s->x, PETSC_FALSE));
  PetscCall(SteadySolveLinear(s, s->f, s->y, &reason));
  PetscCall(PetscFree(s->zero_velocity));
  s->slow = PETSC_FALSE;
  if (reason > 0) PetscCall(VecAXPY(s->x, -1, s->y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The shift goes by the flow, and the weight of the rows of continuity by the shift: residuals count beside that of the
   start again */
static PetscErrorCode measure_again(Steady s, Vec start)
{
  const FlowParameters *par;
  PetscReal             norm;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(s->flow, &par));
  if (s->shift == 0 || !par->convection) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(SteadyChooseShift(s, PETSC_TRUE));
  PetscCall(SteadySetUpSolver(s, s->x, PETSC_FALSE));
  PetscCall(VecSwap(s->x, start));
  PetscCall(set_scale(s, &norm));
  PetscCall(VecSwap(s->x, start));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadySolve(Steady s, PetscInt *its, PetscInt *linear)
{
  PetscReal *u, *p, *U, *u_field, *p_field;
  Vec        start;
  PetscBool  ok;

  PetscFunctionBeginUser;
  InterruptArm(PETSC_TRUE);
  s->its = s->linear = 0;
  s->tol = s->last_norm = 0;
  PetscCall(FlowSolverForgive(s->solver, NULL, NULL));
  PetscCall(CoupleGetSystem(s->couple, &u, &p, &U, NULL, NULL));
  PetscCall(FlowGetFields(s->flow, &u_field, NULL, &p_field));
  PetscCall(FlowSolverPack(s->solver, u_field, p_field, U, s->x));
  PetscCall(measure_start(s, &ok));
  if (!ok) {
    PetscCall(VecDuplicate(s->x, &start));
    PetscCall(VecCopy(s->x, start));
    PetscCall(set_zero_velocity(s));
    PetscCall(measure_again(s, start));
    PetscCall(VecDestroy(&start));
  }
  if (!ok) PetscCall(SteadySolveFrom(s, &ok));
  if (!ok) PetscCall(SteadyPseudoTime(s, &ok));
  if (!ok && !InterruptHeard()) PetscCall(stop_unconverged(s));
  if (ok) PetscCall(SteadyCloseGaps(s));
  PetscCall(SteadyLinearize(s, s->x)); /* fields, matrix and right-hand side of the solution, for forces and reports */
  *its    = s->its;
  *linear = s->linear;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

static PetscErrorCode mult_jacobian(Mat J, Vec x, Vec y)
{
  Steady s;
  Mat    K;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(J, &s));
  PetscCall(FlowSolverGetOperator(s->solver, &K));
  PetscCall(MatMult(K, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_snes(Steady s, const char rtol[])
{
  SNESLineSearch search;
  KSP            ksp;
  PC             pc;
  PetscInt       n;

  PetscFunctionBeginUser;
  PetscCall(OptDefault("-flow_snes_rtol", rtol));
  PetscCall(OptDefault("-flow_snes_max_it", s->linearization == 0 ? "25" : "500"));
  PetscCall(SNESCreate(s->comm, &s->snes));
  PetscCall(SNESSetOptionsPrefix(s->snes, "flow_"));
  /* PETSc's longest step of a line search is 1e8 in any units: where unknowns are large it damps all */
  PetscCall(SNESGetLineSearch(s->snes, &search));
  PetscCall(SNESLineSearchSetTolerances(search, PETSC_DEFAULT, PETSC_MAX_REAL, PETSC_DEFAULT, PETSC_DEFAULT,
                                        PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(SNESSetFunction(s->snes, NULL, SteadyEvaluate, s));
  PetscCall(VecGetLocalSize(s->x, &n));
  PetscCall(MatCreateShell(s->comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, s, &s->jacobian));
  PetscCall(MatShellSetOperation(s->jacobian, MATOP_MULT, (void (*)(void))mult_jacobian));
  PetscCall(SNESSetJacobian(s->snes, s->jacobian, s->jacobian, set_up_jacobian, s));
  PetscCall(SNESMonitorSet(s->snes, monitor, s, NULL));
  PetscCall(SNESSetConvergenceTest(s->snes, test_convergence, s, NULL));
  PetscCall(SNESGetKSP(s->snes, &ksp));
  PetscCall(KSPSetOptionsPrefix(ksp, "flow_correction_"));
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetContext(pc, s));
  PetscCall(PCShellSetName(pc, "flow solver"));
  PetscCall(PCShellSetApply(pc, apply_inverse));
  PetscCall(SNESSetFromOptions(s->snes));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What goes by the mesh */
static PetscErrorCode create_solvers(Steady s)
{
  PetscFunctionBeginUser;
  PetscCall(CoupleGetSolver(s->couple, &s->solver));
  PetscCall(FlowSolverCreateVec(s->solver, &s->x));
  PetscCall(VecDuplicate(s->x, &s->f));
  PetscCall(VecDuplicate(s->x, &s->y));
  PetscCall(VecDuplicate(s->x, &s->at));
  s->still = PETSC_FALSE;
  PetscCall(create_snes(s, s->rtol));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_solvers(Steady s)
{
  PetscFunctionBeginUser;
  PetscCall(SNESDestroy(&s->snes));
  PetscCall(MatDestroy(&s->jacobian));
  PetscCall(VecDestroy(&s->x));
  PetscCall(VecDestroy(&s->f));
  PetscCall(VecDestroy(&s->y));
  PetscCall(VecDestroy(&s->at));
  s->newton = NULL; /* the flow's, of its mesh */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyCreate(Flow flow, Couple couple, const char rtol[], Steady *steady)
{
  Steady                s;
  Mesh                  mesh;
  const FlowRateResult *flow_rate;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetFlowRate(couple, &flow_rate));
  PetscCheck(!flow_rate, RunComm(), PETSC_ERR_SUP,
             "Options -flow_rate and -couple_backflow hold a flow in every time step: run in time without -sim_steady, or give the force by -flow_force");
  PetscCall(PetscNew(&s));
  s->flow         = flow;
  s->couple       = couple;
  s->picard_steps = 3;
  s->pseudo_steps = 200;
  PetscCall(FlowGetMesh(flow, &mesh));
  PetscCall(MeshGetLocal(mesh, &s->loc));
  PetscCall(MeshGetComm(mesh, &s->comm));
  PetscCall(OptChoice("-flow_linearization", LINEARIZATIONS, &s->linearization));
  if (s->linearization == 0) PetscCall(OptInt("-flow_picard_steps", &s->picard_steps));
  PetscCall(OptInt("-flow_pseudo_steps", &s->pseudo_steps));
  PetscCall(PetscStrncpy(s->rtol, rtol, sizeof(s->rtol)));
  PetscCall(create_solvers(s));
  *steady = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyDestroy(Steady *steady)
{
  PetscFunctionBeginUser;
  if (!*steady) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(destroy_solvers(*steady));
  PetscCall(PetscFree(*steady));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyRemesh(Steady s)
{
  PetscFunctionBeginUser;
  PetscCall(destroy_solvers(s));
  PetscCall(create_solvers(s));
  PetscCall(SteadySetUp(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyRefuseTime(void)
{
  const char *const names[] = {"-sim_dt", "-sim_time", "-sim_steps"};
  PetscBool         found;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 3; i++) {
    PetscCall(OptHas(names[i], &found));
    PetscCheck(!found, RunComm(), PETSC_ERR_USER_INPUT,
               "%s is given, but a steady scene takes no time steps: remove it, or set -sim_steady false", names[i]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyView(Steady s, PetscViewer viewer)
{
  PetscReal rtol;
  PetscInt  max_it;

  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(s->snes, NULL, &rtol, NULL, &max_it, NULL));
  PetscCall(PetscViewerASCIIPrintf(viewer, "steady: %s", LINEARIZATIONS[s->linearization]));
  if (s->linearization == 0)
    PetscCall(PetscViewerASCIIPrintf(viewer, " after %" PetscInt_FMT " steps of picard", s->picard_steps));
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   ", relative residual %g, at most %" PetscInt_FMT " iterations, then %" PetscInt_FMT
                                   " pseudo-time steps\n",
                                   (double)rtol, max_it, s->pseudo_steps));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadySetTolerance(Steady s, PetscReal rtol)
{
  PetscFunctionBeginUser;
  PetscCall(SNESSetTolerances(s->snes, PETSC_DEFAULT, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadySetUpFrom(Steady s, PetscErrorCode (*start)(void *), void *ctx)
{
  PetscFunctionBeginUser;
  PetscCall(SteadyBegin(s, 0));
  PetscCall(CoupleUpdateGeometry(s->couple));
  PetscCall((*start)(ctx));
  PetscCall(SteadyChooseShift(s, PETSC_FALSE));
  s->fresh = PETSC_FALSE;
  s->near  = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadySetUp(Steady s)
{
  PetscFunctionBeginUser;
  PetscCall(SteadyBegin(s, 0));
  PetscCall(CoupleUpdateGeometry(s->couple));
  PetscCall(CoupleAssemble(s->couple));
  PetscCall(SteadyChooseShift(s, PETSC_FALSE));
  PetscCall(FlowSolverSetUp(s->solver));
  s->fresh = (PetscBool)!FlowHasSymmetricStress(s->flow); /* a viscosity of moving walls and bodies is another one */
  PetscFunctionReturn(PETSC_SUCCESS);
}
