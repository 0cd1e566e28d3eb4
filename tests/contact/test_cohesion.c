/* Contact: cohesion. Forces of the laws against closed forms, energies against integrals of forces, the speed below
   which bodies stick against theory, momentum, what a wrong scene is told. */
/* ranks: 1 2 */
#include "contactcore.h"
#include "cohesion.h"
#include <stdio.h>

#define RADIUS 0.1
#define RANGE  0.001
#define SPHERES \
  "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_position 0.3,0.5,0.5 " \
  "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 1 -particle_b_position 0.505,0.5,0.5 " \
  "-contact_law spring -contact_restitution 1 -contact_range 0.001 "
#define DISCS \
  "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_position 0.3,0.5 " \
  "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 1 -particle_b_position 0.505,0.5 " \
  "-contact_law spring -contact_restitution 1 -contact_range 0.001 -contact_spring_stiffness 1e9 "
#define ELASTIC "-contact_cohesion_surface_energy 0.5 -contact_cohesion_young 1.82e4 -contact_cohesion_poisson 0.3 "

static const PetscReal WORK = 1, R = 0.05, MODULUS = 1e4; /* of ELASTIC: E/(2 (1 - nu^2)) */

static void create_dry(Fixture *f, PetscInt dim, const char options[])
{
  OK(PetscOptionsClear(NULL));
  OK(PetscOptionsInsertString(NULL, options));
  OK(BodiesCreate(dim, zero, one, &f->b));
  OK(BodiesGetArrays(f->b, &f->s));
  OK(ContactCreate(f->b, 0.04, 0, zero, zero, one, 0, &f->c));
  allocate(f);
}

/* Force on the second sphere, away from the first, at separation s, of a pair that holds on */
static PetscReal force_at(Fixture *f, PetscReal s)
{
  f->s->x[1][0] = f->s->x[0][0] + 2 * RADIUS + RANGE - 1e-6;
  if (f->c->cohesion->law->latches) {
    f->c->list.valid = PETSC_FALSE;
    evaluate(f);
    f->c->list.slip[0][3] = -1e-300;
  }
  f->s->x[1][0] = f->s->x[0][0] + 2 * RADIUS + RANGE + s;
  evaluate(f);
  return f->force[1][0];
}

static PetscReal largest_pull(Fixture *f, PetscReal low, PetscReal high)
{
  PetscReal most = 0;

  for (PetscInt i = 0; i <= 400; i++) most = PetscMin(most, force_at(f, low + i * (high - low) / 400));
  return -most;
}

static void test_pull_off(void **state)
{
  Fixture   f;
  PetscReal pull;

  (void)state;
  create_dry(&f, 3, SPHERES "-contact_cohesion jkr " ELASTIC);
  pull = largest_pull(&f, -2e-4, 2e-3);
  near(pull, 1.5 * PETSC_PI * WORK * R, 1e-4 * pull);
  near(force_at(&f, 0), -8. / 9 * 1.5 * PETSC_PI * WORK * R, 1e-9); /* as it forms */
  destroy(&f);
  create_dry(&f, 3, SPHERES "-contact_cohesion dmt " ELASTIC);
  near(force_at(&f, -1e-12), -2 * PETSC_PI * WORK * R, 1e-6);
  near(force_at(&f, -1e-3), 4. / 3 * MODULUS * PetscSqrtReal(R * 1e-9) - 2 * PETSC_PI * WORK * R, 1e-6);
  near(force_at(&f, 1e-6), 0, 0);
  destroy(&f);
  create_dry(&f, 3,
             SPHERES
             "-contact_cohesion van_der_waals -contact_spring_stiffness 1e9 -contact_cohesion_hamaker 0.06 -contact_cohesion_cutoff 1e-4");
  for (PetscReal h = 1e-4; h < 4e-3; h *= 1.7) near(force_at(&f, h), -0.06 * RADIUS / (12 * h * h), 1e-9 / (h * h));
  near(force_at(&f, 0), -0.06 * RADIUS / 12e-8, 1e-7);
  near(force_at(&f, 5.1e-3), 0, 0);
  destroy(&f);
}

/* In the plane, of a unit of depth */
static void test_plane(void **state)
{
  Fixture f;

  (void)state;
  create_dry(&f, 2,
             DISCS "-contact_cohesion van_der_waals -contact_cohesion_hamaker 1e-3 -contact_cohesion_cutoff 1e-4");
  for (PetscReal h = 1e-4; h < 4e-3; h *= 1.7)
    near(force_at(&f, h), -1e-3 * PetscSqrtReal(R) / (8 * PetscSqrtReal(2) * PetscPowReal(h, 2.5)),
         1e-9 / PetscPowReal(h, 2.5));
  destroy(&f);
  create_dry(&f, 2, DISCS "-contact_cohesion bridge -contact_cohesion_tension 0.07 -contact_cohesion_volume 1e-6");
  near(force_at(&f, 0), -8 * 0.07 * R / PetscPowReal(3 * R * 1e-6, 1. / 3), 1e-6);
  near(force_at(&f, 9e-4), -2 * 0.07 * 1e-6 / PetscSqr(9e-4),
       0.03 * 2 * 0.07 * 1e-6 / PetscSqr(9e-4)); /* all but flat */
  near(force_at(&f, 1.01e-3), 0, 0);             /* beyond sqrt(V) */
  destroy(&f);
}

