/* Lean GMRES: see lean.h. */
#include "compat.h"
#include "leanimpl.h"
#include "leanbasis.h"

#define RESTART 60
#define KEPT    3 /* see Lean.kept; more are dearer to hold than one more application of the preconditioner */

typedef struct {
  PetscBool  flexible, alone, apart; /* on one rank; norms by reductions of their own */
  PetscBool  single;                 /* see LeanSetPrecision */
  PetscBool  zero;                   /* the iterate so far is zero: ksp->vec_sol is free to work with */
  PetscInt   restart, n, capacity;   /* columns of this cycle; room for them */
  PetscInt   max_columns, tail;      /* columns of the solve before; own entries in another unit, at the end */
  PetscInt   kept;                   /* not flexible: preconditioned vectors are kept as long as there are no more */
  LeanBasis  v, z;                   /* Krylov vectors; preconditioned ones */
  Vec        w, t;                   /* to work with: the newest Krylov vector; what the preconditioner makes of it */
  PetscReal *h, *c, *s, *g;          /* R column by column, of column j j + 1 entries; rotations; Q^T r0 */
  PetscReal *now, *before;           /* coefficients of the last two iterates */
  PetscReal *work, *again;           /* a column; what a second orthogonalisation takes */
  PetscReal  loss;                   /* what Krylov vectors lack of being orthogonal, at most, see orthogonalise() */
} Lean;

static PetscReal *column_of(Lean *m, PetscInt j)
{
  return m->h + j * (j + 1) / 2;
}

