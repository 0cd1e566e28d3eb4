/* State: what is saved comes back, also on another distribution of the mesh; files that are no whole checkpoints of the
   mesh are refused with their reason. */
/* ranks: 1 2 3 */
#include "core.h"
#include "mesh/state.h"
#include <hdf5.h>
#include <sys/stat.h>

static char path[PETSC_MAX_PATH_LEN];

/* A module with state of every kind */
typedef struct {
  const MeshLocal *l;
  PetscReal       *u, *p, real[3];
  PetscInt         number[2], length;
  PetscReal       *list; /* its length is state */
  char            *text;
} Thing;

static PetscErrorCode visit_thing(void *thing, State s)
{
  Thing *t = thing;

  PetscFunctionBeginUser;
  PetscCall(StateNodes(s, "u", t->l->dim, t->u));
  PetscCall(StateCells(s, "p", t->l->dim + 1, t->p));
  PetscCall(StateReals(s, "real", 3, t->real));
  PetscCall(StateInts(s, "number", 2, t->number));
  if (StateIsLoading(s)) {
    PetscCall(StateGetSize(s, "list", &t->length));
    PetscCall(PetscMalloc1(t->length, &t->list));
  }
  PetscCall(StateReals(s, "list", t->length, t->list));
  PetscCall(StateText(s, "text", &t->text));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void create_thing(const MeshLocal *l, Thing *t)
{
  memset(t, 0, sizeof(*t));
  t->l = l;
  OK(PetscCalloc1(l->nnode_all * l->dim, &t->u));
  OK(PetscCalloc1(l->ncell * (l->dim + 1), &t->p));
}

static void destroy_thing(Thing *t)
{
  OK(PetscFree(t->u));
  OK(PetscFree(t->p));
  OK(PetscFree(t->list));
  OK(PetscFree(t->text));
}

/* Values that depend on the place alone; nodes with ghosts, or cells */
static void fill_by_place(Thing *t)
{
  const MeshLocal *l = t->l;

  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++)
    t->u[i] = PetscSinReal(17 * l->x[i]) + 3 * l->x[i / l->dim * l->dim];
  for (PetscInt i = 0; i < l->ncell * (l->dim + 1); i++) {
    const PetscReal *x = l->x + l->cell_node[i / (l->dim + 1) * l->nb + l->nb / 2] * l->dim;

    t->p[i] = x[0] + 10 * x[1] + 100 * (i % (l->dim + 1));
  }
}

static void fill_thing(Thing *t)
{
  fill_by_place(t);
  t->real[0]   = PETSC_MAX_REAL;
  t->real[1]   = -1e-300;
  t->real[2]   = PETSC_PI;
  t->number[0] = -5;
  t->number[1] = PETSC_MAX_INT;
  t->length    = 4;
  OK(PetscMalloc1(4, &t->list));
  for (PetscInt i = 0; i < 4; i++) t->list[i] = 0.1 * i;
  OK(PetscStrallocpy("-a 1\n-b two words\n", &t->text));
}

/* Bit for bit what fill_thing() makes, but for nodes and cells within `tolerance` */
static void check_thing(const Thing *t, PetscReal tolerance)
{
  Thing want;

  create_thing(t->l, &want);
  fill_thing(&want);
  BELOW(max_difference(t->l->nnode_all * t->l->dim, t->u, want.u), tolerance);
  BELOW(max_difference(t->l->ncell * (t->l->dim + 1), t->p, want.p), tolerance);
  assert_memory_equal(t->real, want.real, sizeof(want.real));
  assert_memory_equal(t->number, want.number, sizeof(want.number));
  assert_int_equal(t->length, 4);
  assert_memory_equal(t->list, want.list, 4 * sizeof(PetscReal));
  assert_string_equal(t->text, want.text);
  destroy_thing(&want);
}

