/* ranks: 1 2 3
   Snapshots are read back with PETSc's own viewer: fields against the formulas they were filled with (quadratic
   velocity and linear pressure are represented exactly, so tolerances are round-off), connectivity against the geometry
   of a box, messages of wrong directories. */
#include "compat.h"
#include "report/fields.h"
#include "base/log.h"
#include "base/opt.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <unistd.h>

#define OK(call) assert_int_equal((call), 0)
static const PetscReal TOL = 1e-11;
static char            root[PETSC_MAX_PATH_LEN];
static char            message[2048];

static PetscErrorCode record_message(MPI_Comm comm, int line, const char *fun, const char *file, PetscErrorCode n,
                                     PetscErrorType p, const char *mess, void *ctx)
{
  (void)comm, (void)line, (void)fun, (void)file, (void)ctx;
  if (p == PETSC_ERROR_INITIAL) snprintf(message, sizeof(message), "%s", mess);
  return n;
}

static void set_option(const char name[], const char value[])
{
  OK(value ? PetscOptionsSetValue(NULL, name, value) : PetscOptionsClearValue(NULL, name));
}

/* Any function of the Q2 space does: it is represented exactly, and so is its curl at every node */
static void exact_velocity(PetscInt dim, const PetscReal x[3], PetscReal u[3])
{
  u[0] = x[1] * x[1] - 2 * x[0] * x[1];
  u[1] = x[0] * x[0] + x[1] * x[1];
  u[2] = 0;
  if (dim == 3) {
    u[0] += x[2] * x[1];
    u[2] = x[0] * x[2] - x[1];
  }
}

static void exact_vorticity(PetscInt dim, const PetscReal x[3], PetscReal w[3])
{
  w[0] = dim == 3 ? -1 : 0;
  w[1] = dim == 3 ? x[1] - x[2] : 0;
  w[2] = 2 * x[0] - (2 * x[1] - 2 * x[0] + (dim == 3 ? x[2] : 0));
}

static PetscReal exact_pressure(PetscInt dim, const PetscReal x[3])
{
  return 3 + x[0] - 2 * x[1] + (dim == 3 ? 0.5 * x[2] : 0);
}

static PetscBool is_in_body(const PetscReal x[3])
{
  return (PetscBool)(x[0] < 0.45 && x[1] < 0.55);
}

typedef struct {
  Mesh       mesh;
  PetscReal *u, *p;
  PetscInt  *body;
} Case;

static void create_fields(Case *f, PetscBool constant)
{
  const MeshLocal *m;
  PetscReal       *a, xc[MESH_MAX_NB * 3], x[3] = {0}, v[3];

  OK(MeshCreate(PETSC_COMM_WORLD, &f->mesh));
  OK(MeshGetLocal(f->mesh, &m));
  OK(PetscCalloc1(m->nnode_all * m->dim, &f->u));
  OK(PetscCalloc1(m->ncell * (m->dim + 1), &f->p));
  OK(PetscMalloc1(m->nnode_all, &f->body));
  a = f->u;
  for (PetscInt i = 0; i < m->nnode_all; i++) {
    for (PetscInt d = 0; d < m->dim; d++) x[d] = m->x[i * m->dim + d];
    exact_velocity(m->dim, x, v);
    for (PetscInt d = 0; d < m->dim && i < m->nnode; d++) a[i * m->dim + d] = constant ? 1 + d : v[d];
    f->body[i] = is_in_body(x) ? 7 : -1;
  }
  a = f->p;
  for (PetscInt c = 0; c < m->ncell; c++) {
    const PetscReal g[3] = {1, -2, 0.5};

    OK(MeshCellCoordinates(f->mesh, c, xc));
    for (PetscInt d = 0; d < m->dim; d++) x[d] = xc[(m->nb / 2) * m->dim + d];
    a[c * (m->dim + 1)] = constant ? 4 : exact_pressure(m->dim, x);
    for (PetscInt d = 0; d < m->dim; d++) a[c * (m->dim + 1) + 1 + d] = constant ? 0 : g[d];
  }
}

static void destroy_fields(Case *f)
{
  OK(PetscFree(f->u));
  OK(PetscFree(f->p));
  OK(PetscFree(f->body));
  OK(MeshDestroy(&f->mesh));
}

