/* Laws of elastic solids: the tangent is the derivative of the stress, the stress that of the energy, in the plane and
   in space; a rotation costs nothing; simple shear and stretch have the stresses of the textbooks. */
/* ranks: 1 */
#include "core.h"
#include "lawcase.h"

static const SolidMaterial MATERIALS[] = {{.law = SOLID_NEO_HOOKEAN, .mu = 1.3},
                                          {.law = SOLID_NEO_HOOKEAN, .mu = 1.3, .lambda = 2.1},
                                          {.law = SOLID_NEO_HOOKEAN, .mu = 1.3, .lambda = 2.1, .kappa = 0.7},
                                          {.law = SOLID_ST_VENANT_KIRCHHOFF, .mu = 1.3, .lambda = 2.1},
                                          {.law = SOLID_ST_VENANT_KIRCHHOFF, .mu = 1.3, .lambda = 2.1, .kappa = 2.1},
                                          {.law = SOLID_NEO_HOOKEAN, .mu = 1.3, .bulk = 13},
                                          {.law = SOLID_ST_VENANT_KIRCHHOFF, .mu = 1.3, .bulk = 13}};
#define NMATERIALS 7

static void some_gradient(PetscInt dim, PetscReal F[])
{
  for (PetscInt e = 0; e < dim * dim; e++) F[e] = (e % (dim + 1) == 0) + 0.3 * noise(e + 5);
}

static void test_tangent(void **state)
{
  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++)
    for (PetscInt m = 0; m < NMATERIALS; m++) {
      PetscReal F[9];

      some_gradient(dim, F);
      check_tangent(dim, &MATERIALS[m], dim * dim, F);
    }
}

static void test_rotation(void **state)
{
  const PetscReal F[4] = {PetscCosReal(0.7), -PetscSinReal(0.7), PetscSinReal(0.7), PetscCosReal(0.7)};

  (void)state;
  for (PetscInt m = 0; m < NMATERIALS; m++) {
    PetscReal P[4];

    NEAR(SolidLawStress(2, &MATERIALS[m], F, P, NULL), 1, 1e-15);
    for (PetscInt e = 0; e < 4; e++) BELOW(P[e], 1e-14);
    BELOW(SolidLawEnergy(2, &MATERIALS[m], F), 1e-14);
  }
}

/* Cauchy stress of a neo-Hookean solid in simple shear g: mu (g^2, g; g, 0), since J = 1. Of St. Venant-Kirchhoff
   stretched by s along x alone: S_xx = (lambda/2 + mu)(s^2 - 1), P_xx = s S_xx */
static void test_textbook(void **state)
{
  const PetscReal g = 0.4, F[4] = {1, g, 0, 1}, s = 1.3, stretch[4] = {s, 0, 0, 1};
  PetscReal       P[4];

  (void)state;
  (void)SolidLawStress(2, &MATERIALS[1], F, P, NULL);
  NEAR(P[0] * F[0] + P[1] * F[1], 1.3 * g * g, 1e-14); /* P F^T */
  NEAR(P[0] * F[2] + P[1] * F[3], 1.3 * g, 1e-14);
  BELOW(P[2] * F[2] + P[3] * F[3], 1e-14);
  (void)SolidLawStress(2, &MATERIALS[3], stretch, P, NULL);
  NEAR(P[0], s * (0.5 * 2.1 + 1.3) * (s * s - 1), 1e-14);
  NEAR(P[3], 0.5 * 2.1 * (s * s - 1), 1e-14);
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_tangent), cmocka_unit_test(test_rotation),
                                     cmocka_unit_test(test_textbook)};
  int                     failed;

  if (PetscInitialize(&argc, &argv, NULL, NULL)) return 1;
  failed = cmocka_run_group_tests(tests, NULL, NULL);
  if (OptFinalize() || PetscFinalize()) return 1;
  return failed;
}
