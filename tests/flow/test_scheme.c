/* Time schemes as their coefficients have it: orders on an equation with a known solution in unequal steps, constants
   of the error, what is left of stiff parts, the convecting velocity, steady problems. */
#include "core.h"
#include "flow/flow.h"
#include "impl.h"
#include "raised.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
  PetscReal       *u, *p;
  PetscReal        t, y[2]; /* of an equation: y^n, y^{n-1} */
} Case;

static void open_case(Case *c, const char options[])
{
  char text[256];

  snprintf(text, sizeof(text), "-mesh_cells 2,2 %s", options);
  give(text);
  *c = (Case){.t = 0};
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(PetscCalloc2(c->l->nnode_all * 2, &c->u, c->l->ncell * 3, &c->p));
}

static void close_case(Case *c)
{
  OK(PetscFree2(c->u, c->p));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* A step (or part of one) of y' = rate y + cos t by the coefficients of the scheme */
static const FlowStep *take(Case *c, PetscReal dt, PetscReal rate, PetscReal force)
{
  const FlowStep *s;
  PetscReal       y, known;

  OK(FlowBeginStep(c->flow, c->t + dt, dt));
  OK(FlowGetStep(c->flow, &s));
  known = s->d0 * c->y[0] + s->d1 * c->y[1] + (1 - s->theta) * (rate * c->y[0] + force * cos(c->t)) +
          s->theta * force * cos(c->t + dt);
  y = known / (s->ct - s->theta * rate);
  OK(FlowAcceptStep(c->flow, c->u, c->p));
  c->y[1] = c->y[0];
  c->y[0] = y;
  c->t += dt;
  return s;
}

/* Error at t = 2 of y' = -y + cos t, y(0) = 1, after n steps by turns long and short */
static PetscReal solve(const char scheme[], PetscInt n)
{
  Case             c;
  PetscInt         parts;
  const PetscReal *part;
  char             options[64];

  snprintf(options, sizeof(options), "-flow_time %s", scheme);
  open_case(&c, options);
  OK(FlowGetSubsteps(c.flow, &parts, &part));
  c.y[0] = 1;
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt k = 0; k < parts; k++) take(&c, part[k] * (i % 2 ? 2.6 : 1.4) / n, -1, 1);
  NEAR(c.t, 2, 1e-12);
  close_case(&c);
  return PetscAbsReal(c.y[0] - 0.5 * (cos(2.) + sin(2.) + PetscExpReal(-2)));
}

static void test_orders(void **state)
{
  (void)state;
  expect_rate("be", solve("be", 80), solve("be", 160), 1);
  expect_rate("cn", solve("cn", 80), solve("cn", 160), 2);
  expect_rate("bdf2", solve("bdf2", 80), solve("bdf2", 160), 2);
  expect_rate("fstheta", solve("fstheta", 80), solve("fstheta", 160), 2);
}

/* In one step from exact values of y = t^(k + 1), k the order, the error is `error` dt^(k + 1) y^(k + 1) */
static void test_error_constants(void **state)
{
  static const char *const options[] = {"-flow_time be", "-flow_time cn", "-flow_time bdf2"};
  const PetscReal          steps[]   = {0.3, 0.2, 0.2, 0.5, 0.1};

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    Case      c;
    PetscReal t = 0;

    open_case(&c, options[i]);
    for (PetscInt n = 0; n < 5; n++) {
      const FlowStep *s;
      const PetscReal dt = steps[n];
      PetscReal       now, old, older, slope[2], y;

      OK(FlowBeginStep(c.flow, t + dt, dt));
      OK(FlowGetStep(c.flow, &s));
      now      = PetscPowReal(t + dt, s->order + 1);
      old      = PetscPowReal(t, s->order + 1);
      older    = n ? PetscPowReal(t - steps[n - 1], s->order + 1) : 0;
      slope[0] = (s->order + 1) * PetscPowReal(t + dt, s->order);
      slope[1] = (s->order + 1) * PetscPowReal(t, s->order);
      y        = (s->theta * slope[0] + (1 - s->theta) * slope[1] + s->d0 * old + s->d1 * older) / s->ct;
      if (n) NEAR(PetscAbsReal(y - now) / ((s->order == 1 ? 2 : 6) * PetscPowReal(dt, s->order + 1)), s->error, 1e-12);
      OK(FlowAcceptStep(c.flow, c.u, c.p));
      t += dt;
    }
    close_case(&c);
  }
}

