/* What is made of a velocity and a pressure that are known: vorticity and pressure at the nodes, probes, means and
   Reynolds stresses over planes and in time, the friction at walls. */
/* ranks: 2 */
#include "core.h"
#include "derived.h"
#include "impl.h"
#include "raised.h"
#include "report/statistics.h"

static const PetscReal origin[3] = {0, 0, 0}, one[3] = {1, 1, 1};

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Monitor          monitor;
  const MeshLocal *l;
} Case;

static void open_mesh(Case *c, const char options[])
{
  give(options);
  *c = (Case){NULL};
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
}

static void open_case(Case *c, const char options[])
{
  open_mesh(c, options);
  OK(FlowCreate(c->mesh, &c->flow));
  OK(BodiesCreate(c->l->dim, origin, one, &c->bodies));
  OK(MonitorCreate(PETSC_COMM_WORLD, c->bodies, &c->monitor));
}

static void close_case(Case *c)
{
  if (c->monitor) OK(MonitorDestroy(&c->monitor));
  if (c->bodies) OK(BodiesDestroy(&c->bodies));
  if (c->flow) OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* ---- vorticity, pressure ---- */

static void turning(const PetscReal x[], PetscReal v[])
{
  v[0] = -3 * x[1];
  v[1] = 3 * x[0];
}

/* w x x with w = (1, 2, 3), and something without a curl */
static void turning_in_space(const PetscReal x[], PetscReal v[])
{
  v[0] = 2 * x[2] - 3 * x[1] + 5 * x[0];
  v[1] = 3 * x[0] - 1 * x[2] - 7 * x[1];
  v[2] = 1 * x[1] - 2 * x[0] + 2 * x[2];
}

/* curl of quadratics, exact in boxes */
static void bent(const PetscReal x[], PetscReal v[])
{
  v[0] = x[1] * x[1] - 2 * x[0] * x[1];
  v[1] = 3 * x[0] * x[0] + x[0] * x[1];
}

static void turns(const PetscReal x[], PetscReal w[3])
{
  (void)x;
  w[0] = w[1] = 0;
  w[2]        = 6;
}

static void turns_in_space(const PetscReal x[], PetscReal w[3])
{
  (void)x;
  for (PetscInt a = 0; a < 3; a++) w[a] = 2 * (1 + a);
}

static void bends(const PetscReal x[], PetscReal w[3])
{
  w[0] = w[1] = 0;
  w[2]        = 6 * x[0] + x[1] - 2 * x[1] + 2 * x[0];
}

static void check_vorticity(const char options[], Field field, void (*want)(const PetscReal x[], PetscReal w[3]),
                            PetscReal tolerance)
{
  Case       c;
  PetscReal *u, *w;

  open_mesh(&c, options);
  OK(PetscMalloc2(c.l->nnode_all * c.l->dim, &u, c.l->nnode_all * 3, &w));
  fill_field(c.l, field, u);
  OK(DerivedVorticity(c.mesh, u, w));
  for (PetscInt i = 0; i < c.l->nnode_all; i++) {
    PetscReal v[3];

    (*want)(c.l->x + i * c.l->dim, v);
    for (PetscInt a = 0; a < 3; a++) NEAR(w[3 * i + a], v[a], tolerance);
  }
  OK(PetscFree2(u, w));
  close_case(&c);
}

/* Rigid rotations everywhere, in curved and in refined cells; quadratics where cells are boxes, beside nodes that
   hang, too */
static void test_vorticity(void **state)
{
  (void)state;
  check_vorticity("-mesh_kind disc -mesh_resolution 3", turning, turns, 1e-11);
  check_vorticity("-mesh_kind ball -mesh_resolution 2", turning_in_space, turns_in_space, 1e-11);
  check_vorticity("-mesh_cells 3,2,2", turning_in_space, turns_in_space, 1e-12);
  check_vorticity("-mesh_cells 4,3 -mesh_upper 2,1", bent, bends, 1e-12);
  check_vorticity("-mesh_cells 4,3 -mesh_levels 2 -mesh_refine a -mesh_box_a_corners 0,0,0.3,0.4", bent, bends, 1e-12);
}

/* p = 2 - 3 x + 5 y, by value and gradient in cells, at every node; where all around is solid, that of there */
static void test_pressure_at_nodes(void **state)
{
  static const char *const mesh[] = {"-mesh_kind annulus -mesh_resolution 3",
                                     "-mesh_cells 4,3 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0.3,0.4",
                                     "-mesh_cells 4,4"};

  (void)state;
  for (PetscInt k = 0; k < 3; k++) {
    Case       c;
    PetscReal *p, *q;
    PetscInt  *body;

    open_mesh(&c, mesh[k]);
    OK(PetscMalloc3(c.l->ncell * 3, &p, c.l->nnode_all, &q, c.l->nnode_all, &body));
    for (PetscInt i = 0; i < c.l->nnode_all; i++) body[i] = k == 2 && c.l->x[2 * i] < 0.5 + 1e-9 ? 0 : -1;
    for (PetscInt e = 0; e < c.l->ncell; e++) {
      const PetscReal *x     = c.l->x + 2 * c.l->cell_node[9 * e + 4];
      const PetscBool  solid = (PetscBool)(k == 2 && x[0] < 0.5);

      p[3 * e]     = solid ? 99 : 2 - 3 * x[0] + 5 * x[1];
      p[3 * e + 1] = solid ? 0 : -3;
      p[3 * e + 2] = solid ? 0 : 5;
    }
    OK(DerivedPressure(c.mesh, p, body, q));
    for (PetscInt i = 0; i < c.l->nnode_all; i++) {
      const PetscReal *x = c.l->x + 2 * i;

      NEAR(q[i], k == 2 && x[0] < 0.5 - 1e-9 ? 99 : 2 - 3 * x[0] + 5 * x[1], 1e-8);
    }
    OK(PetscFree3(p, q, body));
    close_case(&c);
  }
}

/* ---- probes ---- */

static PetscReal column(Monitor m, const char name[])
{
  for (PetscInt i = 0; i < m->ncolumn; i++)
    if (!strcmp(m->column[i].name, name)) return m->column[i].value;
  fail_msg("there is no column '%s'", name);
  return 0;
}

static PetscReal quantity(Monitor m, const char name[])
{
  for (PetscInt i = 0; i < m->nquantity; i++)
    if (!strcmp(m->quantity[i].name, name)) return m->quantity[i].value;
  fail_msg("there is no quantity '%s'", name);
  return 0;
}

/* A quadratic at places in cells, on edges and in corners, and where the mesh is refined */
static void test_probes(void **state)
{
  const PetscReal at[4][2] = {{0.31, 0.77}, {0.5, 0.5}, {0, 1}, {0.07, 0.13}};
  Case            c;
  Statistics      s;
  PetscReal      *u;

  (void)state;
  open_case(&c,
            "-mesh_cells 4,4 -mesh_levels 1 -mesh_refine a -mesh_box_a_corners 0,0,0.3,0.3 -monitor_probes 0.31,0.77,0.5,0.5,0,1,0.07,0.13");
  OK(StatisticsCreate(c.flow, c.monitor, &s));
  OK(FlowGetFields(c.flow, &u, NULL, NULL));
  fill_field(c.l, bent, u);
  OK(StatisticsStep(s, 1, 1));
  for (PetscInt i = 0; i < 4; i++) {
    PetscReal v[2];
    char      name[32];

    bent(at[i], v);
    for (PetscInt a = 0; a < 2; a++) {
      snprintf(name, sizeof(name), "probe_%d_%c", (int)i, "uv"[a]);
      NEAR(column(c.monitor, name), v[a], 1e-12);
    }
  }
  OK(StatisticsDestroy(&s));
  close_case(&c);
  open_case(&c, "-mesh_cells 4,4 -monitor_probes 0.5,0.5,1.5,0.5");
  begin_error();
  expect_error(StatisticsCreate(c.flow, c.monitor, &s), PETSC_ERR_USER_INPUT, "probe 1 of x = 1.5, y = 0.5", NULL);
  close_case(&c);
}

/* ---- statistics ---- */

/* Around the parabola y (1 - y) (three times that in a longer step) waves along x, out of phase or in phase with those
   of v: the mean is that of the parabolas, the stresses those of the waves and of what the two steps differ by */
static void wavy(const PetscReal x[], PetscReal factor, PetscReal v[])
{
  const PetscReal s = PetscSinReal(2 * PETSC_PI * x[0]);

  v[0] = factor * x[1] * (1 - x[1]) + 0.3 * s;
  v[1] = 0.2 * s;
}

static void test_means(void **state)
{
  char        dir[] = "/tmp/tumble-statistics-XXXXXX", path[128], line[512];
  Case        c;
  Statistics  s;
  PetscReal  *u;
  PetscMPIInt rank;

  (void)state;
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (!rank) assert_non_null(mkdtemp(dir));
  OK(MPI_Bcast(dir, sizeof(dir), MPI_CHAR, 0, PETSC_COMM_WORLD));
  open_case(&c,
            "-mesh_cells 8,4 -mesh_periodic x -flow_density 2 -flow_viscosity 0.1 -output_statistics y -output_statistics_from 1");
  OK(StatisticsCreate(c.flow, c.monitor, &s));
  OK(FlowGetFields(c.flow, &u, NULL, NULL));
  for (PetscInt n = 0; n < 3; n++) { /* before it counts; factor 1 over a time of 1, factor 3 over a time of 3 */
    const PetscReal end[] = {1, 2, 5}, length[] = {1, 1, 3}, factor[] = {50, 1, 3};

    for (PetscInt i = 0; i < c.l->nnode_all; i++) wavy(c.l->x + 2 * i, factor[n], u + 2 * i);
    OK(StatisticsStep(s, end[n], length[n]));
  }
  OK(StatisticsWrite(s, dir));
  snprintf(path, sizeof(path), "%s/statistics.csv", dir);
  if (!rank) {
    FILE    *f    = fopen(path, "r");
    PetscInt rows = 0;

    assert_non_null(f);
    assert_non_null(fgets(line, sizeof(line), f));
    while (fgets(line, sizeof(line), f)) {
      double v[11];
      char  *at = line;

      for (PetscInt i = 0; i < 11; i++, at++) v[i] = strtod(at, &at); /* y, u v w, uu vv ww, uv uw vw, nu */
      NEAR(v[0], rows / 8., 1e-12);
      NEAR(v[1], 2.5 * v[0] * (1 - v[0]), 1e-12);
      NEAR(v[2], 0, 1e-12);
      /* half of the squares of the waves; variance of 1, 3, 3, 3 */
      NEAR(v[4], 0.045 + 0.75 * PetscSqr(v[0] * (1 - v[0])), 1e-12);
      NEAR(v[5], 0.02, 1e-12);
      NEAR(v[7], 0.03, 1e-12);
      NEAR(v[10], 0, 0);
      rows++;
    }
    assert_int_equal(rows, 9);
    fclose(f);
    unlink(path);
    rmdir(dir);
  }
  /* the mean slope at the walls is 2.5: u_tau = sqrt(.05 2.5), Re = u_tau/2/.05 */
  NEAR(quantity(c.monitor, "friction_velocity_lower"), PetscSqrtReal(0.05 * 2.5), 1e-12);
  NEAR(quantity(c.monitor, "friction_velocity_upper"), PetscSqrtReal(0.05 * 2.5), 1e-12);
  NEAR(quantity(c.monitor, "re_tau"), PetscSqrtReal(0.05 * 2.5) * 0.5 / 0.05, 1e-11);
  NEAR(quantity(c.monitor, "statistics_time"), 4, 1e-12);
  OK(StatisticsDestroy(&s));
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_vorticity), cmocka_unit_test(test_pressure_at_nodes),
                                     cmocka_unit_test(test_probes), cmocka_unit_test(test_means)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("derived", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
