/* Rigid: slots, and the three forms of V + w x r against the cross product. */
#include "base/algebra.h"
#include "base/rigid.h"
#include "core.h"

static void test_forms(void **state)
{
  const PetscReal full[6] = {0.3, -1.7, 2.9, 0.6, -0.8, 1.1}, arm[3] = {1.3, -0.4, 0.7};

  (void)state;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const PetscReal r[3] = {arm[0], arm[1], dim == 3 ? arm[2] : 0};
    const PetscInt  nr   = RigidSize(dim);
    PetscReal       u[3] = {0, 0, 0}, w[3] = {0, 0, 0}, want[3], v[3], S[3], M[18];

    assert_int_equal(nr, dim == 2 ? 3 : 6);
    for (PetscInt s = 0; s < nr; s++) *RigidComponent(dim, u, w, s) = full[s];
    for (PetscInt s = 0; s < nr; s++) assert_true(RigidValue(dim, u, w, s) == full[s]);
    assert_true(dim == 3 || (u[2] == 0 && w[0] == 0 && w[1] == 0 && w[2] == full[2]));
    cross(w, r, want);
    RigidVelocityAt(dim, full, r, v);
    RigidMapFill(dim, 1, r, M);
    for (PetscInt a = 0; a < dim; a++) {
      PetscReal by_row = full[a], by_map = 0;

      RigidSpinRow(dim, a, r, S);
      for (PetscInt b = 0; b < nr - dim; b++) by_row += S[b] * full[dim + b];
      for (PetscInt s = 0; s < nr; s++) by_map += M[a * nr + s] * full[s];
      NEAR(v[a], u[a] + want[a], 1e-15);
      NEAR(by_row, v[a], 1e-15);
      NEAR(by_map, v[a], 1e-15);
    }
  }
}

int main(int argc, char **argv)
{
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_forms)};
  int                     failed;

  PetscCall(PetscInitialize(&argc, &argv, NULL, NULL));
  failed = cmocka_run_group_tests_name("rigid", tests, NULL, NULL);
  PetscCall(PetscFinalize());
  return failed;
}
