/* Motion of bodies without a flow: prescribed motion, pendulum about a pivot, stops, external loads. */
/* ranks: 1 2 */
#include "bodies/write.h"
#include "core.h"
#include "raised.h"
#include "base/algebra.h"

static const PetscReal lower[3] = {-10, -10, -10}, upper[3] = {10, 10, 10}, zero[3] = {0, 0, 0},
                       down[3] = {0, -9.81, 0};

static void create(PetscInt dim, const char options[], Bodies *b, BodyArrays **s)
{
  give(options);
  OK(BodiesCreate(dim, lower, upper, b));
  OK(BodiesGetArrays(*b, s));
}

static void refuse(PetscInt dim, const char options[], const char text[])
{
  Bodies b;

  give(options);
  begin_error();
  expect_error(BodiesCreate(dim, lower, upper, &b), 0, text, NULL);
}

static void step(Bodies b, PetscReal dt, const PetscReal gravity[3])
{
  OK(BodiesAdvanceVelocity(b, dt, 0, gravity));
  OK(BodiesAdvancePosition(b, dt, 1));
}

#define CIRCLE "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_position 1,2 "

/* Position, velocity and their prediction are those of the formula, whatever the steps were */
static void test_oscillation(void **state)
{
  const PetscReal dt[] = {0.01, 0.13, 0.0007, 0.4, 0.2};
  Bodies          b;
  BodyArrays     *s;
  PetscReal       t = 0;

  (void)state;
  create(2,
         CIRCLE
         "-particle_a_motion oscillate,constant,rotate -particle_a_velocity 0.3,0 -particle_a_angular_velocity 2 -particle_a_angle 0.4 -particle_a_motion_amplitude 0.25,0.5 "
         "-particle_a_motion_period 4,3 -particle_a_motion_phase 0,0.7 -particle_a_motion_rotation 0.3,1.5,0.2",
         &b, &s);
  assert_int_equal(s->group[0].free, 0);
  for (PetscInt i = 0; i <= 5; i++) {
    const PetscReal c[3] = {2 * PETSC_PI / 4, 2 * PETSC_PI / 3, 2 * PETSC_PI / 1.5};
    PetscReal       X[3], q[4], angle;

    NEAR(s->x[0][0], 1 + 0.3 * t + 0.25 * PetscSinReal(c[0] * t), 1e-14);
    NEAR(s->x[0][1], 2 + 0.5 * PetscSinReal(c[1] * t + 0.7), 1e-14);
    NEAR(s->u[0][0], 0.3 + 0.25 * c[0] * PetscCosReal(c[0] * t), 1e-14);
    NEAR(s->u[0][1], 0.5 * c[1] * PetscCosReal(c[1] * t + 0.7), 1e-14);
    NEAR(s->angle[0], 0.4 + 2 * t + 0.3 * PetscSinReal(c[2] * t + 0.2), 1e-14);
    NEAR(s->w[0][2], 2 + 0.3 * c[2] * PetscCosReal(c[2] * t + 0.2), 1e-14);
    if (i == 5) break;
    for (PetscInt order = 0; order <= 2; order++) {
      OK(BodiesPredict(b, 0, dt[i], order, X, q, &angle));
      NEAR(X[1], 2 + 0.5 * PetscSinReal(c[1] * (t + dt[i]) + 0.7), 1e-14);
      NEAR(q[3], PetscSinReal(0.5 * (0.4 + 2 * (t + dt[i]) + 0.3 * PetscSinReal(c[2] * (t + dt[i]) + 0.2))), 1e-14);
    }
    step(b, dt[i], down);
    t += dt[i];
  }
  OK(BodiesDestroy(&b));
}

/* The ramp: velocity is the derivative of the position, zero at first and whole at last */
static void test_ramp(void **state)
{
  Bodies      b;
  BodyArrays *s;

  (void)state;
  create(2, CIRCLE "-particle_a_motion constant -particle_a_velocity 2,0 -particle_a_motion_ramp 0.5", &b, &s);
  NEAR(s->u[0][0], 0, 0);
  for (PetscInt i = 0; i < 20; i++) {
    const PetscReal x = s->x[0][0], t = s->time, dt = 0.05, part = PetscMin((t + dt) / 0.5, 1);

    step(b, dt, zero);
    NEAR(s->u[0][0], 1 - PetscCosReal(PETSC_PI * part), 1e-14);
    NEAR((s->x[0][0] - x) / dt, 0.5 * (s->u[0][0] + s->u_old[0][0]), 0.012);
  }
  NEAR(s->x[0][0], 1 + 2 * (0.25 + 0.5), 1e-13);
  OK(BodiesDestroy(&b));
}

