/* Contact: the law, the pair search, conservation, and bodies that must come to rest without overlap. */
/* ranks: 1 2 */
#include "contactcore.h"

/* ---- the law ---- */

static void test_law(void **state)
{
  const PetscReal rho = 1.5, R = 0.1, r = 0.02, u2 = PETSC_PI / 2 * 2 * R * 0.5 * 10,
                  K      = 1.5 * (rho + 1) * PETSC_PI * R * R * u2 / r;
  const PetscReal gaps[] = {0.03, 0.019, 0.01, 0.001, 0, -0.01};
  Fixture         f;

  (void)state;
  create(&f, 2, 2 * r, down, zero, one, 4,
         "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1.5 -particle_a_position 0.3,0.7 "
         "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 1.5 -particle_b_position 0.5,0.7");
  for (size_t i = 0; i < sizeof(gaps) / sizeof(gaps[0]); i++) {
    const PetscReal g = gaps[i], want = K * (g >= r ? 0 : g >= 0 ? PetscSqr((r - g) / r) : 1 - g / (0.5 * r));

    f.s->x[0][1] = f.s->x[1][1] = 0.7;
    f.s->x[1][0]                = f.s->x[0][0] + 2 * R + g; /* pair */
    evaluate(&f);
    near(f.force[1][0], want, 1e-11 * K);
    near(f.force[0][0], -want, 1e-11 * K);
    near(f.force[0][1], 0, 1e-11 * K);
    near(f.torque[0][2], 0, 1e-11 * K);
    if (g < r) near(f.gap[0], g, 1e-14);
    f.s->x[1][0] = 0.9; /* wall below; the upper wall is not solid */
    f.s->x[0][1] = R + g;
    f.s->x[1][1] = 1 - R;
    evaluate(&f);
    near(f.force[0][1], want, 1e-11 * K);
    near(f.force[1][1], 0, 0);
  }
  destroy(&f);
}

