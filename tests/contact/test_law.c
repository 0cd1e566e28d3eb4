/* Contact: restitution, friction, lubrication, shapes of all kinds, search methods, energy; bodies alone. */
/* ranks: 1 2 */
#include "contactcore.h"
#include <stdio.h>
#include <unistd.h>

#define DISCS(n) \
  "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_place lattice -particle_a_count " #n \
  " "

static void create_dry(Fixture *f, PetscInt dim, PetscReal h, const PetscReal gravity[3], const PetscReal upper[3],
                       PetscInt walls, const char options[])
{
  OK(PetscOptionsClear(NULL));
  OK(PetscOptionsInsertString(NULL, options));
  OK(BodiesCreate(dim, zero, upper, &f->b));
  OK(BodiesGetArrays(f->b, &f->s));
  OK(ContactCreate(f->b, h, 0, gravity, zero, upper, walls, &f->c));
  allocate(f);
}

/* ---- spring ---- */

/* Head-on: speed of separation in that of approach, for pairs of unequal masses and for a wall */
static PetscReal collide(PetscReal e, PetscReal density, PetscBool wall)
{
  char      options[512];
  Fixture   f;
  PetscReal m[2], before, after;

  snprintf(options, sizeof(options),
           "-particle_groups a,b -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_position 0.3,0.5 -particle_a_velocity 1,0 "
           "-particle_b_shape circle -particle_b_radius 0.15 -particle_b_density %g -particle_b_position 0.6,%g -contact_law spring -contact_range 0.02 "
           "-contact_restitution %g",
           (double)density, wall ? 0.2 : 0.5, (double)e);
  create_dry(&f, 2, 1, zero, (const PetscReal[3]){1, 1, 1}, wall ? 2 : 0, options);
  if (wall) f.s->x[1][1] = 0.8;
  for (PetscInt k = 0; k < 2; k++) OK(ContactGetMass(f.c, k, &m[k], NULL));
  before = f.s->u[0][0] - f.s->u[1][0];
  for (PetscInt i = 0; i < 700; i++) OK(ContactAdvanceAlone(f.c, 1e-3));
  after = f.s->u[1][0] - f.s->u[0][0];
  if (!wall) near((m[0] * f.s->u[0][0] + m[1] * f.s->u[1][0]) / m[0], 1, 1e-13);
  near(f.s->u[0][1], 0, 0);
  destroy(&f);
  return after / before;
}

static void test_restitution(void **state)
{
  const PetscReal e[] = {1, 0.8, 0.5, 0.2};

  (void)state;
  for (size_t i = 0; i < 4; i++) {
    near(collide(e[i], 1, PETSC_FALSE), e[i], 0.02);
    near(collide(e[i], 30, PETSC_FALSE), e[i], 0.02);
    near(collide(e[i], 1, PETSC_TRUE), e[i], 0.02);
  }
}

/* Within one step, whose scales are those of the arrival: work of a force F(gap)(1 + v/d) gives v of separation by
   integral of v/(1 + v/d) dv on both sides, which is d - 2e-5 for d = v/10 whatever F and masses. Discs alone, and one
   that stands on many points. */
static void test_repulsive_restitution(void **state)
{
  const char     *shape[]   = {"circle -particle_a_radius 0.1", "ellipse -particle_a_a 0.1 -particle_a_b 0.1"};
  const PetscReal density[] = {1, 30};

  (void)state;
  for (PetscInt i = 0; i < 8; i++) {
    const PetscBool wall = (PetscBool)(i & 1);
    char            options[512];
    Fixture         f;

    snprintf(options, sizeof(options),
             "-particle_groups a,b -particle_a_shape %s -particle_a_density 1 -particle_a_position %g,0.5 -particle_a_velocity 1,0 "
             "-particle_b_shape circle -particle_b_radius 0.15 -particle_b_density %g -particle_b_position 0.6,%g -contact_range 0.02",
             shape[i / 4], wall ? 0.87 : 0.32, (double)density[i / 2 % 2], wall ? 0.2 : 0.5);
    create_dry(&f, 2, 1, zero, (const PetscReal[3]){1, 1, 1}, wall ? 2 : 0, options);
    OK(ContactAdvanceAlone(f.c, 0.1));
    near(f.s->u[1][0] - f.s->u[0][0], 0.1, 0.001);
    destroy(&f);
  }
}

