/* Bodies: placement, tables, inertia, distance, motion, prediction. */
/* ranks: 1 2 */
#include "compat.h"
#include "bodies/write.h"
#include "base/opt.h"
#include "raised.h"
#include "base/algebra.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#define OK(call) assert_int_equal(call, 0)

static const PetscReal zero[3] = {0, 0, 0}, one[3] = {1, 1, 1};

static int clear(void **state)
{
  (void)state;
  return (int)PetscOptionsClear(NULL);
}

static void give(const char options[])
{
  OK(PetscOptionsInsertString(NULL, options));
}

/* A scene with these options must be refused with a message that holds `text`. */
static void refuse(PetscInt dim, const char options[], const char text[])
{
  Bodies b;

  OK(PetscOptionsClear(NULL));
  give(options);
  begin_error();
  expect_error(BodiesCreate(dim, zero, one, &b), 0, text, NULL);
}

static void create(PetscInt dim, const char options[], Bodies *b, BodyArrays **s)
{
  give(options);
  OK(BodiesCreate(dim, zero, one, b));
  OK(BodiesGetArrays(*b, s));
}

static void near(PetscReal got, PetscReal want, PetscReal tolerance)
{
  if (!(PetscAbsReal(got - want) <= tolerance))
    fail_msg("%.17g differs from %.17g by more than %g", (double)got, (double)want, (double)tolerance);
}