/* What is left of y' = -10^9 y after a step: nothing (be, bdf2), all with the other sign (cn), sqrt(1/2) (fstheta) */
static void test_stiff_parts(void **state)
{
  static const char *const options[] = {"-flow_time be", "-flow_time bdf2", "-flow_time cn", "-flow_time fstheta"};
  const PetscReal          want[]    = {0, 0, -1, -PetscSqrtReal(0.5)};

  (void)state;
  for (PetscInt i = 0; i < 4; i++) {
    Case             c;
    PetscInt         parts;
    const PetscReal *part;
    PetscReal        before;

    open_case(&c, options[i]);
    OK(FlowGetSubsteps(c.flow, &parts, &part));
    for (PetscInt n = 0; n < 3; n++) {
      c.y[0] = before = 1;
      c.y[1]          = 1;
      for (PetscInt k = 0; k < parts; k++) take(&c, 0.1 * part[k], -1e9, 0);
      NEAR(c.y[0] / before, want[i], 1e-6);
    }
    close_case(&c);
  }
}

/* Glowinski's theta scheme: 1 - sqrt(1/2) of a step, twice, and one matrix for all three parts */
static void test_parts_of_a_step(void **state)
{
  Case             c;
  PetscInt         parts;
  const PetscReal *part;
  PetscReal        first = 0;

  (void)state;
  open_case(&c, "-flow_time fstheta");
  OK(FlowGetSubsteps(c.flow, &parts, &part));
  assert_int_equal(parts, 3);
  NEAR(part[0], 1 - PetscSqrtReal(0.5), 1e-15);
  NEAR(part[0] + part[1] + part[2], 1, 1e-15);
  for (PetscInt k = 0; k < 6; k++) {
    const FlowStep *s = take(&c, part[k % 3] * 0.1, 0, 0);

    if (!k) first = s->ct / s->theta;
    NEAR(s->ct / s->theta, first, 1e-12 * first);
  }
  close_case(&c);
  open_case(&c, "-flow_time bdf2");
  OK(FlowGetSubsteps(c.flow, &parts, NULL));
  assert_int_equal(parts, 1);
  close_case(&c);
}

/* ---- convecting velocity ---- */

/* A velocity that is a polynomial in time of this degree */
static PetscReal in_time(PetscInt degree, PetscReal t)
{
  return 1 + 2 * t + (degree == 2 ? 5 * t * t : 0);
}

/* w is the velocity at the point theta of the step */
static void check_convecting(const char options[], PetscInt degree, PetscReal theta)
{
  const PetscReal times[] = {0, 0.1, 0.25, 0.3, 0.42};
  Case            c;

  open_case(&c, options);
  for (PetscInt n = 1; n < 5; n++) {
    const PetscReal dt = times[n] - times[n - 1], at = theta < 0 ? times[n - 1] : times[n] - (1 - theta) * dt;

    OK(FlowBeginStep(c.flow, times[n], dt));
    for (PetscInt i = 0; i < c.l->nnode_all * 2 && n > degree + 1; i++)
      NEAR(c.flow->w[i], in_time(degree, at) * noise(i), 1e-13);
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) c.u[i] = in_time(degree, times[n]) * noise(i);
    OK(FlowAcceptStep(c.flow, c.u, c.p));
  }
  close_case(&c);
}

static void test_convecting_velocity(void **state)
{
  (void)state;
  check_convecting("-flow_time be", 1, -1); /* that of the step before */
  check_convecting("-flow_time bdf2 -flow_extrapolation linear", 1, 1);
  check_convecting("-flow_time cn -flow_extrapolation linear", 1, 0.5);
  check_convecting("-flow_time bdf2 -flow_extrapolation quadratic", 2, 1);
  check_convecting("-flow_time cn -flow_extrapolation quadratic", 2, 0.5);
}

