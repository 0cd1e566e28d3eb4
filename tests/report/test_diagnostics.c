/* Probe: pressure at points on curved walls, edges and in cells; coefficients in both forms; the columns and quantities
   that options ask for; mistakes. */
/* ranks: 1 2 3 */
#include "core.h"
#include "report/diagnostics.h"
#include "impl.h"
#include "raised.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  Couple           couple;
  Monitor          monitor;
  Diagnostics      diagnostics;
  BodyState       *s;
  const MeshLocal *l;
} Case;

#define FITTED "-mesh_kind fitted -mesh_resolution 4 "
#define FLOW \
  "-flow_density 1.5 -flow_viscosity 0.01 -flow_bc_left_type inflow -flow_bc_left_velocity 0.3,0 -flow_bc_left_profile parabolic " \
  "-flow_bc_right_type outflow -flow_solver direct -particle_groups cylinder -particle_cylinder_shape circle -particle_cylinder_radius 0.05 " \
  "-particle_cylinder_position 0.2,0.2 -particle_cylinder_free none "

static void build_case(Case *c, const char options[])
{
  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  OK(BodiesGetState(c->bodies, &c->s));
  OK(CoupleCreate(c->flow, c->bodies, &c->couple));
  OK(MonitorCreate(PETSC_COMM_WORLD, c->bodies, &c->monitor));
}

static void destroy_case(Case *c)
{
  OK(MonitorDestroy(&c->monitor));
  OK(CoupleDestroy(&c->couple));
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

static void solve_step(Case *c, PetscInt step, PetscReal dt)
{
  PetscInt           its;
  KSPConvergedReason reason;

  OK(FlowBeginStep(c->flow, step * dt, dt));
  OK(CoupleUpdateGeometry(c->couple));
  OK(CoupleSolve(c->couple, &its, &reason));
  assert_true(reason > 0);
  OK(CoupleForce(c->couple));
}

static PetscReal quantity(Case *c, const char name[])
{
  for (PetscInt i = 0; i < c->monitor->nquantity; i++)
    if (!strcmp(c->monitor->quantity[i].name, name)) return c->monitor->quantity[i].value;
  fail_msg("there is no quantity '%s'", name);
  return 0;
}

/* p = 2 - 3 x + 5 y in every cell is read exactly: on the cylinder, where cells are curved, on an edge of the channel,
   in a corner, inside */
static void test_pressure_difference(void **state)
{
  (void)state;
  const char *const point[] = {"0.15,0.2,0.25,0.2", "0.23535533906,0.23535533906,0.9,0", "0,0.41,2.2,0",
                               "0.1873,0.1333,1.777,0.3111"};
  const PetscReal   want[]  = {-3 * (0.15 - 0.25), -3 * (0.23535533906 - 0.9) + 5 * 0.23535533906,
                               -3 * (0 - 2.2) + 5 * 0.41, -3 * (0.1873 - 1.777) + 5 * (0.1333 - 0.3111)};

  for (PetscInt i = 0; i < 4; i++) {
    char             options[2048];
    Case             c;
    const PetscReal *u, *p;
    PetscReal       *field, *ones, *inverse;

    snprintf(options, sizeof(options), FITTED FLOW "-monitor_dp %s", point[i]);
    build_case(&c, options);
    OK(DiagnosticsCreate(c.flow, c.bodies, c.couple, c.monitor, &c.diagnostics));
    OK(FlowBeginStep(c.flow, 1, 1));
    OK(CoupleUpdateGeometry(c.couple));
    OK(CoupleGetSolution(c.couple, &u, &p));
    field = (PetscReal *)p; /* the coupling's own array: stands for a solution */
    OK(PetscMalloc2(c.l->ncell * 3, &ones, c.l->ncell * 3, &inverse));
    for (PetscInt j = 0; j < c.l->ncell * 3; j++) ones[j] = 1;
    OK(FlowGetPressureGradient(c.flow, ones, inverse));
    for (PetscInt cell = 0; cell < c.l->ncell; cell++) {
      const PetscReal *centre = c.l->x + 2 * c.l->cell_node[cell * 9 + 4];

      field[3 * cell]     = 2 - 3 * centre[0] + 5 * centre[1];
      field[3 * cell + 1] = -3 / inverse[3 * cell + 1];
      field[3 * cell + 2] = 5 / inverse[3 * cell + 2];
    }
    OK(PetscFree2(ones, inverse));
    OK(DiagnosticsStep(c.diagnostics, NULL));
    OK(DiagnosticsFinish(c.diagnostics));
    NEAR(quantity(&c, "dp"), want[i], 1e-10);
    OK(DiagnosticsDestroy(&c.diagnostics));
    destroy_case(&c);
  }
}

/* Coefficients are forces over rho U^2 L / 2; extrema and their times over the steps, from -monitor_from on */
static void test_coefficients(void **state)
{
  (void)state;
  const char *const scheme[] = {"be", "cn"};

  for (PetscInt i = 0; i < 2; i++) {
    char          options[2048];
    Case          c;
    PetscReal     force[5][2];
    CoupleBalance balance = {.error = 0};

    snprintf(options, sizeof(options),
             FITTED FLOW
             "-flow_time %s -particle_cylinder_reference_speed 0.2 -particle_cylinder_reference_length 0.08 -monitor_momentum -monitor_from 0.1",
             scheme[i]);
    build_case(&c, options);
    OK(DiagnosticsCreate(c.flow, c.bodies, c.couple, c.monitor, &c.diagnostics));
    for (PetscInt step = 1; step <= 4; step++) {
      solve_step(&c, step, 0.05);
      for (PetscInt d = 0; d < 2; d++) force[step][d] = c.s->force[0][d];
      OK(DiagnosticsStep(c.diagnostics, &balance));
      OK(CoupleAdvance(c.couple));
    }
    OK(DiagnosticsFinish(c.diagnostics));
    NEAR(quantity(&c, "cd"), force[4][0] * 2 / (1.5 * 0.04 * 0.08), 1e-12);
    NEAR(quantity(&c, "cl"), force[4][1] * 2 / (1.5 * 0.04 * 0.08), 1e-12);
    assert_true(force[1][0] > force[2][0]); /* the start, left out by -monitor_from, has the largest drag of all */
    /* what counts: be at 0.1 (then drag falls), 0.15, ...; cn, where forces hold in the middle of steps, at 0.125,
       0.175 (the last is larger) */
    NEAR(quantity(&c, "cd_max_time"), i ? 0.175 : 0.1, 1e-9);
    NEAR(quantity(&c, "cd_max"), force[i ? 4 : 2][0] * 2 / (1.5 * 0.04 * 0.08), 1e-12);
    BELOW(quantity(&c, "force_difference"), 0.2);
    assert_true(quantity(&c, "force_difference") > 0);
    OK(DiagnosticsDestroy(&c.diagnostics));
    destroy_case(&c);
  }
}

/* A pressure that rises along (1, 2, 4) in a fluid at rest pushes a body down that slope with its volume: lift is
   twice the drag along y, in space as in the plane, over rho U^2 L^2/2 and rho U^2 L/2 */
static void test_axes(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal  volume = dim == 2 ? PETSC_PI * 0.09 : 4. / 3 * PETSC_PI * 0.027;
    char             options[1024];
    Case             c;
    const PetscReal *u, *p, *size;
    PetscReal       *field;

    snprintf(options, sizeof(options),
             "-mesh_cells %s -flow_density 1.5 -couple_method nodal -particle_groups ball -particle_ball_shape circle -particle_ball_radius 0.3 "
             "-particle_ball_position %s -particle_ball_free none -particle_ball_reference_speed 0.2 -particle_ball_reference_length 0.5",
             dim == 2 ? "10,10" : "8,8,8", dim == 2 ? "0.5,0.5" : "0.5,0.5,0.5");
    build_case(&c, options);
    OK(DiagnosticsCreate(c.flow, c.bodies, c.couple, c.monitor, &c.diagnostics));
    OK(FlowBeginStep(c.flow, 1, 1));
    OK(CoupleUpdateGeometry(c.couple));
    OK(FlowAssemble(c.flow));
    OK(CoupleGetSolution(c.couple, &u, &p));
    OK(FlowGetCellSize(c.flow, &size));
    field = (PetscReal *)p;
    for (PetscInt cell = 0; cell < c.l->ncell; cell++)
      for (PetscInt a = 0; a <= dim; a++) {
        const PetscReal *x = c.l->x + dim * c.l->cell_node[cell * c.l->nb + c.l->nb / 2];

        field[(dim + 1) * cell + a] = a ? (1 << (a - 1)) * size[cell] : x[0] + 2 * x[1] + (dim == 3 ? 4 * x[2] : 0);
      }
    OK(CoupleForce(c.couple));
    OK(DiagnosticsStep(c.diagnostics, NULL));
    OK(DiagnosticsFinish(c.diagnostics));
    NEAR(quantity(&c, "cl") / quantity(&c, "cd"), 2, 1e-9);
    NEAR(quantity(&c, "cd") / (-volume * 2 / (1.5 * 0.04 * (dim == 2 ? 0.5 : 0.25))), 1, 0.15);
    OK(DiagnosticsDestroy(&c.diagnostics));
    destroy_case(&c);
  }
}

