/* A mesh that follows a body: velocities linear in space are kept exactly while nodes move; rates of convergence are
   those of a mesh that stands still, 1 (be) and 2 (bdf2) in time, 3 in space, also where the body crosses a periodic
   boundary; the mesh does not remember the way; what is refused. The body is a phantom, which the flow does not see. */
/* ranks: 1 2 */
#include "core.h"
#include "bodies/write.h"
#include "couple/couple.h"
#include "ale.h"
#include "couple/bodysurfaces.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           phantom, none;
  Deform           deform;
  Ale              relative_to;
  MeshUpdate       moved;
  Couple           couple;
  const MeshLocal *l;
  PetscReal        time, speed[2];
  DeformResult     start;
} Case;

typedef PetscErrorCode (*Exact)(void *ctx, PetscReal t, const PetscReal x[], PetscReal u[]);

/* G G = 0: w.grad u does not depend on where w is taken, so that its extrapolation along the nodes is exact too */
static const PetscReal RHO = 1.3, MU = 0.026, AT[2] = {1, -0.5}, G[2][2] = {{0.7, 1.1}, {-0.49 / 1.1, -0.7}},
                       STREAM[2] = {1, 0.5};

/* Linear in space; *ctx: rate of the amplitude */
static PetscReal amplitude(const void *rate, PetscReal t)
{
  return 1 + 0.5 * PetscSinReal(*(const PetscReal *)rate * t);
}

static PetscErrorCode linear(void *rate, PetscReal t, const PetscReal x[], PetscReal u[])
{
  for (PetscInt a = 0; a < 2; a++) u[a] = amplitude(rate, t) * (AT[a] + G[a][0] * x[0] + G[a][1] * x[1]);
  return PETSC_SUCCESS;
}

static PetscErrorCode linear_force(void *rate, PetscReal t, const PetscReal x[], PetscReal f[])
{
  const PetscReal g = amplitude(rate, t), change = 0.5 * *(PetscReal *)rate * PetscCosReal(*(PetscReal *)rate * t) / g;
  PetscReal       u[2];

  PetscCall(linear(rate, t, x, u));
  for (PetscInt a = 0; a < 2; a++) f[a] = RHO * (change * u[a] + g * (G[a][0] * u[0] + G[a][1] * u[1]));
  return PETSC_SUCCESS;
}

/* The decaying vortex in a uniform stream (test_taylorgreen.c) */
static PetscErrorCode taylor_green(void *ctx, PetscReal t, const PetscReal x[], PetscReal u[])
{
  const PetscReal k = 2 * PETSC_PI, f = PetscExpReal(-2 * MU / RHO * k * k * t), a = k * (x[0] - STREAM[0] * t),
                  b = k * (x[1] - STREAM[1] * t);

  (void)ctx;
  u[0] = STREAM[0] + f * PetscSinReal(a) * PetscCosReal(b);
  u[1] = STREAM[1] - f * PetscCosReal(a) * PetscSinReal(b);
  return PETSC_SUCCESS;
}

static const char *const GROUP[5] = {"-particle_groups", "-particle_a_shape", "-particle_a_radius",
                                     "-particle_a_position", "-particle_a_free"};

