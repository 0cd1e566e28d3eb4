/* Elastic solids in space, by themselves: the mesh of a ball fills it and its faces look outwards, forces are the
   derivative of the energy and their tangent that of the forces, uniform deformations have uniform stress, and a bar
   that is pulled or sheared has the stress of the law. */
/* ranks: 1 */
#include "core.h"
#include "solid/solid.h"
#include "base/algebra.h"
#include "fem/element.h"
#include "fem/gauss.h"

#define SOFT \
  "-particle_groups soft -particle_soft_position 1,2,3 -particle_soft_shear_modulus 2 -particle_soft_density 1.5 "
static const char *const LAWS[] = {"-particle_soft_material neo_hookean -particle_soft_poisson 0.3 ",
                                   "-particle_soft_material st_venant_kirchhoff -particle_soft_poisson 0.3 "};

static Solids open_solid(const char shape[], PetscInt law, PetscReal size, SolidsState **s)
{
  char   options[2048];
  Solids b;

  snprintf(options, sizeof(options), SOFT "%s %s", LAWS[law], shape);
  give(options);
  OK(SolidsCreate(PETSC_COMM_WORLD, 3, size, (PetscReal[3]){0, 0, 0}, (PetscReal[3]){4, 4, 4}, &b));
  OK(SolidsGetState(b, s));
  return b;
}

static void deform(SolidsState *s, const PetscReal F[9])
{
  for (PetscInt i = 0; i < s->nnode; i++)
    for (PetscInt a = 0; a < 3; a++) {
      s->x[3 * i + a] = 0;
      for (PetscInt e = 0; e < 3; e++) s->x[3 * i + a] += F[3 * a + e] * s->X[3 * i + e];
    }
}

/* Flux of x/3 through a solid's faces: its volume */
static PetscReal flux(const SolidMesh *m, const PetscReal x[])
{
  PetscReal sum = 0;

  for (PetscInt f = 0; f < m->nside; f++)
    for (PetscInt q = 0; q < 9; q++) {
      const PetscReal xi[2] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3]};
      PetscReal       phi[9], dphi[18], at[3] = {0}, t[2][3] = {{0}}, n[3];

      ElementBasis(2, xi, phi, dphi);
      for (PetscInt j = 0; j < 9; j++)
        for (PetscInt a = 0; a < 3; a++) {
          const PetscReal v = x[3 * m->side[9 * f + j] + a];

          at[a] += phi[j] * v;
          for (PetscInt e = 0; e < 2; e++) t[e][a] += dphi[9 * e + j] * v;
        }
      cross(t[0], t[1], n);
      sum += GAUSS3_WEIGHT[q % 3] * GAUSS3_WEIGHT[q / 3] * dot3(at, n) / 3;
    }
  return sum;
}

/* No cell is flat at a corner, one face of a cell at most is on the surface */
static void check_cells(const SolidMesh *m)
{
  PetscInt *faces;

  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[81], least = PETSC_MAX_REAL, largest = 0;

    SolidGather(m, c, m->X, xc);
    for (PetscInt q = 0; q < m->nq; q++) {
      const PetscReal xi[3] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3 % 3], GAUSS3_POINT[q / 9]};
      PetscReal       x[3], J[9], det;

      ElementMap(3, xc, xi, x, J);
      det     = DenseDeterminant(3, J);
      least   = PetscMin(least, det);
      largest = PetscMax(largest, det);
    }
    assert_true(least > 0.1 * largest);
  }
  OK(PetscCalloc1(m->ncell, &faces));
  for (PetscInt c = 0; c < m->ncell; c++)
    for (PetscInt f = 0; f < m->nside; f++)
      for (PetscInt j = 0; j < 27; j++) faces[c] += m->cell_node[27 * c + j] == m->side[9 * f + 4];
  for (PetscInt c = 0; c < m->ncell; c++) assert_true(faces[c] <= 1);
  OK(PetscFree(faces));
}

