/* Partition of meshes: balance, edge cut, completeness, and the errors a user can meet. */
/* ranks: 1 2 3 */
#include "compat.h"
#include "partition.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#define ok(call) assert_int_equal((call), 0)

static PetscMPIInt size, rank;
static char        message[2048];

static PetscErrorCode keep_message(MPI_Comm comm, int line, const char *func, const char *file, PetscErrorCode code,
                                   PetscErrorType type, const char *text, void *ctx)
{
  (void)comm, (void)line, (void)func, (void)file, (void)ctx;
  if (type == PETSC_ERROR_INITIAL) snprintf(message, sizeof(message), "%s", text);
  return code;
}

static void create_box(PetscInt dim, const PetscInt cells[], DMBoundaryType boundary, DM *dm)
{
  const PetscReal      lower[3] = {0, 0, 0}, upper[3] = {cells[0], cells[1], dim > 2 ? cells[2] : 1};
  const DMBoundaryType bc[3] = {boundary, boundary, boundary};

  ok(CompatCreateBoxMesh(PETSC_COMM_WORLD, dim, cells, lower, upper, bc, dm));
}

static PetscInt sum(PetscInt v)
{
  MPI_Allreduce(MPI_IN_PLACE, &v, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD);
  return v;
}

static PetscInt count_cells(DM dm)
{
  PetscInt cStart, cEnd;

  ok(DMPlexGetHeightStratum(dm, 0, &cStart, &cEnd));
  return cEnd - cStart;
}

static void assert_balanced(DM dm, double tolerance)
{
  PetscInt     most = count_cells(dm);
  const double mean = sum(most) / (double)size;

  MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_INT, MPI_MAX, PETSC_COMM_WORLD);
  if (most > (1 + tolerance) * mean)
    fail_msg("the fullest rank has %d cells, the mean is %g, allowed are %g %% more", (int)most, mean, 100 * tolerance);
}

/* Faces between ranks: each is a leaf on exactly one of its two ranks */
static PetscInt edge_cut(DM dm)
{
  PetscSF         sf;
  PetscInt        n, fStart, fEnd, cut = 0;
  const PetscInt *leaf;

  ok(DMPlexGetHeightStratum(dm, 1, &fStart, &fEnd));
  ok(DMGetPointSF(dm, &sf));
  ok(PetscSFGetGraph(sf, NULL, &n, &leaf, NULL));
  for (PetscInt l = 0; l < n; l++) cut += leaf[l] >= fStart && leaf[l] < fEnd;
  return sum(cut);
}

/* Every unit cell of the box is on exactly one rank */
static void assert_each_cell_once(DM dm, PetscInt nx, PetscInt ny)
{
  PetscInt  cStart, cEnd;
  PetscInt *seen = calloc((size_t)(nx * ny), sizeof(*seen));

  ok(DMPlexGetHeightStratum(dm, 0, &cStart, &cEnd));
  for (PetscInt c = cStart; c < cEnd; c++) {
    PetscReal x[3];

    ok(DMPlexComputeCellGeometryFVM(dm, c, NULL, x, NULL));
    seen[(PetscInt)x[1] * nx + (PetscInt)x[0]]++;
  }
  MPI_Allreduce(MPI_IN_PLACE, seen, (PetscMPIInt)(nx * ny), MPIU_INT, MPI_SUM, PETSC_COMM_WORLD);
  for (PetscInt i = 0; i < nx * ny; i++) assert_int_equal(seen[i], 1);
  free(seen);
}

static void test_box(void **state)
{
  /* shortest possible cuts: a straight line for two parts; for three a line that cuts off a third, and one across the
     rest */
  const PetscInt cells[2] = {40, 40}, shortest[4] = {0, 0, 40, 40 + 27};
  DM             dm;

  (void)state;
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(PartitionPrepare(dm));
  ok(DMSetFromOptions(dm));
  ok(PartitionCheck(dm));
  assert_each_cell_once(dm, cells[0], cells[1]);
  assert_balanced(dm, 0.05);
  if (size <= 3) {
    const PetscInt cut = edge_cut(dm);

    if (cut > 1.5 * shortest[size]) fail_msg("edge cut %d, allowed are 1.5 x %d", (int)cut, (int)shortest[size]);
  }
  ok(DMDestroy(&dm));
}

/* DMSetFromOptions sets an explicitly given type once more; the partition must survive that */
static void test_explicit_type(void **state)
{
  const PetscInt cells[2] = {12, 20};
  DM             dm;

  (void)state;
  ok(PetscOptionsSetValue(NULL, "-petscpartitioner_type", "metis"));
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(PartitionPrepare(dm));
  ok(DMSetFromOptions(dm));
  ok(PartitionCheck(dm));
  assert_each_cell_once(dm, cells[0], cells[1]);
  assert_balanced(dm, 0.05);
  ok(DMDestroy(&dm));
  ok(PetscOptionsClearValue(NULL, "-petscpartitioner_type"));
}

static void test_other_type(void **state)
{
  const PetscInt   cells[2] = {12, 20};
  PetscPartitioner part;
  const char      *type;
  DM               dm;

  (void)state;
  ok(PetscOptionsSetValue(NULL, "-petscpartitioner_type", "simple"));
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(PartitionPrepare(dm));
  ok(DMPlexGetPartitioner(dm, &part));
  ok(PetscPartitionerGetType(part, &type));
  assert_string_equal(type, "simple");
  ok(DMSetFromOptions(dm));
  ok(PartitionCheck(dm));
  assert_each_cell_once(dm, cells[0], cells[1]);
  ok(DMDestroy(&dm));
  ok(PetscOptionsClearValue(NULL, "-petscpartitioner_type"));
}

