/* Lagged: a Laplace operator with patches of low weight that move, preconditioned by the solver of the matrix before:
   iterations, symmetry, when it is set up again. */
/* ranks: 1 2 3 */
#include "cgcount.h"
#include "core.h"
#include "pressure/lagged.h"

#define N 40 /* N x N unknowns */

static PetscReal weight(PetscInt i, PetscInt j, PetscInt shift)
{
  return (i + shift) % 10 < 4 && j % 10 < 4 ? 1e-4 : 1;
}

/* Five-point operator, an edge has the smaller of its ends' weights; patches shifted by `shift` in rows below `upto` */
static Mat operator_of(PetscInt shift, PetscInt upto)
{
  const PetscInt step[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
  PetscInt       first, last;
  Mat            A;

  OK(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, N * N, N * N, 5, NULL, 5, NULL, &A));
  OK(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt r = first; r < last; r++) {
    const PetscInt i = r % N, j = r / N;
    PetscReal      sum = 0;

    for (int k = 0; k < 4; k++) {
      const PetscInt  ni = i + step[k][0], nj = j + step[k][1], c = nj * N + ni;
      const PetscReal w = PetscMin(weight(i, j, j < upto ? shift : 0), weight(ni, nj, nj < upto ? shift : 0));

      sum += w;
      if (ni < 0 || nj < 0 || ni >= N || nj >= N) continue;
      OK(MatSetValue(A, r, c, -w, INSERT_VALUES));
    }
    OK(MatSetValue(A, r, r, sum, INSERT_VALUES));
  }
  OK(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  return A;
}

/* The matrix becomes another one, of which the preconditioner is told */
static void change(Mat *A, PC pc, PetscInt shift, PetscInt upto)
{
  OK(MatDestroy(A));
  *A = operator_of(shift, upto);
  OK(LaggedUpdate(pc, *A));
}

static void create(Mat *A, PC *pc, PetscReal keep)
{
  OK(PetscOptionsSetValue(NULL, "-lagtest_pc_type", "redundant"));
  *A = operator_of(0, 0);
  OK(PCCreate(PETSC_COMM_WORLD, pc));
  OK(PCSetOptionsPrefix(*pc, "lagtest_"));
  OK(PCSetOperators(*pc, *A, *A));
  OK(LaggedCreate(*pc, keep));
  OK(LaggedUpdate(*pc, *A));
}

static Vec filled(Mat A, PetscInt seed)
{
  Vec v;

  OK(MatCreateVecs(A, &v, NULL));
  fill_noise_vec(seed, v);
  return v;
}

/* Iterations of CG with the preconditioner to a residual of 1e-6 */
static PetscInt iterations(Mat A, PC pc, PetscBool reuse)
{
  return count_iterations(A, pc, reuse, 1e-6, 200);
}

static void test_iterations(void **state)
{
  Mat      A;
  PC       pc, old;
  PetscInt with, without;

  (void)state;
  create(&A, &pc, 0.9);
  assert_int_equal(iterations(A, pc, PETSC_FALSE), 1); /* nothing has changed: the solver alone, which is exact */
  OK(PCCreate(PETSC_COMM_WORLD, &old));
  OK(PCSetType(old, PCREDUNDANT));
  OK(PCSetOperators(old, A, A));
  OK(PCSetUp(old));
  OK(PCSetReusePreconditioner(old, PETSC_TRUE));
  change(&A, pc, 1, N);
  with    = iterations(A, pc, PETSC_FALSE);
  without = iterations(A, old, PETSC_TRUE);
  print_message("iterations %d, without correction %d\n", (int)with, (int)without);
  assert_true(with > 1); /* it was not set up again */
  assert_true(with <= 20);
  assert_true(without > 4 * with);
  OK(PCDestroy(&old));
  OK(PCDestroy(&pc));
  OK(MatDestroy(&A));
}

static void test_symmetric(void **state)
{
  Mat       A;
  PC        pc;
  Vec       x, y, Mx, My;
  PetscReal xMy, yMx, xMx;

  (void)state;
  create(&A, &pc, 0.9);
  change(&A, pc, 2, N);
  x = filled(A, 2);
  y = filled(A, 3);
  OK(VecDuplicate(x, &Mx));
  OK(VecDuplicate(y, &My));
  OK(PCApply(pc, x, Mx));
  OK(PCApply(pc, y, My));
  OK(VecDot(x, My, &xMy));
  OK(VecDot(y, Mx, &yMx));
  OK(VecDot(x, Mx, &xMx));
  assert_true(xMx > 0);
  assert_true(PetscAbsReal(xMy - yMx) < 1e-10 * xMx);
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
  OK(VecDestroy(&Mx));
  OK(VecDestroy(&My));
  OK(PCDestroy(&pc));
  OK(MatDestroy(&A));
}

/* Patches moved in the lowest ten of forty rows: some 4 % of the diagonal */
static void test_set_up_again(void **state)
{
  const PetscReal keep[] = {0, 0.01, 0.2};

  (void)state;
  for (int k = 0; k < 3; k++) {
    Mat A;
    PC  pc;

    create(&A, &pc, keep[k]);
    change(&A, pc, 1, 10);
    assert_int_equal(iterations(A, pc, PETSC_FALSE) > 1, keep[k] == 0.2);
    change(&A, pc, 0, 0); /* back to what it was set up for: no row differs */
    assert_int_equal(iterations(A, pc, PETSC_FALSE), 1);
    OK(PCDestroy(&pc));
    OK(MatDestroy(&A));
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_iterations), cmocka_unit_test(test_symmetric),
                                     cmocka_unit_test(test_set_up_again)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("lagged", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
