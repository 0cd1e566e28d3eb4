/* Bodies that are spread over ranks: who owns and who knows one, sums and largest numbers over all that know it, what
   ghosts hear of their owners, and where a body goes that crosses between parts. */
/* ranks: 1 3 */
#include "bodies/local.h"
#include "core.h"

static const PetscReal lower[3] = {0, 0, 0}, upper[3] = {1, 1, 1}, period[3] = {0, 0, 0};

#define SIDE  6
#define COUNT (SIDE * SIDE)
#define REACH 0.11 /* beyond the radii: ghosts are next to a part's border */

static void create(Bodies *b, BodyArrays **s)
{
  give(
    "-particle_groups a -particle_a_shape circle -particle_a_radius 0.02 -particle_a_density 2 -particle_a_place lattice -particle_a_count 36");
  OK(BodiesCreateLocal(PETSC_COMM_WORLD, 2, lower, upper, period, b));
  OK(BodiesMigrate(*b, REACH, 1));
  OK(BodiesGetArrays(*b, s));
}

/* By permanent numbers: how many ranks know a body, how many own it */
static void count(const BodyArrays *s, PetscReal known[COUNT], PetscReal own[COUNT])
{
  for (PetscInt i = 0; i < COUNT; i++) known[i] = own[i] = 0;
  for (PetscInt k = 0; k < s->n; k++) {
    known[s->number[k]]++;
    own[s->number[k]] += s->own[k];
  }
  for (PetscInt i = 0; i < COUNT; i++) {
    known[i] = total(known[i]);
    own[i]   = total(own[i]);
  }
}

/* Each has one owner; with several ranks some are ghosts, but not all everywhere */
static void test_owners(void **state)
{
  Bodies      b;
  BodyArrays *s;
  PetscReal   known[COUNT], own[COUNT], most = 0, sum = 0;
  PetscMPIInt size, rank, *of;
  PetscInt   *which;

  (void)state;
  create(&b, &s);
  count(s, known, own);
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  for (PetscInt i = 0; i < COUNT; i++) {
    NEAR(own[i], 1, 0);
    most = PetscMax(most, known[i]);
    sum += known[i];
  }
  if (size > 1) {
    assert_true(most > 1 && sum < size * COUNT);
    OK(PetscMalloc2(s->n, &of, s->n, &which));
    OK(BodiesGetOwners(b, of, which));
    for (PetscInt k = 0; k < s->n; k++) assert_int_equal(of[k] == rank, s->own[k]);
    OK(PetscFree2(of, which));
  }
  OK(BodiesDestroy(&b));
}

/* The same on all ranks that know a body */
static void test_sums_over_all_that_know(void **state)
{
  Bodies      b;
  BodyArrays *s;
  PetscReal   known[COUNT], own[COUNT], *v, *w;
  PetscMPIInt size, rank;

  (void)state;
  create(&b, &s);
  count(s, known, own);
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(PetscMalloc2(2 * s->n, &v, 2 * s->n, &w));
  for (PetscInt k = 0; k < s->n; k++) {
    v[2 * k]     = 1;
    v[2 * k + 1] = s->own[k] ? 10 + s->number[k] : 0.5; /* half from every ghost */
    w[2 * k]     = s->own[k] ? 3 : 5;
    w[2 * k + 1] = -(PetscReal)s->number[k];
  }
  OK(BodiesSumLocal(b, 2, v));
  OK(BodiesMaxLocal(b, 2, w));
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscReal n = known[s->number[k]];

    NEAR(v[2 * k], n, 0);
    NEAR(v[2 * k + 1], 10 + s->number[k] + 0.5 * (n - 1), 1e-13);
    NEAR(w[2 * k], n > 1 ? 5 : 3, 0);
    NEAR(w[2 * k + 1], -(PetscReal)s->number[k], 0);
  }
  OK(PetscFree2(v, w));
  OK(BodiesDestroy(&b));
}

