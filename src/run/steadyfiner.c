/* Steady: what elements of the next order would change (SteadyFiner of steady.h). */
#include "compat.h"
#include "steadyimpl.h"

#define LINEAR_RTOL 1e-2 /* of an estimate, beside what the first sweep has to solve for */

/* Components that are given at a node: by a boundary, or by a body */
static PetscErrorCode mark_given(Steady s, unsigned char given[])
{
  const PetscInt      *body;
  const unsigned char *fixed;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetNodeBody(s->couple, &body));
  PetscCall(ConditionsGetValues(FlowConditions(s->flow), &fixed, NULL));
  for (PetscInt i = 0; i < s->loc->nnode_all; i++) given[i] = body[i] >= 0 ? 7 : fixed[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The Jacobian of the solution: factors of the last iteration serve; a preconditioner goes by matrices that have
   changed since */
static PetscErrorCode set_up_last(Steady s)
{
  PetscBool direct;

  PetscFunctionBeginUser;
  if (SteadyIsLinear(s)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverIsDirect(s->solver, &direct));
  if (direct && s->newton) PetscCall(FlowSolverSetVelocity(s->solver, s->newton));
  else {
    s->fresh = PETSC_FALSE;
    PetscCall(SteadySetUpSolver(s, s->x, PETSC_TRUE));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* f: residual at x of the system with that Jacobian, and with what was found, unless NULL */
static PetscErrorCode find_residual(Steady s, const FlowFinerResult *finer, Vec x, Vec f)
{
  const PetscInt n = s->loc->nnode_all * s->loc->dim;
  PetscReal     *rhs, *g, *r;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSystem(s->couple, NULL, NULL, NULL, &rhs, &g));
  PetscCall(PetscMalloc1(n, &r));
  for (PetscInt i = 0; i < n; i++) r[i] = rhs[i] + (finer ? finer->load[i] : 0);
  PetscCall(FlowAddVolume(s->flow, s, finer ? &finer->volume : NULL));
  PetscCall(FlowSolverResidual(s->solver, r, g, x, f));
  PetscCall(FlowAddVolume(s->flow, s, NULL));
  PetscCall(PetscFree(r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* start: of that residual at the solution what its own has not: what Newton's method left there counts. */
static PetscErrorCode find_start(Steady s, Vec start)
{
  PetscFunctionBeginUser;
  PetscCall(SteadyEvaluate(s->snes, s->x, s->f, s));
  PetscCall(set_up_last(s));
  PetscCall(find_residual(s, NULL, s->x, start));
  PetscCall(VecAXPY(start, -1, s->f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* From x to what is a solution beside what was found. *size: of the first residual, by which all are measured. */
static PetscErrorCode solve_beside(Steady s, const FlowFinerResult *finer, Vec start, Vec x, PetscReal *size,
                                   PetscBool *ok)
{
  PetscInt           linear;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(find_residual(s, finer, x, s->f));
  PetscCall(VecAXPY(s->f, -1, start));
  if (*size == 0) PetscCall(VecNorm(s->f, NORM_2, size));
  PetscCall(FlowSolverCorrect(s->solver, s->f, LINEAR_RTOL * *size, s->y, &linear, &reason));
  PetscCall(VecAXPY(x, -1, s->y));
  *ok = (PetscBool)(reason > 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Fields and forces of x, without its matrices */
static PetscErrorCode show(Steady s, Vec x)
{
  PetscReal *u, *p, *U;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetSystem(s->couple, &u, &p, &U, NULL, NULL));
  PetscCall(FlowSolverUnpack(s->solver, x, u, p, U));
  PetscCall(FlowSetConvection(s->flow, u));
  PetscCall(CoupleForce(s->couple));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SteadyFiner(Steady s, PetscErrorCode (*look)(void *, const FlowFinerResult *), void *ctx, PetscBool *ok)
{
  FlowFiner              finer;
  const FlowFinerResult *result;
  PetscReal             *u, *p;
  unsigned char         *given;
  PetscBool              direct;
  PetscReal              size = 0;
  Vec                    x, start;

  PetscFunctionBeginUser;
  *ok = PETSC_TRUE;
  PetscCall(PetscMalloc1(s->loc->nnode_all, &given));
  PetscCall(mark_given(s, given));
  PetscCall(CoupleGetSystem(s->couple, &u, &p, NULL, NULL, NULL));
  PetscCall(FlowFinerCreate(s->flow, given, u, &finer));
  PetscCall(PetscFree(given));
  PetscCall(VecDuplicate(s->x, &x));
  PetscCall(VecCopy(s->x, x));
  PetscCall(VecDuplicate(s->x, &start));
  PetscCall(find_start(s, start));
  PetscCall(FlowSolverIsDirect(s->solver, &direct));
  for (PetscInt i = 0; i < (direct ? STEADY_SWEEPS : STEADY_SWEEPS - 1) && *ok; i++) {
    PetscCall(FlowFinerFind(finer, u, p, &result));
    PetscCall(solve_beside(s, result, start, x, &size, ok));
    if (!*ok) break;
    PetscCall(FlowFinerCount(finer, PETSC_TRUE));
    PetscCall(show(s, x));
    PetscCall((*look)(ctx, result));
    PetscCall(FlowFinerCount(finer, PETSC_FALSE));
  }
  PetscCall(FlowFinerDestroy(&finer));
  PetscCall(show(s, s->x));
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&start));
  PetscFunctionReturn(PETSC_SUCCESS);
}