/* A parabola that the flow chose itself adds at most what the line does, which keeps noise in time from growing */
static void test_parabola_is_limited(void **state)
{
  Case c;

  (void)state;
  open_case(&c, "-flow_time bdf2");
  OK(FlowAllowParabola(c.flow, PETSC_TRUE));
  for (PetscInt n = 1; n < 5; n++) {
    c.flow->time.cfl = 3; /* large steps */
    OK(FlowBeginStep(c.flow, n, 1));
    if (n == 4) assert_true(c.flow->time.curvature > 0);
    for (PetscInt i = 0; i < c.l->nnode_all && n == 4; i++) {
      PetscReal line = 0, more = 0;

      for (PetscInt a = 0, j = 2 * i; a < 2; a++, j++) {
        const PetscReal u = c.flow->u[j], old = c.flow->u_old[j];

        line += PetscSqr(u - old);
        more += PetscSqr(c.flow->w[j] - (2 * u - old));
      }
      if (more > line * (1 + 1e-12))
        fail_msg("the parabola adds %g, the line %g", (double)PetscSqrtReal(more), (double)PetscSqrtReal(line));
    }
    for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) c.u[i] = noise(1000 * n + i);
    OK(FlowAcceptStep(c.flow, c.u, c.p));
  }
  close_case(&c);
}

/* Seen from a box that travels and from nodes that move */
static void test_frame_and_drift(void **state)
{
  const PetscReal v[3] = {0.3, -0.2, 0};
  Case            c;
  PetscReal      *drift;

  (void)state;
  open_case(&c, "-flow_time bdf2");
  OK(PetscMalloc1(c.l->nnode_all * 2, &drift));
  for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) {
    c.u[i]   = noise(i);
    drift[i] = noise(500 + i);
  }
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  OK(FlowAcceptStep(c.flow, c.u, c.p));
  OK(FlowBeginStep(c.flow, 0.2, 0.1));
  OK(FlowSetFrame(c.flow, v));
  for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) NEAR(c.flow->w[i], 2 * noise(i) - v[i % 2], 1e-14);
  OK(FlowSetMeshVelocity(c.flow, drift));
  for (PetscInt i = 0; i < c.l->nnode_all * 2; i++) NEAR(c.flow->w[i], 2 * noise(i) - v[i % 2] - drift[i], 1e-14);
  close_case(&c);
  open_case(&c, "-flow_time cn");
  OK(FlowBeginStep(c.flow, 0.1, 0.1));
  begin_error();
  expect_error(FlowSetMeshVelocity(c.flow, drift), PETSC_ERR_SUP, "-mesh_deform", "use -flow_time bdf2 or be", NULL);
  OK(PetscFree(drift));
  close_case(&c);
}

/* A pseudo-time of rate 1/dt, or none; more of it counts for the solution, not for what was */
static void test_steady_steps(void **state)
{
  Case            c;
  const FlowStep *s;
  PetscReal       now;

  (void)state;
  open_case(&c, "-flow_time bdf2");
  OK(FlowBeginSteady(c.flow, 0));
  OK(FlowGetStep(c.flow, &s));
  assert_true(s->ct == 0 && s->d0 == 0 && s->d1 == 0 && s->theta == 1);
  OK(FlowBeginSteady(c.flow, 3));
  assert_true(s->ct == 3 && s->d0 == 3 && s->d1 == 0);
  OK(FlowAddRate(c.flow, 2, &now));
  NEAR(now, 5, 0);
  assert_true(s->ct == 5 && s->d0 == 3);
  close_case(&c);
  open_case(&c, "-flow_rheology oldroyd_b -flow_rheology_time 2 -flow_rheology_solvent 0.5");
  begin_error();
  expect_error(FlowBeginSteady(c.flow, 0), PETSC_ERR_SUP, "oldroyd_b remembers what was", "-flow_rheology_time 2",
               NULL);
  close_case(&c);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_orders),
                                     cmocka_unit_test(test_error_constants),
                                     cmocka_unit_test(test_stiff_parts),
                                     cmocka_unit_test(test_parts_of_a_step),
                                     cmocka_unit_test(test_convecting_velocity),
                                     cmocka_unit_test(test_parabola_is_limited),
                                     cmocka_unit_test(test_frame_and_drift),
                                     cmocka_unit_test(test_steady_steps)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("scheme", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
