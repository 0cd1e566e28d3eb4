/* Meshkind: cell counts, areas, Jacobians, boundaries and circles of the meshes by name, refined, on any number of
   ranks. */
/* ranks: 1 2 3 */
#include "compat.h"
#include "base/algebra.h"
#include "fem/element.h"
#include "mesh/mesh.h"
#include "kinds/map.h"
#include "base/opt.h"
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

static PetscReal jacobian_2d(const PetscReal xc[], PetscReal s, PetscReal t)
{
  const PetscReal xi[2] = {s, t};
  PetscReal       x[2], J[4];

  ElementMap(2, xc, xi, x, J);
  return DenseDeterminant(2, J);
}

/* Area of the mesh of quadratic cells; every Jacobian at the 3 x 3 Gauss points must be positive */
static PetscReal area_of(Mesh m)
{
  const PetscReal  s[3] = {-0.774596669241483377, 0, 0.774596669241483377}, w[3] = {5. / 9, 8. / 9, 5. / 9};
  const MeshLocal *l;
  PetscReal        area = 0, xc[MESH_MAX_NB * 3];

  assert_int_equal(MeshGetLocal(m, &l), 0);
  for (PetscInt c = 0; c < l->ncell; c++) {
    assert_int_equal(MeshCellCoordinates(m, c, xc), 0);
    for (PetscInt q = 0; q < 9; q++) {
      const PetscReal J = jacobian_2d(xc, s[q % 3], s[q / 3]);

      assert_true(J > 0);
      area += w[q % 3] * w[q / 3] * J;
    }
  }
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &area, 1, MPIU_REAL, MPI_SUM, PETSC_COMM_WORLD), 0);
  return area;
}

static PetscInt cells_of(Mesh m)
{
  const MeshLocal *l;

  assert_int_equal(MeshGetLocal(m, &l), 0);
  return l->ncell_global;
}

/* Own nodes of the named boundary over all ranks; each satisfies |x - centre| = r if r > 0 */
static PetscInt boundary_nodes(Mesh m, const char name[], PetscReal cx, PetscReal cy, PetscReal r)
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
      const PetscReal *x = l->x + l->dim * node[i];

      if (r > 0) assert_near(PetscSqrtReal(PetscSqr(x[0] - cx) + PetscSqr(x[1] - cy)), r, 1e-14 * (1 + r));
      total += node[i] < l->nnode;
    }
    assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &total, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD), 0);
  }
  return total;
}

/* The area of a mesh with a circle converges with order 4 (edges are parabolas through three points of the circle) */
static void check_order(const char options[], PetscReal exact)
{
  PetscReal error[3];

  for (PetscInt level = 0; level < 3; level++) {
    char text[512];
    Mesh m;

    (void)snprintf(text, sizeof(text), "%s -dm_refine %d", options, (int)level);
    assert_int_equal(create_mesh(text, &m), 0);
    error[level] = PetscAbsReal(area_of(m) - exact);
    if (level) {
      const PetscReal order = PetscLogReal(error[level - 1] / error[level]) / PetscLogReal(2.0);

      if (order < 3.9)
        print_message("%s: order %g, errors %g %g\n", text, (double)order, (double)error[level - 1],
                      (double)error[level]);
      assert_true(order > 3.9);
    }
    assert_int_equal(MeshDestroy(&m), 0);
  }
}

static void test_areas(void **state)
{
  (void)state;
  check_order("-mesh_kind disc -mesh_centre 3,-1 -mesh_radius 2", PETSC_PI * 4);
  check_order("-mesh_kind annulus -mesh_radii 0.5,2", PETSC_PI * 3.75);
  check_order("-mesh_kind fitted -mesh_resolution 4", 2.2 * 0.41 - PETSC_PI * 0.0025);
}

static void test_disc(void **state)
{
  (void)state;
  Mesh m;

  assert_int_equal(create_mesh("-mesh_kind disc -mesh_centre 0.3,0.4 -mesh_radius 0.25 -mesh_resolution 5 -dm_refine 2",
                               &m),
                   0);
  assert_int_equal(boundary_nodes(m, "outer", 0.3, 0.4, 0.25), 2 * 4 * 5 * 4);
  assert_int_equal(MeshDestroy(&m), 0);
}

