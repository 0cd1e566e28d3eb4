/* Stabilisation of scalars: a step stays within 1 % of its bounds, in time and without, on boxes, cells of two sizes
   and cells that are no parallelograms; the balance closes; smooth fields keep their order. */
/* ranks: 1 2 3 */
#include "core.h"
#include "scalar/scalar.h"

#define SCALAR "-scalars s -scalar_s_conductivity 1e-8 "
#define INFLOW "-scalar_s_bc_left_value .5+.5*sign(y-.33) -scalar_s_bc_bottom_value 0 "
#define FRONT  "-scalar_s_initial .5+.5*sign(.5-x-.4*y) -scalar_s_bc_wall_value .5+.5*sign(.5-x-.4*y+1.05*t) "

typedef struct {
  Mesh             mesh;
  const MeshLocal *l;
  Scalars          s;
  PetscReal       *w;
} Case;

typedef struct {
  PetscReal beyond, balance; /* worst of all steps */
  PetscReal error;           /* at the end, against the field */
} Found;

/* skewed: cells of the skewed mesh, or 0 */
static void open_case(Case *c, PetscInt dim, PetscInt skewed, Field stream, const char options[])
{
  const PetscInt n[3] = {skewed, skewed, skewed};

  give(options);
  if (skewed) create_skewed_mesh(dim, n, &c->mesh);
  else OK(MeshCreateAround(PETSC_COMM_WORLD, &(MeshSurface){0}, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(ScalarsCreate(c->mesh, &c->s));
  OK(PetscCalloc1(c->l->nnode_all * dim, &c->w));
  fill_field(c->l, stream, c->w);
}

/* Steps of BDF2 after one of Euler; dt 0: a steady state. Values between 0 and 1 are within their bounds. */
static Found take_steps(Case *c, PetscInt n, PetscReal dt, Field field)
{
  Found f = {0, 0, 0};

  for (PetscInt k = 0; k < n; k++) {
    KSPConvergedReason reason;
    PetscReal          boundary[8];
    ScalarBalance      b;
    ScalarStep         step = {.time = (k + 1) * dt, .dt = dt, .theta = 1, .extrapolation = k > 0};

    if (dt > 0) step.ct = (k ? 1.5 : 1) / dt;
    if (dt > 0) step.d0 = (k ? 2 : 1) / dt;
    if (dt > 0 && k) step.d1 = -0.5 / dt;
    OK(ScalarsBeginStep(c->s, &step));
    OK(ScalarsSolve(c->s, 0, c->w, &reason));
    assert_true(reason > 0);
    OK(ScalarsMeasure(c->s, 0, &b, boundary, NULL));
    OK(ScalarsAccept(c->s));
    f.beyond  = PetscMax(f.beyond, PetscMax(b.max - 1, -b.min));
    f.balance = PetscMax(f.balance, PetscAbsReal(b.residual) / b.size);
  }
  if (field) {
    PetscReal *T, sum = 0;

    OK(ScalarsGetFields(c->s, 0, &T, NULL));
    for (PetscInt i = 0; i < c->l->nnode; i++) {
      PetscReal exact;

      field(c->l->x + i * c->l->dim, &exact);
      sum += PetscSqr(T[i] - exact);
    }
    f.error = PetscSqrtReal(total(sum) / c->l->nnode_global);
  }
  OK(PetscFree(c->w));
  OK(ScalarsDestroy(&c->s));
  OK(MeshDestroy(&c->mesh));
  return f;
}

static void across(const PetscReal x[], PetscReal w[])
{
  (void)x;
  w[0] = 0.83;
  w[1] = 0.56;
}

static void steeply(const PetscReal x[], PetscReal w[])
{
  (void)x;
  w[0] = 0.36;
  w[1] = 0.93;
}

static void through(const PetscReal x[], PetscReal w[])
{
  across(x, w);
  w[2] = 0.3;
}

static void around(const PetscReal x[], PetscReal w[])
{
  w[0] = 0.5 - x[1];
  w[1] = x[0] - 0.5;
}

static void expect_bounds(PetscInt dim, PetscInt skewed, Field stream, PetscInt n, PetscReal dt, const char options[])
{
  char  all[512] = SCALAR;
  Found f;
  Case  c;

  strcat(all, options);
  open_case(&c, dim, skewed, stream, all);
  f = take_steps(&c, n, dt, NULL);
  BELOW(f.beyond, 0.01);
  BELOW(f.balance, dt > 0 ? 1e-12 : 1e-8);
}

static void test_bounds(void **state)
{
  static const char
    COOLED[] = "-mesh_cells 16,16 -mesh_upper 1,1 -scalar_s_bc_top_transfer 1 -scalar_s_bc_right_transfer 1 " INFLOW;
  static const char BOX
    []      = "-mesh_cells 16,16 -mesh_upper 1,1 " INFLOW,
 IN_SPACE[] = "-mesh_cells 6,6,3 -mesh_upper 1,1,0.5 " INFLOW,
 DISC[]     = "-mesh_cells 16,16 -mesh_upper 1,1 -scalar_s_initial .5+.5*sign(.15-sqrt((x-.5)^2+(y-.75)^2))",
 TREE[] = "-mesh_cells 8,8 -mesh_upper 1,1 -mesh_levels 1 -mesh_refine box -mesh_box_box_corners .3,.3,.8,.8 " INFLOW,
 BALL[] = "-mesh_cells 6,6,3 -mesh_upper 1,1,0.5 -scalar_s_initial .5+.5*sign(.22-sqrt((x-.5)^2+(y-.7)^2+(z-.25)^2))";
  PetscMPIInt ranks;
  Found       f;
  Case        c;

  static const char *const AT[]      = {".25", ".375", ".5"};
  static const char *const CORNERS[] = {".3,.3,.8,.8", "0,.4,.4,.9"};

  (void)state;
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &ranks));
  expect_bounds(2, 0, across, ranks > 1 ? 4 : 24, 0.025, BOX);
  expect_bounds(2, 0, across, ranks > 1 ? 3 : 20, 0.025, TREE);
  if (ranks > 1) return;
  for (PetscInt k = 0; k < 6; k++) { /* jumps on a node, cells of two sizes: 1.3 to 1.5 % while excesses added up */
    char inlet[256];

    snprintf(inlet, sizeof(inlet),
             "-mesh_cells 8,8 -mesh_upper 1,1 -mesh_levels 1 -mesh_refine box -mesh_box_box_corners %s "
             "-scalar_s_bc_left_value .5+.5*sign(y-%s) -scalar_s_bc_bottom_value 0",
             CORNERS[k / 3], AT[k % 3]);
    expect_bounds(2, 0, across, 12, 0.025, inlet);
  }
  expect_bounds(2, 0, steeply, 24, 0.025, BOX);
  expect_bounds(2, 0, across, 1, 0, BOX);
  expect_bounds(2, 0, across, 24, 0.025, COOLED);
  expect_bounds(2, 0, around, 32, 0.025, DISC);
  expect_bounds(2, 12, across, 20, 0.02, FRONT);
  expect_bounds(3, 0, through, 10, 0.04, IN_SPACE);
  expect_bounds(3, 0, around, 6, 0.08, BALL);
  expect_bounds(3, 5, through, 10, 0.03, FRONT);
  open_case(&c, 2, 0, across, SCALAR "-mesh_cells 16,16 -mesh_upper 1,1 -scalar_s_stabilise none " INFLOW);
  f = take_steps(&c, 24, 0.025, NULL);
  assert_true(f.beyond > 0.1);
}