static void test_periodic_cube(void **state)
{
  const PetscInt cells[3] = {6, 8, 10};
  DM             dm;

  (void)state;
  create_box(3, cells, DM_BOUNDARY_PERIODIC, &dm);
  ok(PartitionPrepare(dm));
  ok(DMSetFromOptions(dm));
  ok(PartitionCheck(dm));
  assert_int_equal(sum(count_cells(dm)), 480);
  assert_balanced(dm, 0.05);
  ok(DMDestroy(&dm));
}

/* A mesh that is spread badly already: the graph comes from all ranks */
static void test_distributed_mesh(void **state)
{
  const PetscInt   cells[2] = {40, 40}, shortest[4] = {0, 0, 40, 40 + 27};
  PetscPartitioner part;
  DM               dm, spread, again;

  (void)state;
  if (size == 1) skip();
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(DMPlexGetPartitioner(dm, &part));
  ok(PetscPartitionerSetType(part, PETSCPARTITIONERSHELL));
  ok(PetscPartitionerShellSetRandom(part, PETSC_TRUE));
  ok(DMPlexDistribute(dm, 0, NULL, &spread));
  assert_true(edge_cut(spread) > 1000);
  ok(PartitionPrepare(spread));
  ok(DMPlexDistribute(spread, 0, NULL, &again));
  ok(PartitionCheck(again));
  assert_each_cell_once(again, cells[0], cells[1]);
  assert_balanced(again, 0.05);
  if (size <= 3) assert_true(edge_cut(again) <= 1.5 * shortest[size]);
  ok(DMDestroy(&again));
  ok(DMDestroy(&spread));
  ok(DMDestroy(&dm));
}

/* As few cells as ranks is still a fair request */
static void test_few_cells(void **state)
{
  (void)state;
  for (PetscInt n = size; n <= size + 6; n++) {
    const PetscInt cells[2] = {n, 1};
    DM             dm;

    create_box(2, cells, DM_BOUNDARY_NONE, &dm);
    ok(PartitionPrepare(dm));
    ok(DMSetFromOptions(dm));
    ok(PartitionCheck(dm));
    assert_each_cell_once(dm, n, 1);
    ok(DMDestroy(&dm));
  }
}

static void test_too_few_cells(void **state)
{
  const PetscInt cells[2] = {1, 1};
  DM             dm;

  (void)state;
  if (size == 1) skip();
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(PetscPushErrorHandler(keep_message, NULL));
  assert_int_equal(PartitionPrepare(dm), PETSC_ERR_USER_INPUT);
  ok(PetscPopErrorHandler());
  assert_non_null(strstr(message, "the mesh has 1 cells"));
  assert_non_null(strstr(message, "-mesh_cells"));
  ok(DMDestroy(&dm));
}

/* What a partitioner of PETSc leaves empty is found after distribution */
static void test_check_after_distribution(void **state)
{
  const PetscInt cells[2] = {4, 4};
  DM             dm;

  (void)state;
  if (size == 1) skip();
  ok(PetscOptionsSetValue(NULL, "-petscpartitioner_type", "gather"));
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(PartitionPrepare(dm));
  ok(DMSetFromOptions(dm));
  ok(PetscPushErrorHandler(keep_message, NULL));
  assert_int_equal(PartitionCheck(dm), PETSC_ERR_USER_INPUT);
  ok(PetscPopErrorHandler());
  assert_non_null(strstr(message, "'gather'"));
  assert_non_null(strstr(message, "the mesh has 16 cells"));
  ok(DMDestroy(&dm));
  ok(PetscOptionsClearValue(NULL, "-petscpartitioner_type"));
}

static void test_unknown_type(void **state)
{
  const PetscInt cells[2] = {4, 4};
  DM             dm;

  (void)state;
  ok(PetscOptionsSetValue(NULL, "-petscpartitioner_type", "meits"));
  create_box(2, cells, DM_BOUNDARY_NONE, &dm);
  ok(PetscPushErrorHandler(keep_message, NULL));
  assert_int_equal(PartitionPrepare(dm), PETSC_ERR_USER_INPUT);
  ok(PetscPopErrorHandler());
  assert_non_null(strstr(message, "'meits'"));
  assert_non_null(strstr(message, "metis"));
  assert_non_null(strstr(message, "simple"));
  ok(DMDestroy(&dm));
  ok(PetscOptionsClearValue(NULL, "-petscpartitioner_type"));
}

static void test_no_cells(void **state)
{
  DM dm;

  (void)state;
  if (size == 1) skip();
  ok(DMCreate(PETSC_COMM_WORLD, &dm));
  ok(DMSetType(dm, DMPLEX));
  ok(DMSetDimension(dm, 2));
  ok(PetscPushErrorHandler(keep_message, NULL));
  assert_int_not_equal(PartitionPrepare(dm), 0);
  ok(PetscPopErrorHandler());
  assert_non_null(strstr(message, "no cells"));
  ok(DMDestroy(&dm));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_box),
    cmocka_unit_test(test_explicit_type),
    cmocka_unit_test(test_other_type),
    cmocka_unit_test(test_periodic_cube),
    cmocka_unit_test(test_distributed_mesh),
    cmocka_unit_test(test_few_cells),
    cmocka_unit_test(test_too_few_cells),
    cmocka_unit_test(test_check_after_distribution),
    cmocka_unit_test(test_unknown_type),
    cmocka_unit_test(test_no_cells),
  };
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  MPI_Comm_size(PETSC_COMM_WORLD, &size);
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