/* The whole dataset on every rank, as reals; *n rows */
static PetscScalar *read_dataset(const char dir[], const char file[], const char name[], PetscInt bs, PetscInt *n)
{
  char               path[PETSC_MAX_PATH_LEN];
  PetscViewer        viewer;
  Vec                v;
  PetscScalar       *a;
  const PetscScalar *b;

  OK(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, file));
  OK(PetscViewerCreate(PETSC_COMM_SELF, &viewer));
  OK(PetscViewerSetType(viewer, PETSCVIEWERHDF5));
  OK(PetscViewerFileSetMode(viewer, FILE_MODE_READ));
  OK(PetscViewerFileSetName(viewer, path));
  OK(VecCreate(PETSC_COMM_SELF, &v));
  OK(PetscObjectSetName((PetscObject)v, name));
  OK(VecSetBlockSize(v, bs));
  OK(VecLoad(v, viewer));
  OK(VecGetSize(v, n));
  OK(PetscMalloc1(*n, &a));
  OK(VecGetArrayRead(v, &b));
  OK(PetscArraycpy(a, b, *n));
  OK(VecRestoreArrayRead(v, &b));
  OK(VecDestroy(&v));
  OK(PetscViewerDestroy(&viewer));
  *n /= bs;
  return a;
}

static PetscInt *read_integers(const char dir[], const char file[], const char name[], PetscInt bs, PetscInt *n)
{
  char            path[PETSC_MAX_PATH_LEN];
  PetscViewer     viewer;
  IS              is;
  PetscInt       *a;
  const PetscInt *b;

  OK(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, file));
  OK(PetscViewerCreate(PETSC_COMM_SELF, &viewer));
  OK(PetscViewerSetType(viewer, PETSCVIEWERHDF5));
  OK(PetscViewerFileSetMode(viewer, FILE_MODE_READ));
  OK(PetscViewerFileSetName(viewer, path));
  OK(ISCreate(PETSC_COMM_SELF, &is));
  OK(ISSetType(is, ISGENERAL));
  OK(PetscObjectSetName((PetscObject)is, name));
  OK(ISLoad(is, viewer));
  OK(ISGetLocalSize(is, n));
  OK(PetscMalloc1(*n, &a));
  OK(ISGetIndices(is, &b));
  OK(PetscArraycpy(a, b, *n));
  OK(ISRestoreIndices(is, &b));
  OK(ISDestroy(&is));
  OK(PetscViewerDestroy(&viewer));
  *n /= bs;
  return a;
}

static void assert_close(const char what[], PetscInt i, PetscReal value, PetscReal wanted)
{
  if (PetscAbsReal(value - wanted) <= TOL * (1 + PetscAbsReal(wanted))) return;
  fail_msg("%s[%d] = %.15g, wanted %.15g within %g", what, (int)i, (double)value, (double)wanted, (double)TOL);
}

/* Node k of a VTK cell on a box is the mean of corners: the edges, faces and the volume of VTK's tables */
static void check_cells(PetscInt dim, const PetscScalar x[], PetscInt ncell, const PetscInt cell[],
                        PetscReal wanted_volume)
{
  static const int quad[9][8] = {{0}, {1}, {2}, {3}, {0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 1, 2, 3}};
  static const int quad_n[9]  = {1, 1, 1, 1, 2, 2, 2, 2, 4};
  static const int hex[27][8] = {{0},          {1},          {2},
                                 {3},          {4},          {5},
                                 {6},          {7},          {0, 1},
                                 {1, 2},       {2, 3},       {3, 0},
                                 {4, 5},       {5, 6},       {6, 7},
                                 {7, 4},       {0, 4},       {1, 5},
                                 {2, 6},       {3, 7},       {0, 3, 4, 7},
                                 {1, 2, 5, 6}, {0, 1, 4, 5}, {2, 3, 6, 7},
                                 {0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 2, 3, 4, 5, 6, 7}};
  static const int hex_n[27]  = {1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 4, 4, 4, 4, 4, 4, 8};
  const PetscInt   nb         = dim == 2 ? 9 : 27;
  PetscReal        volume     = 0;

  for (PetscInt c = 0; c < ncell; c++) {
    const PetscInt *node = cell + c * nb;
    PetscReal       side = 1;

    for (PetscInt k = 0; k < nb; k++) {
      const int  n      = dim == 2 ? quad_n[k] : hex_n[k];
      const int *corner = dim == 2 ? quad[k] : hex[k];

      for (PetscInt d = 0; d < 3; d++) {
        PetscReal mean = 0;

        for (int i = 0; i < n; i++) mean += x[3 * node[corner[i]] + d] / n;
        assert_close("cell node", c * nb + k, x[3 * node[k] + d], mean);
      }
    }
    /* counter-clockwise: positive */
    side = (x[3 * node[1]] - x[3 * node[0]]) * (x[3 * node[3] + 1] - x[3 * node[0] + 1]);
    if (dim == 3) side *= x[3 * node[4] + 2] - x[3 * node[0] + 2];
    assert_true(side > 0);
    volume += side;
  }
  assert_close("volume of all cells", ncell, volume, wanted_volume);
}