/* A field that the source below keeps in a rotation */
static void wave(const PetscReal x[], PetscReal *T)
{
  *T = PetscSinReal(3 * x[0]) * PetscCosReal(2 * x[1]);
}

static PetscReal measure_wave(PetscInt n, const char more[])
{
  char options[512];
  Case c;

  snprintf(options, sizeof(options),
           "-scalars s -scalar_s_conductivity 1e-4 -mesh_cells %d,%d -mesh_upper 1,1 -scalar_s_source "
           "(.5-y)*3*cos(3*x)*cos(2*y)-(x-.5)*2*sin(3*x)*sin(2*y)+13e-4*sin(3*x)*cos(2*y) "
           "-scalar_s_bc_left_value sin(3*x)*cos(2*y) -scalar_s_bc_right_value sin(3*x)*cos(2*y) "
           "-scalar_s_bc_bottom_value sin(3*x)*cos(2*y) -scalar_s_bc_top_value sin(3*x)*cos(2*y) %s",
           (int)n, (int)n, more);
  open_case(&c, 2, 0, around, options);
  return take_steps(&c, 1, 0, wave).error;
}

static void test_order(void **state)
{
  PetscMPIInt ranks;
  PetscReal   coarse, fine;

  (void)state;
  OK(MPI_Comm_size(PETSC_COMM_WORLD, &ranks));
  if (ranks > 1) return;
  coarse = measure_wave(16, "");
  fine   = measure_wave(32, "");
  expect_rate("a smooth field, stabilised", coarse, fine, 3);
  BELOW(fine, 1.01 * measure_wave(32, "-scalar_s_stabilise none"));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_bounds), cmocka_unit_test(test_order)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