/* ---- mistakes ---- */

static void test_mistakes(void **state)
{
  (void)state;
  const char *const wrong[][2] =
    {{FITTED FLOW "-monitor_dp 0.2,0.2,1,0.2", "(0.2, 0.2, 0.) lies in no cell"},
     {FITTED FLOW "-monitor_dp 1,0.2,1,0.5", "(1., 0.5, 0.) lies in no cell"},
     {FITTED FLOW "-particle_cylinder_reference_speed 0", "-particle_cylinder_reference_speed"},
     {"-mesh_cells 4,4 -particle_groups dot -particle_dot_shape circle -particle_dot_radius 0.05 -particle_dot_free none "
      "-particle_dot_place lattice -particle_dot_count 4 -particle_dot_reference_speed 1",
      "'dot' has 4 bodies"}};

  for (PetscInt i = 0; i < 4; i++) {
    Case c;

    build_case(&c, wrong[i][0]);
    begin_error();
    expect_error(DiagnosticsCreate(c.flow, c.bodies, c.couple, c.monitor, &c.diagnostics), PETSC_ERR_USER_INPUT,
                 wrong[i][1], NULL);
    destroy_case(&c);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_pressure_difference), cmocka_unit_test(test_coefficients),
                                     cmocka_unit_test(test_axes), cmocka_unit_test(test_mistakes)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("diagnostics", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