/* Work of the law from the range to gap 0 is the energy of arrival. */
static void test_work(void **state)
{
  const PetscReal R = 0.1, r = 0.02;
  PetscReal       work = 0, mass;
  Fixture         f;

  (void)state;
  create(&f, 2, 2 * r, down, zero, one, 4,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 3 -particle_a_position 0.5,0.5");
  for (PetscInt i = 0; i < 1000; i++) {
    f.s->x[0][1] = R + r * (i + 0.5) / 1000;
    evaluate(&f);
    work += f.force[0][1] * r / 1000;
  }
  OK(ContactGetMass(f.c, 0, &mass, NULL));
  near(mass, 4 * PETSC_PI * R * R, 1e-12);
  near(work / (0.5 * mass * PETSC_PI / 2 * 2 * R * 2 * 10), 1, 1e-5);
  destroy(&f);
}

static void test_options(void **state)
{
  const char *scene =
    "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 3 -particle_a_position 0.5,0.11 -contact_range 0.02 ";
  char      options[512];
  PetscReal once;
  PetscInt  substeps;
  Fixture   f;

  (void)state;
  create(&f, 2, 1, down, zero, one, 4, scene);
  evaluate(&f);
  once = f.force[0][1];
  assert_true(once > 0);
  OK(ContactStep(f.c, 0.01, f.a, f.alpha));
  OK(ContactGetWork(f.c, NULL, NULL, &substeps));
  destroy(&f);
  snprintf(options, sizeof(options), "%s -contact_stiffness 3", scene);
  create(&f, 2, 1, down, zero, one, 4, options);
  evaluate(&f);
  near(f.force[0][1], 3 * once, 1e-12 * once);
  destroy(&f);
  snprintf(options, sizeof(options), "%s -contact_law none", scene);
  create(&f, 2, 1, down, zero, one, 4, options);
  evaluate(&f);
  near(f.force[0][1], 0, 0);
  OK(ContactStep(f.c, 0.01, f.a, f.alpha));
  near(f.s->contact_force[0][1], 0, 0);
  destroy(&f);
  snprintf(options, sizeof(options), "%s -contact_substeps 1", scene);
  create(&f, 2, 1, down, zero, one, 4, options);
  begin_error();
  expect_error(ContactStep(f.c, 0.01, f.a, f.alpha), PETSC_ERR_USER_INPUT, "-contact_substeps 1 is too small", NULL);
  destroy(&f);
  snprintf(options, sizeof(options), "%s -contact_substeps %d", scene, (int)(substeps / 3));
  create(&f, 2, 1, down, zero, one, 4, options);
  OK(ContactStep(f.c, 0.01, f.a, f.alpha));
  destroy(&f);
}

/* ---- search ---- */

static void scatter(Fixture *f, PetscInt n, unsigned seed)
{
  srand(seed);
  for (PetscInt k = 0; k < n; k++)
    for (PetscInt a = 0; a < f->s->dim; a++) f->s->x[k][a] = 0.02 + 0.96 * (PetscReal)rand() / RAND_MAX;
}

/* 1000 discs of three sizes, overlapping freely: forces and gaps as from all pairs. */
static void test_brute_force(void **state)
{
  const PetscReal r = 0.004;
  Fixture         f;
  PetscReal(*want)[3], *gap, top = 0;
  PetscInt hits = 0;

  (void)state;
  create(&f, 2, 2 * r, zero, zero, one, 0,
         "-particle_groups a,b,c -particle_a_shape circle -particle_a_radius 0.008 -particle_a_density 2 -particle_a_place lattice -particle_a_count 900 "
         "-particle_b_shape circle -particle_b_radius 0.02 -particle_b_density 2 -particle_b_place lattice -particle_b_count 98 "
         "-particle_c_shape circle -particle_c_radius 0.2 -particle_c_density 2 -particle_c_place lattice -particle_c_count 2");
  assert_int_equal(f.s->n, 1000);
  scatter(&f, 1000, 5);
  f.s->u[0][0] = 1; /* a speed: without gravity the stiffness comes from the motion */
  want         = calloc(1000, sizeof(*want));
  gap          = calloc(1000, sizeof(*gap));
  evaluate(&f);
  for (PetscInt i = 0; i < 1000; i++) gap[i] = PETSC_MAX_REAL;
  for (PetscInt i = 0; i < 1000; i++)
    for (PetscInt j = 0; j < i; j++) {
      const BodyGroup *gi = &f.s->group[f.s->body_group[i]], *gj = &f.s->group[f.s->body_group[j]];
      const PetscReal  d[2] = {f.s->x[i][0] - f.s->x[j][0], f.s->x[i][1] - f.s->x[j][1]},
                      l = PetscSqrtReal(d[0] * d[0] + d[1] * d[1]), g = l - gi->disc - gj->disc;
      const PetscReal K = 1.5 * 3 * PetscMax(gi->mass.volume, gj->mass.volume) / r,
                      F = g >= r ? 0 : K * (g >= 0 ? PetscSqr(1 - g / r) : 1 - 2 * g / r);

      if (g >= r) continue;
      hits++;
      gap[i] = PetscMin(gap[i], g);
      gap[j] = PetscMin(gap[j], g);
      for (PetscInt a = 0; a < 2; a++) {
        want[i][a] += F * d[a] / l;
        want[j][a] -= F * d[a] / l;
      }
      top = PetscMax(top, F);
    }
  assert_true(hits > 500);
  for (PetscInt i = 0; i < 1000; i++) {
    near(f.force[i][0], want[i][0], 1e-10 * top);
    near(f.force[i][1], want[i][1], 1e-10 * top);
    if (gap[i] < PETSC_MAX_REAL) near(f.gap[i], gap[i], 1e-14);
  }
  free(want);
  free(gap);
  destroy(&f);
}

/* Twice the bodies in twice the domain: twice the tests, in 2D and 3D. */
static void test_linear_cost(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    PetscInt tests[2], n[2];

    for (PetscInt level = 0; level < 2; level++) {
      const PetscReal upper[3] = {1 + 3 * level, 1, 1};
      char            options[512];
      Fixture         f;

      n[level] = (dim == 2 ? 1000 : 500) * (1 + 3 * level);
      snprintf(options, sizeof(options),
               "-particle_groups a -particle_a_shape %s -particle_a_radius 0.01 -particle_a_a 0.04 -particle_a_b 0.04 -particle_a_c 0.04 -particle_a_density 2 -particle_a_place random -particle_a_count %d",
               dim == 2 ? "circle" : "ellipse", (int)n[level]);
      create(&f, dim, 0.004, down, zero, upper, 0, options);
      evaluate(&f);
      OK(ContactGetWork(f.c, &tests[level], NULL, NULL));
      destroy(&f);
    }
    assert_true(tests[0] > 0);
    assert_true(tests[1] < 4.6 * tests[0]);
    assert_true(tests[0] < 20 * n[0]);
  }
}

