/* Elastic solids by themselves: the mesh of a disc has its area and lies on it, uniform deformations have uniform
   stress, and the beam of Turek & Hron's benchmark (CSM1, CSM3: Turek & Hron 2006) hangs and swings as published. */
/* ranks: 1 */
#include "core.h"
#include "solid/solid.h"
#include "base/algebra.h"

static const PetscReal BOX[2][3] = {{0, 0, 0}, {4, 4, 0}};

static const char beam[] =
  "-particle_groups flag -particle_flag_shape composite -particle_flag_parts beam,cylinder -particle_flag_beam_shape box "
  "-particle_flag_beam_size 0.4,0.02 -particle_flag_beam_offset 0.2,0 -particle_flag_cylinder_shape circle "
  "-particle_flag_cylinder_radius 0.05 -particle_flag_cylinder_operation difference -particle_flag_pivot 0,0 "
  "-particle_flag_position 0.2,0.2 -particle_flag_material st_venant_kirchhoff -particle_flag_poisson 0.4 "
  "-particle_flag_density 1000 -particle_flag_clamp (x-0.2)^2+(y-0.2)^2<0.0501^2 -particle_flag_watch 0.6,0.2 ";

static Solids open_beam(PetscReal modulus, PetscInt along, PetscInt across, SolidsState **s)
{
  char   options[2048];
  Solids b;

  snprintf(options, sizeof(options),
           "%s -particle_flag_shear_modulus %g -particle_flag_solid_cells %" PetscInt_FMT ",%" PetscInt_FMT, beam,
           (double)modulus, along, across);
  give(options);
  OK(SolidsCreate(PETSC_COMM_WORLD, 2, 0.01, BOX[0], BOX[1], &b));
  OK(SolidsGetState(b, s));
  return b;
}

/* Displacement of the watched tip */
static void get_tip(const SolidsState *s, PetscReal d[2])
{
  const PetscInt i = s->first[0] + s->group[0].watch[0];

  for (PetscInt a = 0; a < 2; a++) d[a] = s->x[2 * i + a] - s->X[2 * i + a];
}

static void test_disc(void **state)
{
  const PetscReal  F[4] = {1.2, 0.3, -0.1, 0.9}, J = 1.2 * 0.9 + 0.1 * 0.3;
  Solids           b;
  SolidsState     *s;
  SolidSums        sums;
  const SolidMesh *m;
  PetscReal        P[4], sum = 0;

  (void)state;
  give(
    "-particle_groups soft -particle_soft_shape circle -particle_soft_radius 0.3 -particle_soft_position 1,2 "
    "-particle_soft_material neo_hookean -particle_soft_shear_modulus 2 -particle_soft_poisson 0.3 -particle_soft_density 1.5");
  OK(SolidsCreate(PETSC_COMM_WORLD, 2, 0.1, BOX[0], BOX[1], &b));
  OK(SolidsGetState(b, &s));
  m = &s->group[0].mesh;
  NEAR(m->volume, PETSC_PI * 0.09, 2e-5 * 0.28);
  assert_true(m->ncell >= 16);
  for (PetscInt e = 0; e < 3 * m->nside; e++)
    NEAR(PetscHypotReal(m->X[2 * m->side[e]], m->X[2 * m->side[e] + 1]), 0.3, 1e-11);
  SolidsMeasure(b, 0, &sums);
  NEAR(sums.centroid[0], 1, 1e-6);
  NEAR(sums.centroid[1], 2, 1e-6);
  BELOW(sums.strain_energy, 1e-14);
  for (PetscInt i = 0; i < s->nnode; i++)
    for (PetscInt a = 0; a < 2; a++) s->x[2 * i + a] = F[2 * a] * s->X[2 * i] + F[2 * a + 1] * s->X[2 * i + 1];
  SolidsMeasure(b, 0, &sums);
  NEAR(sums.volume, J * m->volume, 1e-13);
  NEAR(sums.strain_energy, m->volume * SolidLawEnergy(2, &s->group[0].material, F), 1e-13);
  /* forces of a uniform stress: the sum of f x^T is P F^T times the area */
  (void)SolidLawStress(2, &s->group[0].material, F, P, NULL);
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[18], f[18];

    SolidGather(m, c, s->x, xc);
    NEAR(SolidCellForce(m, &s->group[0].material, c, xc, f, NULL), J, 1e-12);
    for (PetscInt j = 0; j < 9; j++) sum += f[2 * j] * xc[2 * j + 1];
  }
  NEAR(sum, m->volume * (P[0] * F[2] + P[1] * F[3]), 1e-12);
  OK(SolidsDestroy(&b));
}

/* Turek & Hron: -7.187, -66.10 mm; two cells across the beam, each two thirds as long, are to be within .5 %, four
   within .1 % */
static void test_csm1(void **state)
{
  const PetscReal gravity[2] = {0, -2}, within[2] = {5e-3, 1e-3};

  (void)state;
  for (PetscInt i = 0; i < 2; i++) {
    SolidsState *s;
    Solids       b = open_beam(0.5e6, i ? 104 : 52, i ? 4 : 2, &s);
    PetscReal    d[2];

    assert_int_equal(s->group[0].mesh.ncell, i ? 416 : 104);
    OK(SolidsAdvance(b, 1e4, gravity));
    get_tip(s, d);
    NEAR(d[0], -7.187e-3, within[i] * 7.187e-3);
    NEAR(d[1], -66.10e-3, within[i] * 66.10e-3);
    OK(SolidsDestroy(&b));
  }
}

/* Turek & Hron: uy -63.607 +- 65.160 mm, 1.0995 Hz, of which the first half period */
static void test_csm3(void **state)
{
  const PetscReal gravity[2] = {0, -2}, dt = 0.01;
  SolidsState    *s;
  Solids          b      = open_beam(0.5e6, 35, 2, &s);
  PetscReal       lowest = 0, when = 0;

  (void)state;
  for (PetscInt step = 1; step <= 60; step++) {
    PetscReal d[2];

    OK(SolidsAdvance(b, dt, gravity));
    get_tip(s, d);
    if (d[1] < lowest) when = (PetscReal)step * dt;
    lowest = PetscMin(lowest, d[1]);
  }
  NEAR(lowest, -128.767e-3, 0.01 * 128.767e-3);
  NEAR(when, 0.5 / 1.0995, dt);
  OK(SolidsDestroy(&b));
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_disc), cmocka_unit_test(test_csm1),
                                     cmocka_unit_test(test_csm3)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
