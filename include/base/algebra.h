/* Algebra: vectors of three, tiny matrices (blocks of bodies and cells, Jacobians) and rotations. All functions are
   local and cheap (inline).

   Rotations are unit quaternions (w, x, y, z); a plane rotation by the angle a is (cos a/2, 0, 0, sin a/2).
   A symmetric tensor is xx yy zz xy xz yz. */
#pragma once
#include <petscsys.h>

static inline PetscReal dot3(const PetscReal a[3], const PetscReal b[3])
{
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void cross(const PetscReal a[3], const PetscReal b[3], PetscReal c[3])
{
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void apply_tensor(const PetscReal t[6], const PetscReal v[3], PetscReal tv[3])
{
  tv[0] = t[0] * v[0] + t[3] * v[1] + t[4] * v[2];
  tv[1] = t[3] * v[0] + t[1] * v[1] + t[5] * v[2];
  tv[2] = t[4] * v[0] + t[5] * v[1] + t[2] * v[2];
}

/* The inertia of a point mass at r is added: M (r^2 1 - r r^T), Steiner's term of a body with the centre r */
static inline void add_point_inertia(PetscReal mass, const PetscReal r[3], PetscReal inertia[6])
{
  static const PetscInt row[6] = {0, 1, 2, 0, 0, 1}, col[6] = {0, 1, 2, 1, 2, 2};
  const PetscReal       square = dot3(r, r);

  for (PetscInt i = 0; i < 6; i++) inertia[i] += mass * ((row[i] == col[i] ? square : 0) - r[row[i]] * r[col[i]]);
}

/* ---- tiny matrices ---- */

#define DENSE_MAX 6

/* y = M x, or M^T x; M [n][n] */
static inline void DenseMultiply(PetscInt n, const PetscReal M[], PetscBool transposed, const PetscReal x[],
                                 PetscReal y[])
{
  for (PetscInt a = 0; a < n; a++) {
    y[a] = 0;
    for (PetscInt b = 0; b < n; b++) y[a] += M[transposed ? b * n + a : a * n + b] * x[b];
  }
}

/* inv = M^{-1} by Gauss-Jordan, which needs no pivoting for definite matrices; M and inv [n][n], n <= DENSE_MAX, may
   not be the same array */
static inline void DenseInvert(PetscInt n, const PetscReal M[], PetscReal inv[])
{
  PetscReal a[DENSE_MAX * DENSE_MAX];

  for (PetscInt i = 0; i < n * n; i++) {
    a[i]   = M[i];
    inv[i] = i % (n + 1) == 0;
  }
  for (PetscInt k = 0; k < n; k++) {
    const PetscReal pivot = 1 / a[k * n + k];

    for (PetscInt j = 0; j < n; j++) {
      a[k * n + j] *= pivot;
      inv[k * n + j] *= pivot;
    }
    for (PetscInt i = 0; i < n; i++) {
      const PetscReal factor = a[i * n + k];

      if (i == k || factor == 0) continue;
      for (PetscInt j = 0; j < n; j++) {
        a[i * n + j] -= factor * a[k * n + j];
        inv[i * n + j] -= factor * inv[k * n + j];
      }
    }
  }
}

/* L [n][n] lower triangular with L L^T = M, M symmetric and positive semidefinite; rows of M that are zero (fixed
   degrees of freedom) stay zero */
static inline void DenseFactor(PetscInt n, const PetscReal M[], PetscReal L[])
{
  for (PetscInt j = 0; j < n; j++) {
    for (PetscInt i = 0; i < n; i++) {
      PetscReal sum = M[i * n + j];

      for (PetscInt k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
      if (i < j) L[i * n + j] = 0;
      else if (i == j) L[i * n + j] = sum > 0 ? PetscSqrtReal(sum) : 0;
      else L[i * n + j] = L[j * n + j] > 0 ? sum / L[j * n + j] : 0;
    }
  }
}

/* Determinant of the Jacobian J [dim][dim] of a map in 2 or 3 dimensions */
static inline PetscReal DenseDeterminant(PetscInt dim, const PetscReal J[])
{
  if (dim == 2) return J[0] * J[3] - J[1] * J[2];
  return J[0] * (J[4] * J[8] - J[5] * J[7]) + J[1] * (J[5] * J[6] - J[3] * J[8]) + J[2] * (J[3] * J[7] - J[4] * J[6]);
}

/* A x = b for three unknowns, A row-major and not singular: Cramer's rule */
static inline void solve3(const PetscReal A[9], const PetscReal b[3], PetscReal x[3])
{
  PetscReal c0[3], c1[3], c2[3], det;

  cross(A + 3, A + 6, c0);
  cross(A + 6, A, c1);
  cross(A, A + 3, c2);
  det = A[0] * c0[0] + A[1] * c0[1] + A[2] * c0[2];
  for (PetscInt i = 0; i < 3; i++) x[i] = (c0[i] * b[0] + c1[i] * b[1] + c2[i] * b[2]) / det;
}

/* Its inverse inv [dim][dim] by cofactors; returns the determinant (if that is zero, inv is not finite) */
static inline PetscReal DenseInvertMap(PetscInt dim, const PetscReal J[], PetscReal inv[])
{
  const PetscReal det = DenseDeterminant(dim, J);

  if (dim == 2) {
    inv[0] = J[3] / det;
    inv[1] = -J[1] / det;
    inv[2] = -J[2] / det;
    inv[3] = J[0] / det;
  } else {
    inv[0] = (J[4] * J[8] - J[5] * J[7]) / det;
    inv[3] = (J[5] * J[6] - J[3] * J[8]) / det;
    inv[6] = (J[3] * J[7] - J[4] * J[6]) / det;
    inv[1] = (J[2] * J[7] - J[1] * J[8]) / det;
    inv[4] = (J[0] * J[8] - J[2] * J[6]) / det;
    inv[7] = (J[1] * J[6] - J[0] * J[7]) / det;
    inv[2] = (J[1] * J[5] - J[2] * J[4]) / det;
    inv[5] = (J[2] * J[3] - J[0] * J[5]) / det;
    inv[8] = (J[0] * J[4] - J[1] * J[3]) / det;
  }
  return det;
}

/* ---- rotations ---- */

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

/* y = exp(side turn) x, of the rotation vector `turn` (side -1: turned back) */
static inline void RotationApply(const PetscReal turn[3], PetscReal side, const PetscReal x[3], PetscReal y[3])
{
  const PetscReal angle = PetscSqrtReal(dot3(turn, turn)), half = 0.5 * angle;
  const PetscReal s     = angle > 0 ? PetscSinReal(angle) / angle : 1,
                  c     = half > 0 ? 0.5 * PetscSqr(PetscSinReal(half) / half) : 0.5;
  const PetscReal along = c * dot3(turn, x);
  PetscReal       tx[3];

  cross(turn, x, tx);
  for (int a = 0; a < 3; a++) y[a] = PetscCosReal(angle) * x[a] + side * s * tx[a] + along * turn[a];
}

/* ab = a b, quaternions; not the array of one of them */
static inline void RotationMultiply(const PetscReal a[4], const PetscReal b[4], PetscReal ab[4])
{
  ab[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  ab[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  ab[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  ab[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

/* Unit quaternion of the rotation back */
static inline void RotationInvert(const PetscReal q[4], PetscReal back[4])
{
  back[0] = q[0];
  for (int a = 1; a < 4; a++) back[a] = -q[a];
}

/* q <- exp(dt w / 2) q, renormalised; w is the angular velocity in space axes (rad/s), constant during dt */
static inline void RotationAdvance(PetscReal dt, const PetscReal w[3], PetscReal q[4])
{
  const PetscReal rate = PetscSqrtReal(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), half = 0.5 * dt * rate;
  const PetscReal s    = rate > 0 ? PetscSinReal(half) / rate : 0;
  const PetscReal e[4] = {PetscCosReal(half), s * w[0], s * w[1], s * w[2]}, old[4] = {q[0], q[1], q[2], q[3]};

  RotationMultiply(e, old, q);
  const PetscReal n = 1 / PetscSqrtReal(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; i++) q[i] *= n;
}