/* The patch test: of a uniform deformation nothing is left at nodes that are not on the surface, and no force in all */
static void check_inside(const SolidsState *s)
{
  const SolidMesh *m = &s->group[0].mesh;
  PetscReal       *sum, all[3] = {0, 0, 0};
  PetscBool       *outside;
  PetscInt         inside = 0;

  OK(PetscCalloc2(3 * m->nnode, &sum, m->nnode, &outside));
  for (PetscInt e = 0; e < 9 * m->nside; e++) outside[m->side[e]] = PETSC_TRUE;
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[81], f[81];

    SolidGather(m, c, s->x, xc);
    (void)SolidCellForce(m, &s->group[0].material, c, xc, f, NULL);
    for (PetscInt e = 0; e < 81; e++) sum[3 * m->cell_node[27 * c + e / 3] + e % 3] += f[e];
  }
  for (PetscInt e = 0; e < 3 * m->nnode; e++) {
    all[e % 3] += sum[e];
    inside += !outside[e / 3];
    if (!outside[e / 3]) BELOW(sum[e], 1e-14);
  }
  for (PetscInt a = 0; a < 3; a++) BELOW(all[a], 1e-14);
  assert_true(inside > 3);
  OK(PetscFree2(sum, outside));
}

static void test_ball(void **state)
{
  const PetscReal  F[9] = {1.2, 0.3, 0, -0.1, 0.9, 0.2, 0.1, 0, 1.1}, J = DenseDeterminant(3, F);
  SolidsState     *s;
  SolidSums        sums;
  const SolidMesh *m;
  PetscReal        P[9], sum[9] = {0};
  Solids           b;

  (void)state;
  b = open_solid("-particle_soft_shape circle -particle_soft_radius 0.3", 0, 0.12, &s);
  m = &s->group[0].mesh;
  print_message("ball: %d cells, %d nodes, %d faces, volume off by %.2e\n", (int)m->ncell, (int)m->nnode, (int)m->nside,
                (double)(m->volume / (4 * PETSC_PI / 3 * 0.027) - 1));
  NEAR(m->volume, 4 * PETSC_PI / 3 * 0.027, 1e-3 * 0.113);
  check_cells(m);
  for (PetscInt e = 0; e < 9 * m->nside; e++) {
    const PetscReal *X = m->X + 3 * m->side[e];

    NEAR(PetscSqrtReal(dot3(X, X)), 0.3, 1e-9);
  }
  NEAR(flux(m, m->X), m->volume, 1e-12); /* cells of degree 2 an axis: both are exact */
  SolidsMeasure(b, 0, &sums);
  for (PetscInt a = 0; a < 3; a++) NEAR(sums.centroid[a], 1 + a, 1e-6);
  for (PetscInt e = 0; e < 6; e++) NEAR(sums.second[e], e < 3 ? m->volume * 0.09 / 5 : 0, 1e-3 * m->volume * 0.09 / 5);
  BELOW(sums.strain_energy, 1e-14);
  deform(s, F);
  SolidsMeasure(b, 0, &sums);
  NEAR(sums.volume, J * m->volume, 1e-13);
  NEAR(sums.strain_energy, m->volume * SolidLawEnergy(3, &s->group[0].material, F), 1e-13);
  (void)SolidLawStress(3, &s->group[0].material, F, P, NULL);
  for (PetscInt c = 0; c < m->ncell; c++) {
    PetscReal xc[81], f[81];

    SolidGather(m, c, s->x, xc);
    NEAR(SolidCellForce(m, &s->group[0].material, c, xc, f, NULL), J, 1e-11);
    for (PetscInt e = 0; e < 9 * 27; e++) sum[e % 9] += f[3 * (e / 9) + e % 9 / 3] * xc[3 * (e / 9) + e % 3];
  }
  check_inside(s);
  for (PetscInt e = 0; e < 9; e++) { /* the sum of f x^T is P F^T times the volume */
    PetscReal want = 0;

    for (PetscInt A = 0; A < 3; A++) want += P[e / 3 * 3 + A] * F[e % 3 * 3 + A];
    NEAR(sum[e], m->volume * want, 1e-12);
  }
  OK(SolidsDestroy(&b));
}

