/* Membranes by themselves: the tangent of a law is the derivative of its stress, that the one of its energy; principal
   tensions are those of the textbooks; the surface of a shape is closed, with its area and volume; forces are the
   derivative of the energy; a volume that was lost comes back. */
/* ranks: 1 */
#include "core.h"
#include "lawcase.h"
#include "solid/solid.h"

static const SolidMaterial MATERIALS[] = {{.law = SOLID_MEMBRANE_NEO_HOOKEAN, .mu = 1.3},
                                          {.law = SOLID_MEMBRANE_NEO_HOOKEAN, .mu = 1.3, .area = 0.8},
                                          {.law = SOLID_MEMBRANE_SKALAK, .mu = 1.3, .area = 2.6},
                                          {.law = SOLID_MEMBRANE_ZERO_THICKNESS, .mu = 1.3}};
#define NMATERIALS 4

static void test_tangent(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++)
    for (PetscInt m = 0; m < NMATERIALS; m++) {
      const PetscInt n = dim * (dim - 1);
      PetscReal      F[6];

      for (PetscInt e = 0; e < n; e++) F[e] = (e % dim == 0) + 0.3 * noise(e + 5);
      check_tangent(dim, &MATERIALS[m], n, F);
    }
}

/* Principal tensions P F^T/J of stretches s, t as Barthes-Biesel, Diaz & Dhenin 2002 have them; none where nothing is
   stretched */
static void test_textbook(void **state)
{
  const PetscReal stretch[][2] = {{1.3, 0.9}, {2, 0.7}, {1.8, 1.5}}, rest[6] = {0, 1, 0, 0, 1, 0};
  PetscReal       P[6];

  (void)state;
  for (PetscInt k = 0; k < 3; k++) {
    const PetscReal s = stretch[k][0], t = stretch[k][1], J = s * t, F[6] = {0, t, 0, 0, s, 0};

    NEAR(SolidLawStress(3, &MATERIALS[0], F, P, NULL), J, 1e-14);
    NEAR(P[4] * s / J, 1.3 / J * (s * s - 1 / (J * J)), 1e-13);
    NEAR(P[1] * t / J, 1.3 / J * (t * t - 1 / (J * J)), 1e-13);
    (void)SolidLawStress(3, &MATERIALS[2], F, P, NULL);
    NEAR(P[4] * s / J, 1.3 / J * (s * s * (s * s - 1) + 2 * J * J * (J * J - 1)), 1e-13);
    (void)SolidLawStress(3, &MATERIALS[3], F, P, NULL);
    NEAR(P[4] * s / J, 1.3 / J * (s * s - 1 + PetscLogReal(J * J)), 1e-13);
    NEAR(P[1] * t / J, 1.3 / J * (t * t - 1 + PetscLogReal(J * J)), 1e-13);
  }
  for (PetscInt m = 0; m < NMATERIALS; m++) {
    (void)SolidLawStress(3, &MATERIALS[m], rest, P, NULL);
    for (PetscInt e = 0; e < 6; e++) BELOW(P[e], 1e-14);
    BELOW(SolidLawEnergy(3, &MATERIALS[m], rest), 1e-14);
  }
}

static Solids open_membrane(PetscInt dim, const char shape[], PetscReal size, SolidsState **s)
{
  char   options[2048];
  Solids b;

  snprintf(options, sizeof(options),
           "-particle_groups skin -particle_skin_position 1,2%s -particle_skin_material membrane -particle_skin_surface_modulus 2 "
           "-particle_skin_membrane_law skalak %s",
           dim == 3 ? ",3" : "", shape);
  give(options);
  OK(SolidsCreate(PETSC_COMM_WORLD, dim, size, (PetscReal[3]){0, 0, 0}, (PetscReal[3]){4, 4, 4}, &b));
  OK(SolidsGetState(b, s));
  return b;
}

