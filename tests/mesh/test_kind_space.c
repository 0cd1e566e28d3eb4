/* Meshkind in space: volumes, Jacobians, boundaries and counts of tube, ball, shell and the channel around a cylinder,
   refined, periodic, on any number of ranks. */
/* ranks: 1 2 3 */
#include "compat.h"
#include "base/algebra.h"
#include "base/opt.h"
#include "fem/element.h"
#include "mesh/mesh.h"
#include "raised.h"

#define assert_near(a, b, tol) assert_true(PetscAbsReal((PetscReal)(a) - (PetscReal)(b)) <= (tol))

static PetscErrorCode create_mesh(const char options[], Mesh *mesh)
{
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsClear(NULL));
  PetscCall(PetscOptionsInsertString(NULL, options));
  PetscCall(MeshCreate(PETSC_COMM_WORLD, mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Volume of the quadratic cells; every Jacobian at the 27 Gauss points must be positive */
static PetscReal volume_of(Mesh m)
{
  const PetscReal  s[3] = {-0.774596669241483377, 0, 0.774596669241483377}, w[3] = {5. / 9, 8. / 9, 5. / 9};
  const MeshLocal *l;
  PetscReal        volume = 0, xc[MESH_MAX_NB * 3];

  assert_int_equal(MeshGetLocal(m, &l), 0);
  for (PetscInt c = 0; c < l->ncell; c++) {
    assert_int_equal(MeshCellCoordinates(m, c, xc), 0);
    for (PetscInt q = 0; q < 27; q++) {
      const PetscInt  i = q % 3, j = q / 3 % 3, k = q / 9;
      const PetscReal xi[3] = {s[i], s[j], s[k]};
      PetscReal       x[3], J[9], det;

      ElementMap(3, xc, xi, x, J);
      det = DenseDeterminant(3, J);
      assert_true(det > 0);
      volume += w[i] * w[j] * w[k] * det;
    }
  }
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &volume, 1, MPIU_REAL, MPI_SUM, PETSC_COMM_WORLD), 0);
  return volume;
}

/* Own nodes of the named boundary over all ranks (-1: there is none); each is r from the centre, or from its axis along
   z, if r > 0 */
static PetscInt boundary_nodes(Mesh m, const char name[], const PetscReal centre[], PetscInt axes, PetscReal r)
{
  const MeshLocal *l;
  PetscInt         nb, total = -1;

  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_int_equal(MeshGetBoundaryCount(m, &nb), 0);
  for (PetscInt b = 0; b < nb; b++) {
    const char     *found;
    PetscInt        n;
    const PetscInt *node;

    assert_int_equal(MeshGetBoundaryName(m, b, &found), 0);
    if (strcmp(found, name)) continue;
    total = 0;
    assert_int_equal(MeshGetBoundaryNodes(m, b, &n, &node), 0);
    for (PetscInt i = 0; i < n; i++) {
      PetscReal square = 0;

      for (PetscInt d = 0; d < axes; d++) square += PetscSqr(l->x[3 * node[i] + d] - centre[d]);
      if (r > 0) assert_near(PetscSqrtReal(square), r, 1e-14 * (1 + r));
      total += node[i] < l->nnode;
    }
    assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &total, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD), 0);
  }
  return total;
}

/* The volume converges with order 4: faces are quadratic through nodes on the sphere or cylinder */
static void check_order(const char options[], PetscInt cells, PetscReal exact, PetscReal least)
{
  PetscReal error[2];

  for (PetscInt level = 0; level < 2; level++) {
    char             text[512];
    const MeshLocal *l;
    Mesh             m;

    (void)snprintf(text, sizeof(text), "%s -dm_refine %d", options, (int)level);
    assert_int_equal(create_mesh(text, &m), 0);
    assert_int_equal(MeshGetLocal(m, &l), 0);
    assert_int_equal(l->ncell_global, cells << (3 * level));
    error[level] = PetscAbsReal(volume_of(m) - exact);
    assert_int_equal(MeshDestroy(&m), 0);
  }
  if (PetscLogReal(error[0] / error[1]) < least * PetscLogReal(2.0))
    print_message("%s: errors %g %g\n", options, (double)error[0], (double)error[1]);
  assert_true(PetscLogReal(error[0] / error[1]) >= least * PetscLogReal(2.0));
}