/* A disc slides on the floor: it slows down by mu g until it rolls at 2/3 of its first speed. Without friction it
   slides on. */
static void test_sliding(void **state)
{
  const PetscReal mu[] = {0.3, 0}, upper[3] = {9, 1, 1}, early = 0.2, dt = 1e-3;

  (void)state;
  for (PetscInt i = 0; i < 2; i++) {
    char    options[512];
    Fixture f;

    snprintf(options, sizeof(options),
             "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_position 0.5,0.1098 -particle_a_velocity 3,0 "
             "-contact_law spring -contact_range 0.01 -contact_spring_stiffness 2000 -contact_friction %g",
             (double)mu[i]);
    create_dry(&f, 2, 1, down, upper, 4, options);
    for (PetscInt s = 0; s < early / dt; s++) OK(ContactAdvanceAlone(f.c, dt));
    near(f.s->u[0][0], 3 - mu[i] * 10 * early, 0.01);
    near(f.s->w[0][2], -mu[i] * 10 * early * 2 / 0.1, 0.3);
    for (PetscInt s = 0; s < 0.5 / dt; s++) OK(ContactAdvanceAlone(f.c, dt));
    near(f.s->u[0][0], mu[i] > 0 ? 2 : 3, 0.02);
    near(f.s->w[0][2], mu[i] > 0 ? -20 : 0, 0.2);
    destroy(&f);
  }
}

/* On a slope, without rotation: below the angle of friction it stays, above it slides with g_x - mu g_y. */
static void test_slope(void **state)
{
  const PetscReal upper[3] = {9, 1, 1}, dt = 1e-3;

  (void)state;
  for (PetscInt steep = 0; steep < 2; steep++) {
    const PetscReal g[3] = {steep ? 5 : 2, -10, 0};
    Fixture         f;

    create_dry(&f, 2, 1, g, upper, 4,
               "-particle_groups a -particle_a_shape circle -particle_a_radius 0.1 -particle_a_density 1 -particle_a_position 0.5,0.1098 -particle_a_free x,y "
               "-contact_law spring -contact_range 0.01 -contact_spring_stiffness 2000 -contact_friction 0.3 -contact_restitution 0.2");
    for (PetscInt s = 0; s < 1000; s++) OK(ContactAdvanceAlone(f.c, dt));
    near(f.s->u[0][0], steep ? 2 : 0, steep ? 0.05 : 1e-4);
    near(f.s->x[0][0] - 0.5, steep ? 1 : 0, steep ? 0.05 : 0.001);
    destroy(&f);
  }
}

/* ---- lubrication ---- */

/* Two discs, or two equal spheres, of radius 2 R: 1/(4 xi) + 9/40 ln(1/xi), xi the gap over the radius */
static PetscReal film(PetscInt dim, PetscReal R, PetscReal gap)
{
  if (dim == 2) return 3 * PetscSqrtReal(2) * PETSC_PI * PetscPowReal(R / gap, 1.5);
  return 6 * PETSC_PI * 2 * R * (0.25 * 2 * R / gap - 9. / 40 * PetscLogReal(gap));
}

/* The gap that the mesh makes of a gap in space, `closed` of a closed one */
static PetscReal on_mesh(PetscReal gap, PetscReal closed)
{
  return PetscPowReal(PetscPowReal(gap, 4) + PetscPowReal(closed, 4), 0.25);
}

static PetscReal at_wall(PetscReal gap)
{
  return PetscPowReal(PetscPowReal(gap, 6) + PetscPowReal(0.165 * 0.04, 6), 1.0 / 6);
}