/* Fast approach: the far pair is not looked at closely, the near one is stopped. */
static void test_only_near(void **state)
{
  Fixture  f;
  PetscInt pairs, substeps;

  (void)state;
  create(&f, 2, 0.01, down, zero, one, 15,
         "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.05 -particle_a_density 2 -particle_a_position 0.3,0.5 "
         "-particle_b_shape circle -particle_b_radius 0.05 -particle_b_density 2 -particle_b_position 0.7,0.5");
  OK(ContactStep(f.c, 0.01, f.a, f.alpha));
  OK(ContactGetWork(f.c, NULL, &pairs, &substeps));
  assert_int_equal(pairs, 0);
  assert_int_equal(substeps, 0);
  f.s->u[0][0] = 10; /* 0.1 a step, gap 0.3 */
  OK(ContactStep(f.c, 0.02, f.a, f.alpha));
  assert_true(f.s->contact_force[0][0] < 0);
  near(f.s->contact_force[0][0] + f.s->contact_force[1][0], 0, 1e-12 * PetscAbsReal(f.s->contact_force[0][0]));
  destroy(&f);
}

/* ---- conservation ---- */

/* Sums of force, and of torque about the origin, over all bodies. */
static void add_up(const Fixture *f, PetscReal (*force)[3], PetscReal (*torque)[3], PetscReal sum[2], PetscReal *scale)
{
  PetscReal total[3] = {0, 0, 0}, turn[3] = {0, 0, 0};

  *scale = 0;
  for (PetscInt k = 0; k < f->s->n; k++) {
    const PetscReal *x = f->s->x[k], *F = force[k];

    for (PetscInt a = 0; a < 3; a++) {
      total[a] += F[a];
      turn[a] += torque[k][a] + x[(a + 1) % 3] * F[(a + 2) % 3] - x[(a + 2) % 3] * F[(a + 1) % 3];
      *scale = PetscMax(*scale, PetscAbsReal(F[a]));
    }
  }
  sum[0] = PetscSqrtReal(total[0] * total[0] + total[1] * total[1] + total[2] * total[2]);
  sum[1] = PetscSqrtReal(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
}

static void check_conservation(PetscInt dim, const char options[], PetscReal speed)
{
  Fixture   f;
  PetscReal sum[2], scale;

  create(&f, dim, 0.02, zero, zero, one, 0, options);
  scatter(&f, f.s->n, 11);
  for (PetscInt k = 0; k < f.s->n; k++) {
    for (PetscInt a = 0; a < dim; a++) f.s->u[k][a] = speed * (f.s->x[k][(a + 1) % dim] - 0.5);
    f.s->w[k][2] = speed * k;
    if (dim == 3) f.s->w[k][0] = speed;
    RotationAdvance(1, f.s->w[k], f.s->q[k]);
  }
  evaluate(&f);
  add_up(&f, f.force, f.torque, sum, &scale);
  assert_true(scale > 0);
  assert_true(sum[0] < 1e-13 * scale * f.s->n);
  assert_true(sum[1] < 1e-13 * scale * f.s->n);
  OK(ContactStep(f.c, 0.001, f.a, f.alpha));
  add_up(&f, f.s->contact_force, f.s->contact_torque, sum, &scale);
  assert_true(scale > 0);
  assert_true(sum[0] < 1e-13 * scale * f.s->n);
  destroy(&f);
}

static void test_conservation(void **state)
{
  (void)state;
  check_conservation(2,
                     "-particle_groups a -particle_a_shape circle -particle_a_radius 0.03 -particle_a_density 2 -particle_a_place lattice -particle_a_count 200",
                     1);
  check_conservation(
    2,
    "-particle_groups a,b -particle_a_shape ellipse -particle_a_a 0.08 -particle_a_b 0.03 -particle_a_density 2 -particle_a_place lattice -particle_a_count 30 "
    "-particle_b_shape circle -particle_b_radius 0.05 -particle_b_density 0.1 -particle_b_place lattice -particle_b_count 20",
    1);
  check_conservation(3,
                     "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.2 -particle_a_b 0.1 -particle_a_c 0.1 -particle_a_density 2 -particle_a_place lattice -particle_a_count 8",
                     1);
}

/* Surface points against the distance give the gap of the closed form, and the force of two discs is that of two nearly
   round ellipses. */
static void test_points_against_discs(void **state)
{
  const char *shapes[] = {"-particle_a_shape circle -particle_a_radius 0.1",
                          "-particle_a_shape ellipse -particle_a_a 0.1 -particle_a_b 0.1000001"};
  PetscReal   gap[2][2], F[2][2], along[2];

  (void)state;
  for (PetscInt i = 0; i < 2; i++) {
    char    options[256];
    Fixture f;

    snprintf(options, sizeof(options),
             "-particle_groups a %s -particle_a_density 2 -particle_a_place lattice -particle_a_count 2", shapes[i]);
    create(&f, 2, 0.02, down, zero, one, 4, options);
    f.s->x[0][0] = 0.4;
    f.s->x[0][1] = 0.1035;
    f.s->x[1][0] = 0.4 + 0.204 * PetscCosReal(0.3);
    f.s->x[1][1] = 0.8;
    evaluate(&f);
    gap[i][0]    = f.gap[0];
    F[i][0]      = f.force[0][1];
    f.s->x[0][1] = 0.8 - 0.204 * PetscSinReal(0.3);
    evaluate(&f);
    gap[i][1] = f.gap[0];
    F[i][1]   = PetscSqrtReal(PetscSqr(f.force[0][0]) + PetscSqr(f.force[0][1]));
    along[i]  = -(f.force[0][0] * PetscCosReal(0.3) + f.force[0][1] * PetscSinReal(0.3)) / F[i][1];
    destroy(&f);
  }
  for (PetscInt k = 0; k < 2; k++) {
    near(gap[1][k], gap[0][k], 2e-4);
    near(F[1][k] / F[0][k], 1, 0.25);
  }
  near(along[1], 1, 1e-3);
}

/* A flat ellipse that meets the wall tilted is turned flat. */
static void test_tilted(void **state)
{
  Fixture f;

  (void)state;
  create(&f, 2, 0.02, down, zero, one, 4,
         "-particle_groups a -particle_a_shape ellipse -particle_a_a 0.2 -particle_a_b 0.05 -particle_a_density 2 -particle_a_position 0.5,0.08 -particle_a_angle 0.3");
  evaluate(&f);
  near(f.gap[0], 0.08 - PetscSqrtReal(PetscSqr(0.2 * PetscSinReal(0.3)) + PetscSqr(0.05 * PetscCosReal(0.3))), 1e-4);
  assert_true(f.force[0][1] > 0);
  assert_true(f.torque[0][2] < 0); /* the left side is the low one: pushed up it turns the body clockwise */
  destroy(&f);
}

/* ---- coming to rest ---- */

/* The flow of these tests: (M + added M_f) dU/dt = (M - M_f) g - c (U - v) + F', a linear drag that gives the terminal
   speed, implicit in U as the flow solver is; order 1 is backward Euler, 2 is bdf2 with the mean velocity. Rotation is
   damped at the same rate. v = -squeeze (x - 1/2). */
typedef struct {
  PetscInt  order;
  PetscReal dt, added, terminal, squeeze, range;
  PetscReal drag; /* c/M_f for bodies without weight */
} Flow;

typedef struct {
  PetscReal least, late; /* smallest gap of all steps; largest distance moved in the last 50 steps; both in ranges */
} Rest;

static PetscReal advance_value(const Flow *w, PetscBool first, PetscReal inertia, PetscReal drag, PetscReal push,
                               PetscReal old, PetscReal older)
{
  if (w->order == 1 || first) return (inertia * old + w->dt * push) / (inertia + w->dt * drag);
  return (inertia * (2 * old - 0.5 * older) + w->dt * push) / (1.5 * inertia + w->dt * drag);
}

static void step_flow(Fixture *f, const Flow *w, PetscBool first, const PetscReal gravity[3])
{
  BodyArrays *s = f->s;

  for (PetscInt k = 0; k < s->n; k++) {
    const BodyGroup *g   = &s->group[s->body_group[k]];
    const PetscReal  vol = g->mass.volume, M = (g->density + w->added) * vol, W = (g->density - 1) * vol;
    const PetscReal  drag = w->terminal > 0 ? PetscAbsReal(W * gravity[1]) / w->terminal : w->drag * vol,
                    spin  = (g->density + 0.2) * g->mass.inertia[2];

    for (PetscInt a = 0; a < 2; a++) {
      const PetscReal old = s->u[k][a], older = s->u_old[k][a];

      s->u[k][a]     = advance_value(w, first, M, drag,
                                     W * gravity[a] - drag * w->squeeze * (s->x[k][a] - 0.5) + s->contact_force[k][a], old,
                                     older);
      s->u_old[k][a] = old;
    }
    const PetscReal old = s->w[k][2], older = s->w_old[k][2];

    s->w[k][2]     = advance_value(w, first, spin, spin * drag / M, s->contact_torque[k][2], old, older);
    s->w_old[k][2] = old;
  }
  OK(BodiesAdvancePosition(f->b, w->dt, w->order == 1 ? 1 : 0.5));
}

/* The accelerations of the last step without contact, as the coupling computes them. */
static void remaining_acceleration(Fixture *f, PetscReal dt)
{
  for (PetscInt k = 0; k < f->s->n; k++) {
    PetscReal mass, in[6];

    OK(ContactGetMass(f->c, k, &mass, in));
    for (PetscInt a = 0; a < 2; a++)
      f->a[k][a] = (f->s->u[k][a] - f->s->u_old[k][a]) / dt - f->s->contact_force[k][a] / mass;
    f->alpha[k][2] = (f->s->w[k][2] - f->s->w_old[k][2]) / dt - f->s->contact_torque[k][2] / in[2];
  }
}

static Rest settle(Fixture *f, const Flow *w, PetscInt nsteps, const PetscReal gravity[3])
{
  Rest rest            = {PETSC_MAX_REAL, 0};
  PetscReal(*start)[3] = calloc(f->s->n, sizeof(*start));

  for (PetscInt i = 0; i < nsteps; i++) {
    remaining_acceleration(f, w->dt);
    OK(ContactStep(f->c, w->dt, f->a, f->alpha));
    step_flow(f, w, i == 0 ? PETSC_TRUE : PETSC_FALSE, gravity);
    evaluate(f);
    rest.least = PetscMin(rest.least, smallest(f, f->gap) / w->range);
    for (PetscInt k = 0; k < f->s->n; k++)
      for (PetscInt a = 0; a < 2; a++) {
        if (i == nsteps - 50) start[k][a] = f->s->x[k][a];
        if (i > nsteps - 50) rest.late = PetscMax(rest.late, PetscAbsReal(f->s->x[k][a] - start[k][a]) / w->range);
      }
  }
  free(start);
  return rest;
}

/* One disc arrives at its terminal speed: 10 (heavy) to 0.001 (pressed against the lid). `slow`: terminal speed in the
   scale of the stiffness, from inertial to viscous; `travel`: way of a step in ranges. */
static void rest_one_disc(PetscReal rho, PetscReal slow, PetscReal travel, PetscInt order, PetscReal added)
{
  const PetscReal r = 0.01, R = 0.16, side = rho > 1 ? -1 : 1,
                  u      = slow * PetscSqrtReal(PETSC_PI / 2 * 2 * R * PetscAbsReal(rho - 1) * 10);
  const Flow      w      = {.order = order, .dt = travel * r / u, .added = added, .terminal = u, .range = r};
  const PetscInt  nsteps = (slow == 1 && rho > 5 ? 4000 : 400) + (PetscInt)(40 / travel / slow);
  const PetscReal bound  = travel <= 1 ? 0.3 : 3;
  char            options[256];
  Fixture         f;
  Rest            rest;
  PetscReal       gap;

  snprintf(options, sizeof(options),
           "-particle_groups a -particle_a_shape circle -particle_a_radius %g -particle_a_density %g -particle_a_position 0.5,%g -particle_a_velocity 0,%g",
           (double)R, (double)rho, (double)(0.5 + side * (0.5 - R - 5.3 * r)), (double)(side * u));
  create(&f, 2, 2 * r, down, zero, one, 15, options);
  rest = settle(&f, &w, nsteps, down);
  gap  = (0.5 - R - side * (f.s->x[0][1] - 0.5)) / r;
  destroy(&f);
  if (!(rest.least > 0.3 && rest.late < bound && gap > 0.3 && gap < 4))
    fail_msg("density %g, speed %g, travel %g, order %d, added mass %g: smallest gap %g (at least 0.3), late motion %g (at most %g), gap at rest %g (0.3 to 4), in ranges",
             (double)rho, (double)slow, (double)travel, (int)order, (double)added, (double)rest.least,
             (double)rest.late, (double)bound, (double)gap);
}

/* Several ranks repeat what one does: half of it */
static PetscBool is_alone(void)
{
  PetscMPIInt size;

  OK(MPI_Comm_size(PETSC_COMM_WORLD, &size));
  return (PetscBool)(size == 1);
}

static void test_one_disc_rests(void **state)
{
  const PetscReal rho[] = {0.001, 0.5, 1.05, 1.5, 10}, slow[] = {1, 0.3, 0.05}, travel[] = {0.2, 1, 2};

  (void)state;
  for (PetscInt i = 0; i < 5; i++)
    for (PetscInt j = is_alone() ? 0 : 2; j < 3; j++) /* several ranks: the stiffest */
      for (PetscInt l = 0; l < 3; l++)
        for (PetscInt order = 1; order <= (is_alone() ? 2 : 1); order++) {
          rest_one_disc(rho[i], slow[j], travel[l], order, 1);
          if (j < 2 && i % 2) rest_one_disc(rho[i], slow[j], travel[l], order, 1.5);
        }
}

/* Many bodies fall on each other into a narrow box, and light ones rise. */
static void test_pile_rests(void **state)
{
  const PetscReal r = 0.01, upper[3] = {0.8, 2, 1};
  const char     *shape[] = {"circle -particle_a_radius 0.1", "ellipse -particle_a_a 0.12 -particle_a_b 0.07"};
  const PetscReal rho[]   = {0.01, 1.5, 5};

  (void)state;
  for (PetscInt kind = 0; kind < 2; kind++)
    for (PetscInt i = 0; i < (is_alone() ? 3 : 1); i++)
      for (PetscInt order = 1; order <= (is_alone() ? 2 : 1); order++) {
        const PetscReal u = 0.5 * PetscSqrtReal(PETSC_PI / 2 * 0.2 * PetscAbsReal(rho[i] - 1) * 10);
        const Flow      w = {.order = order, .dt = r / u, .added = 1, .terminal = u, .range = r};
        char            options[256];
        Fixture         f;
        Rest            rest;

        snprintf(options, sizeof(options),
                 "-particle_groups a -particle_a_shape %s -particle_a_density %g -particle_a_place random -particle_a_count %d -particle_a_angle 0.4",
                 shape[kind], (double)rho[i], kind ? 6 : 14);
        create(&f, 2, 2 * r, down, zero, upper, 15, options);
        rest = settle(&f, &w, kind ? 400 : 1000, down);
        destroy(&f);
        /* very light bodies that are no discs swing fast: they may dip into each other while they arrive */
        if (!(rest.least > (kind && i == 0 ? -2 : 0.2) && rest.late < (kind ? 2 : 0.2)))
          fail_msg("pile of %s, density %g, order %d: smallest gap %g, late motion %g, in ranges", shape[kind],
                   (double)rho[i], (int)order, (double)rest.least, (double)rest.late);
      }
}

/* Bodies as heavy as the fluid, without gravity, pressed together by the flow: the stiffness comes from their
   motion. */
static void test_squeezed(void **state)
{
  const PetscReal r = 0.01;

  (void)state;
  for (PetscInt order = 1; order <= 2; order++)
    for (PetscReal drag = 1; drag < 200; drag *= 10) {
      const Flow w = {.order = order, .dt = 0.05, .added = 1, .squeeze = 0.5, .range = r, .drag = drag};
      Fixture    f;
      Rest       rest;

      create(&f, 2, 2 * r, zero, zero, one, 0,
             "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_place lattice -particle_a_count 4");
      f.s->x[0][0] += 0.013;
      rest = settle(&f, &w, 400, zero);
      destroy(&f);
      if (!(rest.least > (drag > 50 ? -0.5 : 0.3) && rest.late < 0.1))
        fail_msg("squeezed, drag %g, order %d: smallest gap %g, late motion %g, in ranges", (double)drag, (int)order,
                 (double)rest.least, (double)rest.late);
    }
}

/* A disc that is flung out stiffens its own contacts, not those of bodies at rest elsewhere. */
static void test_local_stiffness(void **state)
{
  Fixture   f;
  PetscReal rest, calm;

  (void)state;
  create(&f, 2, 0.02, down, zero, one, 0,
         "-particle_groups a -particle_a_shape circle -particle_a_radius 0.05 -particle_a_density 2 -particle_a_place lattice -particle_a_count 4");
  f.s->x[1][0] = f.s->x[0][0] + 0.105; /* two pairs, with gaps of half the range */
  f.s->x[1][1] = f.s->x[0][1];
  f.s->x[3][0] = f.s->x[2][0] + 0.105;
  f.s->x[3][1] = f.s->x[2][1];
  evaluate(&f);
  rest = f.force[1][0];
  calm = f.force[3][0];
  near(rest / calm, 1, 1e-12);
  f.s->u[3][1] = 100;
  evaluate(&f);
  near(f.force[1][0], rest, 1e-12 * rest);
  assert_true(f.force[3][0] > 100 * calm);
  destroy(&f);
}

/* ---- separation ---- */

static PetscReal deepest_overlap(const Fixture *f, PetscReal radius)
{
  PetscReal most = 0;

  for (PetscInt i = 0; i < f->s->n; i++)
    for (PetscInt j = 0; j < i && f->s->body_group[i] == 0; j++)
      if (f->s->body_group[j] == 0)
        most = PetscMax(most, 2 * radius - PetscSqrtReal(PetscSqr(f->s->x[i][0] - f->s->x[j][0]) +
                                                         PetscSqr(f->s->x[i][1] - f->s->x[j][1])));
  return most;
}

static void centre_of_mass(const Fixture *f, PetscReal centre[2])
{
  PetscReal mass, total = 0;

  centre[0] = centre[1] = 0;
  for (PetscInt k = 0; k < f->s->n; k++) {
    OK(ContactGetMass(f->c, k, &mass, NULL));
    total += mass;
    for (PetscInt a = 0; a < 2; a++) centre[a] += mass * f->s->x[k][a];
  }
  for (PetscInt a = 0; a < 2; a++) centre[a] /= total;
}

/* Discs, a heavy one and an ellipse thrown into each other and into the walls: nothing overlaps afterwards, and only
   walls move the centre of mass. */
static void test_separation(void **state)
{
  const PetscReal R = 0.07;

  (void)state;
  for (PetscInt walls = 0; walls < 16; walls += 15)
    for (PetscInt on = 0; on < 2; on++) {
      char      options[512];
      Fixture   f;
      PetscReal before[2], after[2], least, found, at = 0.3;

      snprintf(options, sizeof(options),
               "-particle_groups a,b,e -particle_a_shape circle -particle_a_radius 0.07 -particle_a_density 1.1 -particle_a_place lattice "
               "-particle_a_count 25 -particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 20 -particle_b_position 0.6,0.3 "
               "-particle_e_shape ellipse -particle_e_a 0.12 -particle_e_b 0.06 -particle_e_density 2 -particle_e_position 0.4,0.5 "
               "-contact_remove_overlap %s",
               on ? "true" : "false");
      create(&f, 2, 0.02, down, zero, one, walls, options);
      for (PetscInt k = 0; k < f.s->n; k++)
        for (PetscInt a = 0; a < 2; a++) {
          at = at * 7919.1 + 0.37;
          at -= PetscFloorReal(at);
          f.s->x[k][a] += 0.12 * (at - 0.5);
          f.s->u[k][a] = at;
        }
      centre_of_mass(&f, before);
      OK(ContactStep(f.c, 1e-9, f.a, f.alpha));
      assert_true(deepest_overlap(&f, R) > 0.1 * R);
      OK(ContactFinishStep(f.c));
      OK(ContactGetSeparation(f.c, &found));
      assert_true(found > 0.05);
      centre_of_mass(&f, after);
      least = smallest(&f, f.s->gap);
      if (on) {
        assert_true(deepest_overlap(&f, R) <= 1e-3 * R && least >= -1e-3 * R);
        for (PetscInt a = 0; a < 2 && !walls; a++) near(after[a], before[a], 1e-14);
        evaluate(&f);
        near(smallest(&f, f.gap), least, 1e-14);
      } else {
        near(after[0], before[0], 0);
        assert_true(least < -0.1 * R);
      }
      near(f.s->u[f.s->n - 1][1], at, 0); /* velocities stay */
      destroy(&f);
    }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_law),
                                     cmocka_unit_test(test_work),
                                     cmocka_unit_test(test_options),
                                     cmocka_unit_test(test_brute_force),
                                     cmocka_unit_test(test_linear_cost),
                                     cmocka_unit_test(test_only_near),
                                     cmocka_unit_test(test_conservation),
                                     cmocka_unit_test(test_points_against_discs),
                                     cmocka_unit_test(test_tilted),
                                     cmocka_unit_test(test_one_disc_rests),
                                     cmocka_unit_test(test_pile_rests),
                                     cmocka_unit_test(test_squeezed),
                                     cmocka_unit_test(test_local_stiffness),
                                     cmocka_unit_test(test_separation)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (ShapeFinalize() || OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
