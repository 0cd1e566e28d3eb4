/* Pressure on a device: the kernels for devices, as they run on the processor, give the numbers of the pressure
   operator of real meshes (its rows in both precisions, also made there, its smoother's blocks), of the transfer to the
   vertices and back, and a two-level preconditioner that is symmetric and solves. */
#include "core.h"
#include "flow/device.h"
#include "solve/system.h"
#include "pressure/devicelevels.h"
#include "pressure/devicerows.h"
#include "pressure/pressure.h"
#include "../flow/devicecells.h"

#define CLOSE 1e-12 /* of the largest */

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Constraint       constraint;
  Pressure         pressure;
  Transfer         transfer;
  const MeshLocal *l;
  PetscInt         np;
  Mat              S; /* the rows */
  DeviceQueue      queue;
  DeviceRows       rows;
  size_t           room[5];
  PetscReal       *weight;
  DeviceTransfer   vertices;
} Case;

static void open_case(Case *c, const char options[])
{
  const unsigned char *fixed;
  const PetscReal     *value, *mass;
  PetscReal            none[1] = {0};
  Mat                  all;

  give("-mesh_dimension 3 -mesh_upper 1.5,1,1");
  OK(PetscOptionsInsertString(NULL, options));
  OK(PressureSetDefaults());
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(ConstraintCreate(c->mesh, 0, &c->constraint));
  OK(ConditionsGetValues(FlowConditions(c->flow), &fixed, &value));
  OK(ConstraintSetBoundary(c->constraint, fixed, value));
  OK(PressureCreate(c->flow, c->constraint, &c->pressure));
  OK(FlowGetLumpedMass(c->flow, &mass));
  OK(PetscMalloc1(c->l->nnode_all * 3, &c->weight));
  for (PetscInt i = 0; i < c->l->nnode_all * 3; i++) c->weight[i] = fixed[i / 3] >> i % 3 & 1 ? 0 : 1 / mass[i / 3];
  OK(PressureUpdate(c->pressure, c->weight, NULL, none));
  OK(PressureGetMats(c->pressure, &all, &c->S));
  OK(TransferCreate(c->mesh, 4, &c->transfer));
  OK(TransferUpdateCells(c->transfer, c->l->ncell_all, NULL, NULL));
  c->np    = c->l->ncell * 4;
  c->queue = (DeviceQueue){.run = DeviceGetKernels("cpu")};
  c->rows  = (DeviceRows){0};
  OK(DeviceRowsRenew(&c->queue, c->S, PETSC_FALSE, &c->rows, c->room));
  OK(DeviceTransferCreate(&c->queue, c->transfer, c->l->ncell, &c->vertices));
}

static void close_case(Case *c)
{
  OK(DeviceRowsDestroy(&c->queue, &c->rows));
  OK(DeviceTransferDestroy(&c->queue, &c->vertices));
  OK(PetscFree(c->weight));
  OK(TransferDestroy(&c->transfer));
  OK(PressureDestroy(&c->pressure));
  OK(ConstraintDestroy(&c->constraint));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static void multiply(Case *c, const PetscReal x[], PetscReal y[])
{
  Vec v, w;

  OK(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, c->np, x, &v));
  OK(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, c->np, y, &w));
  OK(BlockGSMultiplySparse(c->S, v, w));
  OK(VecDestroy(&v));
  OK(VecDestroy(&w));
}

/* Products and residuals; d = c1 d + c2 D^-1 (b - S x) with the blocks of the rows */
static void check_rows(Case *c)
{
  const DeviceKernels *run = c->queue.run;
  const PetscInt       np  = c->np;
  PetscReal           *x, *b, *y, *want, *d;

  OK(PetscCalloc5(np, &x, np, &b, np, &y, np, &want, np, &d));
  fill_noise_pressure(c->l, 1, x);
  fill_noise_pressure(c->l, 2, b);
  multiply(c, x, want);
  if (c->rows.value) {
    OK((*run->multiply_rows)(&c->queue, &c->rows, x, y));
    BELOW(max_difference(np, y, want), CLOSE * max_abs(np, want));
  }
  OK((*run->residual_rows)(&c->queue, &c->rows, b, x, y));
  for (PetscInt i = 0; i < np; i++) y[i] = b[i] - y[i];
  BELOW(max_difference(np, y, want), 1e-5 * max_abs(np, want));
  for (PetscInt i = 0; i < np; i++) b[i] += want[i]; /* residual b - S x: the old b */
  fill_noise_pressure(c->l, 3, d);
  OK((*run->smooth_rows)(&c->queue, &c->rows,
                         &(DeviceChebyshev){.c1 = 0.3, .c2 = 0.7, .b = b, .x = x, .d = d, .x_new = y}));
  for (PetscInt i = 0; i < np; i++) { /* the block of a row times what it took is the residual */
    y[i] = (d[i] - 0.3 * noise(3 * 1000003 + c->l->cell_start * 4 + i)) / 0.7;
    b[i] -= want[i];
  }
  for (PetscInt r = 0; r < c->rows.n; r++) {
    PetscInt e = c->rows.start[r];

    while (c->rows.column[e] != r) e++;
    for (PetscInt k = 0; k < 4; k++) {
      want[r * 4 + k] = 0;
      for (PetscInt m = 0; m < 4; m++)
        want[r * 4 + k] += (PetscReal)c->rows.single[(c->rows.at[r] + e - c->rows.start[r]) * 16 + 4 * m + k] *
                           y[r * 4 + m];
    }
  }
  BELOW(max_difference(np, want, b), 1e-4 * max_abs(np, want));
  OK(PetscFree5(x, b, y, want, d));
}

