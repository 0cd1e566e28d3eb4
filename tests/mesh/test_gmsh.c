/* Mesh files: built-in meshes are written as Gmsh files of every format, order and orientation, read again, and must
   be the same; what is wrong with a file is said. Any number of ranks. */
/* ranks: 1 2 3 */
#include "compat.h"
#include "base/algebra.h"
#include "base/log.h"
#include "base/opt.h"
#include "fem/element.h"
#include "mesh/mesh.h"
#include "raised.h"
#include "core.h"
#include "mshcase.h"
#include "starmesh.h"

#define FILE_NAME "/tmp/tumble_test_gmsh.msh"

static PetscErrorCode create_mesh(const char options[], Mesh *mesh)
{
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsClear(NULL));
  PetscCall(PetscOptionsInsertString(NULL, options));
  PetscCall(MeshCreate(PETSC_COMM_WORLD, mesh));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal volume_of(Mesh m)
{
  const PetscReal  s[3] = {-0.774596669241483377, 0, 0.774596669241483377}, w[3] = {5. / 9, 8. / 9, 5. / 9};
  const MeshLocal *l;
  PetscReal        volume = 0, xc[MESH_MAX_NB * 3];

  OK(MeshGetLocal(m, &l));
  for (PetscInt c = 0; c < l->ncell; c++) {
    OK(MeshCellCoordinates(m, c, xc));
    for (PetscInt q = 0; q < (l->dim == 2 ? 9 : 27); q++) {
      const PetscReal xi[3] = {s[q % 3], s[q / 3 % 3], s[q / 9]};
      PetscReal       x[3], J[9], det;

      ElementMap(l->dim, xc, xi, x, J);
      det = DenseDeterminant(l->dim, J);
      assert_true(det > 0);
      volume += w[q % 3] * w[q / 3 % 3] * (l->dim == 3 ? w[q / 9] : 1) * det;
    }
  }
  return total(volume);
}

/* Sum over own nodes of a function of their places, and of the boundaries' (by name): do two meshes agree? */
static PetscReal fingerprint(Mesh m, const char name[])
{
  const MeshLocal *l;
  const PetscInt  *node;
  PetscInt         n, b = -1;
  PetscReal        sum = 0;

  OK(MeshGetLocal(m, &l));
  if (name) OK(MeshFindBoundary(m, name, &b));
  if (name) assert_true(b >= 0);
  if (name) OK(MeshGetBoundaryNodes(m, b, &n, &node));
  else n = l->nnode;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *x = l->x + (name ? node[i] : i) * l->dim;

    if (name && node[i] >= l->nnode) continue;
    sum += PetscCosReal(3 * x[0] + 1) * PetscCosReal(2 * x[1] - 1) * (l->dim == 3 ? PetscCosReal(x[2] + 2) : 1) + 1;
  }
  return total(sum);
}

/* Write the mesh of some options, read it with others */
static void through_file(const char made[], const Form *form, const char options[], Mesh *from, Mesh *to)
{
  char all[300];

  OK(create_mesh(made, from));
  write_mesh(*from, form, FILE_NAME);
  snprintf(all, sizeof(all), "-mesh_kind file -mesh_file " FILE_NAME " %s", options);
  OK(create_mesh(all, to));
}

/* ---- tests ---- */

static void expect_same(const char made[], const Form *form)
{
  Mesh     a, b;
  PetscInt n, most;

  through_file(made, form, "", &a, &b);
  NEAR(volume_of(b), volume_of(a), 1e-12);
  NEAR(fingerprint(b, NULL), fingerprint(a, NULL), 1e-9);
  OK(MeshGetBoundaryCount(a, &n));
  OK(MeshGetBoundaryCount(b, &most));
  assert_int_equal(n, most);
  for (PetscInt i = 0; i < n; i++) {
    const char *name;

    OK(MeshGetBoundaryName(a, i, &name));
    NEAR(fingerprint(b, name), fingerprint(a, name), 1e-10);
  }
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
}

#define FITTED "-mesh_kind fitted -mesh_resolution 4"

