/* Large-eddy simulation: the laws at a point, wall distances on boxes, refined and round meshes, the operator without a
   matrix against the assembled one, and both against residuals. */
/* ranks: 1 2 3 */
#include "core.h"
#include "flow/flow.h"
#include "impl.h"

static const Eddy SMAGORINSKY = {.name = "smagorinsky", .constant = 0.1, .filter = 0.5};
static const Eddy WALE        = {.name = "wale", .wale = PETSC_TRUE, .constant = 0.5, .filter = 0.5};

/* ---- laws ---- */

static void test_laws(void **state)
{
  PetscReal shear[3][3] = {{0, 3, 0}, {0, 0, 0}, {0, 0, 0}}, turn[3][3] = {{0, -2, 0}, {2, 0, 0}, {0, 0, 0}},
            strain[3][3] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 0}}, wall[2];

  (void)state;
  NEAR(EddyRate(&SMAGORINSKY, shear), 3, 1e-14);
  NEAR(EddyRate(&SMAGORINSKY, turn), 0, 0);
  NEAR(EddyRate(&SMAGORINSKY, strain), 2, 1e-14);
  NEAR(EddyRate(&WALE, shear), 0, 0);
  /* by hand: G G = -4 (x, y), its trace-free part squared 32/3, no strain; a strain of 1: 2/3 beside 2 */
  NEAR(EddyRate(&WALE, turn), pow(32. / 3, 0.25), 1e-13);
  NEAR(EddyRate(&WALE, strain), pow(2. / 3, 1.5) / (pow(2, 2.5) + pow(2. / 3, 1.25)), 1e-14);
  /* u = (y + y z, y^2, 0): u ~ y, v ~ y^2 as at a wall, where the eddy viscosity falls as y^3 */
  for (PetscInt i = 0; i < 2; i++) {
    const PetscReal y       = i ? 0.5e-3 : 1e-3;
    PetscReal       g[3][3] = {{0, 1, y}, {0, 2 * y, 0}, {0.7 * y, 0.4, -2 * y}};

    wall[i] = EddyRate(&WALE, g);
  }
  NEAR(log2(wall[0] / wall[1]), 3, 0.02);
}

static void test_damping(void **state)
{
  PetscReal y, u;

  (void)state;
  NEAR(EddyDamping(25), 1 - exp(-1.), 1e-15);
  NEAR(EddyDamping(1e-9), 1e-9 / 25, 1e-18);
  NEAR(EddyWallUnits(1e-4, 1e-2, 1), 1e-3, 1e-9); /* u+ = y+ in the sublayer: y+^2 = u y/nu */
  y = EddyWallUnits(12, 30, 1);                   /* the law itself */
  u = 12 * 30 / y;
  NEAR(y, u + exp(-2.2) * (exp(0.4 * u) - 1 - 0.4 * u - PetscSqr(0.4 * u) / 2 - pow(0.4 * u, 3) / 6), 1e-8);
  /* Spalding's law far out is the logarithmic one: u+ = 2.5 ln 400 + 5.5 */
  NEAR(EddyWallUnits(2.5 * log(400.) + 5.5, 400, 1), 400, 8);
  NEAR(EddyWallUnits(1e6, 1, 1), 500, 0);
}

/* ---- wall distances ---- */

static void check_distances(const char options[], PetscReal (*exact)(const PetscReal x[]), PetscReal tolerance)
{
  const MeshLocal *l;
  Mesh             mesh;
  Flow             flow;
  PetscReal        error = 0;

  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(FlowCreate(mesh, &flow));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowBeginStep(flow, 0.1, 0.1));
  OK(FlowUpdateMaterial(flow));
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal xc[MESH_MAX_NB * 3];

    OK(MeshCellCoordinates(mesh, c, xc));
    for (PetscInt q = 0; q < flow->element.nq; q++) {
      PetscReal x[3] = {0, 0, 0}, v[3];

      for (PetscInt j = 0; j < l->nb; j++)
        for (PetscInt a = 0; a < l->dim; a++) x[a] += flow->element.phi[q * flow->element.nbp + j] * xc[j * l->dim + a];
      error = PetscMax(error, PetscAbsReal(WallsDistance(FlowGetWalls(flow), c, q, v) - (*exact)(x)));
    }
  }
  BELOW(error, tolerance);
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