static PetscReal film_force(PetscInt dim, const char shape[], PetscReal apart, PetscReal angle, PetscReal recess)
{
  char      options[512];
  Fixture   f;
  PetscReal force;

  snprintf(options, sizeof(options),
           "-particle_groups a -particle_a_shape %s -particle_a_density 1 -particle_a_place lattice -particle_a_count 2 -particle_a_angle %g "
           "-contact_lubrication -contact_range 1e-6 -contact_lubrication_range 0.04 -contact_roughness 1e-4 -contact_stiffness 1e-9",
           shape, (double)angle);
  create(&f, dim, 0.04, zero, zero, (const PetscReal[3]){2, 2, 2}, 0, options);
  OK(ContactSetViscosity(f.c, 0.7));
  OK(ContactSetFilmGapOffset(f.c, recess));
  for (PetscInt k = 0; k < 2; k++)
    for (PetscInt a = 0; a < dim; a++) {
      f.s->x[k][a] = 1 + (a == 0) * (k - 0.5) * apart;
      f.s->u[k][a] = (a == 0) * (k ? -1 : 1) * 0.25;
    }
  evaluate(&f);
  force = f.force[1][0] / (0.7 * 0.5);
  near(f.force[0][0], -f.force[1][0], 0);
  for (PetscInt k = 0; k < 2; k++) f.s->u[k][0] *= -1; /* drawn apart: the film holds them */
  evaluate(&f);
  near(f.force[1][0], -force * 0.7 * 0.5, 1e-12 * PetscAbsReal(force));
  destroy(&f);
  return force;
}

static void test_film(void **state)
{
  const PetscReal gaps[] = {0.03, 0.01, 0.001};

  (void)state;
  for (size_t i = 0; i < 3; i++) {
    const PetscReal g = gaps[i];

    near(film_force(2, "circle -particle_a_radius 0.2", 0.4 + g, 0, 0) / (film(2, 0.1, g) - film(2, 0.1, 0.04)), 1,
         1e-12);
    near(film_force(3, "circle -particle_a_radius 0.2", 0.4 + g, 0, 0) /
           (film(3, 0.1, g) - film(3, 0.1, on_mesh(g, 0.305 * 0.04))),
         1, 1e-11);
  }
  near(film_force(2, "circle -particle_a_radius 0.2", 0.441, 0, 0), 0, 0);
  /* not below the roughness */
  near(film_force(2, "circle -particle_a_radius 0.2", 0.40001, 0, 0), film(2, 0.1, 1e-4) - film(2, 0.1, 0.04), 1e-9);
  /* the flat sides of two ellipses: radius of curvature a^2/b each */
  near(film_force(2, "ellipse -particle_a_a 0.24 -particle_a_b 0.16", 0.33, 0.5 * PETSC_PI, 0) /
         (film(2, 0.18, 0.01) - film(2, 0.18, 0.04)),
       1, 0.01);
}

/* Force over viscosity and speed on a body at the lower wall, as the film law has it */
static PetscReal wall_force(const char shape[], PetscReal height, PetscReal recess)
{
  char      options[512];
  Fixture   f;
  PetscReal force;

  snprintf(options, sizeof(options),
           "-particle_groups a -particle_a_shape %s -particle_a_density 1 -particle_a_place lattice -particle_a_count 1 -contact_lubrication "
           "-contact_range 0.01 -contact_lubrication_range 0.04 -contact_roughness 1e-4 -contact_stiffness 1e-9",
           shape);
  create(&f, 3, 0.04, zero, zero, (const PetscReal[3]){2, 2, 2}, 63, options);
  OK(ContactSetViscosity(f.c, 0.7));
  OK(ContactSetFilmGapOffset(f.c, recess));
  f.s->x[0][2] = height;
  f.s->u[0][2] = -0.5;
  evaluate(&f);
  force = f.force[0][2] / (0.7 * 0.5);
  destroy(&f);
  return force;
}