static void test_annulus(void **state)
{
  (void)state;
  Mesh m;

  assert_int_equal(create_mesh("-mesh_kind annulus -mesh_centre 0.3,0.4 -mesh_radii 0.1,0.7 -mesh_resolution 3 -dm_refine 2",
                               &m),
                   0);
  assert_int_equal(boundary_nodes(m, "inner", 0.3, 0.4, 0.1), 2 * 4 * 3 * 4);
  assert_int_equal(boundary_nodes(m, "outer", 0.3, 0.4, 0.7), 2 * 4 * 3 * 4);
  assert_int_equal(MeshDestroy(&m), 0);
}

/* A closed boundary has two nodes an edge, an open one has one more */
static void test_fitted(void **state)
{
  (void)state;
  Mesh             m;
  const MeshLocal *l;

  assert_int_equal(create_mesh("-mesh_kind fitted -mesh_resolution 4", &m), 0);
  assert_int_equal(cells_of(m), 136);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind fitted", &m), 0);
  assert_int_equal(cells_of(m), 2176);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind fitted -mesh_resolution 4 -dm_refine 2", &m), 0);
  assert_int_equal(cells_of(m), 136 * 16);
  assert_int_equal(boundary_nodes(m, "cylinder", 0.2, 0.2, 0.05), 2 * 16 * 4);
  assert_int_equal(boundary_nodes(m, "left", 0, 0, 0), 2 * 8 * 4 + 1);
  assert_int_equal(boundary_nodes(m, "right", 0, 0, 0), 2 * 8 * 4 + 1);
  assert_int_equal(boundary_nodes(m, "bottom", 0, 0, 0), 2 * 15 * 4 + 1);
  assert_int_equal(boundary_nodes(m, "top", 0, 0, 0), 2 * 15 * 4 + 1);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_near(l->upper[0], 2.2, 1e-14);
  assert_near(l->upper[1], 0.41, 1e-14);
  assert_int_equal(MeshDestroy(&m), 0);
}

static void test_channel(void **state)
{
  (void)state;
  Mesh m;

  assert_int_equal(create_mesh("-mesh_kind channel", &m), 0);
  assert_int_equal(cells_of(m), 2211);
  assert_near(area_of(m), 2.2 * 0.41, 1e-13);
  assert_int_equal(MeshDestroy(&m), 0);
  assert_int_equal(create_mesh("-mesh_kind channel -mesh_resolution 20", &m), 0);
  assert_int_equal(cells_of(m), 8844);
  assert_int_equal(MeshDestroy(&m), 0);
}

/* Smallest distance from a node to the vertical line at x, over all ranks */
static PetscReal distance_to_line(Mesh m, PetscReal x)
{
  const MeshLocal *l;
  PetscReal        d = PETSC_MAX_REAL;

  assert_int_equal(MeshGetLocal(m, &l), 0);
  for (PetscInt i = 0; i < l->nnode; i++) d = PetscMin(d, PetscAbsReal(l->x[2 * i] - x));
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &d, 1, MPIU_REAL, MPI_MIN, PETSC_COMM_WORLD), 0);
  return d;
}

/* A shift keeps the number of cells and their size near the body, and moves the lines there by less than h */
static void test_shift(void **state)
{
  (void)state;
  Mesh             m;
  const MeshLocal *l;
  PetscReal        first = 0;

  for (int seed = 0; seed < 4; seed++) {
    char      options[128];
    PetscReal d;

    (void)snprintf(options, sizeof(options), "-mesh_kind channel -mesh_shift_seed %d", seed);
    assert_int_equal(create_mesh(options, &m), 0);
    assert_int_equal(cells_of(m), 2211);
    assert_near(area_of(m), 2.2 * 0.41, 1e-13);
    assert_int_equal(MeshGetLocal(m, &l), 0);
    assert_near(l->h, 0.01, 1e-3);
    d = distance_to_line(m, 0.2);
    if (seed == 0) assert_near(d, 0, 1e-14);
    else assert_true(d > 1e-6);
    if (seed == 1) first = d;
    if (seed > 1) assert_true(PetscAbsReal(d - first) > 1e-6);
    assert_int_equal(MeshDestroy(&m), 0);
  }
}

