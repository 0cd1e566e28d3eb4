/* Sweep: sweeps against PETSc's SOR and the factorisation against PETSc's ILU(0), component by component; rows of inert
   nodes. */
/* ranks: 1 2 */
#include "core.h"
#include "relax.h"

#define NX  7
#define DIM 2

/* Convection and diffusion on an NX x NX lattice, nine neighbours, columns ascending: rows of this rank */
static void create(Mat *S)
{
  PetscInt first, last;

  OK(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, NX * NX, NX * NX, 9, NULL, 9, NULL, S));
  OK(MatGetOwnershipRange(*S, &first, &last));
  for (PetscInt i = first; i < last; i++)
    for (PetscInt k = 0; k < 9; k++) {
      const PetscInt  x = i % NX + k % 3 - 1, y = i / NX + k / 3 - 1, j = y * NX + x;
      const PetscReal value = j == i ? 9 : -1 + 3 * noise(i * 100 + j);

      if (x >= 0 && x < NX && y >= 0 && y < NX) OK(MatSetValue(*S, i, j, value, INSERT_VALUES));
    }
  OK(MatAssemblyBegin(*S, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(*S, MAT_FINAL_ASSEMBLY));
}

static void fill(PetscInt n, PetscReal b[])
{
  for (PetscInt i = 0; i < n; i++) b[i] = noise(17 + i);
}

/* y = what PETSc's preconditioner of this type makes of component a of b [n][DIM], on the own part of S */
static void apply_petsc(Mat own, PCType type, MatSORType flag, PetscInt n, PetscInt a, const PetscReal b[], Vec y)
{
  Vec        x;
  PetscReal *xa;
  PC         pc;

  OK(VecDuplicate(y, &x));
  OK(VecGetArray(x, &xa));
  for (PetscInt i = 0; i < n; i++) xa[i] = b[i * DIM + a];
  OK(VecRestoreArray(x, &xa));
  if (type) {
    OK(PCCreate(PETSC_COMM_SELF, &pc));
    OK(PCSetType(pc, type));
    OK(PCSetOperators(pc, own, own));
    OK(PCApply(pc, x, y));
    OK(PCDestroy(&pc));
  } else OK(MatSOR(own, x, 1, (MatSORType)(flag | SOR_ZERO_INITIAL_GUESS), 0, 1, 1, y));
  OK(VecDestroy(&x));
}

static void compare(PetscBool factorise, MatSORType flag, PetscReal bound)
{
  Mat              S, own;
  Relax            s;
  Vec              y, d;
  PetscReal       *b, *x, *inverse, worst = 0;
  const PetscReal *ya;
  PetscInt         n;

  create(&S);
  OK(MatGetDiagonalBlock(S, &own));
  OK(MatGetLocalSize(S, &n, NULL));
  OK(MatCreateVecs(own, &y, &d));
  OK(MatGetDiagonal(own, d));
  OK(PetscMalloc3(n * DIM, &b, n * DIM, &x, n * DIM, &inverse));
  OK(VecGetArrayRead(d, &ya));
  for (PetscInt i = 0; i < n * DIM; i++) inverse[i] = 1 / ya[i / DIM];
  OK(VecRestoreArrayRead(d, &ya));
  fill(n * DIM, b);
  OK(RelaxCreate(n, DIM, &s));
  OK(RelaxUpdate(s, factorise ? RELAX_ILU : RELAX_SOR, S, inverse));
  OK(RelaxApply(s, (MatSORType)(flag | SOR_ZERO_INITIAL_GUESS), 1, b, x));
  for (PetscInt a = 0; a < DIM; a++) {
    apply_petsc(own, factorise ? PCILU : NULL, flag, n, a, b, y);
    OK(VecGetArrayRead(y, &ya));
    for (PetscInt i = 0; i < n; i++) worst = PetscMax(worst, PetscAbsReal(x[i * DIM + a] - ya[i]));
    OK(VecRestoreArrayRead(y, &ya));
  }
  BELOW(worst, bound);
  OK(RelaxDestroy(&s));
  OK(PetscFree3(b, x, inverse));
  OK(VecDestroy(&y));
  OK(VecDestroy(&d));
  OK(MatDestroy(&S));
}

static void sweeps_are_those_of_petsc(void **state)
{
  (void)state;
  compare(PETSC_FALSE, SOR_LOCAL_FORWARD_SWEEP, 1e-13);
  compare(PETSC_FALSE, SOR_LOCAL_BACKWARD_SWEEP, 1e-13);
  compare(PETSC_FALSE, SOR_LOCAL_SYMMETRIC_SWEEP, 1e-13);
}

static void the_factorisation_is_that_of_petsc(void **state)
{
  (void)state;
  compare(PETSC_TRUE, SOR_LOCAL_SYMMETRIC_SWEEP, 1e-6); /* round-off of floats */
}

/* With the nodes of the first half inert, what is left is the factorisation of the other rows and columns alone; an
   inert component keeps zero. */
static void inert_nodes_drop_out(void **state)
{
  Mat              S, own, part;
  Relax            s;
  IS               is;
  Vec              y;
  PetscReal       *b, *x, *inverse, worst = 0;
  const PetscReal *ya;
  PetscInt         n, half;

  (void)state;
  create(&S);
  OK(MatGetDiagonalBlock(S, &own));
  OK(MatGetLocalSize(S, &n, NULL));
  half = n / 2;
  OK(PetscMalloc3(n * DIM, &b, n * DIM, &x, n * DIM, &inverse));
  for (PetscInt i = 0; i < n * DIM; i++) inverse[i] = i / DIM < half || i == n * DIM - 1 ? 0 : 1.0 / 9;
  fill(n * DIM, b);
  OK(RelaxCreate(n, DIM, &s));
  OK(RelaxUpdate(s, RELAX_ILU, S, inverse));
  OK(RelaxApply(s, SOR_ZERO_INITIAL_GUESS, 1, b, x));
  for (PetscInt i = 0; i < half * DIM; i++) assert_true(x[i] == 0);
  assert_true(x[n * DIM - 1] == 0);
  OK(ISCreateStride(PETSC_COMM_SELF, n - half, half, 1, &is));
  OK(MatCreateSubMatrix(own, is, is, MAT_INITIAL_MATRIX, &part));
  OK(MatCreateVecs(part, &y, NULL));
  apply_petsc(part, PCILU, SOR_LOCAL_SYMMETRIC_SWEEP, n - half, 0, b + half * DIM, y);
  OK(VecGetArrayRead(y, &ya));
  for (PetscInt i = half; i < n; i++) worst = PetscMax(worst, PetscAbsReal(x[i * DIM] - ya[i - half]));
  OK(VecRestoreArrayRead(y, &ya));
  BELOW(worst, 1e-6);
  OK(RelaxDestroy(&s));
  OK(PetscFree3(b, x, inverse));
  OK(ISDestroy(&is));
  OK(VecDestroy(&y));
  OK(MatDestroy(&part));
  OK(MatDestroy(&S));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(sweeps_are_those_of_petsc),
                                     cmocka_unit_test(the_factorisation_is_that_of_petsc),
                                     cmocka_unit_test(inert_nodes_drop_out)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("sweep", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