/* A sphere, a/gap + 1/5 ln(a/gap) (Brenner), and an ellipsoid on its flat side, which curves differently each way */
static void test_film_at_wall(void **state)
{
  const PetscReal g = 0.01, open = at_wall(g), k1 = 0.15 / 0.24 / 0.24, k2 = 0.15 / 0.2 / 0.2;
  PetscReal       lead = 2 / ((k1 + k2) * PetscSqrtReal(k1 * k2)) * (1 / g - 1 / open),
            next       = 2 / (k1 + k2) / 5 * PetscLogReal(open / g);

  (void)state;
  near(wall_force("circle -particle_a_radius 0.2", 0.2 + g, 0) /
         (6 * PETSC_PI * (0.04 * (1 / g - 1 / open) + 0.04 * PetscLogReal(open / g))),
       1, 1e-11);
  near(wall_force("ellipse -particle_a_a 0.24 -particle_a_b 0.2 -particle_a_c 0.15", 0.15 + g, 0) /
         (6 * PETSC_PI * (lead + next)),
       1, 0.02);
}

/* Films that the mesh resolves but for a recess of .035 cells count as wider by that, from .4 to 2 cells */
static void test_film_recess(void **state)
{
  const PetscReal gap[] = {0.016, 0.023, 0.03, 0.04, 0.06, 0.079}, share[] = {0, 0.5, 1, 1, 0.5, 0.025};
  const char      ball[] = "circle -particle_a_radius 0.2";

  (void)state;
  for (size_t i = 0; i < 6; i++) {
    const PetscReal g = gap[i], wide = g + 0.035 * 0.04 * share[i], open = at_wall(wide);
    const PetscReal wall = 6 * PETSC_PI * 0.04 * (1 / g - 1 / open + PetscLogReal(open / g));

    near(wall_force(ball, 0.2 + g, 0.035) / wall, 1, 1e-8);
    near(film_force(3, ball, 0.4 + g, 0, 0.035) / (film(3, 0.1, g) - film(3, 0.1, on_mesh(wide, 0.305 * 0.04))), 1,
         1e-8);
  }
  near(wall_force(ball, 0.281, 0.035), 0, 0);
  near(wall_force(ball, 0.241, 0), 0, 0);
  near(film_force(2, ball, 0.441, 0, 0.035), 0, 0); /* in the plane all as without */
}

/* The recess goes with the steps, below .18 h^2/nu to nothing; h .04, density 1, viscosity .7 */
static void test_film_recess_in_steps(void **state)
{
  const PetscReal number[] = {18, 0.36, 0.17}, left[] = {0.99, 0.5, 0};

  (void)state;
  for (size_t i = 0; i < 3; i++) {
    Fixture f;

    create(&f, 3, 0.04, zero, zero, (const PetscReal[3]){2, 2, 2}, 63,
           "-particle_groups a -particle_a_shape circle -particle_a_radius 0.2 -particle_a_density 1 -particle_a_place lattice -particle_a_count 1 -contact_lubrication");
    f.c->fluid.density = 1;
    OK(ContactSetViscosity(f.c, 0.7));
    OK(ContactSetFilmGapOffset(f.c, 0.035));
    OK(ContactSetScales(f.c, number[i] * 0.0016 / 0.7, NULL));
    near(f.c->film.step_offset, 0.035 * left[i], 1e-12);
    destroy(&f);
  }
}

/* A disc thrown at a wall through a film comes to rest before it touches; without it, it bounces. */
static void test_film_stops(void **state)
{
  (void)state;
  for (PetscInt wet = 0; wet < 2; wet++) {
    char    options[512];
    Fixture f;

    snprintf(options, sizeof(options),
             DISCS(
               1) "-contact_law spring -contact_range 0.001 -contact_restitution 0.9 -contact_spring_stiffness 1e4 %s",
             wet ? "-contact_lubrication -contact_lubrication_range 0.05 -contact_roughness 1e-4" : "");
    create_dry(&f, 2, 0.05, zero, one, 2, options);
    OK(ContactSetViscosity(f.c, 0.1));
    f.s->u[0][0] = 1;
    for (PetscInt i = 0; i < 1000; i++) OK(ContactAdvanceAlone(f.c, 1e-3));
    near(f.s->u[0][0], wet ? 0 : -0.9, 0.02);
    if (wet) assert_true(f.s->x[0][0] < 0.9 && f.s->x[0][0] > 0.85);
    destroy(&f);
  }
}