static void test_formats(void **state)
{
  (void)state;
  const double version[] = {4.1, 4, 2.2, 1};

  for (PetscInt i = 0; i < 8; i++) {
    Form form = PLAIN;

    form.version = version[i % 4];
    form.binary  = (PetscBool)(i / 4);
    form.stretch = 1 + i % 3;
    if (form.version < 2) form.groups = 1; /* it knows no names */
    if (form.version < 2 && form.binary) continue;
    if (form.groups == 2) expect_same(FITTED, &form);
  }
}

static void test_second_order(void **state)
{
  (void)state;
  const char *const made[] = {FITTED,
                              "-mesh_kind disc",
                              "-mesh_kind annulus",
                              "-mesh_kind ball -mesh_resolution 2",
                              "-mesh_kind shell -mesh_resolution 2",
                              "-mesh_kind tube -mesh_resolution 2"};
  Form              form   = PLAIN;

  for (PetscInt i = 0; i < 6; i++) {
    form.turned = i % 3; /* none, all, every other */
    form.binary = (PetscBool)(i % 2);
    expect_same(made[i], &form);
  }
}

/* Volume of a file of this order of meshes of twice the resolution: error of order 4; halved cells stay on the bent
   ones */
static void expect_order(const char kind[], PetscInt resolution, PetscInt order, PetscReal exact)
{
  Form      form = PLAIN;
  PetscReal error[2];

  form.order = order;
  for (PetscInt i = 0; i < 2; i++) {
    char      made[200];
    PetscReal volume;
    Mesh      a, b, c;

    snprintf(made, sizeof(made), "%s -mesh_resolution %d", kind, (int)(resolution << i));
    through_file(made, &form, "", &a, &b);
    volume   = volume_of(b);
    error[i] = PetscAbsReal(volume / exact - 1);
    if (i == 0) {
      OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME " -dm_refine 1", &c));
      NEAR(volume_of(c), volume, 1e-12);
      OK(MeshDestroy(&c));
    }
    OK(MeshDestroy(&a));
    OK(MeshDestroy(&b));
  }
  if (error[0] > 16 * 1e-12) expect_rate(kind, error[0], error[1], 4);
}

static void test_order(void **state)
{
  (void)state;
  expect_order("-mesh_kind disc -mesh_radius 2", 2, 2, 4 * PETSC_PI);
  expect_order("-mesh_kind annulus -mesh_radii 1,2", 2, -2, 3 * PETSC_PI);
  expect_order("-mesh_kind ball", 2, -2, 4 * PETSC_PI / 3);
  expect_order("-mesh_kind shell -mesh_radii 1,2", 1, 2, 28 * PETSC_PI / 3);
}

/* First order: the polygon */
static void test_first_order(void **state)
{
  (void)state;
  Form form = PLAIN;
  Mesh a, b;

  form.order = 1;
  through_file("-mesh_kind annulus -mesh_radii 1,2 -mesh_resolution 2", &form, "", &a, &b);
  NEAR(volume_of(b), 8 * 0.5 * (4 - 1) * PetscSinReal(PETSC_PI / 4), 1e-12);
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
  through_file("-mesh_dimension 3 -mesh_cells 2,3,2", &form, "-dm_refine 1", &a, &b);
  NEAR(volume_of(b), 1, 1e-12);
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
}

static void expect_boundary(Mesh m, const char name[], PetscBool there)
{
  PetscInt b;

  OK(MeshFindBoundary(m, name, &b));
  if ((b >= 0) != there) fail_msg("boundary '%s' is %s", name, b >= 0 ? "there" : "missing");
}

static PetscBool remarked(const char text[])
{
  const char *const *remark;
  PetscInt           n;

  OK(LogGetRemarks(&n, &remark));
  for (PetscInt i = 0; i < n; i++)
    if (strstr(remark[i], text)) return PETSC_TRUE;
  return PETSC_FALSE;
}