static void test_focus(void **state)
{
  (void)state;
  Mesh             m;
  const MeshLocal *l;
  PetscInt         inside = 0;

  assert_int_equal(create_mesh("-mesh_upper 4,2 -mesh_periodic x -mesh_focus 1,0,2,0.5 -mesh_focus_h 0.05 -mesh_growth 0.2,0.1 -mesh_coarsest 4,3 -dm_refine 1",
                               &m),
                   0);
  assert_near(area_of(m), 8, 1e-12);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_near(l->h, 0.025, 1e-12);
  for (PetscInt i = 0; i < l->nnode; i++)
    inside += l->x[2 * i] > 1 - 1e-9 && l->x[2 * i] < 2 + 1e-9 && l->x[2 * i + 1] < 0.5 + 1e-9;
  assert_int_equal(MPI_Allreduce(MPI_IN_PLACE, &inside, 1, MPIU_INT, MPI_SUM, PETSC_COMM_WORLD), 0);
  assert_int_equal(inside, (4 * 20 + 1) * (4 * 10 + 1));
  assert_int_equal(boundary_nodes(m, "left", 0, 0, 0), -1);
  assert_true(boundary_nodes(m, "bottom", 0, 0, 0) > 80);
  assert_int_equal(MeshDestroy(&m), 0);
}

static void test_focus_3d(void **state)
{
  (void)state;
  Mesh m;

  assert_int_equal(create_mesh("-mesh_dimension 3 -mesh_focus 0.25,0.25,0,0.75,0.75,1 -mesh_focus_h 0.25 -mesh_growth 1,1,1 -mesh_coarsest 2,2,2",
                               &m),
                   0);
  assert_int_equal(cells_of(m), 4 * 4 * 4);
  assert_int_equal(boundary_nodes(m, "front", 0, 0, 0), 9 * 9);
  assert_int_equal(MeshDestroy(&m), 0);
}

/* Three numbers an axis are three dimensions without another word; two remain two */
static void test_dimension_follows_numbers(void **state)
{
  (void)state;
  const char *const three[] = {"-mesh_cells 3,4,5", "-mesh_upper 1,2,1.5", "-mesh_lower -1,0,0"};
  const MeshLocal  *l;
  Mesh              m;

  for (PetscInt i = 0; i < 3; i++) {
    assert_int_equal(create_mesh(three[i], &m), 0);
    assert_int_equal(MeshGetLocal(m, &l), 0);
    assert_int_equal(l->dim, 3);
    assert_int_equal(MeshDestroy(&m), 0);
  }
  assert_int_equal(create_mesh("-mesh_cells 3,4 -mesh_upper 2,1", &m), 0);
  assert_int_equal(MeshGetLocal(m, &l), 0);
  assert_int_equal(l->dim, 2);
  assert_int_equal(MeshDestroy(&m), 0);
}

/* Count and distance undo each other */
static void test_growth(void **state)
{
  (void)state;
  const PetscReal d[] = {0.01, 0.3, 2, 40}, growth[] = {0, 0.05, 0.7}, coarsest[] = {1, 2, 50};

  for (PetscInt i = 0; i < 4; i++)
    for (PetscInt j = 0; j < 3; j++)
      for (PetscInt k = 0; k < 3; k++)
        assert_near(MeshMapDistance(MeshMapCountCells(d[i], 0.1, growth[j], coarsest[k]), 0.1, growth[j], coarsest[k]),
                    d[i], 1e-12 * d[i]);
}

/* A Gmsh file: one ring of eight quadrilaterals between polygons on the circles r = 1 and 3; names "inside" and
   "outside", if wanted, for their edges, whose geometric entity has the given number */