/* ---- all kinds of shapes ---- */

static const char ZOO[] =
  "-particle_groups e,l,p,c -particle_e_shape ellipse -particle_e_a 0.12 -particle_e_b 0.05 -particle_e_density 2 -particle_e_place random -particle_e_count 6 "
  "-particle_l_shape leaflet -particle_l_length 0.3 -particle_l_thickness 0.05 -particle_l_density 1 -particle_l_place random -particle_l_count 5 -particle_l_angle 1 "
  "-particle_p_shape polygon -particle_p_file %s -particle_p_density 1.5 -particle_p_place random -particle_p_count 6 -particle_p_angle 0.3 "
  "-particle_c_shape circle -particle_c_radius 0.07 -particle_c_density 3 -particle_c_place random -particle_c_count 5 %s";

static void write_square(char path[], size_t len)
{
  PetscMPIInt rank;
  FILE       *file;

  OK(MPI_Comm_rank(PETSC_COMM_WORLD, &rank));
  snprintf(path, len, "/tmp/test_contactlaw.%d.%d.csv", (int)getpid(), (int)rank);
  OK(MPI_Bcast(path, (int)len, MPI_CHAR, 0, PETSC_COMM_WORLD));
  if (rank == 0) {
    file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "-0.09,-0.09\n0.09,-0.09\n0.09,0.09\n-0.09,0.09\n");
    assert_int_equal(fclose(file), 0);
  }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
}

/* Bodies of four shapes fly about in a closed box: momentum of the bodies changes only by what the walls give, and
   nothing overlaps by more than 2 % of its size. */
static void test_zoo(void **state)
{
  const PetscReal upper[3] = {2, 2, 1};
  char            options[1600], path[256];

  (void)state;
  write_square(path, sizeof(path));
  for (PetscInt law = 0; law < 2; law++)
    for (PetscInt walls = 0; walls < 16; walls += 15) {
      Fixture   f;
      PetscReal least = PETSC_MAX_REAL, sum[2] = {0, 0}, push = 0;
      PetscInt  met = 0;

      snprintf(options, sizeof(options), ZOO, path,
               law ? "-contact_law spring -contact_friction 0.3 -contact_range 0.02 -particle_c_velocity 1,0"
                   : "-contact_range 0.02");
      create_dry(&f, 2, 0.04, zero, upper, walls, options);
      for (PetscInt k = 0; k < f.s->n; k++)
        for (PetscInt a = 0; a < 2; a++) f.s->u[k][a] = 1 - f.s->x[k][a] + (a ? 0.4 : -0.4) * (k % 3 - 1);
      OK(ContactDestroy(&f.c)); /* the spring takes its scale from the first speeds */
      OK(ContactCreate(f.b, 0.04, 0, zero, zero, upper, walls, &f.c));
      for (PetscInt i = 0; i < (walls ? 150 : 60); i++) {
        PetscReal total[2] = {0, 0};

        OK(ContactAdvanceAlone(f.c, 0.01));
        least = PetscMin(least, smallest(&f, f.s->gap));
        met += smallest(&f, f.s->gap) < 0.02;
        for (PetscInt k = 0; k < f.s->n; k++)
          for (PetscInt a = 0; a < 2; a++) {
            total[a] += f.s->contact_force[k][a];
            push = PetscMax(push, PetscAbsReal(f.s->contact_force[k][a]));
          }
        for (PetscInt a = 0; a < 2; a++) sum[a] = PetscMax(sum[a], PetscAbsReal(total[a]));
      }
      assert_true(met > 20);
      if (!walls && !(sum[0] < 1e-12 * push && sum[1] < 1e-12 * push))
        fail_msg("momentum is lost: %g, %g of %g", (double)sum[0], (double)sum[1], (double)push);
      if (!(least > -0.02 * 0.14))
        fail_msg("law %d, walls %d: bodies overlap by %g", (int)law, (int)walls, (double)-least);
      for (PetscInt k = 0; k < f.s->n && walls; k++)
        for (PetscInt a = 0; a < 2; a++) assert_true(f.s->x[k][a] > 0 && f.s->x[k][a] < 2);
      destroy(&f);
    }
  OK(MPI_Barrier(PETSC_COMM_WORLD));
  (void)remove(path);
}