static void test_volumes(void **state)
{
  (void)state;
  check_order("-mesh_kind ball -mesh_centre 1,2,3 -mesh_radius 2 -mesh_resolution 3", 27 + 54, PETSC_PI * 32 / 3, 3.7);
  check_order("-mesh_kind shell -mesh_radii 1,2 -mesh_resolution 2 -mesh_ring_ratio 2", 24, PETSC_PI * 28 / 3, 3.7);
  check_order("-mesh_kind tube -mesh_radius 2 -mesh_length 3 -mesh_resolution 3 -mesh_layers 2", 2 * (9 + 12),
              PETSC_PI * 12, 3.7);
  check_order("-mesh_kind tube -mesh_resolution 3 -mesh_layers 3 -mesh_periodic z -mesh_ring_ratio 0.5", 3 * (9 + 12),
              PETSC_PI, 3.7);
  check_order("-mesh_kind fitted -mesh_dimension 3 -mesh_resolution 4 -mesh_layers 3 -mesh_layer_ratio 2", 3 * 136,
              0.41 * (2.2 * 0.41 - PETSC_PI * 0.0025), 3.7);
}

static void test_boundaries(void **state)
{
  (void)state;
  const PetscReal  at[3] = {1, 2, 3}, zero[3] = {0, 0, 0}, cylinder[3] = {0.5, 0.2, 0};
  const MeshLocal *l;
  Mesh             m;

  assert_int_equal(create_mesh("-mesh_kind ball -mesh_centre 1,2,3 -mesh_radius 2 -mesh_resolution 3", &m), 0);
  assert_int_equal(boundary_nodes(m, "outer", at, 3, 2), 6 * 36 + 2);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind shell -mesh_radii 1,3 -mesh_resolution 2 -dm_refine 1", &m), 0);
  assert_int_equal(boundary_nodes(m, "inner", zero, 3, 1), 6 * 64 + 2);
  assert_int_equal(boundary_nodes(m, "outer", zero, 3, 3), 6 * 64 + 2);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind tube -mesh_centre 1,2 -mesh_radius 2 -mesh_resolution 2 -mesh_layers 4", &m),
                   0);
  assert_int_equal(boundary_nodes(m, "outer", at, 2, 2), 16 * 9);
  assert_int_equal(boundary_nodes(m, "back", zero, 0, 0), boundary_nodes(m, "front", zero, 0, 0));
  assert_int_equal(boundary_nodes(m, "left", zero, 0, 0), -1);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind tube -mesh_resolution 2 -mesh_layers 4 -mesh_length 2 -mesh_periodic z", &m),
                   0);
  assert_int_equal(boundary_nodes(m, "outer", zero, 2, 1), 16 * 8);
  assert_int_equal(boundary_nodes(m, "back", zero, 0, 0), -1);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_near(l->period[2], 2, 0);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind fitted -mesh_upper 2.5,0.41,0.5 -mesh_centre 0.5,0.2 -mesh_resolution 4 -mesh_layers 5 -mesh_layer_ratio 3",
                               &m),
                   0);
  assert_int_equal(boundary_nodes(m, "cylinder", cylinder, 2, 0.05), 32 * 11);
  assert_int_equal(boundary_nodes(m, "left", zero, 0, 0), 17 * 11);
  assert_int_equal(boundary_nodes(m, "back", zero, 0, 0), boundary_nodes(m, "front", zero, 0, 0));
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_near(l->upper[0], 2.5, 1e-14);
  assert_near(l->upper[2], 0.5, 1e-14);
  assert_int_equal(MeshDestroy(&m), 0);
}

static void refuse(const char options[], const char text[])
{
  Mesh m = NULL;

  begin_error();
  expect_error(create_mesh(options, &m), 0, text, NULL);
}

static void test_errors(void **state)
{
  (void)state;
  refuse("-mesh_kind shell -mesh_radii 2,1", "outer radius must be larger");
  refuse("-mesh_kind tube -mesh_periodic x", "can be periodic along z only");
  refuse("-mesh_kind tube -mesh_periodic z -mesh_layers 2", "-mesh_layers needs at least 3");
  refuse("-mesh_kind fitted -mesh_dimension 3 -mesh_lower 0,0,1", "empty along axis z");
  refuse("-mesh_kind ball -mesh_resolution 2000", "2.24e+10 cells");
  refuse("-mesh_kind ball -mesh_levels 1", "use box or channel");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_volumes), cmocka_unit_test(test_boundaries),
                                     cmocka_unit_test(test_errors)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("meshkind_space", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
