/* Contact: forces that are solved with the flow (spring.c): bodies alone, whose "flow" is their own inertia. */
/* ranks: 1 2 */
#include "contactcore.h"

#define PAIR \
  "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1.5 -particle_a_position 0.3,0.7 " \
  "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 1.5 -particle_b_position 0.505,0.7 -contact_range 0.02 "

static const PetscReal RANGE = 0.02;

/* Force of a spring on body i when the bodies part with v */
static PetscReal force_at(const ContactSpring *s, PetscReal v)
{
  return s->value - s->rate * v;
}

static void find(Fixture *f, PetscReal dt, PetscInt *n, const ContactSpring *s[])
{
  OK(ContactFindSprings(f->c, dt, PETSC_FALSE, f->a, n, s));
}

/* Implicit steps of two discs whose one spring is all that acts: speed of the first one along x after them; *gap: the
   least on the way */
static PetscReal run_into(Fixture *f, PetscReal dt, PetscInt steps, PetscReal *gap)
{
  PetscReal mass;

  OK(ContactGetMass(f->c, 0, &mass, NULL));
  *gap = PETSC_MAX_REAL;
  for (PetscInt step = 0; step < steps; step++) {
    const ContactSpring *s;
    PetscInt             n;
    PetscReal            force[1], part = f->s->u[0][0] - f->s->u[1][0], v;

    find(f, dt, &n, &s);
    assert_in_range(n, 0, 1);
    v        = n ? s->normal[0] * part : 0;
    force[0] = n ? force_at(s, (v + 2 * dt * s->value / mass) / (1 + 2 * dt * s->rate / mass)) : 0;
    OK(ContactTakeForces(f->c, force));
    near(f->s->contact_force[0][0] + f->s->contact_force[1][0], 0, 1e-13);
    for (PetscInt k = 0; k < 2; k++) {
      f->s->u[k][0] += dt * f->s->contact_force[k][0] / mass;
      f->s->x[k][0] += dt * f->s->u[k][0];
    }
    *gap = PetscMin(*gap, f->s->x[1][0] - f->s->x[0][0] - 0.2);
  }
  return f->s->u[0][0];
}

/* Where the flow holds the bodies the force is the law's at their gap; it grows with the speed of approach. */
static void test_bodies_that_are_held(void **state)
{
  const PetscReal gaps[] = {0.019, 0.01, 0.001, -0.001};
  Fixture         f;

  (void)state;
  create(&f, 2, 0.04, down, zero, one, 4, PAIR);
  for (size_t i = 0; i < sizeof(gaps) / sizeof(gaps[0]); i++) {
    const ContactSpring *s;
    PetscInt             n;

    f.s->x[1][0] = f.s->x[0][0] + 0.2 + gaps[i];
    evaluate(&f);
    find(&f, 1e-3, &n, &s);
    assert_int_equal(n, 1);
    near(s->normal[0], s->i == 0 ? -1 : 1, 1e-12);
    near(force_at(s, 0), PetscAbsReal(f.force[0][0]), 1e-9 * PetscAbsReal(f.force[0][0]));
    assert_true(s->rate > 0);
    near(f.s->contact_force[0][0], 0, 0); /* until ContactTakeForces */
  }
  destroy(&f);
}

/* Only what comes within reach within the step or the look-ahead has a spring. */
static void test_out_of_reach(void **state)
{
  const ContactSpring *s;
  PetscInt             n;
  Fixture              f;

  (void)state;
  create(&f, 2, 0.04, down, zero, one, 4, PAIR);
  f.s->x[1][0] = f.s->x[0][0] + 0.2 + 1.5 * RANGE;
  find(&f, 1e-3, &n, &s);
  assert_int_equal(n, 0);
  f.s->u[0][0] = 12; /* .012 in a step, .024 in two */
  find(&f, 1e-3, &n, &s);
  assert_int_equal(n, 1);
  f.s->u[0][0] = -12;
  find(&f, 1e-3, &n, &s);
  assert_int_equal(n, 0);
  f.s->x[1][0] = f.s->x[0][0] + 0.2 + 0.9 * RANGE; /* parts faster than the law pushes */
  find(&f, 1e-3, &n, &s);
  assert_int_equal(n, 0);
  destroy(&f);
  create(&f, 2, 0.04, down, zero, one, 4, PAIR "-contact_law none");
  f.s->x[1][0] = f.s->x[0][0] + 0.2;
  find(&f, 1e-3, &n, &s);
  assert_int_equal(n, 0);
  destroy(&f);
}