/* ---- search ---- */

/* The same motion, bit for bit, from lists with a skin as from lists that are made anew in every step, also across
   periodic faces, and no gap below those of all pairs is missed */
static void check_gaps(Fixture *f, PetscReal range, PetscBool periodic)
{
  evaluate(f);
  for (PetscInt i = 0; i < f->s->n; i++) {
    PetscReal least = PETSC_MAX_REAL;

    for (PetscInt j = 0; j < f->s->n; j++) {
      PetscReal d[2] = {f->s->x[i][0] - f->s->x[j][0], f->s->x[i][1] - f->s->x[j][1]};

      if (j == i) continue;
      if (periodic) d[0] -= PetscFloorReal(d[0] + 0.5);
      least = PetscMin(least, PetscSqrtReal(d[0] * d[0] + d[1] * d[1]) - f->s->group[f->s->body_group[i]].disc -
                                f->s->group[f->s->body_group[j]].disc);
    }
    if (least < range) assert_true(f->gap[i] <= least + 1e-12);
  }
}

static void test_search(void **state)
{
  (void)state;
  for (PetscInt periodic = 0; periodic < 2; periodic++) {
    const PetscReal range = 0.004, period[3] = {periodic, 0, 0};
    const PetscInt  walls = periodic ? 12 : 15;
    Fixture         f[2];
    PetscInt        searches = 0, tests[2], steps = 200;

    for (PetscInt fresh = 0; fresh < 2; fresh++) {
      create_dry(&f[fresh], 2, 0.008, down, one, walls,
                 "-particle_groups b,a -particle_a_shape circle -particle_a_radius 0.015 -particle_a_density 2 -particle_a_place random -particle_a_count 200 "
                 "-particle_b_shape circle -particle_b_radius 0.1 -particle_b_density 2 -particle_b_place random -particle_b_count 3 -contact_range 0.004");
      OK(ContactSetPeriod(f[fresh].c, period));
      for (PetscInt k = 0; k < f[fresh].s->n; k++) f[fresh].s->u[k][0] = 1 - 2 * f[fresh].s->x[k][1];
    }
    for (PetscInt i = 0; i < steps; i++) {
      OK(ContactDestroy(&f[1].c)); /* and its list */
      OK(ContactCreate(f[1].b, 0.008, 0, down, zero, one, walls, &f[1].c));
      OK(ContactSetPeriod(f[1].c, period));
      for (PetscInt fresh = 0; fresh < 2; fresh++) {
        OK(ContactAdvanceAlone(f[fresh].c, 1e-3));
        OK(ContactGetWork(f[fresh].c, &tests[fresh], NULL, NULL));
      }
      searches += tests[0] > 0;
      for (PetscInt k = 0; k < f[0].s->n; k++)
        for (PetscInt a = 0; a < 2; a++) {
          near(f[0].s->x[k][a], f[1].s->x[k][a], 0);
          near(f[0].s->contact_force[k][a], f[1].s->contact_force[k][a], 0);
        }
      if (i % 20 == 0) check_gaps(&f[0], range, (PetscBool)periodic);
    }
    assert_true(searches < steps);
    if (periodic) { /* two discs meet across the face */
      f[0].s->x[0][0] = 0.05, f[0].s->x[1][0] = 0.852;
      f[0].s->x[0][1] = f[0].s->x[1][1] = 0.5;
      evaluate(&f[0]);
      near(f[0].gap[1], PetscMin(f[0].gap[1], -0.002 + 1e-12), 1e-12);
    }
    destroy(&f[0]);
    destroy(&f[1]);
  }
}