static void write_table(const char file[], const char text[])
{
  PetscMPIInt rank;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  if (!rank) {
    FILE *f = fopen(file, "w");

    assert_non_null(f);
    fputs(text, f);
    fclose(f);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
}

static PetscReal smallest_distance(const BodyArrays *s)
{
  PetscReal d = PETSC_MAX_REAL;

  for (PetscInt i = 0; i < s->n; i++)
    for (PetscInt j = 0; j < i; j++) {
      PetscReal d2 = 0;

      for (PetscInt a = 0; a < 3; a++) d2 += PetscSqr(s->x[i][a] - s->x[j][a]);
      d = PetscMin(d, PetscSqrtReal(d2));
    }
  return d;
}

static void test_empty(void **state)
{
  Bodies      b;
  BodyArrays *s;

  (void)state;
  create(2, "", &b, &s);
  assert_int_equal(s->n, 0);
  OK(BodiesAdvanceVelocity(b, 0.1, 1, zero));
  OK(BodiesAdvancePosition(b, 0.1, 1));
  OK(BodiesDestroy(&b));
}

static void test_single(void **state)
{
  Bodies      b;
  BodyArrays *s;
  PetscReal   volume, inertia[6];

  (void)state;
  create(2,
         "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 2 -particle_a_position 0.3,0.4 -particle_a_velocity 1,2 -particle_a_angular_velocity 3 -particle_a_angle 0.5 "
         "-particle_b_shape circle -particle_b_radius 0.05 -particle_b_position 0.7,0.7 -particle_b_free none",
         &b, &s);
  assert_int_equal(s->n, 2);
  assert_int_equal(s->ngroups, 2);
  assert_int_equal(s->group[0].free, BODY_FREE_X | BODY_FREE_Y | BODY_FREE_ROTATION);
  assert_int_equal(s->group[1].free, 0);
  assert_int_equal(s->body_group[1], 1);
  near(s->x[0][1], 0.4, 0);
  near(s->u[0][1], 2, 0);
  near(s->u_old[0][1], 2, 0);
  near(s->w[0][2], 3, 0);
  near(s->q[0][3], PetscSinReal(0.25), 1e-15);
  near(s->group[0].disc, 0.1, 1e-12);
  OK(BodiesGetVolume(b, 0, &volume));
  near(volume, PETSC_PI * 0.01, 1e-13);
  OK(BodiesGetInertia(b, 0, NULL, PETSC_FALSE, inertia));
  near(inertia[2], 2 * PETSC_PI / 2 * 1e-4, 1e-14);
  near(inertia[0], 0, 0);
  OK(BodiesDestroy(&b));
}

static void test_lattice(void **state)
{
  Bodies      b;
  BodyArrays *s;

  (void)state;
  create(2,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.02 -particle_a_density 2 -particle_a_place lattice -particle_a_count 43 -particle_a_lower 0,0.5",
         &b, &s);
  assert_int_equal(s->n, 43);
  assert_true(smallest_distance(s) > 0.1 - 1e-12); /* 43 bodies on 1 x 0.5: 9 or 10 in a row, 5 rows */
  for (PetscInt k = 0; k < s->n; k++)
    assert_true(s->x[k][0] >= 0.02 && s->x[k][0] <= 0.98 && s->x[k][1] >= 0.52 && s->x[k][1] <= 0.98);
  OK(BodiesDestroy(&b));
  OK(PetscOptionsClear(NULL));
  create(3,
         "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.1 -particle_a_b 0.1 -particle_a_c 0.1 -particle_a_density 2 -particle_a_place lattice -particle_a_count 27",
         &b, &s);
  near(smallest_distance(s), 1. / 3, 1e-12);
  OK(BodiesDestroy(&b));
  refuse(2,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 2 -particle_a_place lattice -particle_a_count 26",
         "does not fit");
}

static void test_random(void **state)
{
  const char *options =
    "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.01 -particle_a_density 2 -particle_a_place random -particle_a_count 900 -particle_a_seed 7 -particle_a_margin 0.001 "
    "-particle_b_shape circle -particle_b_radius 0.2 -particle_b_position 0.5,0.5 -particle_b_density 1";
  Bodies      b;
  BodyArrays *s;
  PetscReal   first[2], sum = 0, low, high;

  (void)state;
  create(2, options, &b, &s);
  assert_int_equal(s->n, 901);
  for (PetscInt i = 0; i < 900; i++) {
    PetscReal r = PetscSqrtReal(PetscSqr(s->x[i][0] - 0.5) + PetscSqr(s->x[i][1] - 0.5));

    assert_true(r >= 0.211);
    assert_true(s->x[i][0] >= 0.01 && s->x[i][0] <= 0.99 && s->x[i][1] >= 0.01 && s->x[i][1] <= 0.99);
    sum += s->x[i][0];
  }
  assert_true(smallest_distance(s) >= 0.021);
  near(sum / 900, 0.5, 0.04);
  low = high = sum;
  OK(MPI_Allreduce(MPI_IN_PLACE, &low, 1, MPIU_REAL, MPIU_MIN, PETSC_COMM_WORLD));
  OK(MPI_Allreduce(MPI_IN_PLACE, &high, 1, MPIU_REAL, MPIU_MAX, PETSC_COMM_WORLD));
  near(low, high, 0);
  first[0] = s->x[0][0];
  OK(BodiesDestroy(&b));
  OK(PetscOptionsClear(NULL));
  give(options);
  create(2, "-particle_a_seed 8", &b, &s);
  first[1] = s->x[0][0];
  assert_true(first[0] != first[1]);
  OK(BodiesDestroy(&b));
  refuse(2,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.05 -particle_a_density 2 -particle_a_place random -particle_a_count 100",
         "of the box");
}

/* Axis and angle, a quaternion, and both: the angle turns what the quaternion has turned */
static void test_table_of_orientations(void **state)
{
  const char *scene =
    "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.05 -particle_a_b 0.02 -particle_a_density 2 -particle_a_place table -particle_a_table test_bodies_table.csv";
  const char     *bad[][2] = {{"x,y,z,axis_x,axis_z\n0.1,0.2,0.3,1,0\n",
                               "test_bodies_table.csv:1: the columns axis_x .. axis_z belong together: 'axis_y'"},
                              {"x,y,z,q_w,q_x,q_y,q_z\n0.1,0.2,0.3,1,0,0,0\n0.1,0.2,0.6,0,0,0,0\n",
                               "test_bodies_table.csv:3: q_w .. q_z are all zero"},
                              {"x,y,z,axis_x,axis_y,axis_z\n0.1,0.2,0.3,0,0,0\n",
                               "test_bodies_table.csv:2: axis_x .. axis_z are all zero"},
                              {"x,y,z,qx\n0.1,0.2,0.3,0\n", "q_w, q_x, q_y, q_z"}};
  const PetscReal c = PetscCosReal(0.25), h = PetscSqrtReal(0.5);
  char            more[512];
  Bodies          b;
  BodyArrays     *s;

  (void)state;
  write_table("test_bodies_table.csv",
              "x,y,z,angle,axis_x,axis_y,axis_z\n0.2,0.2,0.2,0.5,0,2,0\n0.5,0.5,0.5,0,0,0,1\n");
  create(3, scene, &b, &s);
  near(s->q[0][0], c, 1e-15);
  near(s->q[0][2], PetscSinReal(0.25), 1e-15);
  near(s->q[1][0], 1, 1e-15);
  OK(BodiesDestroy(&b));
  write_table("test_bodies_table.csv",
              "x,y,z,q_w,q_x,q_y,q_z,angle,axis_x,axis_y,axis_z\n0.2,0.2,0.2,3,3,0,0,0,0,0,1\n0.5,0.5,0.5,1,1,0,0,3.141592653589793,0,0,1\n");
  create(3, scene, &b, &s);
  near(s->q[0][0], h, 1e-15);
  near(s->q[0][1], h, 1e-15);
  near(PetscAbsReal(s->q[1][2]), h, 1e-15); /* k (1 + i)/sqrt 2 = (k + j)/sqrt 2 */
  near(PetscAbsReal(s->q[1][3]), h, 1e-15);
  OK(BodiesDestroy(&b));
  for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
    write_table("test_bodies_table.csv", bad[i][0]);
    refuse(3, scene, bad[i][1]);
  }
  write_table("test_bodies_table.csv", "x,y,z,axis_x,axis_y,axis_z\n0.1,0.2,0.3,0,0,1\n");
  refuse(3, strcat(strcpy(more, scene), " -particle_a_orientation random"),
         "-particle_a_orientation random draws them");
  refuse(3, strcat(strcpy(more, scene), " -particle_a_hinge 0,0,1 -particle_a_pivot 0,0,0"),
         "remove the columns axis_x, axis_y, axis_z");
  write_table("test_bodies_table.csv", "x,y,angle\n0.1,0.2,1\n");
  refuse(2, strcat(strcpy(more, scene), " -particle_a_orientation random"),
         "-particle_a_orientation random draws them");
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  remove("test_bodies_table.csv");
}