/* A body whose x is prescribed by its given velocity falls in y; a fixed one stays */
static void test_partly_free(void **state)
{
  Bodies      b;
  BodyArrays *s;

  (void)state;
  create(2, CIRCLE "-particle_a_density 2 -particle_a_free y -particle_a_velocity 0.5,0 -particle_a_force 1,0.1", &b,
         &s);
  for (PetscInt i = 0; i < 10; i++) step(b, 0.1, down);
  NEAR(s->x[0][0], 1.5, 1e-14);
  NEAR(s->u[0][0], 0.5, 0);
  NEAR(s->u[0][1], -9.81 + 0.1 / (2 * PETSC_PI * 0.01), 1e-12);
  OK(BodiesDestroy(&b));
  create(2, CIRCLE "-particle_a_density 2 -particle_a_free rotation -particle_a_torque 0.001", &b, &s);
  for (PetscInt i = 0; i < 10; i++) step(b, 0.1, down);
  NEAR(s->x[0][1], 2, 0);
  NEAR(s->w[0][2], 0.001 / (2 * PETSC_PI / 2 * 1e-4), 1e-12);
  OK(BodiesDestroy(&b));
}

/* Rotation about a pivot away from the centroid: the centre goes round, in 3D too */
static void test_prescribed_rotation_about_pivot(void **state)
{
  Bodies      b;
  BodyArrays *s;

  (void)state;
  create(2,
         CIRCLE
         "-particle_a_pivot 0.2,-0.1 -particle_a_motion rotate -particle_a_angular_velocity 3 -particle_a_angle 0.5",
         &b, &s);
  for (PetscInt i = 0; i <= 4; i++) {
    const PetscReal angle = 0.5 + 3 * s->time, c = PetscCosReal(angle), z = PetscSinReal(angle);

    NEAR(s->x[0][0], 1 + c * -0.2 - z * 0.1, 1e-14);
    NEAR(s->x[0][1], 2 + z * -0.2 + c * 0.1, 1e-14);
    NEAR(s->u[0][0], -3 * (s->x[0][1] - 2), 1e-14);
    NEAR(s->u[0][1], 3 * (s->x[0][0] - 1), 1e-14);
    step(b, 0.21, down);
  }
  OK(BodiesDestroy(&b));
  create(3,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_position 1,2,3 -particle_a_pivot 0,0.3,0 -particle_a_motion rotate "
         "-particle_a_angular_velocity 2,0,0",
         &b, &s);
  step(b, 0.37, down);
  NEAR(s->x[0][0], 1, 1e-14);
  NEAR(s->x[0][1], 2 - 0.3 * PetscCosReal(0.74), 1e-14);
  NEAR(s->x[0][2], 3 - 0.3 * PetscSinReal(0.74), 1e-14);
  NEAR(s->u[0][2], 2 * (s->x[0][1] - 2), 1e-14);
  OK(BodiesDestroy(&b));
}

#define PENDULUM \
  "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.5 -particle_a_b 0.1 -particle_a_density 3 -particle_a_position 1,2 -particle_a_pivot -0.4,0 "

/* Physical pendulum: period 2 pi sqrt((I + M L^2)/(M g L)) (1 + A^2/16 + 11 A^4/3072), energy without drift */
static void test_pendulum(void **state)
{
  const PetscReal L = 0.4, inertia = 0.25 * (0.25 + 0.01) + L * L, A = 0.3; /* per mass */
  const PetscReal period = 2 * PETSC_PI * PetscSqrtReal(inertia / (9.81 * L)) *
                           (1 + A * A / 16 + 11 * PetscPowReal(A, 4) / 3072);
  const PetscReal dt = period / 20000;
  Bodies          b;
  BodyArrays     *s;
  PetscReal       crossing[3], angle, top = 0;
  PetscInt        n = 0;

  (void)state;
  create(2, PENDULUM "-particle_a_angle -1.2707963267948966", &b, &s); /* hangs down at -pi/2 */
  NEAR(s->x[0][0], 1 + L * PetscSinReal(A), 1e-12);
  angle = A;
  while (n < 3) {
    PetscReal now;

    step(b, dt, down);
    now = s->angle[0] + PETSC_PI / 2;
    if (now * angle < 0) crossing[n++] = s->time - dt * now / (now - angle);
    angle = now;
    if (n == 2) top = PetscMax(top, PetscAbsReal(now));
    NEAR(PetscSqr(s->x[0][0] - 1) + PetscSqr(s->x[0][1] - 2), L * L, 1e-12);
  }
  NEAR(crossing[2] - crossing[0], period, 1e-5 * period);
  NEAR(top, A, 1e-4 * A);
  OK(BodiesDestroy(&b));
}