/* ---- energy ---- */

static PetscReal kinetic(const Fixture *f, PetscReal height)
{
  PetscReal sum = 0;

  for (PetscInt k = 0; k < f->s->n; k++) {
    PetscReal m, in[6];

    OK(ContactGetMass(f->c, k, &m, in));
    sum += 0.5 * m * (PetscSqr(f->s->u[k][0]) + PetscSqr(f->s->u[k][1])) + 0.5 * in[2] * PetscSqr(f->s->w[k][2]) +
           10 * m * (f->s->x[k][1] - height);
  }
  return sum;
}

/* Kinetic, potential and stored energy add up: constant without losses; with damping and friction they fall, and the
   work of contact says by how much. */
static void test_energy(void **state)
{
  const char *laws[] = {"-contact_restitution 1", "-contact_restitution 0.5 -contact_friction 0.4"};

  (void)state;
  for (PetscInt lossy = 0; lossy < 2; lossy++) {
    char      options[512];
    Fixture   f;
    PetscReal first, last, stored, work, before = PETSC_MAX_REAL;

    snprintf(options, sizeof(options),
             "-particle_groups a -particle_a_shape circle -particle_a_radius 0.05 -particle_a_density 2 -particle_a_place random -particle_a_margin 0.011 -particle_a_lower 0.011,0.011 -particle_a_upper 0.989,0.989 -particle_a_count 30 "
             "-contact_law spring -contact_range 0.01 -contact_spring_stiffness 5000 %s",
             laws[lossy]);
    create_dry(&f, 2, 0.02, down, one, 15, options);
    first = kinetic(&f, 0);
    for (PetscInt i = 0; i < 400; i++) {
      OK(ContactAdvanceAlone(f.c, 2e-3));
      OK(ContactGetEnergy(f.c, &stored, &work));
      if (lossy) assert_true(stored + work < before + 0.005 * first);
      before = stored + work;
    }
    last = kinetic(&f, 0);
    near((last - first - work) / first, 0, 1e-9);
    if (lossy) assert_true(last + stored < 0.6 * first);
    else near((last + stored) / first, 1, 0.02);
    destroy(&f);
  }
}

/* ---- in a flow ---- */

/* A heavy disc meets the floor within one step: the impulse is (1 + e) times its momentum, of which the scheme wants
   `share` now and takes the rest from the next step; bodies end where they part. Without pull: e 0 too. */
static void test_impulse_of_a_step(void **state)
{
  const PetscReal     e[] = {0, 0.1, 0.5, 0.9, 1}, dt = 0.1, speed = 2;
  const ContactScheme scheme = {.weight = 1.5, .theta = 0.5, .implicit = PETSC_TRUE};

  (void)state;
  for (size_t i = 0; i < sizeof(e) / sizeof(e[0]); i++) {
    char                 options[512];
    Fixture              f;
    PetscReal            mass, now, after;
    PetscInt             n;
    const ContactSpring *spring;

    snprintf(options, sizeof(options),
             DISCS(1) "-contact_law spring -contact_range 0.001 -contact_restitution %g -contact_spring_stiffness 1e11",
             (double)e[i]);
    create(&f, 2, 0.1, zero, zero, one, 4, options);
    f.s->density[0] = 1e5;
    f.s->x[0][0]    = 0.5;
    f.s->x[0][1]    = BodiesGetRadius(f.c->state, 0) + 0.06;
    f.s->u[0][1]    = -speed;
    OK(ContactUpdateLocalBodies(f.c));
    OK(ContactSetScheme(f.c, &scheme));
    OK(ContactGetMass(f.c, 0, &mass, NULL));
    OK(ContactStep(f.c, dt, f.a, f.alpha));
    now = f.s->contact_force[0][1] * dt / (mass * speed);
    near(now, 1.5 * (1 + e[i]), 0.02);
    OK(ContactGetSprings(f.c, &n, &spring));
    assert_int_equal(n, 1);
    near(spring->value / spring->rate, e[i] * speed, 0.02 * speed);
    f.s->u_old[0][1] = f.s->u[0][1];
    f.s->u[0][1]     = e[i] * speed;
    f.s->x[0][1] += 0.5 * dt * speed * (e[i] - 1);
    OK(ContactFinishStep(f.c));
    near(f.s->gap[0], 0.001 + e[i] * speed * (dt - 0.059 / speed), 0.004);
    OK(ContactStep(f.c, dt, f.a, f.alpha));
    after = f.s->contact_force[0][1] * dt / (mass * speed);
    near(after, -0.5 * (1 + e[i]), 0.03);
    destroy(&f);
  }
}

