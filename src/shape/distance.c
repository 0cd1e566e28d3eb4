/* Shape, distance: checked distances, normals, from differences of the distance where a plugin gives none, and the
   nearest points of the surface (see shape/host.h). */
#include "compat.h"
#include "guard.h"
#include "tree.h"

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
            "Shape '%s' returns the distance %g at (%g, %g, %g), which is not finite: check the plugin with 'tumble-test-shape %s'",
            s->loaded->type, (double)d[i], (double)x[i * s->dim], (double)x[i * s->dim + 1],
            s->dim == 3 ? (double)x[i * s->dim + 2] : 0.0, s->loaded->file);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- normal ---- */

/* Differences for up to SHAPE_CHUNK points; `shift` moves the points off a place where they vanish. */
static PetscErrorCode DifferenceChunk(Shape s, PetscReal h, PetscInt dim, PetscInt n, const PetscReal x[],
                                      const PetscReal shift[], PetscReal g[])
{
  PetscReal p[SHAPE_CHUNK * 3 * 2 * 3], d[SHAPE_CHUNK * 3 * 2];
  PetscInt  m = 0;

  PetscFunctionBeginUser;
  if (n < 1 || dim < 1) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt a = 0; a < 2 * dim; a++, m++) {
      for (PetscInt b = 0; b < dim; b++) p[m * dim + b] = x[i * dim + b] + shift[b];
      p[m * dim + a / 2] += a % 2 ? h : -h;
    }
  PetscCall(ShapeDistance(s, m, p, d));
  for (PetscInt i = 0; i < n * dim; i++) g[i] = (d[2 * i + 1] - d[2 * i]) / (2.0 * h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDefaultNormal(Shape s, PetscReal r, PetscInt dim, PetscInt n, const PetscReal x[],
                                  PetscReal normal[])
{
  const PetscReal h = 1e-5 * r, zero[3] = {0, 0, 0}; /* truncation h^2 and round-off eps/h balance near 1e-10 */

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i += SHAPE_CHUNK)
    PetscCall(DifferenceChunk(s, h, dim, PetscMin(SHAPE_CHUNK, n - i), x + i * dim, zero, normal + i * dim));
  for (PetscInt i = 0; i < n; i++) {
    PetscReal *g = normal + i * dim, len = VectorLength(dim, g);

    for (PetscInt attempt = 1; len < 0.1 && attempt <= 4; attempt++) {
      const PetscReal shift[3] = {3.1 * h * attempt, 1.7 * h, 0.9 * h};

      PetscCall(DifferenceChunk(s, h, dim, 1, x + i * dim, shift, g));
      len = VectorLength(dim, g);
    }
    if (len > 0)
      for (PetscInt a = 0; a < dim; a++) g[a] /= len;
    else
      for (PetscInt a = 0; a < dim; a++) g[a] = a == 0;
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

/* ---- projection ---- */

/* Direction k of n within an angle of about `spread` around e; all directions if spread is 0. */
static void ConeDirection(PetscInt dim, PetscInt k, PetscInt n, const PetscReal e[], PetscReal spread, PetscReal out[])
{
  PetscReal u[3], len = 0;

  ShapeSpreadDirection(dim, k, n, u);
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
      for (PetscInt a = 0; a < dim; a++)
        y[i * dim + a] -= PetscAbsReal(d[i]) > tolerance ? d[i] * normal[i * dim + a] : 0.0;
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
               s->loaded->type, (double)y[i * dim], (double)y[i * dim + 1], dim == 3 ? (double)y[i * dim + 2] : 0.0,
               (double)d[i], (double)tolerance, s->loaded->file);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeProject(Shape s, PetscInt n, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  if (y != x) PetscCall(PetscArraymove(y, x, n * s->dim));
  for (PetscInt i = 0; i < n; i += SHAPE_CHUNK)
    PetscCall(ProjectChunk(s, PetscMin(SHAPE_CHUNK, n - i), y + i * s->dim));
  PetscFunctionReturn(PETSC_SUCCESS);
}