/* A pivot that is accelerated acts like gravity in the other direction */
static void test_accelerated_pivot(void **state)
{
  Bodies          b;
  BodyArrays     *s;
  const PetscReal c = 2 * PETSC_PI / 3, dt = 1e-5;

  (void)state;
  create(2,
         PENDULUM
         "-particle_a_angle -1.5707963267948966 -particle_a_motion oscillate -particle_a_motion_amplitude 0.2,0 -particle_a_motion_period 3,1 "
         "-particle_a_motion_phase 1.5707963267948966,0 -particle_a_free rotation",
         &b, &s);
  step(b, dt, zero);
  /* pivot at its right end, accelerated to the left */
  NEAR(s->w[0][2] / dt, 0.4 * 0.2 * c * c / (0.25 * 0.26 + 0.16), 1e-4);
  OK(BodiesDestroy(&b));
}

/* Falls onto a stop: rebounds with the wanted part of its speed, at last rests there; is released when gravity turns */
static void test_stops(void **state)
{
  const PetscReal restitution[] = {1, 0.5, 0};

  (void)state;
  for (PetscInt i = 0; i < 3; i++) {
    Bodies      b;
    BodyArrays *s;
    char        options[1024];
    PetscReal   w = 0, first = 0, before = 0, highest = -10;
    PetscInt    bounces = 0;

    snprintf(options, sizeof(options),
             PENDULUM "-particle_a_angle -0.2 -particle_a_stops -0.9,0.3 -particle_a_stops_restitution %g",
             restitution[i]);
    create(2, options, &b, &s);
    for (PetscInt n = 0; n < 30000; n++) {
      step(b, 1e-4, down);
      assert_true(s->angle[0] >= -0.9 && s->angle[0] <= 0.3);
      if (w < 0 && s->w[0][2] >= 0) { /* has just hit the lower stop */
        if (!bounces++) {
          before = w;
          first  = s->w[0][2];
        }
      }
      if (bounces == 1) highest = PetscMax(highest, s->angle[0]);
      w = s->w[0][2];
    }
    NEAR(first, -restitution[i] * before, 2e-3);
    if (restitution[i] == 1) NEAR(highest, -0.2, 2e-3); /* energy is kept */
    if (restitution[i] < 1) {
      NEAR(s->angle[0], -0.9, 0);
      NEAR(s->w[0][2], 0, 0);
      assert_int_equal(s->stopped[0], -1);
      assert_false(BodiesIsFree(b, 0, 3));
      step(b, 1e-4, (const PetscReal[]){0, 9.81, 0});
      assert_int_equal(s->stopped[0], 0);
      assert_true(s->angle[0] > -0.9 && s->w[0][2] > 0);
    } else assert_true(bounces > 2);
    OK(BodiesDestroy(&b));
  }
}

/* Velocities as expressions of t: places are their integrals, whatever the steps were; axes without t move freely */
static void test_expressions(void **state)
{
  const PetscReal dt[] = {0.01, 0.13, 0.0007, 0.4, 7};
  Bodies          b;
  BodyArrays     *s;
  PetscReal       t = 0;

  (void)state;
  create(2,
         CIRCLE
         "-particle_a_velocity 0.3*cos(4*t),t>0.5?2*t:0 -particle_a_angular_velocity exp(-t) -particle_a_motion_ramp 0",
         &b, &s);
  assert_int_equal(s->group[0].free, 0);
  for (PetscInt i = 0; i <= 5; i++) {
    PetscBool still;

    NEAR(s->u[0][0], 0.3 * PetscCosReal(4 * t), 1e-14);
    NEAR(s->x[0][0], 1 + 0.075 * PetscSinReal(4 * t), 1e-13);
    NEAR(s->x[0][1], 2 + (t > 0.5 ? t * t - 0.25 : 0), 1e-4 * t); /* the jump is met to time/2^18 */
    NEAR(s->w[0][2], PetscExpReal(-t), 1e-14);
    NEAR(s->angle[0], 1 - PetscExpReal(-t), 1e-13);
    OK(BodiesAreStill(b, &still));
    assert_false(still);
    if (i < 5) step(b, dt[i], zero);
    t += i < 5 ? dt[i] : 0;
  }
  OK(BodiesDestroy(&b));
  create(3,
         CIRCLE
         "-particle_a_position 1,2,3 -particle_a_velocity 1,0,sin(t) -particle_a_angular_velocity 0,2*t,0 -particle_a_free x -particle_a_density 2",
         &b, &s);
  for (PetscInt i = 0; i < 3; i++) step(b, 0.5, zero);
  NEAR(s->x[0][0], 2.5, 1e-14);
  NEAR(s->x[0][2], 4 - PetscCosReal(1.5), 1e-13);
  NEAR(s->q[0][2], PetscSinReal(1.125), 1e-13); /* half of 1.5^2 about y */
  OK(BodiesDestroy(&b));
}

