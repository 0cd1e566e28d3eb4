/* Mesh: numbering, coordinates, boundaries, exchange between ranks, background grid. */
/* ranks: 1 2 3 */
#include "compat.h"
#include "mesh/mesh.h"
#include "mesh/remap.h"
#include "base/opt.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <sys/resource.h>

#define assert_near(a, b, tol) assert_true(PetscAbsReal((PetscReal)(a) - (PetscReal)(b)) <= (tol))

static PetscErrorCode create_mesh(const char cells[], const char periodic[], PetscInt dim, Mesh *mesh)
{
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsClear(NULL));
  PetscCall(PetscOptionsSetValue(NULL, "-mesh_cells", cells));
  if (periodic) PetscCall(PetscOptionsSetValue(NULL, "-mesh_periodic", periodic));
  if (dim == 3) PetscCall(PetscOptionsSetValue(NULL, "-mesh_dimension", "3"));
  PetscCall(MeshCreate(PETSC_COMM_WORLD, mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Every node of every cell sits at its lattice position; counts are those of a box */
static void check_box(const char cells[], const char periodic[], PetscInt dim, const PetscInt n[3])
{
  Mesh             m;
  const MeshLocal *l;
  PetscInt         nodes = 1, total = 1;

  assert_int_equal(create_mesh(cells, periodic, dim, &m), 0);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  for (PetscInt d = 0; d < dim; d++) {
    nodes *= 2 * n[d] + (l->period[d] > 0 ? 0 : 1);
    total *= n[d];
  }
  assert_int_equal(l->nnode_global, nodes);
  assert_int_equal(l->ncell_global, total);
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3];

    assert_int_equal(MeshCellCoordinates(m, c, xc), 0);
    for (PetscInt j = 0; j < l->nb; j++) {
      const PetscInt lattice[3] = {j % 3, (j / 3) % 3, j / 9};

      for (PetscInt d = 0; d < dim; d++) assert_near(xc[j * dim + d] - xc[d], 0.5 * lattice[d] / n[d], 1e-12);
    }
  }
  assert_int_equal(MeshDestroy(&m), 0);
}

static PetscReal peak_memory(void)
{
  struct rusage use;

  assert_int_equal(getrusage(RUSAGE_SELF, &use), 0);
  return (PetscReal)use.ru_maxrss;
}

/* A large box on many ranks: rank 0 takes no more memory to make it than others, at any time. To be called first: what
   counts is the growth of the peak. */
static void test_memory(void **state)
{
  const PetscReal before = peak_memory();
  PetscReal       sum, most;
  PetscMPIInt     size;
  Mesh            m;

  (void)state;
  assert_int_equal(MPI_Comm_size(PETSC_COMM_WORLD, &size), 0);
  if (size == 1) return;
  assert_int_equal(create_mesh("650,320", NULL, 2, &m), 0);
  sum = most = peak_memory() - before;
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPIU_REAL, MPI_SUM, PETSC_COMM_WORLD), 0);
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_REAL, MPI_MAX, PETSC_COMM_WORLD), 0);
  assert_true(sum > 0 && most < 1.3 * sum / size);
}

static void test_box(void **state)
{
  (void)state;
  const PetscInt n2[3] = {6, 5, 1}, n3[3] = {4, 3, 5};

  check_box("6,5", NULL, 2, n2);
  check_box("6,5", "x", 2, n2);
  check_box("6,5", "x,y", 2, n2);
  check_box("4,3,5", NULL, 3, n3);
  check_box("4,3,5", "z", 3, n3);
}

/* Broadcasting the owner's number gives every ghost its global number; adding one from every cell's corner counts the
   cells around a node */
static void check_exchange(const char cells[], const char periodic[], PetscInt dim)
{
  Mesh             m;
  const MeshLocal *l;
  PetscReal       *v;
  PetscInt        *k;

  assert_int_equal(create_mesh(cells, periodic, dim, &m), 0);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_int_equal(PetscMalloc2(2 * l->nnode_all, &v, l->nnode_all, &k), 0);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    k[i] = i < l->nnode ? l->node_global[i] : -1;
    for (PetscInt a = 0; a < 2; a++) v[2 * i + a] = i < l->nnode ? 10 * l->node_global[i] + a : -1;
  }
  assert_int_equal(MeshSyncNodes(m, 2, v), 0);
  assert_int_equal(MeshSyncNodesInt(m, k), 0);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    assert_int_equal(k[i], l->node_global[i]);
    for (PetscInt a = 0; a < 2; a++) assert_near(v[2 * i + a], 10 * l->node_global[i] + a, 0);
  }
  for (PetscInt i = 0; i < 2 * l->nnode_all; i++) v[i] = 0;
  for (PetscInt c = 0; c < l->ncell; c++)
    for (PetscInt j = 0; j < l->nb; j++)
      for (PetscInt a = 0; a < 2; a++) v[2 * l->cell_node[c * l->nb + j] + a] += 1 + a;
  assert_int_equal(MeshSumNodes(m, 2, v), 0);
  for (PetscInt i = 0; i < l->nnode; i++)
    for (PetscInt a = 0; a < 2; a++)
      assert_near(v[2 * i + a], (1 + a) * (l->node_cell_ptr[i + 1] - l->node_cell_ptr[i]), 0);
  assert_int_equal(PetscFree2(v, k), 0);
  assert_int_equal(MeshDestroy(&m), 0);
}