static void make_path(const char name[], char path[])
{
  OK(PetscSNPrintf(path, PETSC_MAX_PATH_LEN, "%s/%s", root, name));
}

static void read_text(const char dir[], const char name[], char text[], size_t len)
{
  char   path[PETSC_MAX_PATH_LEN];
  FILE  *f;
  size_t n;

  OK(PetscSNPrintf(path, sizeof(path), "%s/%s", dir, name));
  f = fopen(path, "r");
  assert_non_null(f);
  n       = fread(text, 1, len - 1, f);
  text[n] = 0;
  fclose(f);
}

/* Write n snapshots into root/name with the mesh options of the caller; dir is that directory */
static void write_snapshots(const char name[], PetscInt n, PetscBool constant, PetscBool with_body, char dir[])
{
  Case        f;
  Fields      o;
  const char *d;

  make_path(name, dir);
  set_option("-output_dir", dir);
  create_fields(&f, constant);
  OK(FieldsCreate(f.mesh, "box", &o));
  OK(FieldsOpen(o));
  OK(FieldsGetDirectory(o, &d));
  assert_string_equal(d, dir);
  for (PetscInt i = 0; i < n; i++)
    OK(FieldsWrite(o, 10 * i, 0.25 * i, f.u, f.p, with_body ? f.body : NULL, NULL, NULL));
  OK(FieldsDestroy(&o));
  assert_null(o);
  destroy_fields(&f);
  OK(PetscBarrier(NULL));
}

static void check_fields(PetscInt dim, const char dir[])
{
  PetscInt     npoint, n, ncell;
  PetscScalar *x    = read_dataset(dir, "mesh.h5", "coordinates", 3, &npoint),
              *u    = read_dataset(dir, "fields_10.h5", "velocity", 3, &n);
  PetscScalar *w    = read_dataset(dir, "fields_10.h5", "vorticity", dim == 2 ? 1 : 3, &n),
              *p    = read_dataset(dir, "fields_10.h5", "pressure", 1, &n);
  PetscScalar *pm   = read_dataset(dir, "fields_10.h5", "pressure_mean", 1, &n),
              *pg   = read_dataset(dir, "fields_10.h5", "pressure_gradient", 3, &n);
  PetscScalar *time = read_dataset(dir, "fields_10.h5", "time", 1, &n);
  PetscInt    *body = read_integers(dir, "fields_10.h5", "body", 1, &n),
           *cell    = read_integers(dir, "mesh.h5", "cells", dim == 2 ? 9 : 27, &ncell);
  PetscReal       v[3];
  const PetscReal g[3] = {1, -2, dim == 3 ? 0.5 : 0};

  assert_int_equal(n, npoint);
  assert_int_equal(ncell, dim == 2 ? 20 : 24);
  assert_int_equal(npoint, dim == 2 ? 99 : 315);
  assert_close("time", 0, time[0], 0.25);
  for (PetscInt i = 0; i < npoint; i++) {
    exact_velocity(dim, x + 3 * i, v);
    for (PetscInt d = 0; d < 3; d++) assert_close("velocity", 3 * i + d, u[3 * i + d], v[d]);
    exact_vorticity(dim, x + 3 * i, v);
    if (dim == 2) assert_close("vorticity", i, w[i], v[2]);
    for (PetscInt d = 0; d < 3 && dim == 3; d++) assert_close("vorticity", 3 * i + d, w[3 * i + d], v[d]);
    assert_close("pressure", i, p[i], exact_pressure(dim, x + 3 * i));
    assert_int_equal(body[i], is_in_body(x + 3 * i) ? 7 : -1);
  }
  for (PetscInt c = 0; c < ncell; c++) {
    const PetscInt centre = cell[(c + 1) * (dim == 2 ? 9 : 27) - 1];

    assert_close("pressure_mean", c, pm[c], exact_pressure(dim, x + 3 * centre));
    for (PetscInt d = 0; d < 3; d++) assert_close("pressure_gradient", c, pg[3 * c + d], g[d]);
  }
  check_cells(dim, x, ncell, cell, dim == 2 ? 2 : 2.25);
  OK(PetscFree(x));
  OK(PetscFree(u));
  OK(PetscFree(w));
  OK(PetscFree(p));
  OK(PetscFree(pm));
  OK(PetscFree(pg));
  OK(PetscFree(time));
  OK(PetscFree(body));
  OK(PetscFree(cell));
}

