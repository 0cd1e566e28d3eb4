/* Rotations: unit quaternions (w, x, y, z) in the 3D interface; a plane rotation by angle a is (cos a/2, 0, 0, sin a/2).
   All functions are local and cheap (inline). */
#pragma once
#include <petscsys.h>

static inline void RotationFromAngle(PetscReal angle, PetscReal q[4])
{
  q[0] = PetscCosReal(0.5 * angle);
  q[1] = q[2] = 0;
  q[3]        = PetscSinReal(0.5 * angle);
}

/* R [3][3], row-major: x_space = R x_body */
static inline void RotationMatrix(const PetscReal q[4], PetscReal R[9])
{
  const PetscReal w = q[0], x = q[1], y = q[2], z = q[3];

  R[0] = 1 - 2 * (y * y + z * z);
  R[1] = 2 * (x * y - w * z);
  R[2] = 2 * (x * z + w * y);
  R[3] = 2 * (x * y + w * z);
  R[4] = 1 - 2 * (x * x + z * z);
  R[5] = 2 * (y * z - w * x);
  R[6] = 2 * (x * z - w * y);
  R[7] = 2 * (y * z + w * x);
  R[8] = 1 - 2 * (x * x + y * y);
}

/* q <- exp(dt w / 2) q, renormalised; w is the angular velocity in space axes (rad/s), constant during dt */
static inline void RotationAdvance(PetscReal dt, const PetscReal w[3], PetscReal q[4])
{
  const PetscReal rate = PetscSqrtReal(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), half = 0.5 * dt * rate;
  const PetscReal s = rate > 0 ? PetscSinReal(half) / rate : 0, e0 = PetscCosReal(half);
  const PetscReal e[3] = {s * w[0], s * w[1], s * w[2]};
  const PetscReal a = q[0], b = q[1], c = q[2], d = q[3];

  q[0]              = e0 * a - e[0] * b - e[1] * c - e[2] * d;
  q[1]              = e0 * b + e[0] * a + e[1] * d - e[2] * c;
  q[2]              = e0 * c - e[0] * d + e[1] * a + e[2] * b;
  q[3]              = e0 * d + e[0] * c - e[1] * b + e[2] * a;
  const PetscReal n = 1 / PetscSqrtReal(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; i++) q[i] *= n;
}