static void test_names(void **state)
{
  (void)state;
  Form form = PLAIN;
  Mesh a, b;

  for (PetscInt i = 0; i < 3; i++) { /* numbers are names */
    form.groups  = 1;
    form.version = (const double[]){4.1, 2.2, 1}[i];
    through_file("-mesh_cells 2,2", &form, "", &a, &b);
    expect_boundary(b, "10", PETSC_TRUE);
    NEAR(fingerprint(b, "10"), fingerprint(a, "left"), 1e-12);
    NEAR(fingerprint(b, "13"), fingerprint(a, "top"), 1e-12);
    OK(MeshDestroy(&a));
    OK(MeshDestroy(&b));
  }
  form        = PLAIN;
  form.groups = 0; /* one boundary */
  OK(LogFinalize());
  through_file("-mesh_cells 2,2", &form, "", &a, &b);
  expect_boundary(b, "boundary", PETSC_TRUE);
  expect_boundary(b, "left", PETSC_FALSE);
  assert_true(remarked("all 8 edges of it are one boundary, 'boundary'"));
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
  form          = PLAIN;
  form.nameless = 3; /* that of those without a name */
  through_file("-mesh_cells 2,2", &form, "-mesh_unnamed rest", &a, &b);
  NEAR(fingerprint(b, "rest"), fingerprint(a, "top"), 1e-12);
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
  OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME " -mesh_unnamed left", &b));
  expect_boundary(b, "top", PETSC_FALSE);
  expect_boundary(b, "left", PETSC_TRUE);
  OK(MeshDestroy(&b));
}

static void test_turned(void **state)
{
  (void)state;
  Form form = PLAIN;
  Mesh a, b;

  form.turned = 1;
  OK(LogFinalize());
  through_file("-mesh_cells 2,3", &form, "", &a, &b);
  assert_true(remarked("6 of 6 cells that go round clockwise"));
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
  form.turned = 2;
  form.order  = 1;
  through_file("-mesh_cells 2,2,2", &form, "", &a, &b);
  assert_true(remarked("4 of 8 cells that go round left-handed"));
  NEAR(volume_of(b), 1, 1e-13);
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
}

static void test_scale(void **state)
{
  (void)state;
  Mesh             a, b;
  const MeshLocal *l;

  through_file("-mesh_kind annulus -mesh_radii 1000,2000", &PLAIN, "-mesh_scale 0.001 -mesh_offset 5,-1", &a, &b);
  NEAR(volume_of(b), 1e-6 * volume_of(a), 1e-12);
  OK(MeshGetLocal(b, &l));
  NEAR(l->lower[0], 3, 1e-14);
  NEAR(l->upper[0], 7, 1e-14);
  NEAR(l->lower[1], -3, 1e-14);
  OK(MeshDestroy(&a));
  OK(MeshDestroy(&b));
}

/* ---- what is wrong ---- */

static void refuse(const char options[], const char text[])
{
  char all[300];
  Mesh m = NULL;

  snprintf(all, sizeof(all), "-mesh_kind file -mesh_file " FILE_NAME " %s", options);
  begin_error();
  expect_error(create_mesh(all, &m), 0, text, NULL);
}

/* A file with this text after the format: nodes of a square [0,1]^2 with two more at (2, 0), (2, 1), z in place of y if
   so wished */