/* Volume (fourth order in the size of cells), area and moments of a sphere; an ellipsoid that is turned; an ellipse */
static void test_surface(void **state)
{
  const PetscReal r = 0.7;
  PetscReal       coarse;
  SolidsState    *s;
  SolidSums       sums;
  Solids          b = open_membrane(3, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.2, &s);

  (void)state;
  assert_int_equal(s->nnode, s->group[0].mesh.ncell * 4 + 2); /* Euler: a sphere */
  SolidsMeasure(b, 0, &sums);
  coarse = s->group[0].mesh.volume - 4 * PETSC_PI / 3 * r * r * r;
  NEAR(sums.volume, s->group[0].mesh.volume, 1e-13);
  NEAR(sums.area, 4 * PETSC_PI * r * r, 1e-3);
  NEAR(sums.second[1], sums.volume * r * r / 5, 2e-5);
  NEAR(sums.centroid[2], 3, 1e-12);
  NEAR(sums.stretch_max, 1, 1e-7);
  OK(SolidsDestroy(&b));
  b = open_membrane(3, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.1, &s);
  assert_true(PetscAbsReal(s->group[0].mesh.volume - 4 * PETSC_PI / 3 * r * r * r) < PetscAbsReal(coarse) / 12);
  OK(SolidsDestroy(&b));
  b =
    open_membrane(3,
                  "-particle_skin_shape ellipse -particle_skin_a 0.8 -particle_skin_b 0.5 -particle_skin_c 0.3 -particle_skin_angle 0.4",
                  0.15, &s);
  NEAR(s->group[0].mesh.volume, 4 * PETSC_PI / 3 * 0.8 * 0.5 * 0.3, 2e-4);
  OK(SolidsDestroy(&b));
  b = open_membrane(2, "-particle_skin_shape ellipse -particle_skin_a 0.8 -particle_skin_b 0.5", 0.1, &s);
  SolidsMeasure(b, 0, &sums);
  NEAR(sums.volume, PETSC_PI * 0.8 * 0.5, 1e-4);
  NEAR(sums.second[0], PETSC_PI / 4 * 0.8 * 0.8 * 0.8 * 0.5, 1e-4);
  OK(SolidsDestroy(&b));
}

/* Of a membrane that is stirred: each node's force is the derivative of the energy, its tangent that of the force, and
   forces add up to nothing; the volume comes back */
static void test_force(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal  h = 1e-5;
    SolidsState     *s;
    Solids           b = open_membrane(dim, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.6, &s);
    const SolidMesh *m = &s->group[0].mesh;
    const PetscInt   n = m->nb * dim;
    PetscReal        x[SOLID_MAX_N], f[SOLID_MAX_N], up[SOLID_MAX_N], down[SOLID_MAX_N], K[SOLID_MAX_N * SOLID_MAX_N];
    PetscReal        sum[3] = {0, 0, 0}, mean[3], error;
    SolidSums        sums;

    for (PetscInt e = 0; e < dim * s->nnode; e++) s->x[e] += 0.03 * noise(e);
    for (PetscInt c = 0; c < m->ncell; c++) {
      SolidGather(m, c, s->x, x);
      (void)SolidCellForce(m, &s->group[0].material, c, x, f, K);
      for (PetscInt e = 0; e < n; e++) sum[e % dim] += f[e];
    }
    for (PetscInt a = 0; a < 3; a++) BELOW(sum[a], 1e-13);
    for (PetscInt e = 0; e < n; e++) {
      const PetscInt at = dim * m->cell_node[(m->ncell - 1) * m->nb + e / dim] + e % dim;
      PetscReal      energy[2], force = 0;

      x[e] += h;
      (void)SolidCellForce(m, &s->group[0].material, m->ncell - 1, x, up, NULL);
      x[e] -= 2 * h;
      (void)SolidCellForce(m, &s->group[0].material, m->ncell - 1, x, down, NULL);
      x[e] += h;
      for (PetscInt i = 0; i < n; i++) NEAR(K[i * n + e], (up[i] - down[i]) / (2 * h), 1e-6);
      for (PetscInt side = 0; side < 2; side++) {
        s->x[at] += side ? -2 * h : h;
        SolidsMeasure(b, 0, &sums);
        energy[side] = sums.strain_energy;
      }
      s->x[at] += h;
      for (PetscInt c = 0; c < m->ncell; c++) {
        PetscReal y[SOLID_MAX_N];

        SolidGather(m, c, s->x, y);
        (void)SolidCellForce(m, &s->group[0].material, c, y, up, NULL);
        for (PetscInt j = 0; j < m->nb; j++)
          if (dim * m->cell_node[c * m->nb + j] == at - e % dim) force += up[dim * j + e % dim];
      }
      NEAR(force, (energy[0] - energy[1]) / (2 * h), 1e-6);
    }
    OK(SolidKeepVolume(m, s->group[0].clamped, 0, s->x, &error));
    SolidsMeasure(b, 0, &sums);
    NEAR(sums.volume, m->volume, 1e-12);
    for (PetscInt e = 0; e < dim * s->nnode; e++) s->u[e] = e % dim + 1;
    SolidMeanVelocity(m, s->x, s->u, mean);
    for (PetscInt a = 0; a < dim; a++) NEAR(mean[a], (PetscReal)a + 1, 1e-12);
    OK(SolidsDestroy(&b));
  }
}