/* Willett's closed form beside Derjaguin's limit of thin bridges, 1 - s/sqrt(s^2 + 2 V/(pi a)); where it breaks */
static void test_bridge(void **state)
{
  const PetscReal V = 1e-7, most = 2 * PETSC_PI * 0.07 * RADIUS, root = PetscPowReal(V, 1. / 3);
  Fixture         f;

  (void)state;
  create_dry(&f, 3,
             SPHERES
             "-contact_spring_stiffness 1e9 -contact_cohesion bridge -contact_cohesion_tension 0.07 -contact_cohesion_volume 1e-7");
  near(force_at(&f, 0), -most, 1e-9 * most);
  for (PetscReal s = 1e-4; s < 3e-3; s *= 2)
    near(force_at(&f, s), -most * (1 - s / PetscSqrtReal(s * s + 2 * V / (PETSC_PI * RADIUS))), 0.04 * most);
  assert_true(force_at(&f, root * (1 + root / RADIUS / 10) - 1e-6) < 0);
  near(force_at(&f, root * (1 + root / RADIUS / 10) + 1e-6), 0, 0);
  destroy(&f);
}

/* Energy is the integral of the force, and nothing where the pair has parted */
static void test_energy(void **state)
{
  static const char *const OPTIONS[] =
    {SPHERES "-contact_cohesion jkr " ELASTIC,
     SPHERES "-contact_cohesion dmt -contact_cohesion_cutoff 1e-4 " ELASTIC,
     SPHERES
     "-contact_cohesion van_der_waals -contact_spring_stiffness 1e9 -contact_cohesion_hamaker 0.06 -contact_cohesion_cutoff 1e-4",
     SPHERES
     "-contact_spring_stiffness 1e9 -contact_cohesion bridge -contact_cohesion_tension 0.07 -contact_cohesion_volume 1e-7",
     DISCS "-contact_cohesion van_der_waals -contact_cohesion_hamaker 1e-3 -contact_cohesion_cutoff 1e-4",
     DISCS "-contact_cohesion bridge -contact_cohesion_tension 0.07 -contact_cohesion_volume 1e-6"};

  (void)state;
  for (PetscInt i = 0; i < 6; i++) {
    const PetscInt  dim = i < 4 ? 3 : 2, n = 4000;
    Fixture         f;
    const Cohesion *co = &f.c->cohesion;
    PetscReal       reach, low = -3e-4, sum = 0;

    create_dry(&f, dim, OPTIONS[i]);
    co    = &f.c->cohesion;
    reach = (*(*co)->law->reach)(*co, R);
    for (PetscInt k = 0; k < n; k++)
      sum += (reach - low) / n * (*(*co)->law->force)(*co, R, low + (k + 0.5) * (reach - low) / n);
    near(CohesionEnergy(*co, R, low, PETSC_TRUE), sum, 2e-3 * PetscAbsReal(sum));
    near(CohesionEnergy(*co, R, 1.001 * reach, PETSC_TRUE), 0, 0);
    destroy(&f);
  }
}

/* Spheres that collide with this relative speed: do they part? *error: of the momentum; *book: energy stored and work
   of the contact */
static PetscBool parts(const char options[], PetscReal speed, PetscReal dt, PetscReal *error, PetscReal *book)
{
  Fixture   f;
  PetscReal mass, before, after, stored, work;
  PetscBool part;

  create_dry(&f, 3, options);
  OK(ContactGetMass(f.c, 0, &mass, NULL));
  f.s->u[0][0] = 0.7 * speed;
  f.s->u[1][0] = -0.3 * speed;
  before       = 0.5 * mass * 0.58 * speed * speed;
  for (PetscInt i = 0; i * dt < 0.3 / speed; i++) OK(ContactAdvanceAlone(f.c, dt));
  part   = (PetscBool)(f.s->x[1][0] - f.s->x[0][0] > 0.21);
  *error = PetscAbsReal(f.s->u[0][0] + f.s->u[1][0] - 0.4 * speed) / speed;
  OK(ContactGetEnergy(f.c, &stored, &work));
  after = 0.5 * mass * (PetscSqr(f.s->u[0][0]) + PetscSqr(f.s->u[1][0]));
  near(after - before, work, 1e-12 * before); /* of contact alone */
  *book = stored + work;
  destroy(&f);
  return part;
}

/* 1/2 m v^2 = 7.09 (w^5 R^4/E*^2)^(1/3) (Thornton & Ning 1998): what forming and tearing take. With steps that the
   contact resolves and with those that it divides. */
static void test_sticking(void **state)
{
  const PetscReal loss    = 7.0922 * PetscPowReal(PetscPowRealInt(R, 4) / PetscSqr(MODULUS), 1. / 3);
  const char     *options = SPHERES "-contact_cohesion jkr " ELASTIC;
  const PetscReal mass    = 0.5 * 4. / 3 * PETSC_PI * RADIUS * RADIUS * RADIUS,
                  want = PetscSqrtReal(14.18 / mass) * PetscPowReal(PetscPowRealInt(R, 4) / PetscSqr(MODULUS), 1. / 6);

  (void)state;
  for (PetscInt i = 0; i < 2; i++) {
    PetscReal low = 0.5 * want, high = 2 * want, error, book;

    for (PetscInt k = 0; k < 9; k++) {
      const PetscReal v = 0.5 * (low + high);

      if (parts(options, v, i ? 2e-4 : 2e-2, &error, &book)) {
        near(book, -loss, 0.005 * loss); /* what parting has cost */
        high = v;
      } else low = v;
      near(error, 0, 1e-12);
    }
    near(0.5 * (low + high), want, 0.01 * want);
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_pull_off), cmocka_unit_test(test_plane),
                                     cmocka_unit_test(test_bridge), cmocka_unit_test(test_energy),
                                     cmocka_unit_test(test_sticking)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  return PetscFinalize() || failed;
}