static void write_text(const char names[], const char nodes[], const char elements[])
{
  PetscMPIInt rank;

  OK(MPI_Barrier(PETSC_COMM_WORLD));
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (rank == 0) {
    FILE *f = fopen(FILE_NAME, "w");

    assert_non_null(f);
    fprintf(f, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n%s$Nodes\n%s$EndNodes\n$Elements\n%s$EndElements\n", names, nodes,
            elements);
    assert_int_equal(fclose(f), 0);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
}

#define NODES "6\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 2 0 0\n6 2 1 0\n"
#define ROUND "3 1 2 1 1 1 2\n4 1 2 1 1 2 5\n5 1 2 1 1 5 6\n6 1 2 1 1 6 3\n7 1 2 1 1 3 4\n8 1 2 1 1 4 1\n"
#define CELLS "1 3 2 9 1 1 2 3 4\n2 3 2 9 1 2 5 6 3\n"

static void test_errors(void **state)
{
  (void)state;
  Form form = PLAIN;
  Mesh m;

  form.nameless = 3;
  OK(create_mesh("-mesh_cells 4,2", &m));
  write_mesh(m, &form, FILE_NAME);
  refuse("", "4 edges of the outside have no name, the first at (");
  OK(MeshDestroy(&m));
  write_text("", NODES, "6\n" ROUND);
  refuse("", "give the surface a physical name");
  write_text("", "6\n1 0 5 0\n2 1 5 0\n3 1 5 1\n4 0 5 1\n5 2 5 0\n6 2 5 1\n", "8\n" CELLS ROUND);
  refuse("", "plane y = 5, but z must be 0");
  write_text("", NODES, "3\n1 2 2 9 1 1 2 3\n2 2 2 9 1 1 3 4\n3 3 2 9 1 2 5 6 3\n");
  refuse("", "has 2 triangles, 1 quadrilaterals: cells must be quadrilaterals; in Gmsh write Recombine Surface");
  write_text("", NODES, "1\n1 4 2 9 1 1 2 3 4\n");
  refuse("", "has 1 tetrahedra: cells must be hexahedra");
  write_text("", NODES, "1\n1 3 2 9 1 1 2 4 3\n");
  refuse("", "inverted or flat cell, element 1 near");
  write_text("$PhysicalNames\n2\n1 1 \"a\"\n1 2 \"b\"\n$EndPhysicalNames\n", NODES,
             "9\n" CELLS ROUND "9 1 2 2 1 1 2\n");
  refuse("", "two names, 'a' and 'b'");
  write_text("$PhysicalNames\n2\n1 1 \"a b\"\n1 2 \"A_b\"\n$EndPhysicalNames\n", NODES,
             "9\n" CELLS ROUND "9 1 2 2 1 3 2\n");
  refuse("", "'a b' and 'A_b', which are one in options");
  write_text("", NODES, "8\n" CELLS ROUND "$EndElements\n$Periodic\n1\n1 1 2\n0\n$EndPeriodic\n$Elements\n0\n");
  refuse("", "is periodic");
  write_text("", "8\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 2 0 0\n6 2 1 0\n7 1 0 0\n8 1 1 0\n",
             "2\n1 3 2 9 1 1 2 3 4\n2 3 2 9 1 7 5 6 8\n");
  refuse("", "1 edges without a name lie on others, the first at");
  write_text("", NODES, "3\n" CELLS "3 3 2 9 1 1 2 3 4\n");
  refuse("", "with more than two cells");
  write_text("", NODES,
             "2\n"
             "1 36 2 9 1 1 2 3 4 5 6 1 2 3 4 5 6 1 2 3 4\n2 3 2 9 1 2 5 6 3\n");
  refuse("", "cells of order 3");
  write_text("", NODES, "1\n1 3 2 9 1 1 2 3 44\n");
  refuse("", "node 44, which is not among its nodes");
  write_text("", NODES, "1\n1 77 2 9 1 1 2 3 4\n");
  refuse("", "type 77");
  write_text("", NODES, "8\n" CELLS ROUND);
  refuse("-mesh_scale -1", "-mesh_scale");
  refuse("-mesh_plates nowhere", "no edges or faces named 'nowhere'");
}

/* Names with blanks, and edges inside: no boundary, or a thin wall */
static void test_inside(void **state)
{
  (void)state;
  Mesh            m;
  PetscInt        b, n;
  const PetscInt *node;
  PetscMPIInt     size;

  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  if (size > 2) return; /* the mesh has two cells */
  write_text("", NODES, "9\n" CELLS ROUND "9 1 2 2 1 1 2\n");
  OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME, &m)); /* two numbers: the first one */
  expect_boundary(m, "1", PETSC_TRUE);
  expect_boundary(m, "2", PETSC_FALSE);
  OK(MeshDestroy(&m));
  OK(LogFinalize());
  write_text("$PhysicalNames\n1\n2 8 \"rock\"\n$EndPhysicalNames\n", NODES,
             "8\n1 3 2 9 1 1 2 3 4\n2 3 2 8 1 2 5 6 3\n" ROUND);
  OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME, &m));
  assert_true(remarked("has several parts, such as the group of cells 'rock'"));
  OK(MeshDestroy(&m));
  write_text("$PhysicalNames\n3\n1 1 \"outer wall\"\n1 2 \"in side\"\n2 9 \"f\"\n$EndPhysicalNames\n", NODES,
             "10\n" CELLS ROUND "9 1 2 2 3 2 3\n10 1 2 5 4 2 3\n");
  OK(LogFinalize());
  OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME, &m));
  expect_boundary(m, "outer_wall", PETSC_TRUE);
  expect_boundary(m, "in_side", PETSC_FALSE);
  expect_boundary(m, "5", PETSC_FALSE);
  assert_true(remarked("has 1 edges named 'in_side' between cells"));
  OK(MeshDestroy(&m));
  OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME " -mesh_plates in_side", &m));
  OK(MeshFindBoundary(m, "in_side", &b));
  assert_true(b >= 0);
  OK(MeshGetBoundaryNodes(m, b, &n, &node));
  assert_true(total(n) >= 3);
  OK(MeshDestroy(&m));
}

