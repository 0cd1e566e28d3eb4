/* Bodies on a device: terms in cells from moments are those of the matrices, in products and in the diagonal, where
   things hang too; rigid velocities at nodes and in cells, and what comes back, are plain sums over lists. */
#include "core.h"
#include "flow/device.h"
#include "flow/flow.h"

#define CLOSE   1e-12 /* of the largest */
#define MOMENTS 216
#define NBODY   3

static PetscInt pair(PetscInt i, PetscInt j)
{
  static const PetscInt PAIR[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

  return PAIR[i][j];
}

/* The matrix of a part from its moments, as a penalty makes it */
static void make_matrix(const MeshLocal *l, PetscInt cell, const PetscReal m[], PetscInt without, PetscReal a[])
{
  for (PetscInt e = 0; e < 27 * 27; e++) {
    const PetscInt i = e / 27, j = e % 27;

    a[e] = m[(pair(i / 9, j / 9) * 6 + pair(i / 3 % 3, j / 3 % 3)) * 6 + pair(i % 3, j % 3)];
  }
  MeshCellMatrix(l, cell, 1, 27, a);
  for (PetscInt e = 0; e < 27 * 27; e++)
    if ((without >> (e / 27) | without >> (e % 27)) & 1) a[e] = 0;
}

static void check_terms(const char options[])
{
  const MeshLocal *l;
  Mesh             mesh;
  Flow             flow[2];
  PetscReal       *moment, *matrix, *x, *y[2];
  PetscInt         n, *cell, *without;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowCreate(mesh, &flow[0]));
  OK(PetscOptionsSetValue(NULL, "-device", "emulate"));
  OK(FlowCreate(mesh, &flow[1]));
  n = l->ncell; /* every cell, some twice */
  OK(PetscMalloc4(n * MOMENTS, &moment, n * 27 * 27, &matrix, n, &cell, n, &without));
  OK(PetscCalloc3(l->nnode_all * 3, &x, l->nnode_all * 3, &y[0], l->nnode_all * 3, &y[1]));
  for (PetscInt t = 0; t < n; t++) {
    cell[t]    = t % 5 == 4 ? t - 1 : t;
    without[t] = t % 3 ? 0 : (PetscInt)(1e6 * (1 + noise(t)));
    for (PetscInt m = 0; m < MOMENTS; m++) moment[t * MOMENTS + m] = 1 + noise(31 * t + m);
    make_matrix(l, cell[t], moment + t * MOMENTS, without[t], matrix + t * 27 * 27);
  }
  fill_noise(l, 3, x);
  for (PetscInt k = 0; k < 2; k++) {
    OK(FlowBeginStep(flow[k], 0.1, 0.1));
    OK(FlowAddCellTerms(flow[k], &x, n, cell, matrix));
    OK(FlowDescribeCellTerms(flow[k], &x, &(FlowMoments){.without = without, .moment = moment}));
    OK(FlowAssemble(flow[k]));
    OK(FlowMultiply(flow[k], PETSC_FALSE, x, y[k]));
  }
  BELOW(max_difference(l->nnode * 3, y[1], y[0]), CLOSE * max_abs(l->nnode * 3, y[0]));
  for (PetscInt k = 0; k < 2; k++) OK(FlowGetDiagonal(flow[k], y[k]));
  BELOW(max_difference(l->nnode, y[1], y[0]), CLOSE * max_abs(l->nnode, y[0]));
  for (PetscInt k = 0; k < 2; k++) OK(FlowDestroy(&flow[k]));
  OK(MeshDestroy(&mesh));
  OK(PetscFree4(moment, matrix, cell, without));
  OK(PetscFree3(x, y[0], y[1]));
}

static void test_terms(void **state)
{
#define BOX "-mesh_dimension 3 -flow_velocity_operator matrix_free -mesh_upper 1.5,1,1 "
  (void)state;
  check_terms(BOX "-mesh_cells 4,3,3");
  check_terms(BOX "-mesh_cells 3,3,3 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.4,0.4,0.4");
}