/* One file a program, removed at its end: ranks write their own */
static char track_path[64];

static void remove_track(void)
{
  if (track_path[0]) (void)remove(track_path);
}

static const char *write_track(const char text[])
{
  FILE *f;

  if (!track_path[0]) assert_int_equal(atexit(remove_track), 0);
  (void)snprintf(track_path, sizeof(track_path), "track.%d.csv", (int)getpid());
  f = fopen(track_path, "w");
  assert_non_null(f);
  assert_true(fputs(text, f) >= 0);
  assert_int_equal(fclose(f), 0);
  return track_path;
}

/* Largest error of x = sin(2 pi t/3), angle from its rate cos(2 pi t/3), at times between the n + 1 lines of a
   period */
static void check_track(PetscInt n, PetscBool repeat, PetscReal *place, PetscReal *speed, PetscReal *angle)
{
  const PetscReal c = 2 * PETSC_PI / 3;
  char            text[8192], option[512];
  size_t          used = (size_t)snprintf(text, sizeof(text), "# a wave\nt, x, omega\n");
  Bodies          b;
  BodyArrays     *s;
  PetscReal       t = 0;

  for (PetscInt i = 0; i <= n; i++) {
    const PetscReal at = i * 3.0 / n, value = i < n ? PetscSinReal(c * at) : 0, rate = i < n ? PetscCosReal(c * at) : 1;

    used += (size_t)snprintf(text + used, sizeof(text) - used, "%.17g, %.17g, %.17g\n", (double)at, (double)value,
                             (double)rate);
  }
  (void)snprintf(option, sizeof(option), CIRCLE "-particle_a_motion_file %s -particle_a_motion_repeat %s",
                 write_track(text), repeat ? "true" : "false");
  create(2, option, &b, &s);
  assert_int_equal(s->group[0].free, 0);
  *place = *speed = *angle = 0;
  for (PetscInt i = 0; i < (repeat ? 70 : 14); i++) {
    *place = PetscMax(*place, PetscAbsReal(s->x[0][0] - 1 - PetscSinReal(c * t)));
    *speed = PetscMax(*speed, PetscAbsReal(s->u[0][0] - c * PetscCosReal(c * t)));
    *angle = PetscMax(*angle, PetscAbsReal(s->angle[0] - PetscSinReal(c * t) / c));
    BELOW(PetscAbsReal(s->x[0][1] - 2), 0);
    step(b, 0.17, down);
    t += 0.17;
  }
  if (!repeat) { /* held: the place stays, the rate goes on */
    step(b, 1, down);
    NEAR(s->x[0][0], 1, 1e-12);
    BELOW(PetscAbsReal(s->u[0][0]), 1e-12);
    NEAR(s->w[0][2], 1, 1e-12);
  }
  OK(BodiesDestroy(&b));
}

/* Splines: fourth order in places, third in velocities; over many periods without drift */
static void test_file(void **state)
{
  PetscReal coarse[3], fine[3];

  (void)state;
  check_track(12, PETSC_TRUE, &coarse[0], &coarse[1], &coarse[2]);
  check_track(24, PETSC_TRUE, &fine[0], &fine[1], &fine[2]);
  expect_rate("place", coarse[0], fine[0], 4);
  expect_rate("velocity", coarse[1], fine[1], 3);
  expect_rate("angle", coarse[2], fine[2], 4);
  check_track(48, PETSC_FALSE, &fine[0], &fine[1], &fine[2]); /* its ends differ: velocity zero at the last line */
  BELOW(fine[0], 0.05);
}

/* A screw: what a place gains in a period is added each time; the turn is about the axis */
static void test_screw(void **state)
{
  char        option[512];
  Bodies      b;
  BodyArrays *s;

  (void)state;
  (void)
    snprintf(option, sizeof(option),
             "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_position 1,2,3 -particle_a_axis 2,0,0 "
             "-particle_a_motion_file %s -particle_a_motion_repeat true",
             write_track("t,x,angle\n0,5,0\n1,5.5,1\n2,6,2\n3,6.5,3\n4,7,4\n"));
  create(3, option, &b, &s);
  for (PetscInt i = 0; i < 9; i++) step(b, 1.1, zero);
  NEAR(s->x[0][0], 1 + 0.5 * 9.9, 1e-12);
  NEAR(s->u[0][0], 0.5, 1e-12);
  NEAR(s->w[0][0], 1, 1e-12);
  NEAR(s->angle[0], 9.9, 1e-12);
  OK(BodiesDestroy(&b));
}

