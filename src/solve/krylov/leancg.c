/* Lean CG: see lean.h. With u = M^{-1} r and w = A u all inner products of an iteration are known at once, and from

     p' = u + beta p, s' = A p' = w + beta s, r' = r - alpha s'

   follow (p', s') = (u, w) - beta^2 (p, s) and the norm of r', so that no preconditioner is applied for nothing. */
#include "compat.h"
#include "leanimpl.h"

#define LOST 1e-10 /* squares of norms that the recurrence has brought down so far are taken anew */

enum {
  RU,
  WU,
  UU,
  WW,
  WS,
  RW,
  RS,
  CU,
  NDOTS
};

typedef struct {
  Vec       r, u, w, p, s, constant;     /* constant: of the null space, or NULL */
  PetscReal gamma, alpha, rr, ss, exact; /* of the iteration before; square of the residual's norm, when it was taken */
  PetscReal cp, cx;                      /* products of p and x with the constant */
} LeanCG;

/* All inner products of an iteration, in lanes */
static PetscErrorCode take_dots(KSP ksp, LeanCG *m, PetscBool first, PetscReal dot[NDOTS])
{
  const PetscReal *r, *u, *w, *s, *c = NULL;
  PetscReal        lane[NDOTS][4] = {{0}};
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(m->r, &n));
  PetscCall(VecGetArrayRead(m->r, &r));
  PetscCall(VecGetArrayRead(m->u, &u));
  PetscCall(VecGetArrayRead(m->w, &w));
  PetscCall(VecGetArrayRead(m->s, &s));
  if (m->constant) PetscCall(VecGetArrayRead(m->constant, &c));
  for (PetscInt i = 0; i < n; i += 4) {
    const PetscInt width = PetscMin(4, n - i);

    for (PetscInt e = 0; e < width; e++) {
      const PetscReal si = first ? 0 : s[i + e];

      lane[RU][e] += r[i + e] * u[i + e];
      lane[WU][e] += w[i + e] * u[i + e];
      lane[UU][e] += u[i + e] * u[i + e];
      lane[WW][e] += w[i + e] * w[i + e];
      lane[WS][e] += w[i + e] * si;
      lane[RW][e] += r[i + e] * w[i + e];
      lane[RS][e] += r[i + e] * si;
      if (c) lane[CU][e] += c[i + e] * u[i + e];
    }
  }
  if (m->constant) PetscCall(VecRestoreArrayRead(m->constant, &c));
  PetscCall(VecRestoreArrayRead(m->s, &s));
  PetscCall(VecRestoreArrayRead(m->w, &w));
  PetscCall(VecRestoreArrayRead(m->u, &u));
  PetscCall(VecRestoreArrayRead(m->r, &r));
  for (PetscInt k = 0; k < NDOTS; k++) dot[k] = lane[k][0] + lane[k][1] + lane[k][2] + lane[k][3];
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, dot, NDOTS, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)ksp)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* p, s, x, r of the next iteration */
static PetscErrorCode extend(KSP ksp, LeanCG *m, PetscBool first, const PetscReal dot[])
{
  const PetscReal beta = first ? 0 : dot[RU] / m->gamma, ps = dot[WU] - (first ? 0 : beta * dot[RU] / m->alpha);
  const PetscReal alpha = dot[RU] / ps;
  PetscReal       rs;

  PetscFunctionBeginUser;
  if (!(ps > 0) || !(dot[RU] > 0)) { /* nothing is left, or neither matrix may be indefinite */
    ksp->reason = ps == 0 || dot[RU] == 0 ? KSP_CONVERGED_ATOL
                : dot[RU] < 0             ? KSP_DIVERGED_INDEFINITE_PC
                                          : KSP_DIVERGED_INDEFINITE_MAT;
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (first) {
    PetscCall(VecCopy(m->u, m->p));
    PetscCall(VecCopy(m->w, m->s));
  } else {
    PetscCall(VecAYPX(m->p, beta, m->u));
    PetscCall(VecAYPX(m->s, beta, m->w));
  }
  m->cp = dot[CU] + beta * (first ? 0 : m->cp);
  m->cx += alpha * m->cp;
  PetscCall(VecAXPY(ksp->vec_sol, alpha, m->p));
  PetscCall(VecAXPY(m->r, -alpha, m->s));
  m->ss = dot[WW] + (first ? 0 : beta * (2 * dot[WS] + beta * m->ss));
  rs    = dot[RW] + (first ? 0 : beta * dot[RS]);
  m->rr += alpha * (alpha * m->ss - 2 * rs);
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED && m->rr < LOST * m->exact) {
    PetscReal norm;

    PetscCall(VecNorm(m->r, NORM_2, &norm));
    m->exact = m->rr = norm * norm;
  }
  m->gamma = dot[RU];
  m->alpha = alpha;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode check_convergence(KSP ksp, PetscReal norm)
{
  PetscFunctionBeginUser;
  KSPCheckNorm(ksp, norm);
  ksp->rnorm = norm;
  PetscCall(KSPLogResidualHistory(ksp, norm));
  PetscCall(KSPMonitor(ksp, ksp->its, norm));
  PetscCall((*ksp->converged)(ksp, ksp->its, norm, &ksp->reason, ksp->cnvP));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The preconditioned residual without its part in the null space: by that of the operator, or (constant) later */
static PetscErrorCode precondition(KSP ksp, LeanCG *m)
{
  PetscFunctionBeginUser;
  if (m->constant) PetscCall(PCApply(ksp->pc, m->r, m->u));
  else PetscCall(KSP_PCApply(ksp, m->r, m->u));
  PetscCall(KSP_MatMult(ksp, LeanOperator(ksp), m->u, m->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode iterate(KSP ksp, LeanCG *m)
{
  PetscFunctionBeginUser;
  for (PetscBool first = PETSC_TRUE; !ksp->reason; first = PETSC_FALSE) {
    PetscReal dot[NDOTS];

    PetscCall(precondition(ksp, m));
    PetscCall(take_dots(ksp, m, first, dot));
    KSPCheckDot(ksp, dot[RU]);
    if (ksp->normtype == KSP_NORM_PRECONDITIONED)
      PetscCall(check_convergence(ksp, PetscSqrtReal(PetscMax(0, dot[UU] - PetscSqr(dot[CU])))));
    if (ksp->normtype == KSP_NORM_NATURAL) PetscCall(check_convergence(ksp, PetscSqrtReal(PetscAbsReal(dot[RU]))));
    if (ksp->reason) break;
    if (ksp->its >= ksp->max_it) {
      ksp->reason = KSP_DIVERGED_ITS;
      break;
    }
    PetscCall(extend(ksp, m, first, dot));
    if (ksp->reason) break;
    ksp->its++;
    if (ksp->normtype == KSP_NORM_UNPRECONDITIONED)
      PetscCall(check_convergence(ksp, PetscSqrtReal(PetscMax(0, m->rr))));
    if (ksp->normtype == KSP_NORM_NONE) PetscCall(check_convergence(ksp, 0));
    if (!ksp->reason && ksp->its >= ksp->max_it &&
        (ksp->normtype == KSP_NORM_UNPRECONDITIONED || ksp->normtype == KSP_NORM_NONE))
      ksp->reason = KSP_DIVERGED_ITS;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The vector of a null space that is one vector */
static PetscErrorCode find_constant(KSP ksp, LeanCG *m)
{
  MatNullSpace space;
  PetscBool    ones;
  PetscInt     n;
  const Vec   *vec;

  PetscFunctionBeginUser;
  m->constant = NULL;
  PetscCall(MatGetNullSpace(LeanOperator(ksp), &space));
  if (!space) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatNullSpaceGetVecs(space, &ones, &n, &vec));
  if (!ones && n == 1) m->constant = vec[0];
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode solve(KSP ksp)
{
  LeanCG   *m    = (LeanCG *)ksp->data;
  PetscReal norm = 0;

  PetscFunctionBeginUser;
  m->r = ksp->work[0];
  m->u = ksp->work[1];
  m->w = ksp->work[2];
  m->p = ksp->work[3];
  m->s = ksp->work[4];
  PetscCall(find_constant(ksp, m));
  ksp->its = 0;
  if (ksp->guess_zero) PetscCall(VecCopy(ksp->vec_rhs, m->r));
  else {
    PetscCall(KSP_MatMult(ksp, LeanOperator(ksp), ksp->vec_sol, m->r));
    PetscCall(VecAYPX(m->r, -1, ksp->vec_rhs));
  }
  if (ksp->normtype == KSP_NORM_UNPRECONDITIONED) {
    PetscCall(VecNorm(m->r, NORM_2, &norm));
    m->rr = m->exact = norm * norm;
    PetscCall(check_convergence(ksp, norm));
    if (!ksp->reason && norm == 0) ksp->reason = KSP_CONVERGED_ATOL;
  }
  m->cx = 0;
  PetscCall(iterate(ksp, m));
  if (m->constant && m->cx != 0) PetscCall(VecAXPY(ksp->vec_sol, -m->cx, m->constant));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_up(KSP ksp)
{
  PetscFunctionBeginUser;
  PetscCall(KSPSetWorkVecs(ksp, 5));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanCreateCG(KSP ksp)
{
  LeanCG *m;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&m));
  ksp->data               = m;
  ksp->ops->setup         = set_up;
  ksp->ops->solve         = solve;
  ksp->ops->destroy       = KSPDestroyDefault;
  ksp->ops->buildsolution = KSPBuildSolutionDefault;
  ksp->ops->buildresidual = KSPBuildResidualDefault;
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_PRECONDITIONED, PC_LEFT, 3));
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_UNPRECONDITIONED, PC_LEFT, 2));
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_NATURAL, PC_LEFT, 2));
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_NONE, PC_LEFT, 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}
