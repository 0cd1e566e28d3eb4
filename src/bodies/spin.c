/* Spin: see spin.h. */
#include "compat.h"
#include "base/algebra.h"
#include "bodies/spin.h"

#define MAX_IT 60 /* iterations; each gains a factor of at least two for turns below 1 rad */

static PetscReal norm3(const PetscReal v[3])
{
  return PetscSqrtReal(dot3(v, v));
}

/* turn, and v: the angular velocity after it as the beginning sees it */
static void mean_turn(PetscReal dt, const PetscReal w[3], const PetscReal v[3], PetscReal turn[3])
{
  for (PetscInt a = 0; a < 3; a++) turn[a] = 0.5 * dt * (w[a] + v[a]);
}

/* With v = R^T w' the step is I v = R^T L, L = I w + dt T. The change of R^T L with v is taken as that of a small turn,
   m x (dt/2 dv), m = R^T L. */
void BodySpin(PetscReal dt, const PetscReal inertia[6], const PetscReal T[3], PetscReal w[3])
{
  PetscReal L[3], v[3] = {w[0], w[1], w[2]}, turn[3];

  apply_tensor(inertia, w, L);
  for (PetscInt a = 0; a < 3; a++) L[a] += dt * T[a];
  for (PetscInt it = 0; it < MAX_IT; it++) {
    PetscReal m[3], Iv[3], r[3], J[9], e[3];

    mean_turn(dt, w, v, turn);
    RotationApply(turn, -1, L, m);
    apply_tensor(inertia, v, Iv);
    for (PetscInt a = 0; a < 3; a++) r[a] = m[a] - Iv[a];
    for (PetscInt c = 0; c < 3; c++) {
      const PetscReal unit[3] = {c == 0, c == 1, c == 2};
      PetscReal       Ie[3], change[3];

      apply_tensor(inertia, unit, Ie);
      cross(m, unit, change);
      for (PetscInt a = 0; a < 3; a++) J[3 * a + c] = Ie[a] - 0.5 * dt * change[a];
    }
    solve3(J, r, e);
    for (PetscInt a = 0; a < 3; a++) v[a] += e[a];
    if (norm3(e) <= 4 * PETSC_MACHINE_EPSILON * norm3(v)) break;
  }
  mean_turn(dt, w, v, turn);
  RotationApply(turn, 1, v, w);
}

void BodyTurn(PetscReal dt, const PetscReal w_old[3], const PetscReal w[3], PetscReal turn[3])
{
  PetscReal change = PETSC_MAX_REAL;

  mean_turn(dt, w_old, w, turn);
  for (PetscInt it = 0; it < MAX_IT && change > 2 * PETSC_MACHINE_EPSILON * norm3(turn); it++) {
    PetscReal v[3], next[3], d[3];

    RotationApply(turn, -1, w, v);
    mean_turn(dt, w_old, v, next);
    for (PetscInt a = 0; a < 3; a++) {
      d[a]    = next[a] - turn[a];
      turn[a] = next[a];
    }
    change = norm3(d);
  }
}
