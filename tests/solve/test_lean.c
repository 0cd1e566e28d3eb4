/* Lean Krylov methods against PETSc's: the same iterates and iterations, fewer vectors, and what they tell of
   themselves */
#include "core.h"
#include "krylov/lean.h"

#define N 60 /* rows of all ranks */

/* Convection and diffusion on a line, or (flow 0) the singular Laplacian with its null space */
static Mat create_matrix(PetscReal flow, PetscBool singular)
{
  Mat      A;
  PetscInt begin, end;

  OK(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, N, N, 3, NULL, 3, NULL, &A));
  OK(MatGetOwnershipRange(A, &begin, &end));
  for (PetscInt i = begin; i < end; i++) {
    const PetscReal more = singular ? 0 : 0.05 * (1 + i % 7);

    if (i > 0) OK(MatSetValue(A, i, i - 1, -1 - flow, INSERT_VALUES));
    if (i < N - 1) OK(MatSetValue(A, i, i + 1, -1 + flow, INSERT_VALUES));
    OK(MatSetValue(A, i, i, (i > 0) + (i < N - 1) + more, INSERT_VALUES));
  }
  OK(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  if (singular) {
    MatNullSpace space;
    Vec          one;

    OK(MatCreateVecs(A, &one, NULL));
    OK(VecSet(one, 1));
    OK(VecNormalize(one, NULL));
    OK(MatNullSpaceCreate(PETSC_COMM_WORLD, PETSC_FALSE, 1, &one, &space));
    OK(MatSetNullSpace(A, space));
    OK(MatNullSpaceDestroy(&space));
    OK(VecDestroy(&one));
  }
  return A;
}

static Vec create_rhs(Mat A, PetscBool singular)
{
  PetscInt   begin, end;
  PetscReal *a;
  Vec        b;

  OK(MatCreateVecs(A, &b, NULL));
  OK(VecGetOwnershipRange(b, &begin, &end));
  OK(VecGetArray(b, &a));
  for (PetscInt i = begin; i < end; i++) a[i - begin] = PetscSinReal(1.7 * (PetscReal)i) + 0.2 * (PetscReal)(i % 5);
  OK(VecRestoreArray(b, &a));
  if (singular) {
    PetscReal sum;

    OK(VecSum(b, &sum));
    OK(VecShift(b, -sum / N));
  }
  return b;
}

static KSP solve(const char type[], PCSide side, KSPNormType norm, PetscInt restart, PetscReal rtol, Mat A, Vec b,
                 Vec x)
{
  KSP ksp;
  PC  pc;

  OK(LeanRegister());
  OK(KSPCreate(PETSC_COMM_WORLD, &ksp));
  OK(KSPSetType(ksp, type));
  OK(KSPGetPC(ksp, &pc));
  OK(PCSetType(pc, PCJACOBI));
  OK(KSPSetPCSide(ksp, side));
  OK(KSPSetNormType(ksp, norm));
  OK(KSPGMRESSetRestart(ksp, restart));
  OK(KSPSetTolerances(ksp, rtol, 1e-50, 1e5, 400));
  OK(KSPSetOperators(ksp, A, A));
  OK(KSPSolve(ksp, b, x));
  return ksp;
}

