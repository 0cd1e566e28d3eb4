/* VCycle: hypre's own cycle on one rank, on several a preconditioner as good; symmetric, in any unit, with a finest
   matrix that has changed. */
/* ranks: 1 2 3 */
#include "cgcount.h"
#include "core.h"
#include "pressure/vcycle.h"

#define N 300 /* N x N unknowns: more on the second level than all ranks hold */

/* Five-point operator times unit; rows whose number is a multiple of 97 are `grown` times as large on the diagonal */
static Mat operator_of(PetscReal unit, PetscReal grown)
{
  PetscInt first, last;
  Mat      A;

  OK(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, N * N, N * N, 5, NULL, 5, NULL, &A));
  OK(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt r = first; r < last; r++) {
    const PetscInt i = r % N, j = r / N;

    if (i > 0) OK(MatSetValue(A, r, r - 1, -unit, INSERT_VALUES));
    if (i < N - 1) OK(MatSetValue(A, r, r + 1, -unit, INSERT_VALUES));
    if (j > 0) OK(MatSetValue(A, r, r - N, -unit, INSERT_VALUES));
    if (j < N - 1) OK(MatSetValue(A, r, r + N, -unit, INSERT_VALUES));
    OK(MatSetValue(A, r, r, (r % 97 ? 4 : 4 * grown) * unit, INSERT_VALUES));
  }
  OK(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  return A;
}

static PC hypre_of(Mat A)
{
  PC pc;

  OK(PCCreate(PETSC_COMM_WORLD, &pc));
  OK(PCSetOptionsPrefix(pc, "vtest_"));
  OK(PCSetOperators(pc, A, A));
  OK(PCSetFromOptions(pc));
  OK(PCSetUp(pc));
  return pc;
}

