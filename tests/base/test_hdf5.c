/* Hdf5: arrays and attributes come back on any distribution; what is not there or could not be written is told by all
   ranks. */
/* ranks: 1 2 3 */
#include "core.h"
#include "base/hdf5.h"
#include <hdf5.h>
#include <signal.h>
#include <sys/resource.h>

static char        path[PETSC_MAX_PATH_LEN];
static PetscMPIInt rank, size;

/* rank + 1 rows here */
static Hdf5Rows uneven(void)
{
  Hdf5Rows rows;

  OK(Hdf5SpreadRows(PETSC_COMM_WORLD, rank + 1, &rows));
  return rows;
}

static void test_rows(void **state)
{
  const Hdf5Rows rows = uneven();

  (void)state;
  assert_int_equal(rows.n, rank + 1);
  assert_int_equal(rows.start, rank * (rank + 1) / 2);
  assert_int_equal(rows.total, size * (size + 1) / 2);
}

static void write_file(void)
{
  const Hdf5Rows rows = uneven();
  PetscReal      x[2 * 8];
  PetscInt       number[8];
  unsigned char  letter = 'x';
  char           reason[256];
  Hdf5           file;

  for (PetscInt i = 0; i < rows.n; i++) {
    number[i] = rows.start + i;
    for (PetscInt d = 0; d < 2; d++) x[2 * i + d] = noise(2 * number[i] + d);
  }
  OK(Hdf5Create(PETSC_COMM_WORLD, path, &file));
  OK(Hdf5Write(file, "/group/x", HDF5_REAL, rows, 2, x));
  OK(Hdf5WriteReals(file, "line", rows.n, 1, x));
  OK(Hdf5WriteInts(file, "number", rank ? rows.n : 0, 1, number));
  OK(Hdf5Write(file, "letter", HDF5_BYTE, rank ? (Hdf5Rows){0, 1, 1} : (Hdf5Rows){1, 0, 1}, 0, &letter));
  OK(Hdf5WriteAttribute(file, "/group/x", "count", HDF5_INT, 1, &rows.total));
  OK(Hdf5WriteAttribute(file, "/", "title", HDF5_BYTE, 6, "rooms"));
  OK(Hdf5Close(&file, reason, sizeof(reason)));
  assert_string_equal(reason, "");
}

static void test_return(void **state)
{
  const PetscInt total = size * (size + 1) / 2;
  const Hdf5Rows rows  = rank ? (Hdf5Rows){0, total, total} : (Hdf5Rows){total, 0, total};
  PetscReal      x[2 * 16];
  PetscInt       n, bs, count = 0;
  char           title[16] = "";
  PetscBool      good;
  Hdf5           file;

  (void)state;
  write_file();
  OK(Hdf5Open(PETSC_COMM_WORLD, path, &file, &good));
  assert_true(good);
  OK(Hdf5GetSize(file, "/group/x", &n, &bs));
  assert_int_equal(n, rows.total);
  assert_int_equal(bs, 2);
  OK(Hdf5Read(file, "/group/x", HDF5_REAL, rows, 2, x, &good));
  assert_true(good);
  for (PetscInt i = 0; i < 2 * rows.n; i++) assert_true(x[i] == noise(i));
  OK(Hdf5ReadAttribute(file, "/group/x", "count", HDF5_INT, 1, &count, &good));
  assert_true(good);
  assert_int_equal(count, rows.total);
  OK(Hdf5ReadAttribute(file, "/", "title", HDF5_BYTE, sizeof(title), title, &good));
  assert_true(good);
  assert_string_equal(title, "rooms");
  OK(Hdf5Close(&file, NULL, 0));
}

/* One dimension where the number of columns says so */
static void test_shapes(void **state)
{
  PetscInt  n, bs;
  PetscBool good;
  Hdf5      file;

  (void)state;
  write_file();
  OK(Hdf5Open(PETSC_COMM_WORLD, path, &file, &good));
  OK(Hdf5GetSize(file, "line", &n, &bs));
  assert_int_equal(n, size * (size + 1) / 2);
  assert_int_equal(bs, 0);
  OK(Hdf5GetSize(file, "number", &n, &bs));
  assert_int_equal(n, size * (size + 1) / 2 - 1);
  assert_int_equal(bs, 1);
  OK(Hdf5Close(&file, NULL, 0));
}

static void test_missing(void **state)
{
  PetscInt  n, bs;
  PetscReal x[16];
  PetscBool good;
  Hdf5      file;

  (void)state;
  write_file();
  OK(Hdf5Open(PETSC_COMM_WORLD, path, &file, &good));
  OK(Hdf5GetSize(file, "/nowhere/x", &n, &bs));
  assert_int_equal(n, -1);
  OK(Hdf5Read(file, "/nowhere/x", HDF5_REAL, uneven(), 1, x, &good));
  assert_false(good);
  OK(Hdf5ReadAttribute(file, "/group/x", "nothing", HDF5_INT, 1, &n, &good));
  assert_false(good);
  OK(Hdf5Close(&file, NULL, 0));
  OK(Hdf5Open(PETSC_COMM_WORLD, "/tmp/tumble-no-such-directory/x.h5", &file, &good));
  assert_false(good);
  OK(Hdf5Close(&file, NULL, 0));
}