static void put_file(const char text[], long size)
{
  FILE *f = fopen(FILE_NAME, "wb");

  assert_non_null(f);
  assert_int_equal(fwrite(text, 1, (size_t)size, f), size);
  assert_int_equal(fclose(f), 0);
}

static char *get_file(long *size)
{
  FILE *f = fopen(FILE_NAME, "rb");
  char *text;

  assert_non_null(f);
  assert_int_equal(fseek(f, 0, SEEK_END), 0);
  *size = ftell(f);
  rewind(f);
  text = (char *)malloc((size_t)*size);
  assert_int_equal(fread(text, 1, (size_t)*size, f), *size);
  assert_int_equal(fclose(f), 0);
  return text;
}

/* A file that ends anywhere, or has a byte changed, is refused or read, but never crashes */
static void test_damaged(void **state)
{
  (void)state;
  PetscMPIInt rank;
  Mesh        m;
  char       *text = NULL;
  long        size = 0;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(create_mesh("-mesh_cells 2,2", &m));
  for (PetscInt k = 0; k < 48; k++) {
    const PetscBool cut  = (PetscBool)(k % 12 < 5);
    Mesh            read = NULL;
    PetscErrorCode  got;
    Form            form = PLAIN;

    form.binary  = (PetscBool)(k / 12 % 2);
    form.version = k / 24 ? 4.1 : 2.2;
    if (k % 12 == 0) write_mesh(m, &form, FILE_NAME);
    if (rank == 0) {
      const long at = (long)((double)size * 0.5 * (1 + noise(k)));

      if (k % 12 == 0) free(text);
      if (k % 12 == 0) text = get_file(&size);
      if (!cut) text[at < size ? at : 0] ^= 0x15;
      put_file(text, cut ? (long)((double)size * (0.02 + 0.2 * (double)(k % 12))) : size);
      if (!cut) text[at < size ? at : 0] ^= 0x15;
    }
    OK(MPI_Barrier(PETSC_COMM_WORLD));
    begin_error();
    got = create_mesh("-mesh_kind file -mesh_file " FILE_NAME, &read);
    end_error();
    if (cut) assert_int_not_equal(got, 0);
    if (!got) OK(MeshDestroy(&read));
    else assert_int_equal(raised_times, 1);
  }
  free(text);
  OK(MeshDestroy(&m));
}

static int remove_file(void **state)
{
  (void)state;
  (void)MPI_Barrier(PETSC_COMM_WORLD);
  (void)remove(FILE_NAME);
  return 0;
}

/* 42 hexahedra at a node: all of them are there, and more than 125 vertices within two cells */
static void test_star(void **state)
{
  const int        n = 21;
  Mesh             m;
  const MeshLocal *l;
  PetscMPIInt      rank;
  PetscInt         most = 0;

  (void)state;
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (!rank) OK(star_write(FILE_NAME, n));
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  OK(create_mesh("-mesh_kind file -mesh_file " FILE_NAME, &m));
  OK(MeshGetLocal(m, &l));
  assert_int_equal(l->ncell_global, 2 * n);
  NEAR(volume_of(m), star_volume(n), 1e-12);
  for (PetscInt i = 0; i < l->nnode; i++) most = PetscMax(most, l->node_cell_ptr[i + 1] - l->node_cell_ptr[i]);
  OK(MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_INT, MPI_MAX, PETSC_COMM_WORLD));
  assert_int_equal(most, 2 * n);
  OK(MeshDestroy(&m));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_formats), cmocka_unit_test(test_second_order),
                                     cmocka_unit_test(test_order),   cmocka_unit_test(test_first_order),
                                     cmocka_unit_test(test_names),   cmocka_unit_test(test_turned),
                                     cmocka_unit_test(test_scale),   cmocka_unit_test(test_errors),
                                     cmocka_unit_test(test_inside),  cmocka_unit_test(test_damaged),
                                     cmocka_unit_test(test_star)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("gmsh", tests, NULL, remove_file);
  PetscCall(OptFinalize());
  PetscCall(LogFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