static void refuse_track(const char text[], const char more[], const char message[])
{
  char option[512];

  (void)snprintf(option, sizeof(option), CIRCLE "-particle_a_motion_file %s %s", write_track(text), more);
  refuse(2, option, message);
}

static void test_bad_files(void **state)
{
  (void)state;
  refuse(2, CIRCLE "-particle_a_motion_file nowhere.csv", "Table 'nowhere.csv' cannot be read");
  refuse_track("", "", "the table is empty");
  refuse_track("x,y\n0,1\n", "", ":1: the header line has no column 't'");
  refuse_track("t,x,z\n0,1,2\n", "", ":1: column 'z' is not known (known in 2D");
  refuse_track("t\n0\n1\n", "", ":1: nothing moves");
  refuse_track("t,x,u\n0,1,2\n1,1,2\n", "", ":1: columns 'x' and 'u' say the same");
  refuse_track("t,x\n0,1\n", "", "1 line of numbers, a motion needs at least 2");
  refuse_track("t,x\n0,1\n0,2\n", "", ":3: t = 0. does not come after 0.");
  refuse_track("t,x\n0,1\n1,two\n", "", ":3: 'two' in column 'x' is not a finite number");
  refuse_track("t,x\n0,1\n1,2\n2,1\n", "-particle_a_motion_repeat true", "needs at least 4 to be repeated");
  refuse_track("t,u\n0,1\n1,2\n2,1\n3,5\n", "-particle_a_motion_repeat true", ":5: u ends at 5. and begins at 1.");
  refuse_track("t,x\n0,1\n1,2\n", "-particle_a_free x", "-particle_a_free");
}

static void test_refusals(void **state)
{
  refuse(2, CIRCLE "-particle_a_velocity sin(x),0", "Option -particle_a_velocity = sin(x),0 is wrong at character 5: ");
  refuse(2, CIRCLE "-particle_a_velocity sin(t),0 -particle_a_free x -particle_a_density 1",
         "-particle_a_velocity prescribes x");
  refuse(3, CIRCLE "-particle_a_position 1,2,3 -particle_a_angular_velocity sin(t),1,0", "let only one component");
  (void)state;
  refuse(2, CIRCLE "-particle_a_motion wobble", "'wobble' is not known (known: constant, oscillate, rotate)");
  refuse(2, CIRCLE "-particle_a_motion oscillate", "-particle_a_motion_amplitude");
  refuse(2, CIRCLE "-particle_a_motion oscillate -particle_a_motion_amplitude 1,0", "-particle_a_motion_period");
  refuse(2, CIRCLE "-particle_a_motion oscillate -particle_a_motion_rotation 1,0,0", "must be positive");
  refuse(2,
         CIRCLE
         "-particle_a_motion oscillate -particle_a_motion_amplitude 1,0 -particle_a_motion_period 1,1 -particle_a_free x -particle_a_density 1",
         "prescribes x");
  refuse(2, CIRCLE "-particle_a_pivot 0,0.1 -particle_a_free x,rotation -particle_a_density 1",
         "-particle_a_free rotation");
  refuse(2, CIRCLE "-particle_a_stops 0,1 -particle_a_density 1", "-particle_a_stops");
  refuse(2, CIRCLE "-particle_a_stops 1,0 -particle_a_free rotation -particle_a_density 1", "must be below");
  refuse(2, CIRCLE "-particle_a_stops 1,2 -particle_a_free rotation -particle_a_density 1", "starts at the angle 0");
  refuse(2,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_place lattice -particle_a_count 3 -particle_a_pivot 0,0.1 -particle_a_density 1",
         "-particle_a_place single or table");
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] =
    {cmocka_unit_test(test_oscillation), cmocka_unit_test(test_ramp),
     cmocka_unit_test(test_partly_free), cmocka_unit_test(test_prescribed_rotation_about_pivot),
     cmocka_unit_test(test_pendulum),    cmocka_unit_test(test_accelerated_pivot),
     cmocka_unit_test(test_stops),       cmocka_unit_test(test_expressions),
     cmocka_unit_test(test_refusals),    cmocka_unit_test(test_file),
     cmocka_unit_test(test_screw),       cmocka_unit_test(test_bad_files)};
  int failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("motion", tests, NULL, NULL);
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return failed;
}
