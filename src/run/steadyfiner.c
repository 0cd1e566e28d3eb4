/* Steady: what elements of the next order would change (SteadyFiner of steady.h). */
#include "compat.h"
#include "steadyimpl.h"

#define LINEAR_RTOL 1e-2 /* of an estimate */

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

/* The factors of the last iteration serve; a preconditioner goes by matrices that have changed since */
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

/* From x to what is a solution beside what was found */
static PetscErrorCode solve_beside(Steady s, const FlowFinerResult *finer, Vec x, PetscBool *ok)
{
  const PetscInt     n = s->loc->nnode_all * s->loc->dim;
  PetscReal         *rhs, *g, *r, norm;
  PetscInt           linear;
  KSPConvergedReason reason;

  PetscFunctionBeginUser;
  PetscCall(SteadyLinearize(s, x));
  PetscCall(CoupleGetSystem(s->couple, NULL, NULL, NULL, &rhs, &g));
  PetscCall(PetscMalloc1(n, &r));
  for (PetscInt i = 0; i < n; i++) r[i] = rhs[i] + finer->load[i];
  PetscCall(FlowAddVolume(s->flow, s, &finer->volume));
  PetscCall(FlowSolverSetVelocity(s->solver, NULL));
  PetscCall(FlowSolverResidual(s->solver, r, g, x, s->f));
  PetscCall(FlowAddVolume(s->flow, s, NULL));
  PetscCall(PetscFree(r));
  PetscCall(set_up_last(s));
  PetscCall(VecNorm(s->f, NORM_2, &norm));
  PetscCall(FlowSolverCorrect(s->solver, s->f, LINEAR_RTOL * norm, s->y, &linear, &reason));
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
  Vec                    x;

  PetscFunctionBeginUser;
  *ok = PETSC_TRUE;
  PetscCall(SteadyLinearize(s, s->x));
  PetscCall(PetscMalloc1(s->loc->nnode_all, &given));
  PetscCall(mark_given(s, given));
  PetscCall(FlowFinerCreate(s->flow, given, &finer));
  PetscCall(PetscFree(given));
  PetscCall(CoupleGetSystem(s->couple, &u, &p, NULL, NULL, NULL));
  PetscCall(VecDuplicate(s->x, &x));
  PetscCall(VecCopy(s->x, x));
  PetscCall(FlowSolverIsDirect(s->solver, &direct));
  for (PetscInt i = 0; i < (direct ? STEADY_SWEEPS : STEADY_SWEEPS - 1) && *ok; i++) {
    PetscCall(FlowFinerFind(finer, u, p, &result));
    PetscCall(solve_beside(s, result, x, ok));
    if (!*ok) break;
    PetscCall(FlowFinerCount(finer, PETSC_TRUE));
    PetscCall(show(s, x));
    PetscCall((*look)(ctx, result));
    PetscCall(FlowFinerCount(finer, PETSC_FALSE));
  }
  PetscCall(FlowFinerDestroy(&finer));
  PetscCall(show(s, s->x));
  PetscCall(VecDestroy(&x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