/* Vector i of a basis = w; w = that vector as it is kept */
static PetscErrorCode put_vector(LeanBasis *b, PetscInt i, Vec w)
{
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(w, &a));
  PetscCall(LeanBasisPut(b, i, a));
  PetscCall(VecRestoreArray(w, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y += sum_j c[j] (vector j), j < n */
static PetscErrorCode add(const LeanBasis *b, PetscInt n, const PetscReal c[], Vec y)
{
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(y, &a));
  LeanBasisAdd(b, n, c, 0, b->length, a);
  PetscCall(VecRestoreArray(y, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reserve_column(Lean *m, PetscInt j)
{
  PetscInt capacity;

  PetscFunctionBeginUser;
  if (j < m->capacity) PetscFunctionReturn(PETSC_SUCCESS);
  capacity = m->capacity = PetscMin(m->restart, 2 * j + 8);
  PetscCall(PetscRealloc((size_t)(capacity * (capacity + 1) / 2) * sizeof(PetscReal), &m->h));
  PetscCall(PetscRealloc((size_t)capacity * sizeof(PetscReal), &m->c));
  PetscCall(PetscRealloc((size_t)capacity * sizeof(PetscReal), &m->s));
  PetscCall(PetscRealloc((size_t)(capacity + 1) * sizeof(PetscReal), &m->g));
  PetscCall(PetscRealloc((size_t)capacity * sizeof(PetscReal), &m->now));
  PetscCall(PetscRealloc((size_t)capacity * sizeof(PetscReal), &m->before));
  PetscCall(PetscRealloc((size_t)(capacity + 2) * sizeof(PetscReal), &m->work));
  PetscCall(PetscRealloc((size_t)(capacity + 2) * sizeof(PetscReal), &m->again));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y: coefficients of the iterate after n columns */
static void solve_triangle(Lean *m, PetscInt n, PetscReal y[])
{
  for (PetscInt k = n; k-- > 0;) {
    PetscReal sum = m->g[k];

    for (PetscInt j = k + 1; j < n; j++) sum -= column_of(m, j)[k] * y[j];
    y[k] = sum / column_of(m, k)[k];
  }
}

#define MIN_LEFT    1e-2 /* of a square, from which it may be a difference of squares: 14 digits stay */
#define SINGLE_EPS  6e-8 /* what rounding to single precision loses of it */
#define MAX_LOSS    1e-3 /* orthogonal enough: residuals are estimated to that, and no iteration is lost */
#define MIN_RTOL    1e-6 /* a tighter tolerance wants them all */
#define SINGLE_RTOL 1e-5 /* Krylov vectors in single precision do: a residual is wrong by 1e-7 of the first */

/* dot[j] = products of w with the first n Krylov vectors, dot[n] = that with itself; w -= what lies along them */
static PetscErrorCode project_out(KSP ksp, Lean *m, PetscInt n, PetscReal dot[])
{
  const PetscReal *w;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(m->w, &w));
  LeanBasisDot(&m->v, n, w, dot);
  PetscCall(VecRestoreArrayRead(m->w, &w));
  PetscCall(
    MPIU_Allreduce(MPI_IN_PLACE, dot, (PetscMPIInt)n + 1, MPIU_REAL, MPIU_SUM, PetscObjectComm((PetscObject)ksp)));
  for (PetscInt i = 0; i < n; i++) dot[i] = -dot[i];
  PetscCall(add(&m->v, n, dot, m->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of what project_out() found: square of the norm that is left; is it more than that share of what was there? */
static PetscBool exceeds_fraction(PetscInt n, const PetscReal dot[], PetscReal fraction, PetscReal *left)
{
  *left = dot[n];
  for (PetscInt i = 0; i < n; i++) *left -= PetscSqr(dot[i]);
  return (PetscBool)(*left > fraction * dot[n]);
}

/* w orthogonal to the first n Krylov vectors, its products with these, less, and its norm. On several ranks in one
   reduction, unless little of w is left, as it is behind a good preconditioner. What the vectors so far lack of being
   orthogonal grows with the share of w that goes; vectors in single precision want it twice before that spoils the
   minimum (once throughout, the residual stops to fall at 1e-4). */
static PetscErrorCode orthogonalise(KSP ksp, Lean *m, PetscInt n, PetscReal h[], PetscReal *norm)
{
  PetscReal left, loss;
  PetscBool converged;

  PetscFunctionBeginUser;
  PetscCall(project_out(ksp, m, n, h));
  converged = exceeds_fraction(n, h, MIN_LEFT, &left);
  loss      = m->v.single ? SINGLE_EPS + (left > 0 ? m->loss * PetscSqrtReal(h[n] / left) : 1) : 0;
  converged = (PetscBool)(converged &&
                          (!m->v.single || m->loss * h[n] < MAX_LOSS * left)); /* to that, a norm as well */
  if (loss > MAX_LOSS) {
    PetscCall(project_out(ksp, m, n, m->again));
    converged = exceeds_fraction(n, m->again, MIN_LEFT, &left);
    for (PetscInt i = 0; i < n; i++) h[i] += m->again[i];
    loss = SINGLE_EPS;
  }
  m->loss = PetscMax(m->loss, loss);
  if (!m->apart && converged) *norm = PetscSqrtReal(left);
  else PetscCall(VecNorm(m->w, NORM_2, norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The next Krylov vector and column j of R; residual: norm that it leaves */
static PetscErrorCode add_column(KSP ksp, Lean *m, PetscInt j, PetscReal *residual)
{
  PetscReal *h, *r, norm;
  Vec        z = m->flexible && m->zero ? ksp->vec_sol : m->t;

  PetscFunctionBeginUser;
  PetscCall(reserve_column(m, j));
  h = m->work;
  r = column_of(m, j);
  PetscCall(KSP_PCApply(ksp, m->w, z));
  if (m->flexible || j < m->kept) PetscCall(put_vector(&m->z, j, z));
  PetscCall(KSP_MatMult(ksp, LeanOperator(ksp), z, m->w));
  PetscCall(orthogonalise(ksp, m, j + 1, h, &norm));
  for (PetscInt i = 0; i <= j; i++) r[i] = -h[i];
  if (norm > 0) PetscCall(VecScale(m->w, 1 / norm));
  PetscCall(put_vector(&m->v, j + 1, m->w));
  for (PetscInt i = 0; i < j; i++) {
    const PetscReal above = r[i];

    r[i]     = m->c[i] * above + m->s[i] * r[i + 1];
    r[i + 1] = m->c[i] * r[i + 1] - m->s[i] * above;
  }
  h[0]        = PetscSqrtReal(PetscSqr(r[j]) + PetscSqr(norm));
  m->c[j]     = h[0] == 0 ? 1 : r[j] / h[0]; /* not a number stays one */
  m->s[j]     = h[0] == 0 ? 0 : norm / h[0];
  m->g[j + 1] = -m->s[j] * m->g[j];
  m->g[j]     = m->c[j] * m->g[j];
  r[j]        = m->c[j] * r[j] + m->s[j] * norm;
  *residual   = PetscAbsReal(m->g[j + 1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x += what the columns are worth; zero: x is zero */
static PetscErrorCode add_correction(KSP ksp, Lean *m, PetscBool zero, Vec x)
{
  PetscFunctionBeginUser;
  if (zero) PetscCall(VecZeroEntries(x));
  if (m->n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  if (m->flexible || m->n <= m->kept) {
    PetscCall(add(&m->z, m->n, m->now, x));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (m->n == 1) { /* t still holds the preconditioned first vector */
    PetscCall(VecAXPY(x, m->now[0], m->t));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecZeroEntries(m->w));
  PetscCall(add(&m->v, m->n, m->now, m->w));
  PetscCall(KSP_PCApply(ksp, m->w, zero ? x : m->t));
  if (!zero) PetscCall(VecAXPY(x, 1, m->t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One cycle of at most `restart` columns from the residual in w */
static PetscErrorCode cycle(KSP ksp, Lean *m, PetscReal norm)
{
  PetscFunctionBeginUser;
  m->n    = 0;
  m->loss = SINGLE_EPS;
  PetscCall(reserve_column(m, 0));
  m->g[0] = norm;
  PetscCall(VecScale(m->w, 1 / norm));
  PetscCall(put_vector(&m->v, 0, m->w));
  while (!ksp->reason && m->n < m->restart && ksp->its < ksp->max_it) {
    PetscReal residual = 0, *y;

    PetscCall(add_column(ksp, m, m->n, &residual));
    KSPCheckNorm(ksp, residual);
    y               = m->before;
    m->before       = m->now;
    m->now          = y;
    m->before[m->n] = 0;
    m->n++;
    solve_triangle(m, m->n, m->now);
    ksp->its++;
    ksp->rnorm = residual;
    PetscCall(KSPLogResidualHistory(ksp, residual));
    PetscCall(KSPMonitor(ksp, ksp->its, residual));
    PetscCall((*ksp->converged)(ksp, ksp->its, residual, &ksp->reason, ksp->cnvP));
    if (!ksp->reason && residual == 0) ksp->reason = KSP_CONVERGED_ATOL; /* solved, and no further column */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_residual(KSP ksp, Vec r, PetscBool zero, PetscReal *norm)
{
  PetscFunctionBeginUser;
  if (zero) PetscCall(VecCopy(ksp->vec_rhs, r));
  else {
    PetscCall(KSP_MatMult(ksp, LeanOperator(ksp), ksp->vec_sol, r));
    PetscCall(VecAYPX(r, -1, ksp->vec_rhs));
  }
  PetscCall(VecNorm(r, NORM_2, norm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The residual of the last cycle lies along the columns of Q turned back: no product */
static PetscErrorCode build_residual(KSP ksp, Vec t, Vec r, Vec *residual)
{
  Lean      *m = (Lean *)ksp->data;
  PetscReal *q;

  PetscFunctionBeginUser;
  (void)t;
  if (m->n) {
    PetscCall(PetscMalloc1(m->n + 1, &q));
    q[m->n] = m->g[m->n];
    for (PetscInt i = m->n; i-- > 0;) {
      q[i]     = -m->s[i] * q[i + 1];
      q[i + 1] = m->c[i] * q[i + 1];
    }
    PetscCall(VecZeroEntries(r));
    PetscCall(add(&m->v, m->n + 1, q, r));
    PetscCall(PetscFree(q));
  } else PetscCall(VecCopy(m->w, r));
  if (residual) *residual = r;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Vectors to work with, and the precision that the tolerance bears */
static PetscErrorCode prepare(KSP ksp, Lean *m)
{
  PetscInt length;

  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(ksp->vec_rhs, &length));
  m->apart = (PetscBool)(m->alone || ksp->rtol < MIN_RTOL);
  PetscCall(LeanBasisUse(&m->v, (PetscBool)(m->single && ksp->rtol >= SINGLE_RTOL), length, length - m->tail));
  PetscCall(LeanBasisUse(&m->z, m->single, length, length - m->tail));
  m->kept = m->v.single == m->z.single ? KEPT : 0;
  if (m->w == ksp->vec_rhs && !ksp->guess_zero) PetscCall(VecDestroy(&m->w)); /* a start value's residual wants both */
  if (!m->w) PetscCall(VecDuplicate(ksp->vec_rhs, &m->w));
  if (!m->t && !(m->flexible && m->zero)) PetscCall(VecDuplicate(ksp->vec_rhs, &m->t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A first step takes more Krylov vectors than those behind it: what two solves did not need goes */
static PetscErrorCode drop_vectors(Lean *m, PetscInt n)
{
  const PetscInt max_columns = PetscMax(n, m->max_columns);

  PetscFunctionBeginUser;
  m->max_columns = n;
  PetscCall(LeanBasisKeep(&m->v, max_columns + 1));
  PetscCall(LeanBasisKeep(&m->z, max_columns));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The residual to start a cycle from, after another; where the right-hand side is spent, from that cycle's vectors */
static PetscErrorCode start_anew(KSP ksp, Lean *m, PetscReal *norm)
{
  PetscFunctionBeginUser;
  if (m->w == ksp->vec_rhs) {
    PetscCall(build_residual(ksp, NULL, m->w, NULL));
    PetscCall(VecNorm(m->w, NORM_2, norm));
  } else PetscCall(take_residual(ksp, m->w, PETSC_FALSE, norm));
  m->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode iterate(KSP ksp)
{
  Lean     *m = (Lean *)ksp->data;
  PetscReal norm;

  PetscFunctionBeginUser;
  ksp->its = 0;
  m->n     = 0;
  m->zero  = ksp->guess_zero;
  PetscCall(prepare(ksp, m));
  PetscCall(take_residual(ksp, m->w, m->zero, &norm));
  KSPCheckNorm(ksp, norm);
  ksp->rnorm = norm;
  PetscCall(KSPLogResidualHistory(ksp, norm));
  PetscCall(KSPMonitor(ksp, 0, norm));
  PetscCall((*ksp->converged)(ksp, 0, norm, &ksp->reason, ksp->cnvP));
  while (!ksp->reason && norm > 0) {
    PetscCall(cycle(ksp, m, norm));
    if (ksp->reason == KSP_DIVERGED_NANORINF || ksp->reason == KSP_DIVERGED_PC_FAILED) m->n = 0;
    PetscCall(add_correction(ksp, m, m->zero, ksp->vec_sol));
    m->zero = PETSC_FALSE;
    if (!ksp->reason && ksp->its >= ksp->max_it) ksp->reason = KSP_DIVERGED_ITS;
    if (ksp->reason) break;
    PetscCall(prepare(ksp, m));
    PetscCall(start_anew(ksp, m, &norm));
    KSPCheckNorm(ksp, norm);
  }
  if (!ksp->reason) ksp->reason = KSP_CONVERGED_ATOL;
  PetscCall(drop_vectors(m, PetscMin(ksp->its, m->restart)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Later releases of PETSc lock the right-hand side in a solve, which here may be a vector to work with (LeanSetWork) */
static PetscErrorCode solve(KSP ksp)
{
  const Lean *m     = (const Lean *)ksp->data;
  PetscInt    locks = 0;

  PetscFunctionBeginUser;
  if (m->w == ksp->vec_rhs) PetscCall(VecLockGet(ksp->vec_rhs, &locks));
  for (PetscInt i = 0; i < locks; i++) PetscCall(VecLockReadPop(ksp->vec_rhs));
  PetscCall(iterate(ksp));
  for (PetscInt i = 0; i < locks; i++) PetscCall(VecLockReadPush(ksp->vec_rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what others ask ---- */

/* During a solve the iterate, after it the solution */
static PetscErrorCode build_solution(KSP ksp, Vec to, Vec *solution)
{
  Lean *m = (Lean *)ksp->data;

  PetscFunctionBeginUser;
  PetscCheck(to, PetscObjectComm((PetscObject)ksp), PETSC_ERR_SUP, "Give a vector for the iterate");
  if (ksp->reason || !m->zero) PetscCall(VecCopy(ksp->vec_sol, to));
  if (!ksp->reason) PetscCall(add_correction(ksp, m, m->zero, to));
  if (solution) *solution = to;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanGetIterates(KSP ksp, PetscInt begin, PetscInt end, PetscReal now[], PetscReal before[])
{
  Lean            *m = (Lean *)ksp->data;
  const PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(ksp->vec_sol, &a));
  for (PetscInt i = begin; i < end; i++) now[i - begin] = before[i - begin] = m->zero ? 0 : a[i];
  PetscCall(VecRestoreArrayRead(ksp->vec_sol, &a));
  LeanBasisAdd(&m->z, m->n, m->now, begin, end, now);
  LeanBasisAdd(&m->z, m->n, m->before, begin, end, before);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* NULL: not one of ours */
static PetscErrorCode get_lean(KSP ksp, Lean **m)
{
  PetscBool lean;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompareAny((PetscObject)ksp, &lean, LEAN_GMRES, LEAN_FGMRES, ""));
  *m = lean ? (Lean *)ksp->data : NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanSetPrecision(KSP ksp, PetscBool single, PetscInt tail)
{
  Lean *m = NULL;

  PetscFunctionBeginUser;
  PetscCall(get_lean(ksp, &m));
  if (!m) PetscFunctionReturn(PETSC_SUCCESS);
  m->single = single;
  m->tail   = tail;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanSetWork(KSP ksp, Vec w, Vec t)
{
  Lean *m = NULL;

  PetscFunctionBeginUser;
  PetscCall(get_lean(ksp, &m));
  if (!m) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscObjectReference((PetscObject)w));
  PetscCall(VecDestroy(&m->w));
  m->w = w;
  if (!t) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscObjectReference((PetscObject)t));
  PetscCall(VecDestroy(&m->t));
  m->t = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_restart(KSP ksp, PetscInt restart)
{
  PetscFunctionBeginUser;
  PetscCheck(restart >= 1, PetscObjectComm((PetscObject)ksp), PETSC_ERR_USER_INPUT,
             "-%sksp_gmres_restart %" PetscInt_FMT ": give 1 or more",
             ((PetscObject)ksp)->prefix ? ((PetscObject)ksp)->prefix : "", restart);
  ((Lean *)ksp->data)->restart = restart;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(KSP ksp, PetscViewer viewer)
{
  Lean *m = (Lean *)ksp->data;

  PetscFunctionBeginUser;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  restart=%" PetscInt_FMT ", vectors %" PetscInt_FMT "\n", m->restart,
                                   m->v.n + m->z.n + (m->w ? 1 : 0) + (m->t ? 1 : 0)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode set_up(KSP ksp)
{
  PetscInt  restart;
  PetscBool set;

  PetscFunctionBeginUser;
  PetscCall(
    PetscOptionsGetInt(((PetscObject)ksp)->options, ((PetscObject)ksp)->prefix, "-ksp_gmres_restart", &restart, &set));
  if (set) PetscCall(set_restart(ksp, restart));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode reset(KSP ksp)
{
  Lean *m = (Lean *)ksp->data;

  PetscFunctionBeginUser;
  PetscCall(LeanBasisDestroy(&m->v));
  PetscCall(LeanBasisDestroy(&m->z));
  PetscCall(VecDestroy(&m->w));
  PetscCall(VecDestroy(&m->t));
  m->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(KSP ksp)
{
  Lean *m = (Lean *)ksp->data;

  PetscFunctionBeginUser;
  PetscCall(reset(ksp));
  PetscCall(PetscFree(m->h));
  PetscCall(PetscFree(m->c));
  PetscCall(PetscFree(m->s));
  PetscCall(PetscFree(m->g));
  PetscCall(PetscFree(m->now));
  PetscCall(PetscFree(m->before));
  PetscCall(PetscFree(m->work));
  PetscCall(PetscFree(m->again));
  PetscCall(PetscObjectComposeFunction((PetscObject)ksp, "KSPGMRESSetRestart_C", NULL));
  PetscCall(KSPDestroyDefault(ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_lean(KSP ksp, PetscBool flexible)
{
  Lean       *m;
  PetscMPIInt size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(PetscObjectComm((PetscObject)ksp), &size));
  PetscCall(PetscNew(&m));
  m->alone                = (PetscBool)(size == 1);
  m->flexible             = flexible;
  m->single               = PETSC_TRUE;
  m->restart              = RESTART;
  ksp->data               = m;
  ksp->ops->setup         = set_up;
  ksp->ops->solve         = solve;
  ksp->ops->reset         = reset;
  ksp->ops->destroy       = destroy;
  ksp->ops->view          = view;
  ksp->ops->buildsolution = build_solution;
  ksp->ops->buildresidual = build_residual;
  PetscCall(KSPSetSupportedNorm(ksp, KSP_NORM_UNPRECONDITIONED, PC_RIGHT, 3));
  PetscCall(PetscObjectComposeFunction((PetscObject)ksp, "KSPGMRESSetRestart_C", set_restart));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_flexible(KSP ksp)
{
  PetscFunctionBeginUser;
  PetscCall(create_lean(ksp, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_fixed(KSP ksp)
{
  PetscFunctionBeginUser;
  PetscCall(create_lean(ksp, PETSC_FALSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LeanRegister(void)
{
  PetscFunctionBeginUser;
  PetscCall(KSPRegister(LEAN_FGMRES, create_flexible));
  PetscCall(KSPRegister(LEAN_GMRES, create_fixed));
  PetscCall(KSPRegister(LEAN_CG, LeanCreateCG));
  PetscFunctionReturn(PETSC_SUCCESS);
}