static void test_table(void **state)
{
  const char *scene =
    "-particle_groups a -particle_a_shape circle -particle_a_radius 0.05 -particle_a_density 2 -particle_a_place table -particle_a_table test_bodies_table.csv -particle_a_velocity 5,6";
  const char *bad[][2] = {{"x,y\n0.1,0.2\n0.3,zzz\n", "test_bodies_table.csv:3: 'zzz' in column 'y'"},
                          {"x,y\n0.1,0.2,0.3\n", "test_bodies_table.csv:2: more values"},
                          {"\nx,y,u\n# a remark\n0.1,0.2\n", "test_bodies_table.csv:4: 2 values"},
                          {"x,speed\n", "test_bodies_table.csv:1: column 'speed' is not known"},
                          {"x,u\n", "test_bodies_table.csv:1: the header line has no column 'y'"},
                          {"x,y,x\n", "test_bodies_table.csv:1: column 'x' appears twice"},
                          {"x,y\n0.1,nan\n", "test_bodies_table.csv:2: 'nan'"},
                          {"x,y,z\n0.1,0.2,0.3\n", "test_bodies_table.csv:1: column 'z' is not known"},
                          {"# nothing\n", "the table is empty"},
                          {"x,y\n0.1,1.2\n", "outside the domain"}};
  Bodies      b;
  BodyArrays *s;

  (void)state;
  write_table("test_bodies_table.csv", "# bodies\ny, x, v ,omega,angle\r\n\n0.2,0.1,3,4,0.5\n0.6,0.5,-3,-4,1e0");
  create(2, scene, &b, &s);
  assert_int_equal(s->n, 2);
  near(s->x[1][0], 0.5, 0);
  near(s->x[1][1], 0.6, 0);
  near(s->u[1][0], 5, 0);
  near(s->u[1][1], -3, 0);
  near(s->w[1][2], -4, 0);
  near(s->angle[1], 1, 0);
  OK(BodiesDestroy(&b));
  for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
    write_table("test_bodies_table.csv", bad[i][0]);
    refuse(2, scene, bad[i][1]);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  remove("test_bodies_table.csv");
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  refuse(2, scene, "cannot be read");
}

