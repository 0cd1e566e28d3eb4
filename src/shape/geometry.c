/* Geometry of a loaded shape: checked distances, normals, projection, mass, bounding radius, surface points (see
   shape/host.h). */
#include "compat.h"
#include "guard.h"
#include "impl.h"

PetscErrorCode ShapeDistance(Shape s, PetscInt n, const PetscReal x[], PetscReal d[])
{
  PetscInt bad = 0;

  PetscFunctionBeginUser;
  GUARDED(s, distance, (s, n, x, d));
  for (PetscInt i = 0; i < n; i++) bad += !(PetscAbsReal(d[i]) <= PETSC_MAX_REAL);
  if (PetscUnlikely(bad)) {
    PetscInt i = 0;

    while (PetscAbsReal(d[i]) <= PETSC_MAX_REAL) i++;
    SETERRQ(PETSC_COMM_SELF, PETSC_ERR_FP,
            "Shape '%s' returns the distance %g at (%g, %g, %g), which is not finite: check the plugin with 'tumble-test-shape %s'", s->loaded->type,
            (double)d[i], (double)x[i * s->dim], (double)x[i * s->dim + 1], s->dim == 3 ? (double)x[i * s->dim + 2] : 0.0, s->loaded->file);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeNormal(Shape s, PetscInt n, const PetscReal x[], PetscReal normal[])
{
  PetscFunctionBeginUser;
  if (s->ops.normal) GUARDED(s, normal, (s, n, x, normal));
  else PetscCall(ShapeDefaultNormal(s, s->radius, s->dim, n, x, normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Unit direction k of n spread over the circle (sphere: Fibonacci lattice). */
static void SpreadDirection(PetscInt dim, PetscInt k, PetscInt n, PetscReal e[])
{
  if (dim == 2) {
    e[0] = PetscCosReal(2.0 * PETSC_PI * (PetscReal)k / (PetscReal)n);
    e[1] = PetscSinReal(2.0 * PETSC_PI * (PetscReal)k / (PetscReal)n);
  } else {
    PetscReal z = 1.0 - (2.0 * (PetscReal)k + 1.0) / (PetscReal)n, rho = PetscSqrtReal(1.0 - z * z), phi = 2.399963229728653 * (PetscReal)k;

    e[0] = rho * PetscCosReal(phi);
    e[1] = rho * PetscSinReal(phi);
    e[2] = z;
  }
}

/* Direction k of n within an angle of about `spread` around e; all directions if spread is 0. */
static void ConeDirection(PetscInt dim, PetscInt k, PetscInt n, const PetscReal e[], PetscReal spread, PetscReal out[])
{
  PetscReal u[3], len = 0;

  SpreadDirection(dim, k, n, u);
  for (PetscInt a = 0; a < dim; a++) {
    out[a] = spread > 0 ? e[a] + spread * (PetscReal)(k % 8 + 1) / 8.0 * u[a] : u[a];
    len += PetscSqr(out[a]);
  }
  for (PetscInt a = 0; a < dim; a++) out[a] /= PetscSqrtReal(len);
}

/* Where the gradient misleads (kink, medial axis): of all points at distance |d| around y0, the closest to the surface,
   in ever narrower cones. Replaces y, d if it is better than they are. */
static PetscErrorCode StepBySearch(Shape s, const PetscReal y0[], PetscReal d0, PetscReal y[], PetscReal *d)
{
  const PetscReal spread[5] = {0.0, 0.15, 0.02, 0.003, 0.0004};
  const PetscInt  dim = s->dim, n = dim == 2 ? SHAPE_CHUNK : 4 * SHAPE_CHUNK;
  PetscReal       x[4 * SHAPE_CHUNK * 3], dist[4 * SHAPE_CHUNK], e[3] = {0, 0, 0}, out[3], best_d = PETSC_MAX_REAL;

  PetscFunctionBeginUser;
  for (int stage = 0; stage < 5; stage++) {
    PetscInt best = -1;

    for (PetscInt k = 0; k < n; k++) {
      ConeDirection(dim, k, n, e, spread[stage], out);
      for (PetscInt a = 0; a < dim; a++) x[k * dim + a] = y0[a] + PetscAbsReal(d0) * out[a];
    }
    PetscCall(ShapeDistance(s, n, x, dist));
    for (PetscInt k = 0; k < n; k++) {
      if (PetscAbsReal(dist[k]) >= PetscAbsReal(best_d)) continue;
      best   = k;
      best_d = dist[k];
    }
    if (best < 0) continue;
    for (PetscInt a = 0; a < dim; a++) e[a] = (x[best * dim + a] - y0[a]) / PetscAbsReal(d0);
  }
  if (PetscAbsReal(best_d) >= PetscAbsReal(*d)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < dim; a++) y[a] = y0[a] + PetscAbsReal(d0) * e[a];
  PetscCall(ShapeDistance(s, 1, y, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Project up to SHAPE_CHUNK points in place. Because |d| never exceeds the true distance, a step of length |d| cannot
   cross the surface; where d is Euclidean and smooth one step is enough, so one that leaves a tenth of the way went in
   the wrong direction. */
static PetscErrorCode ProjectChunk(Shape s, PetscInt n, PetscReal y[])
{
  const PetscInt  dim = s->dim, max_iterations = 200;
  const PetscReal tolerance = 1e-12 * s->radius;
  PetscReal       d[SHAPE_CHUNK], old_d[SHAPE_CHUNK], old_y[SHAPE_CHUNK * 3], normal[SHAPE_CHUNK * 3];
  PetscInt        open = n;

  PetscFunctionBeginUser;
  PetscCall(ShapeDistance(s, n, y, d));
  for (PetscInt it = 0; it < max_iterations && open; it++) {
    PetscCall(ShapeNormal(s, n, y, normal));
    PetscCall(PetscArraycpy(old_y, y, n * dim));
    PetscCall(PetscArraycpy(old_d, d, n));
    for (PetscInt i = 0; i < n; i++)
      for (PetscInt a = 0; a < dim; a++) y[i * dim + a] -= PetscAbsReal(d[i]) > tolerance ? d[i] * normal[i * dim + a] : 0.0;
    PetscCall(ShapeDistance(s, n, y, d));
    open = 0;
    for (PetscInt i = 0; i < n; i++) {
      if (PetscAbsReal(d[i]) > tolerance && PetscAbsReal(d[i]) > 0.1 * PetscAbsReal(old_d[i]))
        PetscCall(StepBySearch(s, &old_y[i * dim], old_d[i], &y[i * dim], &d[i]));
      if (PetscAbsReal(d[i]) > tolerance) open++;
    }
  }
  for (PetscInt i = 0; i < n; i++)
    PetscCheck(PetscAbsReal(d[i]) <= tolerance, PETSC_COMM_SELF, PETSC_ERR_NOT_CONVERGED,
               "Projection onto shape '%s' stopped at (%g, %g, %g) with distance %g instead of %g: its distance or normal is wrong there, check it with 'tumble-test-shape %s'",
               s->loaded->type, (double)y[i * dim], (double)y[i * dim + 1], dim == 3 ? (double)y[i * dim + 2] : 0.0, (double)d[i], (double)tolerance,
               s->loaded->file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeProject(Shape s, PetscInt n, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  if (y != x) PetscCall(PetscArraymove(y, x, n * s->dim));
  for (PetscInt i = 0; i < n; i += SHAPE_CHUNK) PetscCall(ProjectChunk(s, PetscMin(SHAPE_CHUNK, n - i), y + i * s->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetMass(Shape s, ShapeMass *m)
{
  PetscFunctionBeginUser;
  if (!s->have_mass) {
    PetscCall(PetscMemzero(&s->mass, sizeof(s->mass)));
    if (s->ops.mass) GUARDED(s, mass, (s, &s->mass));
    else PetscCall(ShapeDefaultMass(s, s->radius, s->dim, &s->mass));
    PetscCheck(s->mass.volume > 0 && s->mass.volume < PETSC_MAX_REAL, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "Shape '%s' has volume %g, which must be positive and finite: check its options -%s* and 'tumble-test-shape %s'", s->loaded->type,
               (double)s->mass.volume, s->prefix, s->loaded->file);
    s->have_mass = PETSC_TRUE;
  }
  *m = s->mass;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetRadius(Shape s, PetscReal *r)
{
  ShapeMass m;

  PetscFunctionBeginUser;
  if (!s->have_centroid_radius) {
    PetscReal offset2 = 0;

    PetscCall(ShapeGetMass(s, &m));
    for (PetscInt a = 0; a < s->dim; a++) offset2 += PetscSqr(m.centroid[a]);
    s->centroid_radius = 0;
    if (s->ops.reach) GUARDED(s, reach, (s, m.centroid, &s->centroid_radius));
    if (s->centroid_radius <= 0) PetscCall(ShapeDefaultRadius(s, s->radius, s->dim, m.centroid, &s->centroid_radius));
    s->centroid_radius      = PetscMin(s->centroid_radius, s->radius + PetscSqrtReal(offset2));
    s->have_centroid_radius = PETSC_TRUE;
  }
  *r = s->centroid_radius;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeSurface(Shape s, PetscInt n, PetscReal x[], PetscReal w[])
{
  PetscFunctionBeginUser;
  if (s->ops.surface) GUARDED(s, surface, (s, n, x, w));
  else if (n > 0) PetscCall(ShapeDefaultSurface(s, s->radius, s->dim, n, x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeGetCorners(Shape s, PetscInt *n, const PetscReal *x[])
{
  PetscFunctionBeginUser;
  if (!s->have_corners) {
    if (s->ops.corners) {
      PetscInt again = 0;

      GUARDED(s, corners, (s, 0, &s->ncorner, NULL));
      PetscCall(PetscMalloc1(s->ncorner * s->dim, &s->corner));
      GUARDED(s, corners, (s, s->ncorner, &again, s->corner));
      PetscCheck(again == s->ncorner, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
                 "Shape '%s' counts %" PetscInt_FMT " corners, then %" PetscInt_FMT ": check the plugin with 'tumble-test-shape %s'", s->loaded->type,
                 s->ncorner, again, s->loaded->file);
    } else if (s->dim == 2) PetscCall(ShapeDefaultCorners(s, &s->ncorner, &s->corner));
    s->have_corners = PETSC_TRUE;
  }
  *n = s->ncorner;
  *x = s->corner;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Project points around the body onto it and compare their radii; the volume rules out holes. 1e-6 leaves room for a
   centroid found by quadrature. */
PetscErrorCode ShapeGetDisc(Shape s, PetscReal *r)
{
  enum {
    N = 97
  };
  PetscReal x[N * 3], e[3], r0 = PETSC_MAX_REAL, r1 = 0, sum = 0, ball;
  ShapeMass m;

  PetscFunctionBeginUser;
  if (!s->have_disc) {
    PetscCall(ShapeGetMass(s, &m));
    for (PetscInt k = 0; k < N; k++) {
      SpreadDirection(s->dim, k, N, e);
      for (PetscInt a = 0; a < s->dim; a++) x[k * s->dim + a] = m.centroid[a] + 1.5 * s->radius * e[a];
    }
    PetscCall(ShapeProject(s, N, x, x));
    for (PetscInt k = 0; k < N; k++) {
      PetscReal r2 = 0;

      for (PetscInt a = 0; a < s->dim; a++) r2 += PetscSqr(x[k * s->dim + a] - m.centroid[a]);
      r0 = PetscMin(r0, PetscSqrtReal(r2));
      r1 = PetscMax(r1, PetscSqrtReal(r2));
      sum += PetscSqrtReal(r2) / N;
    }
    ball         = s->dim == 2 ? PETSC_PI * PetscSqr(sum) : 4.0 / 3.0 * PETSC_PI * sum * PetscSqr(sum);
    s->disc      = r1 - r0 <= 1e-6 * sum && PetscAbsReal(m.volume - ball) <= 1e-3 * ball ? sum : 0.0;
    s->have_disc = PETSC_TRUE;
  }
  *r = s->disc;
  PetscFunctionReturn(PETSC_SUCCESS);
}
