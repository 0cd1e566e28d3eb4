/* Contact with walls that are no sides of a box: force, film with the curvature of the wall, shapes on inclined walls,
   friction of a wall that moves. */
/* ranks: 1 2 */
#include "contactcore.h"

/* A border around (or, outside, in) a round one */
static Border round_border(PetscInt dim, PetscReal radius, PetscInt axis, PetscBool inside)
{
  const BorderRound r = {.radius = radius, .axis = axis, .inside = inside};
  Border            b;

  OK(BorderCreate(dim, &b));
  OK(BorderAdd(b, "outer", PETSC_TRUE));
  OK(BorderAddRound(b, 0, &r));
  return b;
}

static void set_border(Fixture *f, Border b)
{
  OK(ContactSetWalls(f->c, &(ContactWalls){.border = b, .side = {-1, -1, -1, -1, -1, -1}}));
}

static const PetscReal minus[3] = {-2, -2, -2}, two[3] = {2, 2, 2};

static void test_force(void **state)
{
  const PetscReal R = 0.2, r = 0.04, u2 = PETSC_PI / 2 * 2 * R * 1 * 10, K = 1.5 * 3 * PETSC_PI * R * R * u2 / r,
                  gap = 0.01;
  Fixture     f;
  Border      b = round_border(2, 1, -1, PETSC_TRUE);
  const char *name;

  (void)state;
  create(&f, 2, 2 * r, down, minus, two, 0,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.2 -particle_a_density 2 -particle_a_position 0,0");
  set_border(&f, b);
  f.s->x[0][0] = 0.6 * (1 - R - gap);
  f.s->x[0][1] = -0.8 * (1 - R - gap);
  evaluate(&f);
  near(f.gap[0], gap, 1e-14);
  near(f.force[0][0], -0.6 * K * PetscSqr(1 - gap / r), 1e-10 * K);
  near(f.force[0][1], 0.8 * K * PetscSqr(1 - gap / r), 1e-10 * K);
  near(f.torque[0][2], 0, 1e-12 * K);
  OK(ContactGetWallName(f.c, CONTACT_SIDES, &name));
  assert_string_equal(name, "outer");
  f.s->x[0][0] = f.s->x[0][1] = 0;
  evaluate(&f);
  near(f.force[0][0], 0, 0);
  destroy(&f);
  OK(BorderDestroy(&b));
}

/* The rate of the film between a body and a round wall, and that between it and a ball in place of the wall */
static PetscReal film_rate(PetscInt dim, PetscReal radius, PetscInt axis, PetscBool inside, PetscReal x)
{
  const char
           *options = "-particle_groups a -particle_a_shape circle -particle_a_radius 0.2 -particle_a_density 2 "
                      "-contact_range 0.005 -contact_lubrication -contact_lubrication_range 0.02 -contact_roughness 0.0001";
  char      all[512];
  Fixture   f;
  Border    b = round_border(dim, radius, axis, inside);
  PetscInt  n;
  PetscReal gap, rate;
  Rub       rub;

  (void)snprintf(all, sizeof(all), "%s -particle_a_position %s", options, dim == 2 ? "0,0" : "0,0,0");
  create(&f, dim, 0.02, down, minus, two, 0, all);
  set_border(&f, b);
  OK(ContactSetViscosity(f.c, 1));
  f.s->x[0][0] = x;
  evaluate(&f);
  assert_int_equal(f.c->list.n, 1);
  OK(ContactPairDashpots(f.c, 0, 1e-3, &n, &rub, &gap));
  assert_true(n > 0 && f.c->dashpot[n - 1].film);
  rate = f.c->dashpot[n - 1].rate;
  destroy(&f);
  OK(BorderDestroy(&b));
  return rate;
}

static void test_film(void **state)
{
  const PetscReal gap = 0.002, open = 0.02, near_disc = PetscPowReal(gap, -1.5) - PetscPowReal(open, -1.5);
  const PetscReal inner = 1 / (1 / 0.2 - 1 / 0.5), outer = 1 / (1 / 0.2 + 1 / 0.5), c = 3 * PetscSqrtReal(2) * PETSC_PI;
  PetscReal       flat, hollow, tube;

  (void)state;
  near(film_rate(2, 0.5, -1, PETSC_TRUE, 0.3 - gap) / (c * PetscPowReal(inner, 1.5) * near_disc), 1, 1e-9);
  near(film_rate(2, 0.5, -1, PETSC_FALSE, 0.7 + gap) / (c * PetscPowReal(outer, 1.5) * near_disc), 1, 1e-9);
  /* in space by the leading term: 6 pi mu R^2/gap, with curvatures of 5 - 2 in a ball, 5 - 2 and 5 in a tube */
  flat   = film_rate(3, 1e6, -1, PETSC_FALSE, 1e6 + 0.2 + 1e-4);
  hollow = film_rate(3, 0.5, -1, PETSC_TRUE, 0.3 - 1e-4);
  tube   = film_rate(3, 0.5, 2, PETSC_TRUE, 0.3 - 1e-4);
  near(hollow / flat, PetscSqr(5. / 3), 0.02 * PetscSqr(5. / 3));
  near(tube / flat, (2. / 8 / PetscSqrtReal(15)) / (2. / 10 / 5), 0.02);
}

/* ---- a wall of faces ---- */

/* From (-2, 0), as a hill or straight along `slope`, in n faces; the domain is above */
static Border face_border(PetscInt n, PetscReal slope)
{
  BorderFace face[64];
  Border     b;

  for (PetscInt i = 0; i < n; i++) {
    face[i] = (BorderFace){.node = {2 * i, 2 * i + 1, 2 * i + 2}, .inside = {0, 100, 0}};
    for (PetscInt k = 0; k < 3; k++) {
      face[i].x[k][0] = -2 + 4 * (i + 0.5 * k) / n;
      face[i].x[k][1] = slope * face[i].x[k][0];
    }
  }
  OK(BorderCreate(2, &b));
  OK(BorderAdd(b, "slope", PETSC_TRUE));
  OK(BorderSetFaces(b, n, face));
  return b;
}

/* An ellipse above a slope: the gap by its support function, all along the wall and over its joints */
static void test_ellipse_on_a_slope(void **state)
{
  const PetscReal n[2] = {-0.6, 0.8};
  Border          b    = face_border(7, 0.75);
  Fixture         f;

  (void)state;
  create(&f, 2, 0.02, down, minus, two, 0,
         "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.3 -particle_a_b 0.1 -particle_a_density 2 -particle_a_position 0,0");
  set_border(&f, b);
  for (PetscInt i = 0; i < 40; i++) {
    const PetscReal a = 0.3 * i, c = PetscCosReal(a), s = PetscSinReal(a), along = n[0] * c + n[1] * s,
                    across = n[1] * c - n[0] * s;
    const PetscReal h = PetscSqrtReal(PetscSqr(0.3 * along) + PetscSqr(0.1 * across)), at = -0.7 + i / 30.;

    f.s->x[0][0] = 0.8 * at + (h + 0.004) * n[0];
    f.s->x[0][1] = 0.6 * at + (h + 0.004) * n[1];
    RotationFromAngle(a, f.s->q[0]);
    evaluate(&f);
    near(f.gap[0], 0.004, 4e-4); /* of points a range apart */
    assert_true(f.force[0][0] < 0 && f.force[0][1] > 0);
    near(f.force[0][0] * 0.8 + f.force[0][1] * 0.6, 0, 1e-9 * f.force[0][1]); /* without friction: along the normal */
  }
  destroy(&f);
  OK(BorderDestroy(&b));
}

/* ---- moving walls ---- */

static PetscErrorCode belt(void *context, PetscInt boundary, const PetscReal x[3], PetscReal v[3])
{
  (void)context;
  (void)x;
  assert_int_equal(boundary, 0);
  v[0] = 1;
  v[1] = 7; /* across the wall: it stays where it is */
  v[2] = 0;
  return PETSC_SUCCESS;
}

/* A box on a belt of speed 1: u = mu g t, then 1 */
static void test_belt(void **state)
{
  Border  b = face_border(9, 0);
  Fixture f;

  (void)state;
  for (PetscInt side = 0; side < 2; side++) { /* the belt is made of faces, or a side of the box */
    ContactWalls walls = {.border = b, .side = {-1, -1, side ? 0 : -1, -1, -1, -1}, .velocity = belt};
    PetscReal    start = 0;

    create(&f, 2, 0.04, down, side ? (const PetscReal[]){-2, 0, 0} : minus, two, side ? 4 : 0,
           "-particle_groups a -particle_a_shape box -particle_a_size 0.5,0.2 -particle_a_density 1000 -particle_a_position -0.5,0.1195 "
           "-contact_law spring -contact_restitution 0.1 -contact_friction 0.5 -contact_range 0.02 -particle_a_free x,y");
    if (side) {
      OK(BorderCreate(2, &walls.border));
      OK(BorderAdd(walls.border, "bottom", PETSC_TRUE));
    }
    OK(ContactSetWalls(f.c, &walls));
    for (PetscInt i = 1; i <= 60; i++) {
      OK(ContactAdvanceAlone(f.c, 0.005));
      if (i == 8) start = f.s->u[0][0];
      if (i == 20) near(f.s->u[0][0] - start, 0.5 * 10 * 12 * 0.005, 1e-3); /* it rests on the belt by then */
    }
    near(f.s->u[0][0], 1, 0.01);
    near(f.s->u[0][1], 0, 0.02);
    destroy(&f);
    if (side) OK(BorderDestroy(&walls.border));
  }
  OK(BorderDestroy(&b));
}

/* ---- the start ---- */

static void test_start(void **state)
{
  Border  b = round_border(2, 1, -1, PETSC_TRUE);
  Fixture f;

  (void)state;
  create(&f, 2, 0.02, down, minus, two, 0,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.2 -particle_a_density 2 -particle_a_position 0.5,0");
  set_border(&f, b);
  OK(ContactCheckStart(f.c));
  f.s->x[0][0] = 0.85;
  begin_error();
  expect_error(ContactCheckStart(f.c), PETSC_ERR_USER_INPUT, "Body 0 of group 'a' overlaps wall 'outer' by 0.05",
               "0.85,0", NULL);
  f.s->x[0][0] = 1.5;
  begin_error();
  expect_error(ContactCheckStart(f.c), PETSC_ERR_USER_INPUT, "Body 0 of group 'a'", "1.5,0",
               "lies 0.5 beyond boundary 'outer'", NULL);
  destroy(&f);
  OK(BorderDestroy(&b));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_force), cmocka_unit_test(test_film),
                                     cmocka_unit_test(test_ellipse_on_a_slope), cmocka_unit_test(test_belt),
                                     cmocka_unit_test(test_start)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  return PetscFinalize() || failed;
}