static void test_refusals(void **state)
{
  (void)state;
  refuse(2, "-particle_groups a", "-particle_a_shape");
  refuse(2, "-particle_groups a,a -particle_a_shape circle", "twice");
  refuse(2, "-particle_groups a -particle_a_shape circle -particle_a_position 0.5,0.5", "-particle_a_density");
  refuse(2, "-particle_groups a -particle_a_shape circle -particle_a_density 1", "-particle_a_position");
  refuse(2, "-particle_groups a -particle_a_shape circle -particle_a_density 1 -particle_a_position 0.5,1.5",
         "outside the domain");
  refuse(2,
         "-particle_groups a -particle_a_shape circle -particle_a_density 1 -particle_a_position 0.5,0.5 -particle_a_free x,roll",
         "'roll' is not known");
  refuse(2,
         "-particle_groups a -particle_a_shape circle -particle_a_density 1 -particle_a_position 0.5,0.5 -particle_a_free none,x",
         "stands alone");
  refuse(2,
         "-particle_groups a -particle_a_shape circle -particle_a_density 1 -particle_a_position 0.5,0.5 -particle_a_place heap",
         "heap");
  refuse(2, "-particle_groups a -particle_a_shape circle -particle_a_density 1 -particle_a_place random",
         "-particle_a_count");
}

/* More points than one chunk, against the formula of a disc; rotation against an ellipse. */
static void test_distance(void **state)
{
  Bodies          b;
  BodyArrays     *s;
  PetscReal       x[600 * 2], d[600], q[4];
  const PetscReal X[3] = {0.2, 0.3, 0};

  (void)state;
  create(2,
         "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 2 -particle_a_position 0.3,0.4 "
         "-particle_b_shape ellipse -particle_b_a 0.2 -particle_b_b 0.1 -particle_b_density 2 -particle_b_position 0.5,0.5",
         &b, &s);
  for (PetscInt i = 0; i < 600; i++) {
    x[2 * i]     = (i % 25) / 25.;
    x[2 * i + 1] = (PetscInt)(i / 25) / 24.;
  }
  OK(BodiesDistance(b, 0, NULL, NULL, 600, x, d));
  for (PetscInt i = 0; i < 600; i++)
    near(d[i], PetscSqrtReal(PetscSqr(x[2 * i] - 0.3) + PetscSqr(x[2 * i + 1] - 0.4)) - 0.1, 1e-14);
  RotationFromAngle(PETSC_PI / 2, q);
  x[0] = 0.2;
  x[1] = 0.6;
  x[2] = 0.5;
  x[3] = 0.3;
  OK(BodiesDistance(b, 1, X, q, 2, x, d));
  near(d[0], 0.1, 1e-12); /* along the long axis, which now points up */
  near(d[1], 0.2, 1e-12);
  OK(BodiesDestroy(&b));
}