/* The name of what failed first */
static void test_failures(void **state)
{
  const PetscReal x = 1;
  char            reason[256];
  Hdf5            file;

  (void)state;
  OK(Hdf5Create(PETSC_COMM_WORLD, "/tmp/tumble-no-such-directory/x.h5", &file));
  OK(Hdf5WriteReals(file, "x", 1, 1, &x));
  OK(Hdf5Close(&file, reason, sizeof(reason)));
  assert_string_equal(reason, "HDF5 fails at the file (No such file or directory)");
  OK(Hdf5Create(PETSC_COMM_WORLD, path, &file));
  OK(Hdf5WriteReals(file, "x", 1, 1, &x));
  OK(Hdf5WriteReals(file, "x", 1, 1, &x));
  OK(Hdf5Close(&file, reason, sizeof(reason)));
  assert_string_equal(reason, "HDF5 fails at x");
}

/* A file that a tool has written anew, in chunks and as other types, reads the same: overlapping rows, too */
static void test_foreign(void **state)
{
  const hsize_t   total[2] = {6, 2}, chunk[2] = {4, 1};
  const Hdf5Rows  rows      = {rank < 3 ? 4 : 0, rank < 3 ? rank : 0, 6};
  const PetscReal value[12] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11};
  PetscReal       x[8];
  PetscBool       good;
  Hdf5            h;

  (void)state;
  if (!rank) {
    const hid_t file  = H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                space = H5Screate_simple(2, total, NULL), how = H5Pcreate(H5P_DATASET_CREATE);
    hid_t set;

    H5Pset_chunk(how, 2, chunk);
    set = H5Dcreate2(file, "x", H5T_STD_I16BE, space, H5P_DEFAULT, how, H5P_DEFAULT);
    assert_true(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, value) >= 0);
    H5Dclose(set);
    H5Pclose(how);
    H5Sclose(space);
    H5Fclose(file);
  }
  MPI_Barrier(PETSC_COMM_WORLD);
  OK(Hdf5Open(PETSC_COMM_WORLD, path, &h, &good));
  OK(Hdf5Read(h, "x", HDF5_REAL, rows, 2, x, &good));
  assert_true(good);
  for (PetscInt i = 0; i < 2 * rows.n; i++) assert_true(x[i] == (PetscReal)(2 * rows.start + i));
  OK(Hdf5Read(h, "x", HDF5_REAL, (Hdf5Rows){0, 0, 5}, 2, x, &good)); /* another length */
  assert_false(good);
  OK(Hdf5Close(&h, NULL, 0));
}

/* The disk is full for the last rank alone: the others do not wait for it, all say why */
static void test_full(void **state)
{
  const PetscInt      n     = 1000;
  const struct rlimit small = {(rlim_t)(rank == size - 1 ? 4096 : RLIM_INFINITY), RLIM_INFINITY},
                      all   = {RLIM_INFINITY, RLIM_INFINITY};
  PetscReal *x;
  char       reason[256];
  Hdf5       file;

  (void)state;
  if (size == 1) return; /* HDF5 falls over a file that it cannot close when the program ends */
  OK(PetscCalloc1(n, &x));
  signal(SIGXFSZ, SIG_IGN);
  assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
  OK(Hdf5Create(PETSC_COMM_WORLD, path, &file));
  OK(Hdf5WriteReals(file, "first", n, 1, x));
  OK(Hdf5WriteReals(file, "second", n, 1, x));
  OK(Hdf5Close(&file, reason, sizeof(reason)));
  assert_int_equal(setrlimit(RLIMIT_FSIZE, &all), 0);
  assert_string_equal(reason, "HDF5 fails at first (File too large)");
  OK(PetscFree(x));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_rows),     cmocka_unit_test(test_return),
                                     cmocka_unit_test(test_shapes),   cmocka_unit_test(test_missing),
                                     cmocka_unit_test(test_failures), cmocka_unit_test(test_foreign),
                                     cmocka_unit_test(test_full)};
  int                     failed, pid = (int)getpid();

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  PetscCallMPI(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  PetscCallMPI(MPI_Bcast(&pid, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  snprintf(path, sizeof(path), "/tmp/tumble-hdf5-%d.h5", pid);
  failed = cmocka_run_group_tests_name("hdf5", tests, NULL, NULL);
  if (!rank) unlink(path);
  PetscCall(PetscFinalize());
  return failed;
}