/* The same number of iterations and answer as PETSc's; restart 7 starts anew more than once */
static void compare(const char lean[], const char petsc[], PCSide side, KSPNormType norm, PetscReal flow,
                    PetscBool singular, PetscInt restart, PetscReal rtol)
{
  Mat                A = create_matrix(flow, singular);
  Vec                b = create_rhs(A, singular), x, y;
  KSP                ksp[2];
  KSPConvergedReason reason[2];
  PetscInt           its[2];
  PetscReal          size, error;

  OK(VecDuplicate(b, &x));
  OK(VecDuplicate(b, &y));
  ksp[0] = solve(petsc, side, norm, restart, rtol, A, b, x);
  ksp[1] = solve(lean, side, norm, restart, rtol, A, b, y);
  for (PetscInt i = 0; i < 2; i++) {
    OK(KSPGetIterationNumber(ksp[i], &its[i]));
    OK(KSPGetConvergedReason(ksp[i], &reason[i]));
    assert_int_equal(reason[i], KSP_CONVERGED_RTOL);
  }
  assert_in_range(its[1], its[0] - 1, its[0] + 1);
  OK(VecNorm(x, NORM_2, &size));
  OK(VecAXPY(y, -1, x));
  OK(VecNorm(y, NORM_2, &error));
  BELOW(error, PetscMax(1e-9, 10 * rtol) * size);
  for (PetscInt i = 0; i < 2; i++) OK(KSPDestroy(&ksp[i]));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
  OK(VecDestroy(&b));
  OK(MatDestroy(&A));
}

static void test_gmres(void **state)
{
  (void)state;
  compare(LEAN_FGMRES, KSPFGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 0.3, PETSC_FALSE, 60, 1e-12);
  compare(LEAN_GMRES, KSPGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 0.3, PETSC_FALSE, 60, 1e-11);
  compare(LEAN_FGMRES, KSPFGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 0.3, PETSC_FALSE, 60, 1.001e-5);
  compare(LEAN_GMRES, KSPGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 0.3, PETSC_FALSE, 60, 1.001e-5);
  compare(LEAN_FGMRES, KSPFGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 0.6, PETSC_FALSE, 25, 1e-3);
  compare(LEAN_GMRES, KSPGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 0.6, PETSC_FALSE, 25, 1e-3);
}

static void test_cg(void **state)
{
  const KSPNormType norms[] = {KSP_NORM_UNPRECONDITIONED, KSP_NORM_PRECONDITIONED, KSP_NORM_NATURAL};

  (void)state;
  for (PetscInt i = 0; i < 3; i++)
    for (PetscInt singular = 0; singular < 2; singular++) {
      compare(LEAN_CG, KSPCG, PC_LEFT, norms[i], 0, (PetscBool)singular, 30, 1e-2);
      compare(LEAN_CG, KSPCG, PC_LEFT, norms[i], 0, (PetscBool)singular, 30, 1e-9);
    }
}

/* The residual of a solve from its coefficients, with Krylov vectors in single precision or not; work vectors lent to
   it may hold anything before */
static void test_residual(void **state)
{
  const PetscReal rtol[] = {1e-2, 1e-7};
  Mat             A      = create_matrix(0.3, PETSC_FALSE);
  Vec             b      = create_rhs(A, PETSC_FALSE), x, r, t, told, work[2];
  PetscReal       whole, size, error;
  KSP             ksp;

  (void)state;
  OK(VecDuplicate(b, &x));
  OK(VecDuplicate(b, &r));
  OK(VecDuplicate(b, &t));
  for (PetscInt i = 0; i < 2; i++) OK(VecDuplicate(b, &work[i]));
  OK(VecNorm(b, NORM_2, &whole));
  for (PetscInt i = 0; i < 2; i++) {
    ksp = solve(LEAN_GMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 60, rtol[i], A, b, x);
    OK(KSPBuildResidual(ksp, t, r, &told));
    OK(VecNorm(told, NORM_2, &size));
    assert_true(size > 1e-2 * rtol[i] * whole);
    BELOW(size, rtol[i] * whole);
    OK(MatMult(A, x, t));
    OK(VecAYPX(t, -1, b));
    OK(VecAXPY(t, -1, told));
    OK(VecNorm(t, NORM_2, &error));
    BELOW(error, (i ? 1e-13 : 1e-6) * whole);
    for (PetscInt j = 0; j < 2; j++) OK(VecSet(work[j], NAN));
    OK(LeanSetWork(ksp, work[0], work[1]));
    OK(KSPSolve(ksp, b, r));
    OK(VecAXPY(r, -1, x));
    OK(VecNorm(r, NORM_2, &error));
    BELOW(error, 1e-14);
    OK(KSPDestroy(&ksp));
  }
  for (PetscInt i = 0; i < 2; i++) OK(VecDestroy(&work[i]));
  OK(VecDestroy(&x));
  OK(VecDestroy(&r));
  OK(VecDestroy(&t));
  OK(VecDestroy(&b));
  OK(MatDestroy(&A));
}