/* All rows once more, made there, one after the other: the host's but for its rounding (1e-11), with the inverses of
   the blocks on the diagonal */
static void check_made(Case *c)
{
  const DeviceKernels *run  = c->queue.run;
  const PetscInt       n    = c->rows.n;
  const DevicePairs    none = {0};
  struct _p_RowsView   host;
  DeviceRows           r = c->rows;
  DeviceCells          cells;
  DeviceDivergence     divergence;
  PetscReal           *work, largest;
  int                 *place, *row, *where;

  OK(FlowCreateDeviceCells(c->flow, &c->queue, n, NULL, &cells));
  OK(FlowCreateDeviceDivergence(c->flow, &c->queue, &cells, NULL, &divergence));
  OK(PetscMalloc3(r.start[n] * 16, &r.value, r.start[n] * 16, &r.single, n * 16, &r.inverse));
  OK(PetscMalloc6(n, &r.at, n, &r.kind, n, &place, n, &row, n, &where, n * 16, &work));
  for (int e = 0; e < cells.ngroup * DEVICE_GROUP; e++)
    if (cells.cell[e] >= 0) place[cells.cell[e]] = e;
  for (int i = 0; i < n; i++) row[i] = r.kind[i] = i;
  OK((*run->body.make_rows)(&c->queue, &cells, &divergence, place, c->weight, (int)n, row, r.start, &r));
  OK((*run->body.invert_rows)(&c->queue, (int)n, row, &none, where, work, &r));
  OK(BlockGSGetRows(c->S, &host));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal *want = c->rows.value + c->rows.at[i] * 16, *got = r.value + r.at[i] * 16;
    const PetscInt   all = (r.start[i + 1] - r.start[i]) * 16;

    BELOW(max_difference(all, got, want), (host.exact ? 1e-11 : 1e-7) * max_abs(all, want));
    largest = 0;
    for (PetscInt e = 0; e < 16; e++) largest = PetscMax(largest, PetscAbsReal((PetscReal)host.inverse[i * 16 + e]));
    for (PetscInt e = 0; e < 16; e++)
      BELOW(PetscAbsReal((PetscReal)(r.inverse[i * 16 + e] - host.inverse[i * 16 + e])), 1e-6 * largest);
  }
  OK(PetscFree3(r.value, r.single, r.inverse));
  OK(PetscFree6(r.at, r.kind, place, row, where, work));
  OK(FlowDestroyDeviceDivergence(&c->queue, &divergence));
  OK(DeviceCellsDestroy(&c->queue, &cells));
}

static void check_vertices(Case *c)
{
  const DeviceKernels *run = c->queue.run;
  const PetscInt       nv  = c->vertices.nvertex;
  PetscReal           *r, *x, *v, *want, *other;

  OK(PetscCalloc5(c->np, &r, c->np, &x, nv, &v, PetscMax(nv, c->np), &want, nv, &other));
  fill_noise_pressure(c->l, 4, r);
  OK(TransferRestrict(c->transfer, r, want));
  OK((*run->vertices.add_restricted)(&c->queue, &c->vertices, r, v));
  BELOW(max_difference(nv, v, want), CLOSE * max_abs(nv, want));
  OK(PetscArraycpy(other, v, nv));
  OK(PetscArraycpy(x, r, c->np));
  OK(TransferInterpolateAdd(c->transfer, other, x, NULL));
  OK((*run->vertices.add_interpolated)(&c->queue, &c->vertices, v, r));
  BELOW(max_difference(c->np, r, x), CLOSE * max_abs(c->np, x));
  OK(PetscFree5(r, x, v, want, other));
}