/* Bending: the energy of a circle and a sphere; forces are its derivative; the matrix is not negative and takes a
   uniform motion for nothing */
static void test_bending(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal  h = 1e-5, exact = dim == 2 ? PETSC_PI / 0.7 : 8 * PETSC_PI;
    SolidsState     *s;
    Solids           b = open_membrane(dim, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.15, &s);
    const SolidMesh *m = &s->group[0].mesh;
    PetscReal        coarse, energy[2], *f;

    coarse = SolidBend(m, 1, s->x, NULL) - exact;
    OK(SolidsDestroy(&b));
    b = open_membrane(dim, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.075, &s);
    BELOW(SolidBend(&s->group[0].mesh, 1, s->x, NULL) - exact, PetscAbsReal(coarse) / 3.5);
    OK(SolidsDestroy(&b));
    b = open_membrane(dim, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.5, &s);
    m = &s->group[0].mesh;
    for (PetscInt e = 0; e < dim * s->nnode; e++) s->x[e] += 0.02 * noise(e);
    OK(PetscCalloc1(dim * s->nnode, &f));
    (void)SolidBend(m, 1.7, s->x, f);
    for (PetscInt i = 0; i < s->nnode; i++) {
      PetscReal sum = 0;

      for (PetscInt e = m->around[i]; e < m->around[i + 1]; e++) sum += m->laplace[e];
      BELOW(sum, 1e-10);
    }
    for (PetscInt e = 0; e < dim * s->nnode; e += 7) {
      for (PetscInt side = 0; side < 2; side++) {
        s->x[e] += side ? -2 * h : h;
        energy[side] = SolidBend(m, 1.7, s->x, NULL);
      }
      s->x[e] += h;
      NEAR(f[e], (energy[0] - energy[1]) / (2 * h), 1e-5 * (1 + PetscAbsReal(f[e])));
    }
    OK(PetscFree(f));
    OK(SolidsDestroy(&b));
  }
}

/* The area as a whole: its derivative; with a tension the force on a node has that of it, and its tangent; an ellipse,
   and an ellipsoid, gets a volume and an area together, a sphere, which has none of less, its volume alone */