/* Two discs that meet, at steps from a fifth of the time in which they cross the range to a hundred times it, slow and
   fast: they neither overlap by more than .05 of the range nor part faster than they came, nor pass. */
static void test_no_speed_nor_step_is_too_large(void **state)
{
  (void)state;
  for (PetscReal speed = 1e-2; speed < 200; speed *= 10)
    for (PetscReal share = 0.2; share < 101; share *= 5) {
      const PetscReal dt = share * RANGE / (2 * speed);
      PetscReal       gap, after;
      Fixture         f;

      create(&f, 2, 0.04, down, zero, one, 4, PAIR);
      f.s->x[1][0] = f.s->x[0][0] + 0.2 + 0.9 * RANGE;
      f.s->u[0][0] = speed;
      f.s->u[1][0] = -speed;
      after        = run_into(&f, dt, 40 + (PetscInt)(40 / share), &gap);
      if (!(gap > -0.05 * RANGE && after <= 0 && after >= -speed))
        fail_msg("speed %g, step %g ranges: least gap %g, speed after %g", (double)speed, (double)share, (double)gap,
                 (double)after);
      destroy(&f);
    }
}

/* With short steps two discs part as without a flow, with a tenth of the speed scale (test_repulsive_restitution). */
static void test_restitution(void **state)
{
  const PetscReal scale = PetscSqrtReal(PETSC_PI / 2 * 2 * 0.1 * 0.5 * 10);
  PetscReal       gap;
  Fixture         f;

  (void)state;
  create(&f, 2, 0.04, down, zero, one, 4, PAIR);
  f.s->x[1][0] = f.s->x[0][0] + 0.2 + RANGE;
  f.s->u[0][0] = 1;
  f.s->u[1][0] = -1;
  near(-2 * run_into(&f, 1e-5, 25000, &gap), 0.1 * scale, 1e-3 * scale);
  destroy(&f);
}

/* A wall pushes a body off itself, and a touch beside the centre of an ellipse turns it: torque of the lever. */
static void test_wall_and_lever(void **state)
{
  PetscReal            force[8] = {0}, lift = 0, torque = 0;
  const ContactSpring *s;
  PetscInt             n;
  Fixture              f;

  (void)state;
  create(&f, 2, 0.04, down, zero, one, 4,
         "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.1 -particle_a_b 0.05 -particle_a_density 1.5 -particle_a_position 0.5,0.08 "
         "-particle_a_angle 0.4 -contact_range 0.02");
  find(&f, 1e-3, &n, &s);
  assert_in_range(n, 1, 8);
  for (PetscInt k = 0; k < n; k++) {
    assert_true(s[k].i == 0 && s[k].j < 0);
    near(s[k].normal[1], 1, 1e-12);
    force[k] = force_at(&s[k], 0);
    lift += force[k];
    torque += s[k].ri[0] * force[k];
  }
  OK(ContactTakeForces(f.c, force));
  assert_true(lift > 0 && torque < 0); /* it touches with its lower, left end */
  near(f.s->contact_force[0][1], lift, 1e-12 * lift);
  near(f.s->contact_torque[0][2], torque, -1e-12 * torque);
  destroy(&f);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {
    cmocka_unit_test(test_bodies_that_are_held),
    cmocka_unit_test(test_out_of_reach),
    cmocka_unit_test(test_no_speed_nor_step_is_too_large),
    cmocka_unit_test(test_restitution),
    cmocka_unit_test(test_wall_and_lever),
  };
  int failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  return PetscFinalize() || failed;
}