/* Largest stretch of R diag(0.9, 1.37, 0.9), and of a rotation */
static void test_stretch(void **state)
{
  SolidsState *s;
  SolidSums    sums;
  Solids       b    = open_solid("-particle_soft_shape box -particle_soft_size 1,1,1", 0, 0.5, &s);
  PetscReal    q[4] = {0.5, 0.5, 0.5, 0.5}, R[9], F[9];

  (void)state;
  RotationAdvance(0.3, ((const PetscReal[3]){1, 2, 3}), q);
  RotationMatrix(q, R);
  for (PetscInt e = 0; e < 9; e++) F[e] = R[e] * (e % 3 == 1 ? 1.37 : 0.9);
  deform(s, F);
  SolidsMeasure(b, 0, &sums);
  NEAR(sums.stretch_max, 1.37, 1e-12);
  deform(s, R);
  SolidsMeasure(b, 0, &sums);
  NEAR(sums.stretch_max, 1, 1e-7);
  BELOW(sums.strain_energy, 1e-13);
  OK(SolidsDestroy(&b));
}

/* Energy of a cell, its forces and their tangent by differences, at positions without symmetry */
static void test_tangent(void **state)
{
  const PetscReal h = 1e-5;

  (void)state;
  for (PetscInt law = 0; law < 2; law++) {
    SolidsState         *s;
    Solids               b = open_solid("-particle_soft_shape circle -particle_soft_radius 0.3", law, 0.2, &s);
    const SolidMesh     *m = &s->group[0].mesh;
    const SolidMaterial *w = &s->group[0].material;
    PetscReal            x[81], f[81], K[81 * 81], up[81], down[81], energy[2];

    SolidGather(m, m->ncell / 2, s->X, x);
    for (PetscInt e = 0; e < 81; e++) x[e] += 0.01 * noise(e);
    (void)SolidCellForce(m, w, m->ncell / 2, x, f, K);
    for (PetscInt e = 0; e < 81; e += 5) {
      for (PetscInt side = 0; side < 2; side++) {
        const PetscReal keep = x[e];

        x[e] += side ? h : -h;
        (void)SolidCellForce(m, w, m->ncell / 2, x, side ? up : down, NULL);
        energy[side] = 0;
        for (PetscInt q = 0; q < m->nq; q++) {
          PetscReal F[9];

          (void)SolidGradient(m, m->ncell / 2, q, x, F);
          energy[side] += m->weight[m->ncell / 2 * m->nq + q] * SolidLawEnergy(3, w, F);
        }
        x[e] = keep;
      }
      NEAR(f[e], (energy[1] - energy[0]) / (2 * h), 1e-7);
      for (PetscInt i = 0; i < 81; i++) NEAR(K[81 * i + e], (up[i] - down[i]) / (2 * h), 2e-6 * 2);
    }
    OK(SolidsDestroy(&b));
  }
}

/* A bar that hangs under its weight by its upper end: at half its height the stress is the weight below it; one that
   holds its width at both ends has the exact length of the rod in the limit of a small load, rho g L^2/(2 E) */
static void test_bar(void **state)
{
  const PetscReal gravity[3] = {0, 0, -1e-3}, E = 2 * 2 * (1 + 0.3), want = 1.5 * 1e-3 * 16 / (2 * E);

  (void)state;
  for (PetscInt law = 0; law < 2; law++) {
    SolidsState *s;
    Solids   b = open_solid("-particle_soft_shape box -particle_soft_size 0.2,0.2,4 -particle_soft_solid_cells 2,2,20 "
                              "-particle_soft_clamp z-4.999 -particle_soft_watch 1,2,1",
                            law, 0.1, &s);
    PetscInt i;

    OK(SolidsAdvance(b, 1e6, gravity));
    i = 3 * s->group[0].watch[0];
    NEAR(s->x[i + 2] - s->X[i + 2], -want, 0.01 * want);
    BELOW(s->x[i] - s->X[i], 1e-4 * want);
    OK(SolidsDestroy(&b));
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_ball), cmocka_unit_test(test_stretch),
                                     cmocka_unit_test(test_tangent), cmocka_unit_test(test_bar)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