static void test_area(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal h = 1e-5;
    SolidsState    *s;
    Solids b = open_membrane(dim, "-particle_skin_shape ellipse -particle_skin_a 0.8 -particle_skin_b 0.5", 0.4, &s);
    const SolidMesh *m   = &s->group[0].mesh;
    SolidMaterial    law = s->group[0].material;
    PetscReal        x[SOLID_MAX_N], f[SOLID_MAX_N], without[SOLID_MAX_N], up[SOLID_MAX_N], down[SOLID_MAX_N];
    PetscReal        K[SOLID_MAX_N * SOLID_MAX_N], *l, *all, *work, area[2], error;
    SolidSums        sums;

    OK(PetscCalloc3(dim * s->nnode, &l, dim * s->nnode, &all, dim * s->nnode, &work));
    for (PetscInt e = 0; e < dim * s->nnode; e++) s->x[e] += 0.02 * noise(e);
    SolidsMeasure(b, 0, &sums);
    NEAR(SolidFindArea(m, s->x, l), sums.area, 1e-13);
    for (PetscInt e = 0; e < dim * s->nnode; e += 5) {
      for (PetscInt side = 0; side < 2; side++) {
        s->x[e] += side ? -2 * h : h;
        area[side] = SolidFindArea(m, s->x, work);
      }
      s->x[e] += h;
      NEAR(l[e], (area[0] - area[1]) / (2 * h), 1e-8);
    }
    for (PetscInt c = 0; c < m->ncell; c++) {
      SolidGather(m, c, s->x, x);
      law.tension = 0;
      (void)SolidCellForce(m, &law, c, x, without, NULL);
      law.tension = 0.7;
      (void)SolidCellForce(m, &law, c, x, f, K);
      for (PetscInt j = 0; j < m->nb * dim; j++)
        all[dim * m->cell_node[c * m->nb + j / dim] + j % dim] += (f[j] - without[j]) / 0.7;
    }
    for (PetscInt e = 0; e < dim * s->nnode; e++) NEAR(all[e], l[e], 1e-12);
    for (PetscInt e = 0; e < m->nb * dim; e++) {
      x[e] += h;
      (void)SolidCellForce(m, &law, m->ncell - 1, x, up, NULL);
      x[e] -= 2 * h;
      (void)SolidCellForce(m, &law, m->ncell - 1, x, down, NULL);
      x[e] += h;
      for (PetscInt i = 0; i < m->nb * dim; i++) NEAR(K[i * m->nb * dim + e], (up[i] - down[i]) / (2 * h), 1e-6);
    }
    OK(SolidKeepVolume(m, s->group[0].clamped, 1.02 * m->area, s->x, &error));
    SolidsMeasure(b, 0, &sums);
    NEAR(sums.volume, m->volume, 1e-12);
    NEAR(sums.area, 1.02 * m->area, 1e-12);
    OK(PetscFree3(l, all, work));
    OK(SolidsDestroy(&b));
    b = open_membrane(dim, "-particle_skin_shape circle -particle_skin_radius 0.7", 0.3, &s);
    for (PetscInt e = 0; e < dim * s->nnode; e++) s->x[e] *= 1.001;
    OK(SolidKeepVolume(&s->group[0].mesh, s->group[0].clamped, s->group[0].mesh.area, s->x, &error));
    SolidsMeasure(b, 0, &sums);
    NEAR(sums.volume, s->group[0].mesh.volume, 1e-12);
    for (PetscInt e = 0; e < dim * s->nnode; e += dim)
      s->x[e] *= 1.02; /* an ellipse: 2 % less than a circle's cannot be */
    OK(SolidKeepVolume(&s->group[0].mesh, s->group[0].clamped, 0.98 * s->group[0].mesh.area, s->x, &error));
    SolidsMeasure(b, 0, &sums);
    NEAR(sums.volume, s->group[0].mesh.volume, 1e-12);
    NEAR(sums.stretch_max, 1.01, 0.02);
    OK(SolidsDestroy(&b));
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_tangent), cmocka_unit_test(test_textbook),
                                     cmocka_unit_test(test_surface), cmocka_unit_test(test_force),
                                     cmocka_unit_test(test_bending), cmocka_unit_test(test_area)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