/* ---- the two levels ---- */

/* I^T S I and a little of the identity: hourglasses, which no cell sees, and the constant have no value */
static void make_matrix(Case *c, Mat *A)
{
  const PetscInt nv = c->vertices.nvertex;
  PetscReal     *unit, *p, *sp, *column, shift = 0;

  OK(PetscCalloc4(nv, &unit, c->np, &p, c->np, &sp, nv, &column));
  OK(MatCreateSeqAIJ(PETSC_COMM_SELF, nv, nv, nv, NULL, A));
  for (PetscInt j = 0; j < nv; j++) {
    OK(PetscArrayzero(unit, nv));
    OK(PetscArrayzero(p, c->np));
    OK(PetscArrayzero(column, nv));
    unit[j] = 1;
    OK((*c->queue.run->vertices.add_interpolated)(&c->queue, &c->vertices, unit, p));
    multiply(c, p, sp);
    OK((*c->queue.run->vertices.add_restricted)(&c->queue, &c->vertices, sp, column));
    if (j == 0) shift = 0.02 * column[0];
    column[j] += shift;
    for (PetscInt i = 0; i < nv; i++)
      if (PetscAbsReal(column[i]) > 1e-9 * shift) OK(MatSetValue(*A, i, j, column[i], INSERT_VALUES));
  }
  OK(MatAssemblyBegin(*A, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(*A, MAT_FINAL_ASSEMBLY));
  OK(PetscFree4(unit, p, sp, column));
}

/* Largest eigenvalue of D^-1 S, D the blocks, a little enlarged */
static PetscReal find_largest(Case *c)
{
  PetscReal *x, *y, *d, *zero, size = 1;

  OK(PetscCalloc4(c->np, &x, c->np, &y, c->np, &d, c->np, &zero));
  fill_noise_pressure(c->l, 5, x);
  for (PetscInt k = 0; k < 30; k++) {
    OK((*c->queue.run->smooth_rows)(&c->queue, &c->rows,
                                    &(DeviceChebyshev){.c2 = 1, .b = zero, .x = x, .d = d, .x_new = y}));
    size = PetscSqrtReal(dot(c->np, d, d));
    for (PetscInt i = 0; i < c->np; i++) x[i] = -d[i] / size;
  }
  OK(PetscFree4(x, y, d, zero));
  return 1.1 * size;
}

/* CG with it to 1e-8: steps */
static PetscInt count_steps(Case *c, const DevicePressure *m)
{
  PetscReal *r, *z, *p, *q, rz, first;
  PetscInt   steps = 0;

  OK(PetscCalloc4(c->np, &r, c->np, &z, c->np, &p, c->np, &q));
  fill_noise_pressure(c->l, 6, p);
  multiply(c, p, r); /* consistent */
  OK(DevicePressureApply(&c->queue, m, r, z));
  OK(PetscArraycpy(p, z, c->np));
  rz = dot(c->np, r, z);
  for (first = rz; rz > 1e-16 * first && steps < 60; steps++) {
    PetscReal alpha, before = rz;

    multiply(c, p, q);
    alpha = rz / dot(c->np, p, q);
    for (PetscInt i = 0; i < c->np; i++) r[i] -= alpha * q[i];
    OK(DevicePressureApply(&c->queue, m, r, z));
    rz = dot(c->np, r, z);
    for (PetscInt i = 0; i < c->np; i++) p[i] = z[i] + rz / before * p[i];
  }
  OK(PetscFree4(r, z, p, q));
  return steps;
}

static void check_levels(Case *c, const DeviceGrid *grid)
{
  DevicePressure m = {.rows = c->rows, .transfer = c->vertices, .degree = 3};
  PetscReal     *a, *b, *ma, *mb, ab;
  DeviceSparse   lowest;
  PetscInt       n;
  Mat            A;

  OK(PetscCalloc4(c->np, &a, c->np, &b, c->np, &ma, c->np, &mb));
  OK(PetscCalloc3(c->np, &m.x, c->np, &m.r, c->np, &m.d));
  make_matrix(c, &A);
  OK(DeviceLevelsCreate(&c->queue, A, grid, PETSC_FALSE, &n, &m.level, &lowest));
  assert_int_equal(lowest.n > 0, grid != NULL);
  assert_true(n > 1);
  m.nlevel  = (int)n;
  m.largest = find_largest(c);
  fill_noise_pressure(c->l, 7, a);
  fill_noise_pressure(c->l, 8, b);
  OK(DevicePressureApply(&c->queue, &m, a, ma));
  OK(DevicePressureApply(&c->queue, &m, b, mb));
  ab = dot(c->np, a, mb);
  NEAR(dot(c->np, b, ma), ab, 1e-5 * PetscSqrtReal(dot(c->np, a, ma) * dot(c->np, b, mb)));
  assert_in_range(count_steps(c, &m), 4, 24);
  OK(DeviceLevelsDestroy(&c->queue, n, &m.level));
  OK(DeviceSparseDestroy(&c->queue, &lowest));
  OK(MatDestroy(&A));
  OK(PetscFree3(m.x, m.r, m.d));
  OK(PetscFree4(a, b, ma, mb));
}

/* P keeps constants; functions linear in space, too, where nothing is periodic and intervals are even */
static void check_coarsening(const DeviceGrid *g, PetscBool linear)
{
  DeviceGrid coarse;
  PetscReal *a, *b;
  Mat        P;
  Vec        x, y;

  OK(DeviceGridCoarsen(g, &coarse, &P));
  assert_non_null(P);
  assert_true(coarse.n < g->n);
  OK(MatCreateVecs(P, &x, &y));
  OK(VecGetArray(x, &a));
  for (PetscInt i = 0; i < coarse.n; i++)
    a[i] = 1 + (linear ? coarse.at[i][0] * 2 + 4 * coarse.at[i][1] - 6 * coarse.at[i][2] : 0);
  OK(VecRestoreArray(x, &a));
  OK(MatMult(P, x, y));
  OK(VecGetArray(y, &b));
  for (PetscInt i = 0; i < g->n; i++)
    NEAR(b[i], 1 + (linear ? g->at[i][0] + 2 * g->at[i][1] - 3 * g->at[i][2] : 0), 1e-12);
  OK(VecRestoreArray(y, &b));
  OK(VecDestroy(&x));
  OK(VecDestroy(&y));
  OK(MatDestroy(&P));
  OK(DeviceGridDestroy(&coarse));
}

static void check_lattice(Case *c)
{
  DeviceGrid g;

  OK(DeviceGridCreate(c->mesh, c->transfer, &g));
  assert_non_null(g.at);
  check_coarsening(&g, (PetscBool)!g.period[0]);
  check_levels(c, &g);
  OK(DeviceGridDestroy(&g));
}

static void test_scenes(void **state)
{
  static const char *const SCENES[] =
    {"-mesh_cells 6,4,4", "-mesh_cells 5,4,3 -mesh_periodic x",
     "-mesh_cells 4,4,4 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4"};

  (void)state;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(SCENES); i++) {
    Case c;

    open_case(&c, SCENES[i]);
    assert_int_equal(c.l->hang != NULL, i == 2);
    check_rows(&c);
    check_made(&c);
    check_vertices(&c);
    check_levels(&c, NULL);
    check_lattice(&c);
    close_case(&c);
  }
}