static PetscReal to_plates(const PetscReal x[])
{
  return PetscMin(x[1] + 1, 1 - x[1]);
}

static PetscReal to_box(const PetscReal x[])
{
  return PetscMin(PetscMin(PetscMin(x[0], 2 - x[0]), PetscMin(x[1], 1 - x[1])), PetscMin(x[2], 1 - x[2]));
}

static PetscReal to_circles(const PetscReal x[])
{
  const PetscReal r = PetscSqrtReal(x[0] * x[0] + x[1] * x[1]);

  return PetscMin(r - 1, 2 - r);
}

static PetscReal to_round(const PetscReal x[])
{
  return 1 - PetscSqrtReal(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

static PetscReal to_lid(const PetscReal x[])
{
  return 1 - x[1];
}

#define LAW "-flow_rheology smagorinsky "

static void test_distances(void **state)
{
  (void)state;
  check_distances(LAW "-mesh_cells 4,6,3 -mesh_lower 0,-1,0 -mesh_upper 2,1,1 -mesh_periodic x,z -mesh_stretch 0,1.5,0",
                  to_plates, 1e-14);
  check_distances(LAW "-mesh_cells 5,4,3 -mesh_upper 2,1,1", to_box, 1e-14);
  check_distances(LAW
                  "-mesh_cells 4,4,3 -mesh_upper 2,1,1 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0,0.6,0.6,0.6",
                  to_box, 1e-14);
  check_distances(LAW "-mesh_kind annulus -mesh_resolution 6", to_circles, 2e-4); /* parabolas stand for arcs */
  check_distances(LAW "-mesh_kind disc -mesh_resolution 6", to_round, 2e-4);
  check_distances(LAW "-mesh_kind ball -mesh_resolution 4", to_round, 2e-3);
}

/* Walls are what the fluid sticks to, moving or not, and how they move is known at the nearest place: of a lid that
   goes as x, where x is; without any the distance is the largest number */
static void test_walls_that_count(void **state)
{
  static const char *const open =
    "-mesh_cells 4,4 -flow_bc_left_type inflow -flow_bc_left_velocity 1,0 -flow_bc_right_type outflow -flow_bc_bottom_type slip "
    "-flow_bc_top_type moving_wall -flow_bc_top_velocity x,0 ";
  const MeshLocal *l;
  Mesh             mesh;
  Flow             flow;
  char             options[512];

  (void)state;
  snprintf(options, sizeof(options), LAW "%s", open);
  check_distances(options, to_lid, 1e-14);
  for (PetscInt k = 0; k < 2; k++) {
    snprintf(options, sizeof(options), LAW "%s", k ? "-mesh_cells 3,3 -mesh_periodic x,y" : open);
    give(options);
    OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
    OK(FlowCreate(mesh, &flow));
    OK(MeshGetLocal(mesh, &l));
    OK(FlowBeginStep(flow, 0.1, 0.1));
    OK(FlowUpdateMaterial(flow));
    for (PetscInt c = 0; c < l->ncell_all; c++)
      for (PetscInt q = 0; q < flow->element.nq; q++) {
        PetscReal       v[3];
        const PetscReal d = WallsDistance(FlowGetWalls(flow), c, q, v), *centre = l->x + 2 * l->cell_node[9 * c + 4];

        if (k) NEAR(d, PETSC_MAX_REAL, 0);
        else NEAR(v[0], centre[0] + PetscSqrtReal(0.6) * 0.125 * (q / 3 - 1), 1e-12); /* Gauss points */
        NEAR(v[1], 0, 1e-15);
      }
    OK(FlowDestroy(&flow));
    OK(MeshDestroy(&mesh));
  }
}

/* ---- operator ---- */

static void fill(const MeshLocal *l, PetscReal phase, PetscReal u[])
{
  for (PetscInt i = 0; i < l->nnode_all * l->dim; i++) {
    const PetscReal *x = l->x + i / l->dim * l->dim;

    u[i] = PetscSinReal(3 * x[0] + 2 * x[1] + (l->dim == 3 ? x[2] : 0) + phase * (1 + i % l->dim));
  }
}

/* S of the step times a change of the velocity is the change of the residual, for every component on its own; with and
   without a matrix */
static void check_operator(PetscInt dim, const char kind[])
{
  const MeshLocal *l;
  Mesh             mesh;
  Flow             flow;
  PetscReal       *u, *now, *v, *p, *sum, *y, error = 0, size = 0;
  char             options[256];
  const PetscInt   n[3] = {3, 2, 2};

  OK(PetscSNPrintf(options, sizeof(options), "-flow_viscosity 1e-3 -flow_les_constant 2 -flow_rheology %s", kind));
  give(options);
  create_skewed_mesh(dim, n, &mesh);
  OK(FlowCreate(mesh, &flow));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowGetFields(flow, &now, NULL, NULL));
  fill(l, 1, now);
  OK(FlowBeginStep(flow, 0.1, 0.1));
  OK(FlowAssemble(flow));
  OK(PetscCalloc5(l->nnode_all * dim, &u, l->nnode_all * dim, &v, l->ncell_all * (dim + 1), &p, l->nnode_all * dim,
                  &sum, l->nnode_all * dim, &y));
  fill(l, 2, u);
  for (PetscInt s = 0; s < 2; s++)
    for (PetscInt cell = 0; cell < l->ncell; cell++) {
      PetscReal r[81];

      OK(FlowCellResidual(flow, cell, s ? u : v, p, r));
      for (PetscInt i = 0; i < l->nb * dim; i++)
        sum[l->cell_node[cell * l->nb + i / dim] * dim + i % dim] += (s ? 1 : -1) * r[i];
    }
  OK(MeshSumNodes(mesh, dim, sum));
  if (FlowIsMatrixFree(flow)) {
    OK(FlowMultiply(flow, PETSC_FALSE, u, y));
  } else {
    for (PetscInt a = 0; a < dim; a++) {
      Mat S;
      Vec in, out;

      OK(FlowGetMatrix(flow, &S));
      OK(MatCreateVecs(S, &in, &out));
      for (PetscInt pass = 0; pass < 2; pass++) {
        PetscReal *x;

        OK(VecGetArray(pass ? out : in, &x));
        for (PetscInt i = 0; i < l->nnode; i++) {
          if (pass) y[i * dim + a] = x[i];
          else x[i] = u[i * dim + a];
        }
        OK(VecRestoreArray(pass ? out : in, &x));
        if (!pass) OK(MatMult(S, in, out));
      }
      OK(VecDestroy(&in));
      OK(VecDestroy(&out));
    }
  }
  for (PetscInt i = 0; i < l->nnode * dim; i++) {
    error = PetscMax(error, PetscAbsReal(y[i] - sum[i]));
    size  = PetscMax(size, PetscAbsReal(sum[i]));
  }
  BELOW(error, 1e-12 * size);
  OK(PetscFree5(u, v, p, sum, y));
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

static void test_operator(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++)
    for (PetscInt free = 0; free < 2; free++) {
      check_operator(dim, free ? "wale -flow_velocity_operator matrix_free" : "wale -flow_velocity_operator assembled");
      check_operator(dim, free ? "smagorinsky -flow_velocity_operator matrix_free -flow_convection_form skew"
                               : "smagorinsky -flow_velocity_operator assembled -flow_convection_form skew");
    }
}

/* A surface is a point here */
static PetscErrorCode find_point(void *owner, PetscReal reach, PetscInt n, const PetscReal x[], PetscReal distance[],
                                 PetscReal v[])
{
  const PetscReal *at = owner;

  for (PetscInt q = 0; q < n; q++) {
    const PetscReal d = PetscSqrtReal(PetscSqr(x[2 * q] - at[0]) + PetscSqr(x[2 * q + 1] - at[1]));

    if (d >= PetscMin(reach, distance[q])) continue;
    distance[q] = d;
    for (PetscInt a = 0; a < 3; a++) v[3 * q + a] = 0;
  }
  return PETSC_SUCCESS;
}

/* Of two owners of surfaces the nearer one damps the eddies of a point; the same owner again counts once, and none
   leaves them as they were */
static void test_surfaces(void **state)
{
  PetscReal        at[2][2] = {{0.3, 0.5}, {0.6, 0.55}}, *now, *mu[5];
  PetscInt         nq, nearer[2] = {0, 0}, n;
  const MeshLocal *l;
  Mesh             mesh;
  Flow             flow;

  (void)state;
  give("-mesh_cells 6,6 -mesh_periodic x,y -flow_viscosity 1e-3 -flow_rheology smagorinsky");
  OK(MeshCreate(PETSC_COMM_WORLD, &mesh));
  OK(MeshGetLocal(mesh, &l));
  OK(FlowCreate(mesh, &flow));
  OK(FlowGetFields(flow, &now, NULL, NULL));
  fill_noise(l, 1, now);
  nq = flow->element.nq;
  n  = l->ncell * nq;
  for (PetscInt i = 0; i < 5; i++) { /* none, the first, the second, both, none */
    for (PetscInt s = 0; s < 2; s++) OK(FlowSetSurfaces(flow, at[s], (i >> s) & 1 ? find_point : NULL));
    if (i == 3) OK(FlowSetSurfaces(flow, at[0], find_point));
    OK(FlowBeginStep(flow, 0.1, 0.1));
    OK(FlowUpdateMaterial(flow));
    OK(PetscMalloc1(n + 1, &mu[i]));
    OK(PetscArraycpy(mu[i], flow->viscosity.mu, n));
  }
  for (PetscInt i = 0; i < n; i++) {
    PetscReal xc[MESH_MAX_NB * 3], x[2] = {0, 0}, d[2];

    OK(MeshCellCoordinates(mesh, i / nq, xc));
    for (PetscInt j = 0; j < l->nb * 2; j++) x[j % 2] += flow->element.phi[i % nq * flow->element.nbp + j / 2] * xc[j];
    for (PetscInt s = 0; s < 2; s++) d[s] = PetscSqrtReal(PetscSqr(x[0] - at[s][0]) + PetscSqr(x[1] - at[s][1]));
    NEAR(mu[3][i], mu[d[0] < d[1] ? 1 : 2][i], 0);
    NEAR(mu[4][i], mu[0][i], 0);
    assert_true(mu[3][i] <= mu[0][i]);
    for (PetscInt s = 0; s < 2; s++) nearer[s] += (d[s] < d[!s] && mu[1 + s][i] < 0.9 * mu[0][i]);
  }
  for (PetscInt s = 0; s < 2; s++) assert_true(total((PetscReal)nearer[s]) > 10);
  for (PetscInt i = 0; i < 5; i++) OK(PetscFree(mu[i]));
  OK(FlowDestroy(&flow));
  OK(MeshDestroy(&mesh));
}

/* A rigid motion has no stress of eddies, however viscous they are, when it goes on as it was */
static void test_rigid(void **state)
{
  const PetscInt n[3] = {3, 2, 2};

  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const MeshLocal *l;
    Mesh             mesh;
    Flow             flow;
    PetscReal       *v, *was, *p, r[81], error = 0;

    give("-flow_viscosity 1e-9 -flow_rheology wale -flow_convection false");
    create_skewed_mesh(dim, n, &mesh);
    OK(FlowCreate(mesh, &flow));
    OK(MeshGetLocal(mesh, &l));
    OK(FlowGetFields(flow, &v, &was, NULL));
    for (PetscInt i = 0; i < l->nnode_all; i++) {
      v[i * dim]     = -l->x[i * dim + 1];
      v[i * dim + 1] = l->x[i * dim];
    }
    OK(PetscArraycpy(was, v, l->nnode_all * dim));
    OK(FlowBeginStep(flow, 0.1, 0.1));
    OK(FlowAssemble(flow));
    OK(PetscCalloc1(l->ncell_all * (dim + 1), &p));
    for (PetscInt cell = 0; cell < l->ncell; cell++) {
      OK(FlowCellResidual(flow, cell, v, p, r));
      for (PetscInt i = 0; i < l->nb * dim; i++) error = PetscMax(error, PetscAbsReal(r[i]));
    }
    BELOW(error, 1e-9);
    OK(PetscFree(p));
    OK(FlowDestroy(&flow));
    OK(MeshDestroy(&mesh));
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_laws),      cmocka_unit_test(test_damping),
                                     cmocka_unit_test(test_distances), cmocka_unit_test(test_walls_that_count),
                                     cmocka_unit_test(test_operator),  cmocka_unit_test(test_surfaces),
                                     cmocka_unit_test(test_rigid)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("eddy", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