static void fill(PetscInt n, PetscInt seed, double v[])
{
  for (PetscInt i = 0; i < n; i++) v[i] = noise(seed + i);
}

/* Lists of n entries of few bodies, one of which has none */
static void make_list(PetscInt n, int start[], int body[])
{
  const int end[NBODY] = {(int)n / 3, (int)n / 3, (int)n};

  start[0] = 0;
  for (PetscInt k = 0; k < NBODY; k++) {
    start[k + 1] = end[k];
    for (int i = start[k]; i < end[k]; i++) body[i] = (int)k;
  }
}

static void test_rigid(void **state)
{
#define N 500
  DeviceQueue q = {.run = DeviceGetKernels("cpu")};
  int         start[NBODY + 1], body[N], node[N];
  double arm[4 * N], U[NBODY * 6], x[N * 3], y[N * 3] = {0}, want[N * 3] = {0}, out[NBODY * 6], sum[NBODY * 6] = {0};
  DevicePairs r = {N, NBODY, start, node, body, arm};

  (void)state;
  make_list(N, start, body);
  for (int i = 0; i < N; i++) node[i] = i * 7 % 211 | (i % 8) << DEVICE_NODE_BITS; /* some nodes more than once */
  fill(4 * N, 0, arm);
  fill(NBODY * 6, 1000, U);
  fill(N * 3, 2000, x);
  for (int i = 0; i < N; i++) {
    const double *V = U + body[i] * 6, *W = V + 3, a[3] = {arm[N + i], arm[2 * N + i], arm[3 * N + i]};

    for (int c = 0; c < 3; c++) {
      const int at = i * 7 % 211 * 3 + c, d = (c + 1) % 3, e = (c + 2) % 3;

      if (i % 8 >> c & 1) continue;
      want[at] += 2 * (arm[i] * V[c] + W[d] * a[e] - W[e] * a[d]);
      sum[body[i] * 6 + c] += 2 * arm[i] * x[at];
      sum[body[i] * 6 + 3 + d] += 2 * a[e] * x[at]; /* torque: arm x force */
      sum[body[i] * 6 + 3 + e] -= 2 * a[d] * x[at];
    }
  }
  OK((*q.run->body.add_rigid)(&q, &r, 2, U, y));
  BELOW(max_difference(N * 3, y, want), CLOSE * max_abs(N * 3, want));
  OK((*q.run->body.sum_rigid)(&q, &r, 2, x, out));
  BELOW(max_difference(NBODY * 6, out, sum), CLOSE * max_abs(NBODY * 6, sum));
}

static void test_blocks(void **state)
{
  DeviceQueue q = {.run = DeviceGetKernels("cpu")};
  int         start[NBODY + 1], body[N], cell[N];
  double w[24 * N], U[NBODY * 6], x[N * 4], y[N * 4] = {0}, want[N * 4] = {0}, out[NBODY * 6], sum[NBODY * 6] = {0};
  DevicePairs b = {N, NBODY, start, cell, body, w};

  (void)state;
  make_list(N, start, body);
  fill(24 * N, 0, w);
  fill(NBODY * 6, 1000, U);
  fill(N * 4, 2000, x);
  for (int i = 0; i < N; i++) {
    cell[i] = i * 3 % 101;
    for (int e = 0; e < 24; e++) {
      want[cell[i] * 4 + e / 6] -= w[e * N + i] * U[body[i] * 6 + e % 6];
      sum[body[i] * 6 + e % 6] += w[e * N + i] * x[cell[i] * 4 + e / 6];
    }
  }
  OK((*q.run->body.add_blocks)(&q, &b, -1, U, y));
  BELOW(max_difference(N * 4, y, want), CLOSE * max_abs(N * 4, want));
  OK((*q.run->body.sum_blocks)(&q, &b, x, out));
  BELOW(max_difference(NBODY * 6, out, sum), CLOSE * max_abs(NBODY * 6, sum));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_terms), cmocka_unit_test(test_rigid),
                                     cmocka_unit_test(test_blocks)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("devicemoments", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