/* Levels of the vertices of one mesh, and weights of its nodes */
typedef struct {
  Coarse       coarse;
  PetscInt     n;
  DeviceLevel *level;
  DeviceSparse lowest;
} Levels;

/* More weight at every `step`-th node that is no wall's, and more in every seventh cell */
static void change_weights(Flow flow, const MeshLocal *l, PetscInt step, Coarse coarse)
{
  const PetscReal *const *b;
  const unsigned char    *fixed;
  PetscReal               block[16], change[3];

  OK(FlowGetCellDivergence(flow, &b));
  OK(ConditionsGetValues(FlowConditions(flow), &fixed, NULL));
  for (PetscInt i = 0; i < l->nnode; i += step) {
    for (PetscInt a = 0; a < 3; a++) change[a] = fixed[i] >> a & 1 ? 0 : 2 + noise(3 * i + a);
    OK(CoarseAddNode(coarse, b, i, change));
  }
  for (PetscInt e = 0; e < 16; e++) block[e] = e % 5 == 0 ? 0.02 : 0.001;
  for (PetscInt c = step; c < l->ncell; c += 7) OK(CoarseAddCells(coarse, 1, 1, &c, block));
  OK(CoarseAssemble(coarse));
}

static void open_levels(Mesh mesh, Flow flow, const MeshLocal *l, PetscInt changes, Levels *s)
{
  const DeviceQueue *q = FlowGetQueue(flow);
  Transfer           transfer;
  DeviceGrid         grid;
  Mat                A;

  OK(CoarseCreate(mesh, 4, PETSC_TRUE, 0.03, &s->coarse));
  for (PetscInt k = 0; k < changes; k++) change_weights(flow, l, 1 + 4 * k, s->coarse);
  OK(CoarseGetMatrix(s->coarse, &A));
  OK(CoarseGetTransfer(s->coarse, &transfer));
  OK(DeviceGridCreate(mesh, transfer, &grid));
  OK(DeviceLevelsCreate(q, A, &grid, PETSC_TRUE, &s->n, &s->level, &s->lowest));
  OK(DeviceGridDestroy(&grid));
}

