/* Steady, the system: residual, matrix and linear solve at a velocity, for SNES (steady.c) and for the ways to a
   solution (steadyroute.c). */
#include "compat.h"
#include "steadyimpl.h"
#include "base/interrupt.h"
#include "base/log.h"

#define RTOL_MAX 1e-2 /* of the residual, left by a linear solve */
/* The same where the viscosity varies, for Picard's iteration and for Newton's (runs/studies/rheology) */
#define PICARD_VARYING 0.2
#define NEWTON_VARYING 0.1
#define NEAR           1e-3 /* of the residual at a start that is close to the solution: it takes a correction or two */
#define LEFT           0.1  /* of the nonlinear tolerance; the rest is for what is not linear (runs/studies/rheology) */

PetscErrorCode SteadyBegin(Steady s, PetscReal rate)
{
  PetscFunctionBeginUser;
  PetscCall(FlowBeginSteady(s->flow, rate));
  s->still = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is all there already? What depends on more than the velocity, or is put together for steps, is not asked. */
static PetscErrorCode is_there(Steady s, Vec x, PetscBool *there)
{
  PetscFunctionBeginUser;
  *there = PETSC_FALSE;
  if (s->zero_velocity || s->shift > 0 || FlowHasSymmetricStress(s->flow)) {
    s->still = PETSC_FALSE;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (s->still) PetscCall(VecEqual(x, s->at, there));
  if (!*there) PetscCall(VecCopy(x, s->at));
  s->still = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyLinearize(Steady s, Vec x)
{
  PetscReal *u, *p, *U;
  PetscBool  there;

  PetscFunctionBeginUser;
  PetscCall(is_there(s, x, &there));
  if (there) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleGetSystem(s->couple, &u, &p, &U, NULL, NULL));
  PetscCall(FlowSolverUnpack(s->solver, x, u, p, U));
  PetscCall(FlowSetConvection(s->flow, s->zero_velocity && s->slow ? s->zero_velocity : u));
  PetscCall(FlowSetRheologyVelocity(s->flow, s->zero_velocity ? s->zero_velocity : u));
  PetscCall(CoupleAssemble(s->couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyEvaluate(SNES snes, Vec x, Vec f, void *ctx)
{
  Steady     s = (Steady)ctx;
  PetscReal *rhs, *g;

  PetscFunctionBeginUser;
  (void)snes;
  PetscCall(SteadyLinearize(s, x));
  PetscCall(CoupleGetSystem(s->couple, NULL, NULL, NULL, &rhs, &g));
  PetscCall(FlowSolverSetVelocity(s->solver, NULL));
  PetscCall(FlowSolverResidual(s->solver, rhs, g, x, f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The system has the flow's matrix at its rate, the preconditioner that of a time step on top, unless that is as small
   as at rest */
static PetscErrorCode set_up_shifted(Steady s, const PetscReal u[])
{
  const FlowParameters *par;
  PetscReal             rate;
  Mat                   A = NULL;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(s->flow, &par));
  if (par->convection && !s->slow) {
    PetscCall(FlowAssembleComponents(s->flow, u, &A));
    PetscCall(FlowAddRate(s->flow, s->shift, &rate));
    PetscCall(CoupleAssemble(s->couple));
  }
  PetscCall(FlowSolverSetShift(s->solver, s->shift, A));
  PetscCall(FlowSolverSetUp(s->solver));
  if (A) PetscCall(FlowAddRate(s->flow, -s->shift, &rate));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadySetUpSolver(Steady s, Vec x, PetscBool newton)
{
  PetscReal *u;
  Mat        A;
  PetscBool  ends;

  PetscFunctionBeginUser;
  if (s->fresh) {
    s->fresh = PETSC_FALSE;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(SteadyLinearize(s, x));
  PetscCall(InterruptAsk(&ends)); /* what follows takes seconds in space, and SteadySolveLinear does without it */
  if (ends) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(CoupleGetSystem(s->couple, &u, NULL, NULL, NULL, NULL));
  s->newton = NULL;
  if (s->shift > 0) {
    PetscCall(set_up_shifted(s, newton ? u : NULL));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (newton) {
    PetscCall(FlowAssembleComponents(s->flow, u, &A));
    PetscCall(FlowSolverSetVelocity(s->solver, A));
    s->newton = A;
  }
  PetscCall(FlowSolverSetUp(s->solver));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool SteadyIsLinear(Steady s)
{
  const FlowParameters *par;

  PetscFunctionBeginUser;
  PetscCallAbort(PETSC_COMM_SELF, FlowGetParameters(s->flow, &par));
  PetscFunctionReturn((PetscBool)(!par->convection && !FlowHasSymmetricStress(s->flow)));
}

PetscBool SteadyUsesNewton(Steady s, PetscInt its)
{
  return (PetscBool)(!SteadyIsLinear(s) && s->linearization == 0 && (s->near || its >= s->picard_steps));
}

/* Share of the residual that a linear solve may leave: no more than the nonlinear iteration leaves anyway. Picard's
   takes it down by one digit or two; Newton's by the square of what it did last (Eisenstat & Walker, SIAM J. Sci.
   Comput. 17, 16, 1996, choice 2), or by a digit at a time where each costs the more iterations the more viscosities
   differ. Of a linear problem nothing. */
static PetscReal choose_rtol(Steady s, PetscReal norm)
{
  const PetscReal last = s->last_norm;

  if (SteadyIsLinear(s)) return 0;
  if (FlowHasSymmetricStress(s->flow)) return SteadyUsesNewton(s, s->its) ? NEWTON_VARYING : PICARD_VARYING;
  if (!SteadyUsesNewton(s, s->its) || last <= 0) return RTOL_MAX;
  return PetscMin(RTOL_MAX, 0.5 * PetscSqr(norm / last));
}

/* y = J^{-1} f by the solver of the flow. LEFT of what the nonlinear solver wants is enough: its last correction
   starts so close that the usual share of it may be lost in round-off. */
PetscErrorCode SteadySolveLinear(Steady s, Vec f, Vec y, KSPConvergedReason *reason)
{
  PetscReal norm, converged;
  PetscBool ends;

  PetscFunctionBeginUser;
  PetscCall(InterruptAsk(&ends));
  if (ends) {
    *reason        = KSP_DIVERGED_BREAKDOWN;
    s->last_linear = 0;
    PetscCall(VecZeroEntries(y));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecNorm(f, NORM_2, &norm));
  if (s->near) converged = NEAR * s->scale;
  else converged = PetscMax(LEFT * PetscMax(s->tol, s->rel_tol * s->scale), choose_rtol(s, norm) * norm);
  PetscCall(FlowSolverCorrect(s->solver, f, converged, y, &s->last_linear, reason));
  s->last_norm = norm;
  s->linear += s->last_linear;
  s->its++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyPrint(Steady s, const char method[], PetscReal norm)
{
  PetscFunctionBeginUser;
  if (LogIsMute()) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscPrintf(s->comm, "  steady %3" PetscInt_FMT "  residual %10.3e  relative %9.2e", s->its, (double)norm,
                        (double)(s->scale > 0 ? norm / s->scale : 0)));
  if (s->its) PetscCall(PetscPrintf(s->comm, "  %-11s %3" PetscInt_FMT " linear iterations", method, s->last_linear));
  PetscCall(PetscPrintf(s->comm, "\n"));
  s->shown = s->its;
  PetscFunctionReturn(PETSC_SUCCESS);
}