/* Inertia of a turned ellipsoid is R I R^T; trace and eigen directions are kept. */
static void test_inertia_3d(void **state)
{
  Bodies          b;
  BodyArrays     *s;
  const PetscReal e[3] = {0.3, 0.2, 0.1}, w[3] = {0.4, -1.1, 0.7};
  PetscReal       in[6], R[9], main[3], volume;

  (void)state;
  create(3,
         "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.3 -particle_a_b 0.2 -particle_a_c 0.1 -particle_a_density 2 -particle_a_position 0.5,0.5,0.5",
         &b, &s);
  OK(BodiesGetVolume(b, 0, &volume));
  near(volume, 4 * PETSC_PI / 3 * e[0] * e[1] * e[2], 1e-8);
  RotationAdvance(1, w, s->q[0]);
  RotationMatrix(s->q[0], R);
  OK(BodiesGetInertia(b, 0, NULL, PETSC_FALSE, in));
  for (PetscInt a = 0; a < 3; a++) main[a] = 2 * volume / 5 * (PetscSqr(e[(a + 1) % 3]) + PetscSqr(e[(a + 2) % 3]));
  near(in[0] + in[1] + in[2], main[0] + main[1] + main[2], 1e-8);
  for (PetscInt a = 0; a < 3; a++) { /* I r = main r for column a of R */
    near(in[0] * R[a] + in[3] * R[3 + a] + in[4] * R[6 + a], main[a] * R[a], 1e-8);
    near(in[3] * R[a] + in[1] * R[3 + a] + in[5] * R[6 + a], main[a] * R[3 + a], 1e-8);
    near(in[4] * R[a] + in[5] * R[3 + a] + in[2] * R[6 + a], main[a] * R[6 + a], 1e-8);
  }
  OK(BodiesDestroy(&b));
}

static void energy_and_spin(Bodies b, BodyArrays *s, PetscReal *energy, PetscReal L[3])
{
  PetscReal in[6], *w = s->w[0];

  OK(BodiesGetInertia(b, 0, NULL, PETSC_FALSE, in));
  L[0]    = in[0] * w[0] + in[3] * w[1] + in[4] * w[2];
  L[1]    = in[3] * w[0] + in[1] * w[1] + in[5] * w[2];
  L[2]    = in[4] * w[0] + in[5] * w[1] + in[2] * w[2];
  *energy = 0.5 * (L[0] * w[0] + L[1] * w[1] + L[2] * w[2]);
}

/* A free top tumbles about its middle axis: energy and angular momentum to round-off over a hundred turns, orientation
   of second order. */
static void test_tumbling(void **state)
{
  PetscReal q[3][4], error[2] = {0, 0};

  (void)state;
  for (PetscInt level = 0; level < 3; level++) {
    const PetscInt  n  = 100 << (level < 2 ? level : 4);
    const PetscReal dt = PETSC_PI / 2 / n;
    Bodies          b;
    BodyArrays     *s;
    PetscReal       e0, e1, L0[3], L1[3], turned = 0;

    OK(PetscOptionsClear(NULL));
    create(3,
           "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.3 -particle_a_b 0.2 -particle_a_c 0.1 -particle_a_density 2 -particle_a_position 0.5,0.5,0.5 -particle_a_angular_velocity 0.1,4,0.1",
           &b, &s);
    energy_and_spin(b, s, &e0, L0);
    for (PetscInt i = 0; i < (level ? n : 100 * n); i++) { /* 4 rad/s: a turn in n steps */
      OK(BodiesAdvanceVelocity(b, dt, 1, zero));
      OK(BodiesAdvancePosition(b, dt, 1));
      turned = PetscMax(turned, PetscAbsReal(s->w[0][0]) + PetscAbsReal(s->w[0][2]));
      if (i == n - 1) OK(PetscArraycpy(q[level], s->q[0], 4));
    }
    energy_and_spin(b, s, &e1, L1);
    near(e1 / e0, 1, 1e-11);
    for (PetscInt a = 0; a < 3; a++) near(L1[a], L0[a], 1e-11 * PetscAbsReal(L0[1]));
    assert_true(level || turned > 2); /* it did tumble */
    OK(BodiesDestroy(&b));
  }
  for (PetscInt level = 0; level < 2; level++)
    for (PetscInt a = 0; a < 4; a++) error[level] = PetscMax(error[level], PetscAbsReal(q[level][a] - q[2][a]));
  assert_true(error[1] < 2e-3);
  near(PetscLog2Real(error[0] / error[1]), 2, 0.1);
}