static void test_exchange(void **state)
{
  (void)state;
  check_exchange("7,9", NULL, 2);
  check_exchange("7,9", "x", 2);
  check_exchange("4,3,5", NULL, 3);
}

/* Large boxes on many ranks come another way */
static void test_large_box(void **state)
{
  PetscMPIInt size;

  (void)state;
  assert_int_equal(MPI_Comm_size(PETSC_COMM_WORLD, &size), 0);
  if (size == 1) return;
  check_exchange("650,320", "x", 2);
}

static void test_boundaries(void **state)
{
  (void)state;
  Mesh             m;
  const MeshLocal *l;
  PetscInt         n, total[4]     = {0, 0, 0, 0}, nb;
  const PetscInt  *node, expect[4] = {2 * 9 + 1, 2 * 9 + 1, 2 * 7 + 1, 2 * 7 + 1};

  assert_int_equal(create_mesh("7,9", NULL, 2, &m), 0);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_int_equal(MeshGetBoundaryCount(m, &nb), 0);
  assert_int_equal(nb, 4);
  for (PetscInt b = 0; b < 4; b++) {
    PetscInt sides;

    assert_int_equal(MeshGetBoundarySides(m, b, &sides), 0);
    assert_int_equal(sides, 1 << b);
    assert_int_equal(MeshGetBoundaryNodes(m, b, &n, &node), 0);
    for (PetscInt i = 0; i < n; i++) {
      assert_near(l->x[2 * node[i] + b / 2], b % 2, 1e-12);
      total[b] += node[i] < l->nnode;
    }
  }
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, total, 4, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD), 0);
  for (PetscInt b = 0; b < 4; b++) assert_int_equal(total[b], expect[b]);
  assert_int_equal(MeshDestroy(&m), 0);
}

static void test_nodes_in_box(void **state)
{
  (void)state;
  Mesh             m;
  const MeshLocal *l;
  const PetscReal  x[2] = {0.42, 0.71}, half = 0.23;
  PetscInt         n, count                  = 0;
  const PetscInt  *list;

  assert_int_equal(create_mesh("17,13", NULL, 2, &m), 0);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_int_equal(MeshNodesInBox(m, x, half, &n, &list), 0);
  for (PetscInt i = 0; i < l->nnode_all; i++)
    count += PetscMax(PetscAbsReal(l->x[2 * i] - x[0]), PetscAbsReal(l->x[2 * i + 1] - x[1])) <= half;
  assert_int_equal(n, count);
  assert_int_equal(MeshDestroy(&m), 0);
}

/* Every rank makes meshes of its own, of other sizes and more of them than other ranks do: nothing asks all ranks */
static void test_rank_of_its_own(void **state)
{
  const char *const kinds[] = {"box", "disc"};
  PetscMPIInt       rank;

  (void)state;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  for (int k = 0; k < 2; k++)
    for (int again = 0; again <= rank; again++) {
      const PetscInt   n = 4 + rank + 2 * again;
      char             number[32];
      Mesh             m;
      Remap            remap;
      MPI_Comm         comm;
      const MeshLocal *l;

      (void)snprintf(number, sizeof(number), "%d,3", (int)n);
      assert_int_equal(PetscOptionsClear(NULL), 0);
      assert_int_equal(PetscOptionsSetValue(NULL, "-mesh_kind", kinds[k]), 0);
      assert_int_equal(PetscOptionsSetValue(NULL, k ? "-mesh_resolution" : "-mesh_cells", k ? "4" : number), 0);
      assert_int_equal(MeshCreate(PETSC_COMM_SELF, &m), 0);
      assert_int_equal(MeshGetLocal(m, &l), 0);
      assert_int_equal(MeshGetComm(m, &comm), 0);
      assert_true(comm == PETSC_COMM_SELF);
      assert_int_equal(l->ncell, l->ncell_global);
      assert_int_equal(l->nnode, l->nnode_global);
      if (!k) assert_int_equal(l->ncell_global, 3 * n);
      assert_int_equal(MeshRebase(m), 0);
      assert_int_equal(RemapCreate(m, &remap), 0);
      assert_int_equal(RemapDestroy(&remap), 0);
      assert_int_equal(MeshDestroy(&m), 0);
    }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_memory),       cmocka_unit_test(test_box),
                                     cmocka_unit_test(test_large_box),    cmocka_unit_test(test_exchange),
                                     cmocka_unit_test(test_large_box),    cmocka_unit_test(test_boundaries),
                                     cmocka_unit_test(test_nodes_in_box), cmocka_unit_test(test_rank_of_its_own)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("mesh", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
