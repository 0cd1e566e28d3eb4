/* RankBoxes: which ranks have boxes near a place, against a look at all boxes. */
/* ranks: 1 2 3 */
#include "core.h"
#include "base/rankboxes.h"

#define NBOX  40 /* a rank */
#define NASK  300
#define WHOLE 2 /* side of the domain */

static PetscReal random01(PetscInt i)
{
  return 0.5 + 0.5 * noise(i);
}

/* Box i of a rank: small ones, every tenth long */
static void make_box(PetscInt dim, PetscInt rank, PetscInt i, PetscReal box[2][3])
{
  for (PetscInt a = 0; a < 3; a++) {
    const PetscInt  seed = 1000 * rank + 10 * i + a;
    const PetscReal side = a >= dim ? 0 : (i % 10 == 9 && a == 0 ? 0.5 : 0.02) * random01(seed + 7);

    box[0][a] = a < dim ? (WHOLE - side) * random01(seed) : 0;
    box[1][a] = box[0][a] + side;
  }
}

/* Square of the distance of x to a box and its images */
static PetscReal distance_of(PetscInt dim, const PetscReal period[3], const PetscReal box[2][3], const PetscReal x[3])
{
  PetscReal sum = 0;

  for (PetscInt a = 0; a < dim; a++) {
    PetscReal d = PETSC_MAX_REAL;

    for (PetscInt k = period[a] > 0 ? -2 : 0; k <= (period[a] > 0 ? 2 : 0); k++)
      d = PetscMin(d, PetscMax(0, PetscMax(box[0][a] - x[a] - k * period[a], x[a] + k * period[a] - box[1][a])));
    sum += d * d;
  }
  return sum;
}

static void check(PetscInt dim, const PetscReal period[3])
{
  const PetscReal lower[3] = {0, 0, 0}, upper[3] = {WHOLE, WHOLE, WHOLE};
  PetscReal       own[NBOX][2][3];
  PetscMPIInt     rank, size;
  PetscInt        answers = 0;
  RankBoxes       r;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  for (PetscInt i = 0; i < NBOX; i++) make_box(dim, rank, i, own[i]);
  OK(RankBoxesCreate(PETSC_COMM_WORLD, dim, lower, upper, period, NBOX, own, &r));
  for (PetscInt i = 0; i < NASK; i++) {
    const PetscReal    reach = PetscPowReal(10, -3 + 3.3 * random01(77 * i));
    PetscReal          x[3] = {0, 0, 0}, least = PETSC_MAX_REAL;
    const PetscMPIInt *answer;
    PetscMPIInt        owner = -1;
    PetscInt           n, k = 0;

    /* outside of the domain, too; a period away where there is one */
    for (PetscInt a = 0; a < dim; a++) x[a] = WHOLE * (-0.1 + 1.2 * random01(31 * i + a));
    OK(RankBoxesNear(r, x, reach, &n, &answer));
    answers += n;
    for (PetscMPIInt p = 0; p < size; p++) {
      PetscReal d = PETSC_MAX_REAL;

      for (PetscInt j = 0; j < NBOX; j++) {
        PetscReal box[2][3], one;

        make_box(dim, p, j, box);
        one = distance_of(dim, period, box, x);
        if (one < least) owner = p;
        least = PetscMin(least, one);
        d     = PetscMin(d, one);
      }
      if (PetscAbsReal(PetscSqrtReal(d) - reach) < 1e-9) continue; /* as good as a tie */
      assert_true((k < n && answer[k] == p) == (d < reach * reach));
      k += d < reach * reach;
    }
    assert_int_equal(k, n);
    assert_int_equal(RankBoxesOwner(r, x), owner);
  }
  assert_true(answers > NASK / 10 && answers < size * NASK);
  OK(RankBoxesDestroy(&r));
}

static void test_near(void **state)
{
  (void)state;
  check(2, (const PetscReal[3]){0, 0, 0});
  check(3, (const PetscReal[3]){0, 0, 0});
}

static void test_periodic(void **state)
{
  (void)state;
  check(2, (const PetscReal[3]){WHOLE, 0, 0});
  check(3, (const PetscReal[3]){WHOLE, WHOLE, WHOLE});
}

/* A rank may have none, and a domain one box of the size of a point */
static void test_few(void **state)
{
  const PetscReal    zero[3] = {0, 0, 0}, one[3] = {1, 1, 1}, x[3] = {0.5, 0.5, 0};
  PetscReal          box[1][2][3] = {{{0.25, 0.25, 0}, {0.25, 0.25, 0}}};
  const PetscMPIInt *answer;
  PetscMPIInt        rank;
  PetscInt           n;
  RankBoxes          r;

  (void)state;
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(RankBoxesCreate(PETSC_COMM_WORLD, 2, zero, one, zero, rank == 0, box, &r));
  OK(RankBoxesNear(r, x, 0.35, &n, &answer));
  assert_int_equal(n, 0);
  OK(RankBoxesNear(r, x, 0.36, &n, &answer));
  assert_int_equal(n, 1);
  assert_int_equal(answer[0], 0);
  assert_int_equal(RankBoxesOwner(r, x), 0);
  OK(RankBoxesDestroy(&r));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_near), cmocka_unit_test(test_periodic),
                                     cmocka_unit_test(test_few)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("regions", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