static void test_forces(void **state)
{
  const PetscReal g[3] = {0, -10, 0};
  Bodies          b;
  BodyArrays     *s;

  (void)state;
  create(2,
         "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 2 -particle_a_position 0.3,0.4 "
         "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 2 -particle_b_position 0.7,0.5 -particle_b_free y -particle_b_velocity 0.25,0 -particle_b_angular_velocity 2",
         &b, &s);
  for (PetscInt k = 0; k < 2; k++) {
    s->force[k][0]          = PETSC_PI * 0.01;
    s->contact_force[k][0]  = PETSC_PI * 0.01;
    s->torque[k][2]         = 1e-4 * PETSC_PI;
    s->contact_torque[k][2] = 1e-4 * PETSC_PI;
  }
  OK(BodiesAdvanceVelocity(b, 0.01, 1, g));
  near(s->u[0][0], 0.01, 1e-14);
  near(s->u[0][1], -0.05, 1e-14);
  near(s->w[0][2], 0.02, 1e-14);
  near(s->u_old[0][1], 0, 0);
  near(s->u[1][0], 0.25, 0); /* frozen: keeps what it was given */
  near(s->u[1][1], -0.05, 1e-14);
  near(s->w[1][2], 2, 0);
  OK(BodiesAdvancePosition(b, 0.01, 0.5));
  near(s->x[0][1], 0.4 - 0.01 * 0.025, 1e-15);
  near(s->x[1][0], 0.7 + 0.0025, 1e-15);
  near(s->angle[1], 0.02, 1e-15);
  near(s->q[1][3], PetscSinReal(0.01), 1e-15);
  OK(BodiesDestroy(&b));
}

/* x = cos t and angle = sin t, velocities known exactly at t and t - dt: the error of one prediction falls with dt^2,
   dt^3. */
static void test_prediction(void **state)
{
  Bodies      b;
  BodyArrays *s;

  (void)state;
  create(2,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 2 -particle_a_position 0.3,0.4",
         &b, &s);
  for (PetscInt kind = 1; kind <= 3; kind++) { /* the last: second order with a step before that was shorter */
    const PetscInt  order = PetscMin(kind, 2);
    const PetscReal ratio = kind == 3 ? 0.6 : 1;
    PetscReal       e[2], ea[2], eq[2];

    for (PetscInt level = 0; level < 2; level++) {
      const PetscReal t = 0.7, dt = 0.02 / (1 << level);
      PetscReal       X[3], q[4], exact[4], angle;

      s->x[0][0]     = PetscCosReal(t);
      s->u[0][0]     = -PetscSinReal(t);
      s->dt_old      = kind == 3 ? ratio * dt : 0;
      s->u_old[0][0] = -PetscSinReal(t - ratio * dt);
      s->angle[0]    = PetscSinReal(t);
      s->w[0][2]     = PetscCosReal(t);
      s->w_old[0][2] = PetscCosReal(t - ratio * dt);
      OK(BodiesPredict(b, 0, dt, order, X, q, &angle));
      RotationFromAngle(PetscSinReal(t + dt), exact);
      e[level]  = PetscAbsReal(X[0] - PetscCosReal(t + dt));
      ea[level] = PetscAbsReal(angle - PetscSinReal(t + dt));
      eq[level] = PetscAbsReal(q[3] - exact[3]);
    }
    near(PetscLog2Real(e[0] / e[1]), order + 1, 0.1);
    near(PetscLog2Real(ea[0] / ea[1]), order + 1, 0.1);
    near(PetscLog2Real(eq[0] / eq[1]), order + 1, 0.1);
  }
  OK(BodiesDestroy(&b));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] =
    {cmocka_unit_test_setup(test_empty, clear),      cmocka_unit_test_setup(test_single, clear),
     cmocka_unit_test_setup(test_lattice, clear),    cmocka_unit_test_setup(test_random, clear),
     cmocka_unit_test_setup(test_table, clear),      cmocka_unit_test_setup(test_table_of_orientations, clear),
     cmocka_unit_test_setup(test_refusals, clear),   cmocka_unit_test_setup(test_distance, clear),
     cmocka_unit_test_setup(test_inertia_3d, clear), cmocka_unit_test_setup(test_tumbling, clear),
     cmocka_unit_test_setup(test_forces, clear),     cmocka_unit_test_setup(test_prediction, clear)};
  int failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1; /* no ShapeFinalize: refused scenes never give their shapes back */
  return failed;
}