static PetscErrorCode apply(PC pc, Vec b, Vec x)
{
  VCycle s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(VCycleApply(s, b, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Iterations of CG to a residual of 1e-8 */
static PetscInt iterations(Mat A, PC pc)
{
  return count_iterations(A, pc, PETSC_TRUE, 1e-8, 100);
}

static PC shell_of(Mat A, VCycle s)
{
  PC pc;

  OK(PCCreate(PETSC_COMM_WORLD, &pc));
  OK(PCSetType(pc, PCSHELL));
  OK(PCSetOperators(pc, A, A));
  OK(PCShellSetContext(pc, s));
  OK(PCShellSetApply(pc, apply));
  return pc;
}

/* (size of a - b) / size of b */
static PetscReal difference(Vec a, Vec b)
{
  PetscReal size, apart;

  OK(VecNorm(b, NORM_2, &size));
  OK(VecAXPY(a, -1, b));
  OK(VecNorm(a, NORM_2, &apart));
  return apart / size;
}

static void test_as_hypre(void **state)
{
  Mat         A = operator_of(1, 1), B = operator_of(1e-60, 1);
  PC          hypre[2] = {hypre_of(A), hypre_of(A)}, tiny = hypre_of(B), shell;
  VCycle      s, t;
  Vec         b, x[3];
  PetscInt    levels, held, its, own;
  PetscBool   fits;
  PetscMPIInt size;

  (void)state;
  OK(VCycleFits(hypre[0], &fits));
  assert_true(fits);
  OK(VCycleCreate(hypre[0], A, &s));
  OK(VCycleCreate(tiny, B, &t));
  OK(VCycleGetLevels(s, &levels, &held));
  assert_true(held >= 2 && levels >= held + 2); /* one between the finest and those that all hold */
  OK(MatCreateVecs(A, &b, &x[0]));
  for (int k = 1; k < 3; k++) OK(VecDuplicate(x[0], &x[k]));
  fill_noise_vec(2, b);
  OK(PCApply(hypre[1], b, x[0]));
  OK(VCycleApply(s, b, x[1]));
  OK(VecScale(b, 1e-60));
  OK(VCycleApply(t, b, x[2]));
  BELOW(difference(x[2], x[1]), 1e-6); /* no number leaves single precision */
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  if (size == 1) BELOW(difference(x[1], x[0]), 1e-6);
  shell = shell_of(A, s);
  its   = iterations(A, hypre[1]);
  own   = iterations(A, shell);
  print_message("iterations: hypre's cycle %d, ours %d; %d levels, %d held by all\n", (int)its, (int)own, (int)levels,
                (int)held);
  assert_true(own <= its + 1);
  OK(VCycleDestroy(&s));
  OK(VCycleDestroy(&t));
  OK(PCDestroy(&shell));
  for (int k = 0; k < 2; k++) OK(PCDestroy(&hypre[k]));
  OK(PCDestroy(&tiny));
  OK(MatDestroy(&A));
  OK(MatDestroy(&B));
  OK(VecDestroy(&b));
  for (int k = 0; k < 3; k++) OK(VecDestroy(&x[k]));
}

/* One row in 97 has grown a thousandfold: the levels below take it with D, and without overshoot */
static void test_changed(void **state)
{
  Mat       A = operator_of(1, 1), B = operator_of(1, 1000);
  PC        hypre = hypre_of(A), fresh = hypre_of(B), shell;
  PetscInt  kept, anew, over;
  VCycle    s;
  Vec       d[2], x, y, Mx, My;
  PetscReal xMy, yMx, xMx;

  (void)state;
  OK(VCycleCreate(hypre, A, &s));
  OK(MatCreateVecs(A, &d[0], &d[1]));
  OK(MatGetDiagonal(A, d[0]));
  OK(MatGetDiagonal(B, d[1]));
  OK(VecPointwiseDivide(d[0], d[0], d[1]));
  OK(VecSqrtAbs(d[0]));
  OK(VCycleSetMatrix(s, B, d[0]));
  OK(VecDuplicate(d[0], &x));
  OK(VecDuplicate(x, &y));
  OK(VecDuplicate(x, &Mx));
  OK(VecDuplicate(x, &My));
  fill_noise_vec(3, x);
  fill_noise_vec(4, y);
  OK(VCycleApply(s, x, Mx));
  OK(VCycleApply(s, y, My));
  OK(VecDot(x, My, &xMy));
  OK(VecDot(y, Mx, &yMx));
  OK(VecDot(x, Mx, &xMx));
  assert_true(xMx > 0);
  BELOW(PetscAbsReal(xMy - yMx), 1e-5 * xMx);
  shell = shell_of(B, s);
  kept  = iterations(B, shell);
  anew  = iterations(B, fresh);
  OK(VCycleSetMatrix(s, B, NULL));
  over = iterations(B, shell);
  print_message("iterations: levels of before %d, without D %d, new ones %d\n", (int)kept, (int)over, (int)anew);
  assert_true(kept < over && kept <= 8 * anew);
  OK(VCycleSetMatrix(s, A, NULL)); /* and back */
  OK(PCSetOperators(shell, A, A));
  assert_true(iterations(A, shell) <= 10);
  OK(PCDestroy(&fresh));
  OK(PCDestroy(&shell));
  OK(PCDestroy(&hypre));
  OK(VCycleDestroy(&s));
  OK(MatDestroy(&A));
  OK(MatDestroy(&B));
  for (int k = 0; k < 2; k++) OK(VecDestroy(&d[k]));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
  OK(VecDestroy(&Mx));
  OK(VecDestroy(&My));
}

int main(int argc, char **argv)
{
  static const char
    *const                OPTIONS = "-vtest_pc_type hypre -vtest_pc_hypre_boomeramg_relax_type_down l1-Gauss-Seidel "
                                    "-vtest_pc_hypre_boomeramg_relax_type_up backward-l1-Gauss-Seidel "
                                    "-vtest_pc_hypre_boomeramg_relax_type_coarse symmetric-SOR/Jacobi -vtest_pc_hypre_boomeramg_no_CF "
                                    "-vtest_pc_hypre_boomeramg_coarsen_type PMIS -vtest_pc_hypre_boomeramg_interp_type ext+i";
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_as_hypre), cmocka_unit_test(test_changed)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCall(PetscOptionsInsertString(NULL, OPTIONS));
  failed = cmocka_run_group_tests_name("vcycle", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