static PetscErrorCode write_ring(const char path[], PetscBool named, int entity)
{
  FILE *f;

  PetscFunctionBeginUser;
  PetscCall(PetscFOpen(PETSC_COMM_WORLD, path, "w", &f));
  PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"));
  PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "$PhysicalNames\n%d\n", named ? 3 : 1));
  if (named) PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "1 1 \"inside\"\n1 2 \"outside\"\n"));
  PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "2 3 \"fluid\"\n$EndPhysicalNames\n$Nodes\n16\n"));
  for (int i = 0; i < 16; i++) {
    const PetscReal r = i < 8 ? 1 : 3, a = 0.25 * PETSC_PI * (i % 8);

    PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "%d %.16g %.16g 0\n", i + 1, (double)(r * PetscCosReal(a)),
                           (double)(r * PetscSinReal(a))));
  }
  PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "$EndNodes\n$Elements\n%d\n", named ? 24 : 8));
  for (int i = 0; i < 8; i++)
    PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "%d 3 2 3 10 %d %d %d %d\n", i + 1, i + 1, i + 9, (i + 1) % 8 + 9,
                           (i + 1) % 8 + 1));
  for (int i = 0; i < 16 && named; i++)
    PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "%d 1 2 %d %d %d %d\n", i + 9, i / 8 + 1, entity, i + 1,
                           (i + 1) % 8 + 1 + i / 8 * 8));
  PetscCall(PetscFPrintf(PETSC_COMM_WORLD, f, "$EndElements\n"));
  PetscCall(PetscFClose(PETSC_COMM_WORLD, f));
  PetscCallMPI(MPI_Barrier(PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

#define RING "/tmp/tumble_test_meshkind.msh"

static void test_round_file(void **state)
{
  (void)state;
  Mesh m;

  assert_int_equal(write_ring(RING, PETSC_TRUE, 10), 0);
  assert_int_equal(create_mesh("-mesh_kind file -mesh_file " RING " -dm_refine 2", &m), 0);
  assert_int_equal(cells_of(m), 8 * 16);
  assert_near(area_of(m), 8 * PetscSqrtReal(8.0), 1e-12); /* between octagons */
  assert_int_equal(MeshDestroy(&m), 0);
  check_order("-mesh_kind file -mesh_file " RING " -mesh_round_inside 0,0,1 -mesh_round_outside 0,0,3", PETSC_PI * 8);
  assert_int_equal(create_mesh("-mesh_kind file -mesh_file " RING
                               " -mesh_round_outside 0,0,3 -mesh_round_inside 0,0,1 -dm_refine 3",
                               &m),
                   0);
  assert_int_equal(boundary_nodes(m, "inside", 0, 0, 1), 2 * 8 * 8);
  assert_int_equal(boundary_nodes(m, "outside", 0, 0, 3), 2 * 8 * 8);
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
  refuse("-mesh_kind file", "needs -mesh_file");
  refuse("-mesh_kind file -mesh_file /nonexistent.msh", "check -mesh_file");
  assert_int_equal(write_ring(RING, PETSC_TRUE, 1), 0); /* numbers of curves that are those of groups say nothing */
  refuse("-mesh_kind file -mesh_file " RING " -mesh_round_inside 0,0,2", "correct -mesh_round_inside");
  refuse("-mesh_kind annulus -mesh_radii 2,1", "outer radius must be larger");
  refuse("-mesh_focus 0,0,1,1", "give -mesh_focus_h");
  refuse("-mesh_focus 0,0,1,1 -mesh_focus_h 0.1 -mesh_cells 3,3", "remove -mesh_cells");
  refuse("-mesh_focus 2,0,3,1 -mesh_focus_h 0.1", "outside the box");
  refuse("-mesh_lower 2,0", "not above -mesh_lower");
  refuse("-mesh_cells 2,4 -mesh_periodic x", "-mesh_cells needs at least 3");
  assert_int_equal(MPI_Barrier(PETSC_COMM_WORLD), 0);
  (void)remove(RING);
}

/* A cell with a corner of nearly 180 degrees, of a mesh lined up with an elastic disc: all its points are found in it,
   beside that corner too, from where Newton's method ends up far away when it begins in the middle */
static void test_flat_corner(void **state)
{
  const PetscReal xc[18] = {25.6723, 24.6349, 26.7522, 24.4533, 27.8321, 24.2717, 25.9851, 24.7821, 27.0111,
                            24.8594, 27.8944, 25.1462, 26.3112, 24.8981, 27.2766, 25.2499, 27.9566, 26.0208};

  (void)state;
  for (PetscInt i = 0; i < 21 * 21; i++) {
    const PetscReal xi[2] = {0.095 * (PetscReal)(i % 21 - 10), 0.095 * (PetscReal)(i / 21 - 10)};
    PetscReal       x[2], back[2], J[4], at[2];

    ElementMap(2, xc, xi, x, J);
    assert_true(J[0] * J[3] - J[1] * J[2] > 0);
    assert_true(ElementLocate(2, xc, x, at));
    ElementMap(2, xc, at, back, J);
    for (PetscInt a = 0; a < 2; a++) {
      assert_near(back[a], x[a], 1e-9);
      assert_near(at[a], xi[a], 1e-6);
    }
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] =
    {cmocka_unit_test(test_growth),     cmocka_unit_test(test_areas),
     cmocka_unit_test(test_disc),       cmocka_unit_test(test_annulus),
     cmocka_unit_test(test_fitted),     cmocka_unit_test(test_channel),
     cmocka_unit_test(test_shift),      cmocka_unit_test(test_focus),
     cmocka_unit_test(test_focus_3d),   cmocka_unit_test(test_dimension_follows_numbers),
     cmocka_unit_test(test_round_file), cmocka_unit_test(test_flat_corner),
     cmocka_unit_test(test_errors)};
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("meshkind", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