static void close_levels(Flow flow, Levels *s)
{
  OK(CoarseDestroy(&s->coarse));
  OK(DeviceLevelsDestroy(FlowGetQueue(flow), s->n, &s->level));
  OK(DeviceSparseDestroy(FlowGetQueue(flow), &s->lowest));
}

static void compare_sparse(const DeviceSparse *a, const DeviceSparse *b, PetscReal tol)
{
  assert_int_equal(a->n, b->n);
  assert_int_equal(a->width, b->width);
  for (PetscInt e = 0; e < a->n * a->width; e++) assert_int_equal(a->column[e], b->column[e]);
  BELOW(max_difference(a->n * a->width, a->value, b->value), tol * max_abs(a->n * a->width, b->value));
}

/* Matrices of vertices that change where they are kept, and the levels below them, are those of the host */
static void check_changes(const char options[])
{
  const MeshLocal   *l;
  const DeviceQueue *q;
  Mesh               mesh;
  Flow               flow;
  Transfer           transfer;
  DeviceTransfer     on;
  Levels             there, here;
  PetscReal         *noise, *sums;
  PetscBool          kept;

  give(
    "-mesh_dimension 3 -mesh_upper 1.5,1,1 -device emulate -flow_velocity_operator matrix_free -flow_bc_left_type outflow");
  OK(PetscOptionsInsertString(NULL, options));
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowCreate(mesh, &flow));
  q = FlowGetQueue(flow);
  assert_true(FlowHasBoxesAlone(flow));
  open_levels(mesh, flow, l, 1, &there);
  open_levels(mesh, flow, l, 2, &here);
  assert_true(there.n > 1);
  OK(CoarseKeepChanges(there.coarse, &kept));
  assert_true(kept);
  change_weights(flow, l, 5, there.coarse);
  OK(CoarseGetTransfer(there.coarse, &transfer));
  OK(DeviceTransferCreate(q, transfer, l->ncell, &on));
  OK(PetscMalloc2(there.level[0].A.n, &noise, DEVICE_PARTIAL + 2, &sums));
  DeviceLevelsFillNoise(there.level[0].A.n, noise);
  OK(DeviceLevelsChange(flow, there.coarse, &on, &there.level[0].A));
  OK(DeviceLevelsUpdate(q, there.n, there.level, &there.lowest, PETSC_TRUE, noise, sums));
  assert_int_equal(there.n, here.n);
  for (PetscInt k = 0; k < here.n; k++) {
    const DeviceLevel *a = there.level + k, *b = here.level + k;
    const PetscBool    last = (PetscBool)(k == here.n - 1);

    compare_sparse(&a->A, &b->A, last ? 1e-7 : CLOSE); /* the inverse of what is singular but for 1e-8 */
    if (last) continue;
    compare_sparse(&a->P, &b->P, 0);
    BELOW(max_difference(a->A.n, a->inverse, b->inverse), CLOSE * max_abs(a->A.n, b->inverse));
    NEAR(a->largest, b->largest, 1e-10 * b->largest);
  }
  compare_sparse(&there.lowest, &here.lowest, CLOSE);
  OK(PetscFree2(noise, sums));
  OK(DeviceTransferDestroy(q, &on));
  close_levels(flow, &there);
  close_levels(flow, &here);
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

static void test_changes(void **state)
{
  (void)state;
  check_changes("-mesh_cells 6,4,4");
  check_changes("-mesh_cells 7,4,5 -mesh_periodic y");
  check_changes("-mesh_cells 4,4,4 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4");
}

/* A hole of 2 x 2 cells: a vertex beside it has more neighbours than those of one cell */
static void test_hole(void **state)
{
  PetscInt   at[13 * 13 * 5][3];
  DeviceGrid g = {.at = at, .size = {12, 12, 4}, .h = {1, 1, 1}};

  (void)state;
  for (PetscInt i = 0; i < 13 * 13 * 5; i++) {
    const PetscInt x = i % 13, y = i / 13 % 13;

    if (x == 6 && y == 6) continue;
    at[g.n][0]   = x;
    at[g.n][1]   = y;
    at[g.n++][2] = i / 169;
  }
  check_coarsening(&g, PETSC_TRUE);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_scenes), cmocka_unit_test(test_changes),
                                     cmocka_unit_test(test_hole)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("devicerows", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