/* Sums and extremes count own bodies once */
static void test_sums_over_own(void **state)
{
  Bodies      b;
  BodyArrays *s;
  PetscReal   sum[2] = {0, 0}, ends[2] = {-1, 100};
  PetscBool   any;

  (void)state;
  create(&b, &s);
  for (PetscInt k = 0; k < s->n; k++) {
    if (!s->own[k]) continue;
    sum[0]++;
    sum[1] += s->number[k];
    ends[0] = PetscMax(ends[0], s->number[k]);
    ends[1] = PetscMin(ends[1], s->number[k]);
  }
  OK(BodiesSum(b, 2, sum));
  OK(BodiesMax(b, 1, &ends[0]));
  OK(BodiesMin(b, 1, &ends[1]));
  NEAR(sum[0], COUNT, 0);
  NEAR(sum[1], COUNT * (COUNT - 1) / 2, 0);
  NEAR(ends[0], COUNT - 1, 0);
  NEAR(ends[1], 0, 0);
  any = PETSC_FALSE;
  for (PetscInt k = 0; k < s->n; k++) any = (PetscBool)(any || (s->own[k] && s->number[k] == COUNT - 1));
  OK(BodiesAny(b, &any));
  assert_true(any);
  OK(BodiesDestroy(&b));
}

/* Ghosts have what their owners have: arrays of others, places and velocities */
static void test_ghosts(void **state)
{
  Bodies      b;
  BodyArrays *s;
  PetscReal  *v;

  (void)state;
  create(&b, &s);
  OK(PetscCalloc1(3 * s->n, &v));
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt d = 0; d < 3 && s->own[k]; d++) {
      v[3 * k + d] = noise(3 * s->number[k] + d);
      s->u[k][d]   = 2 * v[3 * k + d];
      s->w[k][d]   = 4 * v[3 * k + d];
    }
  OK(BodiesUpdateGhosts(b, 3, v));
  OK(BodiesSync(b, PETSC_TRUE));
  for (PetscInt k = 0; k < s->n; k++)
    for (PetscInt d = 0; d < 3; d++) {
      NEAR(v[3 * k + d], noise(3 * s->number[k] + d), 0);
      NEAR(s->u[k][d], 2 * v[3 * k + d], 0);
      NEAR(s->w[k][d], 4 * v[3 * k + d], 0);
    }
  OK(PetscFree(v));
  OK(BodiesDestroy(&b));
}

/* All go to the other end of the box, and what others keep of them goes along */
static void test_moving_house(void **state)
{
  Bodies      b;
  BodyArrays *s;
  PetscReal  *kept, known[COUNT], own[COUNT];

  (void)state;
  create(&b, &s);
  OK(BodiesAttach(b, sizeof(*kept), (void **)&kept));
  for (PetscInt k = 0; k < s->n; k++) {
    kept[k] = noise(s->number[k]);
    for (PetscInt d = 0; d < 2; d++) s->x[k][d] = 1 - s->x[k][d];
    s->u[k][0] = s->number[k];
  }
  OK(BodiesMigrate(b, REACH, 1));
  count(s, known, own);
  for (PetscInt i = 0; i < COUNT; i++) NEAR(own[i], 1, 0);
  for (PetscInt k = 0; k < s->n; k++) {
    NEAR(kept[k], noise(s->number[k]), 0);
    NEAR(s->u[k][0], s->number[k], 0);
    if (k) assert_true(s->number[k] > s->number[k - 1]);
  }
  OK(BodiesDetach(b, (void **)&kept));
  OK(BodiesDestroy(&b));
}

/* Rows of all bodies by their numbers, there and back to their owners */
static void test_rows(void **state)
{
  Bodies      b;
  BodyArrays *s;
  BodyRows    rows;
  PetscReal  *v, *row;

  (void)state;
  create(&b, &s);
  OK(BodiesBeginRows(b, &rows));
  OK(PetscCalloc2(s->n, &v, rows.n, &row));
  for (PetscInt k = 0; k < s->n; k++) v[k] = s->own[k] ? 7 + s->number[k] : -1;
  OK(BodiesGatherRows(b, &rows, sizeof(*v), v, row));
  for (PetscInt i = 0; i < rows.n; i++) {
    NEAR(row[i], 7 + rows.start + i, 0);
    row[i] *= 2;
  }
  OK(BodiesScatterRows(b, &rows, sizeof(*v), row, v));
  for (PetscInt k = 0; k < s->n; k++) NEAR(v[k], s->own[k] ? 2 * (7 + s->number[k]) : -1, 0);
  OK(PetscFree2(v, row));
  OK(BodiesEndRows(&rows));
  OK(BodiesDestroy(&b));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_owners),
                                     cmocka_unit_test(test_sums_over_all_that_know),
                                     cmocka_unit_test(test_sums_over_own),
                                     cmocka_unit_test(test_ghosts),
                                     cmocka_unit_test(test_moving_house),
                                     cmocka_unit_test(test_rows)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("known", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