typedef struct {
  Vec       last, now; /* iterates as KSPBuildSolution has them */
  PetscInt  asked;
  PetscReal error; /* largest difference to what LeanGetIterates says */
} Asked;

/* Both ways to ask for the iterate, and the one before; stops after 1e-6 */
static PetscErrorCode ask(KSP ksp, PetscInt it, PetscReal norm, KSPConvergedReason *reason, void *ctx)
{
  Asked           *s = (Asked *)ctx;
  const PetscReal *a, *b;
  PetscReal        now[N], before[N];
  PetscInt         n;

  PetscFunctionBeginUser;
  *reason = KSP_CONVERGED_ITERATING;
  if (it == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPBuildSolution(ksp, s->now, NULL));
  PetscCall(VecGetLocalSize(s->now, &n));
  PetscCall(LeanGetIterates(ksp, 0, n, now, before));
  PetscCall(VecGetArrayRead(s->now, &a));
  PetscCall(VecGetArrayRead(s->last, &b));
  for (PetscInt i = 0; i < n; i++)
    s->error = PetscMax(s->error, PetscMax(PetscAbsReal(now[i] - a[i]), PetscAbsReal(before[i] - b[i])));
  PetscCall(VecRestoreArrayRead(s->last, &b));
  PetscCall(VecRestoreArrayRead(s->now, &a));
  PetscCall(VecCopy(s->now, s->last));
  s->asked++;
  if (norm < 1e-6) *reason = KSP_CONVERGED_RTOL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Iterates during a solve, from zero and from a start value, over restarts, and with a right-hand side that is spent */
static void test_iterates(void **state)
{
  Mat       A = create_matrix(0.3, PETSC_FALSE);
  Vec       b = create_rhs(A, PETSC_FALSE), x, rhs;
  PetscReal size, error;
  KSP       ksp;
  Asked     s;

  (void)state;
  OK(VecDuplicate(b, &x));
  OK(VecDuplicate(b, &rhs));
  OK(VecDuplicate(b, &s.last));
  OK(VecDuplicate(b, &s.now));
  for (PetscInt n = 0; n < 4; n++) {
    const PetscInt i = n % 2;

    ksp = solve(LEAN_FGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 25, 0.5, A, b, x);
    OK(KSPSetInitialGuessNonzero(ksp, (PetscBool)i));
    OK(KSPSetConvergenceTest(ksp, ask, &s, NULL));
    s.asked = 0;
    s.error = 0;
    if (i) OK(VecSet(x, 1));
    OK(VecSet(s.last, (PetscReal)i));
    OK(VecCopy(b, rhs));
    if (n / 2) OK(LeanSetWork(ksp, rhs, NULL));
    OK(KSPSolve(ksp, rhs, x));
    assert_true(s.asked > 25);
    BELOW(s.error, 1e-14);
    OK(VecAXPY(s.last, -1, x));
    OK(VecNorm(s.last, NORM_2, &error));
    BELOW(error, 1e-14);
    OK(MatMult(A, x, s.now));
    OK(VecAXPY(s.now, -1, b));
    OK(VecNorm(s.now, NORM_2, &size));
    BELOW(size, 2e-6); /* Krylov vectors in single precision */
    OK(KSPDestroy(&ksp));
  }
  OK(VecDestroy(&rhs));
  OK(VecDestroy(&s.now));
  OK(VecDestroy(&s.last));
  OK(VecDestroy(&x));
  OK(VecDestroy(&b));
  OK(MatDestroy(&A));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_gmres), cmocka_unit_test(test_cg),
                                     cmocka_unit_test(test_residual), cmocka_unit_test(test_iterates)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("lean", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