static void fields_come_back_in_2d(void **state)
{
  char dir[PETSC_MAX_PATH_LEN];

  (void)state;
  set_option("-mesh_cells", "5,4");
  set_option("-mesh_upper", "2,1");
  write_snapshots("two/levels/deep", 2, PETSC_FALSE, PETSC_TRUE, dir);
  check_fields(2, dir);
}

static void fields_come_back_in_3d(void **state)
{
  char dir[PETSC_MAX_PATH_LEN];

  (void)state;
  set_option("-mesh_dimension", "3");
  set_option("-mesh_cells", "2,3,4");
  set_option("-mesh_upper", "1.5,1,1.5");
  write_snapshots("box3", 2, PETSC_FALSE, PETSC_TRUE, dir);
  check_fields(3, dir);
  set_option("-mesh_dimension", NULL);
}

/* Cells of a periodic mesh share their points but across the period, over which none is stretched */
static void periodic_cells_are_whole(void **state)
{
  char         dir[PETSC_MAX_PATH_LEN];
  PetscInt     npoint, ncell, n, *cell;
  PetscScalar *x, *u, *p, *w;

  (void)state;
  set_option("-mesh_cells", "5,4");
  set_option("-mesh_upper", "2,1");
  set_option("-mesh_periodic", "x");
  write_snapshots("periodic", 1, PETSC_TRUE, PETSC_TRUE, dir);
  set_option("-mesh_periodic", NULL);
  x    = read_dataset(dir, "mesh.h5", "coordinates", 3, &npoint);
  cell = read_integers(dir, "mesh.h5", "cells", 9, &ncell);
  u    = read_dataset(dir, "fields_0.h5", "velocity", 3, &n);
  assert_int_equal(ncell, 20);
  assert_int_equal(npoint, 11 * 9);
  assert_int_equal(n, npoint);
  check_cells(2, x, ncell, cell, 2);
  w = read_dataset(dir, "fields_0.h5", "vorticity", 1, &n);
  p = read_dataset(dir, "fields_0.h5", "pressure", 1, &n);
  for (PetscInt i = 0; i < npoint; i++) {
    assert_close("velocity", i, u[3 * i], 1);
    assert_close("velocity", i, u[3 * i + 1], 2);
    assert_close("velocity", i, u[3 * i + 2], 0);
    assert_close("vorticity", i, w[i], 0);
    assert_close("pressure", i, p[i], 4);
  }
  OK(PetscFree(x));
  OK(PetscFree(cell));
  OK(PetscFree(u));
  OK(PetscFree(w));
  OK(PetscFree(p));
}

static void index_names_the_snapshots(void **state)
{
  char  dir[PETSC_MAX_PATH_LEN], text[16384], path[PETSC_MAX_PATH_LEN];
  char *first, *second;

  (void)state;
  set_option("-mesh_cells", "3,3");
  set_option("-mesh_upper", "1,1");
  write_snapshots("index", 2, PETSC_FALSE, PETSC_FALSE, dir);
  read_text(dir, "fields.xdmf", text, sizeof(text));
  assert_non_null(strstr(text, "TopologyType=\"Quadrilateral_9\" NumberOfElements=\"9\""));
  first  = strstr(text, "<Time Value=\"0\"/>");
  second = strstr(text, "<Time Value=\"0.25\"/>");
  assert_non_null(first);
  assert_non_null(second);
  assert_true(strstr(first, "fields_0.h5:/velocity") < second);
  assert_non_null(strstr(second, "Dimensions=\"49 3\">fields_10.h5:/velocity"));
  assert_null(strstr(text, ":/body")); /* not written, so not named */
  OK(PetscSNPrintf(path, sizeof(path), "%s/fields.xdmf.part", dir));
  assert_int_not_equal(access(path, F_OK), 0);
}

