/* Lean Krylov methods against PETSc's: the same iterates and iterations, fewer vectors, and what they tell of
   themselves */
#include "core.h"
#include "lean.h"

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

static KSP solve(const char type[], PCSide side, KSPNormType norm, PetscInt restart, PetscReal rtol, Mat A, Vec b, Vec x)
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
static void compare(const char lean[], const char petsc[], PCSide side, KSPNormType norm, PetscReal flow, PetscBool singular, PetscInt restart,
                    PetscReal rtol)
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

/* Residual and iterates from coefficients, and vectors that are lent */
static void test_what_is_told(void **state)
{
  Mat              A = create_matrix(0.3, PETSC_FALSE);
  Vec              b = create_rhs(A, PETSC_FALSE), x, r, t, told, base, work[2];
  const Vec       *z;
  const PetscReal *now, *before;
  PetscBool        lean;
  PetscInt         n;
  PetscReal        size, error;
  KSP              ksp;

  (void)state;
  OK(VecDuplicate(b, &x));
  OK(VecDuplicate(b, &r));
  OK(VecDuplicate(b, &t));
  ksp = solve(LEAN_GMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 60, 1e-2, A, b, x);
  OK(KSPBuildResidual(ksp, t, r, &told));
  OK(VecNorm(told, NORM_2, &size));
  OK(MatMult(A, x, t));
  OK(VecAYPX(t, -1, b));
  OK(VecAXPY(t, -1, told));
  OK(VecNorm(t, NORM_2, &error));
  assert_true(size > 0);
  BELOW(error, 1e-12 * size / 1e-2);
  OK(LeanBorrow(ksp, 2, &lean, work));
  assert_true(lean && work[0] != work[1]);
  OK(VecSet(work[1], NAN)); /* the next solve does not care */
  OK(KSPSolve(ksp, b, r));
  OK(VecAXPY(r, -1, x));
  OK(VecNorm(r, NORM_2, &error));
  BELOW(error, 1e-14);
  OK(KSPDestroy(&ksp));
  ksp = solve(LEAN_FGMRES, PC_RIGHT, KSP_NORM_UNPRECONDITIONED, 60, 1e-6, A, b, x);
  OK(LeanGetIterates(ksp, &lean, &base, &n, &z, &now, &before));
  assert_true(lean && n > 2 && base == x);
  OK(VecZeroEntries(t));
  OK(VecMAXPY(t, n, now, (Vec *)z)); /* the whole correction, which started from zero */
  OK(VecAXPY(t, -1, x));
  OK(VecNorm(t, NORM_2, &error));
  BELOW(error, 1e-13);
  assert_true(before[n - 1] == 0 && before[0] != now[0]);
  OK(KSPDestroy(&ksp));
  OK(VecDestroy(&x));
  OK(VecDestroy(&r));
  OK(VecDestroy(&t));
  OK(VecDestroy(&b));
  OK(MatDestroy(&A));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_gmres), cmocka_unit_test(test_cg), cmocka_unit_test(test_what_is_told)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("lean", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