static PetscErrorCode open_case(Case *c, const char options[], Exact exact, void *ctx)
{
  FlowSolver solver;
  PetscReal *u;

  PetscFunctionBeginUser;
  *c = (Case){.speed = {2, 1}};
  give(
    "-flow_density 1.3 -flow_viscosity 0.026 -flow_ksp_rtol 1e-11 -flow_ksp_max_it 200 -mesh_deform -mesh_deform_size 0.5 -particle_groups a -particle_a_shape circle "
    "-particle_a_radius 0.15 -particle_a_position 0.35,0.4 -particle_a_free none");
  PetscCall(PetscOptionsInsertString(NULL, options));
  PetscCall(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  PetscCall(MeshGetLocal(c->mesh, &c->l));
  PetscCall(BodiesCreate(2, c->l->lower, c->l->upper, &c->phantom));
  PetscCall(BodySurfacesCreateDeform(c->mesh, c->phantom, &c->deform));
  PetscCall(DeformMesh(c->deform, &c->start));
  for (PetscInt i = 0; i < 5; i++) PetscCall(PetscOptionsClearValue(NULL, GROUP[i]));
  PetscCall(BodiesCreate(2, c->l->lower, c->l->upper, &c->none));
  PetscCall(FlowCreate(c->mesh, &c->flow));
  if (ctx) PetscCall(FlowSetSource(c->flow, linear_force, ctx));
  if (ctx) PetscCall(ConditionsSetField(FlowConditions(c->flow), exact, ctx));
  PetscCall(CoupleCreate(c->flow, c->none, &c->couple));
  PetscCall(CoupleGetSolver(c->couple, &solver));
  PetscCall(MeshUpdateCreate(c->flow, NULL, NULL, &c->moved));
  PetscCall(MeshUpdateSetSolver(c->moved, solver));
  PetscCall(AleCreate(c->moved, c->flow, c->phantom, c->deform, &c->relative_to));
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c->l->nnode_all; i++) PetscCall(exact(ctx, 0, c->l->x + 2 * i, u + 2 * i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void close_case(Case *c)
{
  OK(AleDestroy(&c->relative_to));
  OK(MeshUpdateDestroy(&c->moved));
  OK(CoupleDestroy(&c->couple));
  OK(FlowDestroy(&c->flow));
  OK(BodiesDestroy(&c->none));
  OK(DeformDestroy(&c->deform));
  OK(BodiesDestroy(&c->phantom));
  OK(MeshDestroy(&c->mesh));
}

static PetscErrorCode take_step(Case *c, PetscReal dt)
{
  PetscInt           its;
  BodyArrays        *s;
  KSPConvergedReason reason;
  PetscReal          X[1][3];

  PetscFunctionBeginUser;
  c->time += dt;
  PetscCall(BodiesGetArrays(c->phantom, &s));
  for (PetscInt a = 0; a < 3; a++) X[0][a] = s->x[0][a] + (a < 2 ? c->time * c->speed[a] : 0);
  for (PetscInt a = 0; a < 2; a++)
    if (c->l->period[a] > 0) X[0][a] -= PetscFloorReal(X[0][a] / c->l->period[a]) * c->l->period[a];
  PetscCall(FlowBeginStep(c->flow, c->time, dt));
  PetscCall(AleUpdate(c->relative_to, X, s->q));
  PetscCall(CoupleUpdateGeometry(c->couple));
  PetscCall(CoupleSolve(c->couple, &its, &reason));
  PetscCheck(reason > 0, PETSC_COMM_SELF, PETSC_ERR_PLIB, "no solution");
  PetscCall(CoupleForce(c->couple));
  PetscCall(CoupleAdvance(c->couple));
  PetscCall(AleAccept(c->relative_to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Root mean square over the nodes */
static PetscReal measure(const Case *c, Exact exact, void *ctx)
{
  PetscReal *u, sum = 0;

  OK(FlowGetFields(c->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < c->l->nnode; i++) {
    PetscReal want[2];

    OK(exact(ctx, c->time, c->l->x + 2 * i, want));
    sum += PetscSqr(u[2 * i] - want[0]) + PetscSqr(u[2 * i + 1] - want[1]);
  }
  return PetscSqrtReal(total(sum) / c->l->nnode_global);
}

static void check_mesh(const Case *c)
{
  const DeformResult *r;

  OK(AleGetResult(c->relative_to, &r));
  if (r->jacobian < 0.3 || r->area[0] < 0.9 || r->area[1] > 1.1)
    fail_msg("smallest Jacobian %g of its cell's mean, sizes %g to %g of the wanted ones", (double)r->jacobian,
             (double)r->area[0], (double)r->area[1]);
}

static void check_kept(const char scheme[])
{
  PetscReal rate = 0, far = 0, *x;
  Case      c;

  OK(open_case(&c, scheme, linear, &rate));
  OK(PetscMalloc1(2 * c.l->nnode_all, &x));
  OK(PetscArraycpy(x, c.l->x, 2 * c.l->nnode_all));
  for (PetscInt i = 0; i < 8; i++) {
    OK(take_step(&c, i % 2 ? 0.01 : 0.015)); /* uneven */
    check_mesh(&c);
    BELOW(measure(&c, linear, &rate), 1e-8);
  }
  for (PetscInt i = 0; i < 2 * c.l->nnode_all; i++) far = PetscMax(far, PetscAbsReal(c.l->x[i] - x[i]));
  assert_true(largest(far) > 0.05); /* nodes have moved */
  OK(PetscFree(x));
  close_case(&c);
}

static void test_linear_velocity_is_kept(void **state)
{
  (void)state;
  check_kept("-mesh_cells 12,12 -flow_time be");
  check_kept("-mesh_cells 12,12 -flow_time bdf2");
}

static void check_time(const char scheme[], PetscReal order)
{
  PetscReal rate = 4, error[3];

  for (PetscInt i = 0; i < 3; i++) {
    Case c;

    OK(open_case(&c, scheme, linear, &rate));
    for (PetscInt k = 0; k < 12 << i; k++) OK(take_step(&c, 0.2 / (12 << i)));
    error[i] = measure(&c, linear, &rate);
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) expect_rate(scheme, error[i], error[i + 1], order);
}

static void test_order_in_time(void **state)
{
  (void)state;
  check_time("-mesh_cells 8,8 -flow_time be", 1);
  check_time("-mesh_cells 8,8 -flow_time bdf2", 2);
}

/* Nodes move up to several times as fast as the fluid */
static void test_order_in_space(void **state)
{
  PetscReal error[3];

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    char options[128];
    Case c;

    snprintf(options, sizeof(options),
             "-mesh_cells %d,%d -mesh_periodic x,y -flow_time bdf2 -flow_ksp_rtol 1e-9 -particle_a_position 0.03,0.4",
             8 << i, 8 << i);
    OK(open_case(&c, options, taylor_green, NULL));
    c.speed[0] = -4;
    for (PetscInt k = 0; k < 16; k++) OK(take_step(&c, 0.001)); /* through the boundary */
    check_mesh(&c);
    error[i] = measure(&c, taylor_green, NULL);
    close_case(&c);
  }
  for (PetscInt i = 0; i < 2; i++) expect_rate("velocity in space", error[i], error[i + 1], 3);
}

/* There and back: the mesh is nearly that of the beginning, sound all the way */
static void test_no_trail(void **state)
{
  PetscReal rate = 0, off = 0, far = 0, *x;
  Case      c;

  (void)state;
  OK(open_case(&c, "-mesh_cells 16,16", linear, &rate));
  OK(PetscMalloc1(2 * c.l->nnode_all, &x));
  OK(PetscArraycpy(x, c.l->x, 2 * c.l->nnode_all));
  for (PetscInt i = 1; i <= 50; i++) {
    /* 0.3 away after half of the time */
    c.speed[0] = c.speed[1] = 0.3 * PetscSqr(PetscSinReal(PETSC_PI * i / 50.)) / (0.01 * i);
    OK(take_step(&c, 0.01));
    check_mesh(&c);
    for (PetscInt k = 0; k < 2 * c.l->nnode_all && i == 25; k++) far = PetscMax(far, PetscAbsReal(c.l->x[k] - x[k]));
  }
  for (PetscInt k = 0; k < 2 * c.l->nnode_all; k++) off = PetscMax(off, PetscAbsReal(c.l->x[k] - x[k]));
  far = largest(far);
  off = largest(off);
  if (off > 0.2 * far)
    fail_msg("nodes moved by %g, and were %g away from where they had been when the body was back", (double)far,
             (double)off);
  OK(PetscFree(x));
  close_case(&c);
}

static void expect_refusal(const char options[])
{
  PetscReal rate = 0;
  Case      c;

  OK(open_case(&c, options, linear, &rate));
  OK(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
  assert_int_equal(take_step(&c, 0.01), PETSC_ERR_SUP);
  OK(PetscPopErrorHandler());
  close_case(&c);
}

static void test_refusals(void **state)
{
  (void)state;
  expect_refusal("-mesh_cells 8,8 -flow_time cn");
  expect_refusal("-mesh_cells 8,8 -flow_time fstheta");
  expect_refusal("-mesh_cells 8,8 -flow_convection false");
  expect_refusal("-mesh_cells 8,8 -flow_convection_form skew");
  expect_refusal("-mesh_cells 8,8 -flow_extrapolation quadratic");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_linear_velocity_is_kept),
                                     cmocka_unit_test(test_order_in_time), cmocka_unit_test(test_order_in_space),
                                     cmocka_unit_test(test_no_trail), cmocka_unit_test(test_refusals)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("follow", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
