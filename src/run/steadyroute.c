/* Steady: the route to the solution (see steadyimpl.h). */
#include "compat.h"
#include "steadyimpl.h"
#include "base/interrupt.h"
#include "base/log.h"

/* The viscosity of cells that bodies cut, and the penalty that goes with it, depend on what is beside them, which
   Newton's matrix does not know: it is held while Newton's method takes a VISCOSITY_RTOL of the residual, and evaluated
   again, -flow_snes_max_it times at most, until that changes the stress by less than STRESS_TOL of the largest one
   (runs/studies/rheology) */
#define STRESS_TOL     1e-3
#define VISCOSITY_RTOL 1e-2

/* Stages of a fluid that is stiffer at rest: viscosity at rest over that of the parameters, from which one on, times
   what, at least what; what a stage leaves of the residual, and how far it settles */
#define RIGID_FIRST 10
#define RIGID_RISE  3
#define RISE_MIN    1.2
#define STAGE       1e-2

#define STEPS_LONGER 10 /* rates of pseudo-time steps and of those that precondition, beside those of the flow */

/* ---- pseudo-time ---- */

/* One linear step of pseudo-time from x with c_t = rate; norm: of the steady residual at x before it */
static PetscErrorCode take_pseudo_step(Steady s, PetscReal rate, PetscReal *norm, PetscBool *ok)
{
  PetscReal         *p, *U, *u_field;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSystem(s->couple, NULL, &p, &U, NULL, NULL));
  PetscCall(FlowGetFields(s->flow, &u_field, NULL, NULL));
  PetscCall(FlowSolverUnpack(s->solver, s->x, u_field, p, U));
  PetscCall(SteadyBegin(s, rate));
  PetscCall(SteadyEvaluate(s->snes, s->x, s->f, s));
  PetscCall(VecNorm(s->f, NORM_2, norm));
  PetscCall(SteadySetUpSolver(s, s->x, PETSC_TRUE));
  PetscCall(SteadySolveLinear(s, s->f, s->y, &reason));
  *ok = (PetscBool)(reason > 0 && !PetscIsInfOrNanReal(*norm));
  if (*ok) PetscCall(VecAXPY(s->x, -1, s->y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rates at which convection and viscosity cross the domain, along its longest and its shortest extent */
typedef struct {
  PetscReal along, across;
} Crossing;

/* Of the flow at s->x, or of one at rest */
static PetscErrorCode measure_crossing(Steady s, PetscBool flows, Crossing *r)
{
  const FlowParameters *par;
  PetscReal            *u, nu, speed = 0, max = 0, min = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(s->flow, &par));
  if (flows) PetscCall(SteadyLinearize(s, s->x));
  PetscCall(CoupleGetSystem(s->couple, &u, NULL, NULL, NULL, NULL));
  nu = par->viscosity / par->density;
  for (PetscInt i = 0; i < s->loc->nnode_all * s->loc->dim && flows; i++) speed = PetscMax(speed, PetscAbsReal(u[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, s->comm));
  for (PetscInt d = 0; d < s->loc->dim; d++) max = PetscMax(max, s->loc->upper[d] - s->loc->lower[d]);
  for (PetscInt d = 0; d < s->loc->dim; d++) min = PetscMin(min, s->loc->upper[d] - s->loc->lower[d]);
  r->along  = speed / max + nu / PetscSqr(max);
  r->across = speed / min + nu / PetscSqr(min);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyChooseShift(Steady s, PetscBool flows)
{
  Crossing  r;
  PetscBool can;

  PetscFunctionBeginUser;
  s->shift = 0;
  PetscCall(FlowSolverCanShift(s->solver, &can));
  if (can) PetscCall(measure_crossing(s, flows, &r));
  if (can) s->shift = STEPS_LONGER * r.along;
  if (can) s->fresh = PETSC_FALSE;
  PetscCall(FlowSolverSetShift(s->solver, s->shift, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* SNES from x, until the residual is `target` or, of the present one, the share rtol or that of the tolerance; *ok: it
   is */
static PetscErrorCode run_snes(Steady s, PetscReal tol, PetscReal rtol, PetscBool *ok)
{
  SNESConvergedReason reason;
  PetscReal           before[3];
  PetscInt            max_it, max_f;

  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(s->snes, &before[0], &before[1], &before[2], &max_it, &max_f));
  s->tol = PetscMax(before[0], tol);
  PetscCall(SNESSetTolerances(s->snes, s->tol, PetscMax(before[1], rtol), before[2], max_it, max_f));
  PetscCall(SNESSolve(s->snes, NULL, s->x));
  PetscCall(SNESGetConvergedReason(s->snes, &reason));
  PetscCall(SNESSetTolerances(s->snes, before[0], before[1], before[2], max_it, max_f));
  *ok = (PetscBool)(reason > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The nonlinear solver from x, until the residual is `target` and cells that bodies cut change the stress by no more
   than `hold`; *ok: converged. On failure x is what it was. */
static PetscErrorCode solve_nonlinear(Steady s, PetscReal tol, PetscReal stress_tol, PetscBool *ok)
{
  Vec       before;
  PetscReal change = 1;
  PetscInt  max;

  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(s->snes, NULL, NULL, NULL, &max, NULL));
  PetscCall(VecDuplicate(s->x, &before));
  PetscCall(VecCopy(s->x, before));
  PetscCall(SteadyBegin(s, 0));
  *ok = PETSC_TRUE;
  for (PetscInt k = 0; k < max && change > stress_tol && *ok; k++) {
    PetscCall(FlowSetCutViscosity(s->flow, k ? CUT_RELAXED : CUT_UPDATE, &change));
    if (k) PetscCall(SteadyEvaluate(s->snes, s->x, s->f, s));
    if (k) PetscCall(FlowSetCutViscosity(s->flow, CUT_FROZEN, &change));
    if (k == 1) change = 1;           /* what is kept is of the last iterate, whatever it is worth */
    if (s->linearization) change = 0; /* Picard's iteration needs no derivative */
    PetscCall(SNESSetForceIteration(s->snes, (PetscBool)(change > stress_tol)));
    PetscCall(run_snes(s, tol, change > stress_tol ? VISCOSITY_RTOL : 0, ok));
  }
  s->unsettled = *ok ? change : 0;
  *ok          = (PetscBool)(*ok && change <= stress_tol);
  if (!*ok && !InterruptHeard()) PetscCall(VecCopy(before, s->x));
  PetscCall(VecDestroy(&before));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyMeasure(Steady s, PetscReal *norm)
{
  PetscFunctionBeginUser;
  PetscCall(SteadyBegin(s, 0));
  PetscCall(FlowSetCutViscosity(s->flow, CUT_UPDATE, NULL));
  PetscCall(SteadyEvaluate(s->snes, s->x, s->f, s));
  PetscCall(VecNorm(s->f, NORM_2, norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From x, with a viscosity at rest that is higher and higher, each from the flow before, as Newton's method finds only
   what is near (runs/studies/rheology). After a stage that fails, the next ones are closer. */
static PetscErrorCode solve_in_stages(Steady s, PetscBool *ok)
{
  PetscReal rigid = RIGID_FIRST, rise = RIGID_RISE, solved = 0, start = 0;
  PetscBool more;

  PetscFunctionBeginUser;
  for (PetscBool first = PETSC_TRUE;; first = PETSC_FALSE) {
    PetscCall(FlowSetRegularisation(s->flow, rigid, &more));
    if (first) PetscCall(SteadyMeasure(s, &start)); /* of which stages are to leave a share */
    PetscCall(solve_nonlinear(s, more ? STAGE * start : s->rel_tol * s->scale, more ? STAGE : STRESS_TOL, ok));
    if (*ok && !more) PetscFunctionReturn(PETSC_SUCCESS);
    if (*ok) solved = rigid;
    else rise = PetscSqrtReal(rise);
    if (!*ok && (solved == 0 || rise < RISE_MIN || InterruptHeard())) break;
    rigid = solved * rise;
  }
  PetscCall(FlowSetRegularisation(s->flow, PETSC_MAX_REAL, &more));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadySolveFrom(Steady s, PetscBool *ok)
{
  const PetscBool staged = (PetscBool)(FlowHasYield(s->flow) && !s->near);
  PetscBool       can;

  PetscFunctionBeginUser;
  if (!staged) PetscCall(solve_nonlinear(s, s->rel_tol * s->scale, STRESS_TOL, ok));
  if ((!staged && *ok) || InterruptHeard()) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSetRegularisation(s->flow, RIGID_FIRST, &can));
  if (can || staged) PetscCall(solve_in_stages(s, ok));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyPseudoTime(Steady s, PetscBool *ok)
{
  PetscReal rate = 0, norm, last = 0, next_try = 0;
  Crossing  r;

  PetscFunctionBeginUser;
  *ok = PETSC_FALSE;
  if (InterruptHeard()) PetscFunctionReturn(PETSC_SUCCESS);
  if (s->pseudo_steps && !LogIsMute())
    PetscCall(PetscPrintf(s->comm, "  steady: no convergence; pseudo-time steps from the start\n"));
  PetscCall(measure_crossing(s, PETSC_TRUE, &r));
  rate = STEPS_LONGER * r.across;
  for (PetscInt k = 0; k < s->pseudo_steps; k++) {
    PetscBool solved;

    PetscCall(take_pseudo_step(s, rate, &norm, &solved));
    if (!solved) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(SteadyPrint(s, "pseudo-time", norm));
    /* the first residual is that of the jump at the boundary */
    if (k > 1) rate *= PetscMin(2, PetscMax(0.2, 0.8 * norm / last));
    if (k == 1) next_try = 1e-2 * norm;
    last = norm;
    if (k <= 1 || norm > next_try) continue;
    PetscCall(solve_nonlinear(s, s->rel_tol * s->scale, STRESS_TOL, ok));
    if (*ok || InterruptHeard()) PetscFunctionReturn(PETSC_SUCCESS);
    next_try = 1e-2 * norm;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- gaps ---- */

#define CLOSINGS  6   /* at most */
#define CLOSE_MIN 0.3 /* of what is left over, that the next time may leave */

PetscErrorCode SteadyCloseGaps(Steady s)
{
  Vec       before;
  PetscReal norm = 0, last = PETSC_MAX_REAL;
  PetscBool any, ok        = PETSC_TRUE;

  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(s->x, &before));
  for (PetscInt k = 0; k < CLOSINGS && ok; k++) {
    PetscCall(FlowSolverForgive(s->solver, s->x, &any));
    if (!any) break;
    PetscCall(SteadyMeasure(s, &norm));
    if (norm <= s->rel_tol * s->scale) break;
    ok = (PetscBool)(norm <= CLOSE_MIN * last);
    if (!ok) break;
    last = norm;
    PetscCall(VecCopy(s->x, before));
    PetscCall(solve_nonlinear(s, s->rel_tol * s->scale, STRESS_TOL, &ok));
  }
  /* which solves it but for this */
  if (!ok || InterruptHeard()) PetscCall(VecCopy(before, s->x));
  /* prescribed motion presses fluid into a cell from which none can go */
  if (!ok && !InterruptHeard()) {
    PetscCall(FlowSolverForgive(s->solver, NULL, &any));
    PetscCall(
      LogRemark("the flow is not free of divergence in cells between two surfaces, which -flow_pressure_gap_compressibility makes compressible: residual %g. "
                "Refine the mesh there (-mesh_levels), or use -couple_method aligned",
                (double)last));
  }
  PetscCall(VecDestroy(&before));
  PetscFunctionReturn(PETSC_SUCCESS);
}