static PetscErrorCode save(Mesh mesh, Thing *t)
{
  State s;

  PetscFunctionBeginUser;
  PetscCall(MeshCreateState(mesh, &s));
  PetscCall(StateBeginSave(s, path));
  PetscCall(StateModule(s, "thing"));
  PetscCall(visit_thing(t, s));
  PetscCall(StateEnd(s));
  PetscCall(StateDestroy(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode load(Mesh mesh, StateVisit visit, void *t, PetscBool *same)
{
  State s;

  PetscFunctionBeginUser;
  PetscCall(MeshCreateState(mesh, &s));
  PetscCall(StateBeginLoad(s, path));
  PetscCall(StateModule(s, "thing"));
  PetscCall(visit(t, s));
  *same = StateIsSamePartition(s);
  PetscCall(StateEnd(s));
  PetscCall(StateDestroy(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void write_file(const char options[])
{
  Mesh             mesh;
  const MeshLocal *l;
  Thing            t;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  create_thing(l, &t);
  fill_thing(&t);
  OK(save(mesh, &t));
  destroy_thing(&t);
  OK(MeshDestroy(&mesh));
}

static void read_file(const char options[], PetscBool same_wanted, PetscReal tolerance)
{
  Mesh             mesh;
  const MeshLocal *l;
  Thing            t;
  PetscBool        same;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  create_thing(l, &t);
  OK(load(mesh, visit_thing, &t, &same));
  assert_int_equal(same, same_wanted);
  check_thing(&t, tolerance);
  destroy_thing(&t);
  OK(MeshDestroy(&mesh));
}

static void test_same(void **state)
{
  (void)state;
  struct stat st;

  write_file("-mesh_cells 9,7");
  assert_int_equal(stat(path, &st), 0);
  read_file("-mesh_cells 9,7", PETSC_TRUE, 0);
}

/* Another order of the cells, and on several ranks another partition: found by place */
static void test_redistributed(void **state)
{
  (void)state;
  write_file("-mesh_cells 9,7 -mesh_periodic x -petscpartitioner_type simple");
  read_file("-mesh_cells 9,7 -mesh_periodic x -mesh_order rcm", PETSC_FALSE, 1e-12);
  write_file("-mesh_kind annulus -petscpartitioner_type simple");
  read_file("-mesh_kind annulus -mesh_order rcm", PETSC_FALSE, 1e-12);
  write_file("-mesh_dimension 3 -mesh_cells 4,3,5 -petscpartitioner_type simple");
  read_file("-mesh_dimension 3 -mesh_cells 4,3,5 -mesh_order rcm", PETSC_FALSE, 1e-12);
}

/* ---- refusals ---- */

static char message[4096];

static PetscErrorCode keep_message(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode code,
                                   PetscErrorType type, const char *text, void *ctx)
{
  (void)comm;
  (void)line;
  (void)function;
  (void)file;
  (void)ctx;
  if (type == PETSC_ERROR_INITIAL) snprintf(message, sizeof(message), "%s", text);
  return code;
}

static void expect_refusal(const char options[], StateVisit visit, const char text[])
{
  Mesh             mesh;
  const MeshLocal *l;
  Thing            t;
  PetscBool        same;
  PetscErrorCode   code;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  create_thing(l, &t);
  message[0] = 0;
  OK(PetscPushErrorHandler(keep_message, NULL));
  code = load(mesh, visit, &t, &same);
  OK(PetscPopErrorHandler());
  assert_int_not_equal(code, 0);
  if (!strstr(message, text)) fail_msg("'%s' is not in '%s'", text, message);
  destroy_thing(&t);
  OK(MeshDestroy(&mesh));
}

/* Rank 0 changes the file */
static void edit(long keep, long at, int flip)
{
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  if (!rank && keep >= 0) assert_int_equal(truncate(path, keep), 0);
  if (!rank && flip) {
    FILE *f = fopen(path, "r+b");
    int   c;

    assert_non_null(f);
    fseek(f, at, SEEK_SET);
    c = fgetc(f);
    fseek(f, at, SEEK_SET);
    fputc(c ^ flip, f);
    fclose(f);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
}

static void test_broken_files(void **state)
{
  (void)state;
  struct stat st;
  PetscMPIInt rank;
  FILE       *f;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  write_file("-mesh_cells 9,7");
  assert_int_equal(stat(path, &st), 0);
  edit((long)st.st_size - 1, 0, 0);
  expect_refusal("-mesh_cells 9,7", visit_thing, "truncated");
  edit(20, 0, 0);
  expect_refusal("-mesh_cells 9,7", visit_thing, "truncated");
  edit(0, 0, 0);
  expect_refusal("-mesh_cells 9,7", visit_thing, "empty");
  if (!rank) {
    f = fopen(path, "w");
    fprintf(f, "mesh: {cells: [9, 7]}\n");
    fclose(f);
  }
  edit(-1, 0, 0);
  expect_refusal("-mesh_cells 9,7", visit_thing, "no HDF5 file");
  if (!rank) assert_true(H5Fclose(H5Fcreate(path, H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)) >= 0);
  edit(-1, 0, 0);
  expect_refusal("-mesh_cells 9,7", visit_thing, "no checkpoint of tumble");
  if (!rank) unlink(path);
  edit(-1, 0, 0);
  expect_refusal("-mesh_cells 9,7", visit_thing, "No such file");
}

/* Where array "thing/u" begins in the file */
static long find_array(void)
{
  hid_t file = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT), set;
  long  at;

  assert_true(file >= 0);
  set = H5Dopen2(file, "thing/u", H5P_DEFAULT);
  at  = (long)H5Dget_offset(set);
  H5Dclose(set);
  H5Fclose(file);
  return at;
}

static void test_checksum(void **state)
{
  (void)state;
  long at;

  write_file("-mesh_cells 9,7");
  at = find_array();
  edit(-1, at + 100, 4);
  expect_refusal("-mesh_cells 9,7", visit_thing, "checksum");
  expect_refusal("-mesh_cells 9,7 -mesh_order rcm", visit_thing, "checksum");
  edit(-1, at + 100, 4);
  read_file("-mesh_cells 9,7", PETSC_TRUE, 0);
}

static void test_other_meshes(void **state)
{
  (void)state;
  write_file("-mesh_cells 9,7");
  expect_refusal("-mesh_cells 10,7", visit_thing, "63 cells");
  expect_refusal("-mesh_cells 9,7 -mesh_upper 1,2", visit_thing, "another mesh");
  expect_refusal("-mesh_cells 7,9", visit_thing, "another mesh");
}

static PetscErrorCode visit_unknown(void *thing, State s)
{
  PetscFunctionBeginUser;
  PetscCall(StateReals(s, "spin", 3, ((Thing *)thing)->real));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode visit_longer(void *thing, State s)
{
  PetscFunctionBeginUser;
  PetscCall(StateReals(s, "real", 2, ((Thing *)thing)->real));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void test_other_arrays(void **state)
{
  (void)state;
  write_file("-mesh_cells 9,7");
  expect_refusal("-mesh_cells 9,7", visit_unknown, "has no '/thing/spin'");
  expect_refusal("-mesh_cells 9,7", visit_longer, "3 x 1 values of '/thing/real'");
}

static void test_no_directory(void **state)
{
  (void)state;
  Mesh             mesh;
  const MeshLocal *l;
  Thing            t;
  PetscErrorCode   code;
  char             kept[PETSC_MAX_PATH_LEN];

  give("-mesh_cells 9,7");
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  create_thing(l, &t);
  fill_thing(&t);
  OK(PetscStrncpy(kept, path, sizeof(kept)));
  OK(PetscStrncpy(path, "/tmp/tumble-no-such-directory/x.h5", sizeof(path)));
  OK(PetscPushErrorHandler(keep_message, NULL));
  code = save(mesh, &t);
  OK(PetscPopErrorHandler());
  OK(PetscStrncpy(path, kept, sizeof(path)));
  assert_int_not_equal(code, 0);
  if (!strstr(message, "Cannot write checkpoint")) fail_msg("'%s'", message);
  destroy_thing(&t);
  OK(MeshDestroy(&mesh));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_same),         cmocka_unit_test(test_redistributed),
                                     cmocka_unit_test(test_broken_files), cmocka_unit_test(test_checksum),
                                     cmocka_unit_test(test_other_meshes), cmocka_unit_test(test_other_arrays),
                                     cmocka_unit_test(test_no_directory)};
  int                     failed, pid = (int)getpid();
  PetscMPIInt             rank;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  PetscCallMPI(MPI_Bcast(&pid, 1, MPI_INT, 0, PETSC_COMM_WORLD));
  PetscCallMPI(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  snprintf(path, sizeof(path), "/tmp/tumble-state-%d.h5", pid);
  failed = cmocka_run_group_tests_name("state", tests, NULL, NULL);
  if (!rank) unlink(path);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