/* ---- mistakes ---- */

static void refused(const char options[], const char what[])
{
  Fixture        f;
  PetscErrorCode got;

  OK(PetscOptionsClear(NULL));
  OK(PetscOptionsInsertString(NULL, options));
  OK(BodiesCreate(2, zero, one, &f.b));
  begin_error();
  got = ContactCreate(f.b, 0.1, 1, zero, zero, one, 0, &f.c);
  end_error();
  if (!got || !strstr(raised, what)) fail_msg("%s: got %d, '%s'", options, (int)got, raised);
  OK(BodiesDestroy(&f.b));
}

static void test_mistakes(void **state)
{
  (void)state;
  refused(DISCS(2) "-contact_law spring", "-contact_spring_stiffness");
  refused(DISCS(2) "-contact_law spring -contact_restitution 1.2", "-contact_restitution");
  refused(DISCS(2) "-contact_eps_overlap 1", "needs -contact_eps");
  refused(DISCS(2) "-contact_law none -contact_lubrication", "-contact_law");
  refused(DISCS(2) "-contact_law hard", "repulsive, spring, none");
}

/* The literal parameters of the method: force (Ri + Rj) (r - gap)^2/eps, overlap (Ri + Rj)/eps' */
static void test_eps(void **state)
{
  Fixture f;

  (void)state;
  create(&f, 2, 0.02, zero, zero, one, 1,
         DISCS(2) "-contact_range 0.02 -contact_eps 1e-3 -contact_eps_overlap 4e-3 -contact_wall_factor 2");
  f.s->x[0][0] = 0.105;
  f.s->x[1][0] = 0.105 + 0.2 + 0.01;
  f.s->x[0][1] = f.s->x[1][1] = 0.5;
  evaluate(&f);
  near(f.force[1][0], 0.2 * 1e-4 / 1e-3, 1e-12);
  near(f.force[0][0], 2 * 0.2 * PetscSqr(0.015) / 1e-3 - 0.2 * 1e-4 / 1e-3, 1e-12);
  f.s->x[1][0] = 0.105 + 0.2 - 0.01;
  evaluate(&f);
  near(f.force[1][0], 0.2 * 4e-4 / 1e-3 + 0.2 * 0.01 / 4e-3, 1e-12);
  destroy(&f);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_restitution),
                                     cmocka_unit_test(test_repulsive_restitution),
                                     cmocka_unit_test(test_sliding),
                                     cmocka_unit_test(test_slope),
                                     cmocka_unit_test(test_film),
                                     cmocka_unit_test(test_film_at_wall),
                                     cmocka_unit_test(test_film_recess),
                                     cmocka_unit_test(test_film_recess_in_steps),
                                     cmocka_unit_test(test_film_stops),
                                     cmocka_unit_test(test_zoo),
                                     cmocka_unit_test(test_search),
                                     cmocka_unit_test(test_energy),
                                     cmocka_unit_test(test_impulse_of_a_step),
                                     cmocka_unit_test(test_mistakes),
                                     cmocka_unit_test(test_eps)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (ShapeFinalize() || OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