/* A fluid pressure next to a body must not be mixed with the value of cells inside it */
static void solid_cells_stay_out_of_the_average(void **state)
{
  const MeshLocal *m;
  char             dir[PETSC_MAX_PATH_LEN];
  Case             f;
  Fields           o;
  PetscScalar     *a, *p, *x;
  PetscReal        xc[MESH_MAX_NB * 3];
  PetscInt         n;

  (void)state;
  set_option("-mesh_cells", "4,4");
  make_path("solid", dir);
  set_option("-output_dir", dir);
  create_fields(&f, PETSC_TRUE);
  OK(MeshGetLocal(f.mesh, &m));
  for (PetscInt i = 0; i < m->nnode_all; i++) f.body[i] = m->x[2 * i] < 0.5 + 1e-9 ? 0 : -1;
  a = f.p;
  for (PetscInt c = 0; c < m->ncell; c++) {
    OK(MeshCellCoordinates(f.mesh, c, xc));
    if (xc[8] < 0.5) a[3 * c] = -1000;
  }
  OK(FieldsCreate(f.mesh, "box", &o));
  OK(FieldsOpen(o));
  OK(FieldsWrite(o, 0, 0, f.u, f.p, f.body, NULL, NULL));
  OK(FieldsDestroy(&o));
  destroy_fields(&f);
  OK(PetscBarrier(NULL));
  p = read_dataset(dir, "fields_0.h5", "pressure", 1, &n);
  x = read_dataset(dir, "mesh.h5", "coordinates", 3, &n);
  for (PetscInt i = 0; i < n; i++) {
    if (PetscAbsReal(p[i] - (x[3 * i] > 0.499 ? 4 : -1000)) > 1e-6)
      fail_msg("pressure %g at x = %g", (double)p[i], (double)x[3 * i]);
  }
  OK(PetscFree(x));
  OK(PetscFree(p));
}

static PetscErrorCode create_in(const char dir[], Mesh mesh)
{
  Fields         o = NULL;
  PetscErrorCode err;

  message[0] = 0;
  set_option("-output_dir", dir);
  OK(PetscPushErrorHandler(record_message, NULL));
  err = FieldsCreate(mesh, "box", &o);
  if (!err) err = FieldsOpen(o);
  OK(PetscPopErrorHandler());
  if (o) OK(FieldsDestroy(&o));
  return err;
}

static void touch(const char path[])
{
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (rank == 0) {
    FILE *f = fopen(path, "w");

    assert_non_null(f);
    fclose(f);
  }
  OK(PetscBarrier(NULL));
}

static void wrong_directories_are_refused(void **state)
{
  Mesh mesh;
  char dir[PETSC_MAX_PATH_LEN], path[PETSC_MAX_PATH_LEN + 16];

  (void)state;
  set_option("-mesh_cells", "4,4");
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  make_path("used", dir);
  OK(create_in(dir, mesh));
  OK(create_in(dir, mesh)); /* an empty directory may be there */
  snprintf(path, sizeof(path), "%s/series.csv", dir);
  touch(path);
  assert_int_equal(create_in(dir, mesh), PETSC_ERR_USER_INPUT);
  assert_non_null(strstr(message, "-output_overwrite"));
  assert_non_null(strstr(message, dir));
  set_option("-output_overwrite", "true");
  OK(create_in(dir, mesh));
  set_option("-output_overwrite", NULL);

  strcat(path, "/below"); /* series.csv is a file */
  assert_int_equal(create_in(path, mesh), PETSC_ERR_FILE_OPEN);
  assert_non_null(strstr(message, "-output_dir"));
  OK(MeshDestroy(&mesh));
}

static void make_root(void)
{
  PetscMPIInt rank;

  snprintf(root, sizeof(root), "/tmp/tumble-test-output-XXXXXX");
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (rank == 0) assert_non_null(mkdtemp(root));
  OK(MPI_Bcast(root, sizeof(root), MPI_CHAR, 0, PETSC_COMM_WORLD));
}

static void remove_root(void)
{
  PetscMPIInt rank;
  char        command[PETSC_MAX_PATH_LEN + 16];

  OK(PetscBarrier(NULL));
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  snprintf(command, sizeof(command), "rm -rf '%s'", root);
  if (rank == 0 && !getenv("TUMBLE_TEST_KEEP")) OK(system(command));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(fields_come_back_in_2d),
    cmocka_unit_test(fields_come_back_in_3d),
    cmocka_unit_test(periodic_cells_are_whole),
    cmocka_unit_test(index_names_the_snapshots),
    cmocka_unit_test(solid_cells_stay_out_of_the_average),
    cmocka_unit_test(wrong_directories_are_refused),
  };
  int failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  if (LogInitialize()) return 1;
  make_root();
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  remove_root();
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
