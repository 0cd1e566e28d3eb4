/* Drops, start in space: where there is no curve to begin with, the mesh is lined up with the shapes themselves
   (phase/drops.h), or with the zero of a region, by Newton's method along its gradient. Overlapping ones are one. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "shape/host.h"

#define DIFFER 1e-6  /* of the domain: for gradients of a region */
#define CLOSE  1e-13 /* of the domain */
#define NSTEP  30

/* x in the frame of the group's shape */
static PetscErrorCode to_frame(const DropGroup *g, const PetscReal x[3], PetscReal r[3])
{
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt a = 0; a < 3; a++) {
    r[a] = mass.centroid[a];
    for (PetscInt b = 0; b < 3; b++) r[a] += g->turn[3 * b + a] * (x[b] - g->x[b]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode from_frame(const DropGroup *g, const PetscReal r[3], PetscReal x[3])
{
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt a = 0; a < 3; a++) {
    x[a] = g->x[a];
    for (PetscInt b = 0; b < 3; b++) x[a] += g->turn[3 * a + b] * (r[b] - mass.centroid[b]);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Value of a region at x over the size of its gradient, about a distance, and the gradient's direction n */
static PetscErrorCode region_distance(Drops b, const DropGroup *g, const PetscReal x[3], PetscReal *d, PetscReal n[3])
{
  PetscReal e = 0, value, size;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) e = PetscMax(e, DIFFER * (b->upper[a] - b->lower[a]));
  PetscCall(ExprEvaluateAlone(g->region, 0, x, &value));
  for (PetscInt a = 0; a < 3; a++) {
    PetscReal y[3] = {x[0], x[1], x[2]}, v[2];

    for (PetscInt i = 0; i < 2; i++) {
      y[a] = x[a] + (i ? e : -e);
      PetscCall(ExprEvaluateAlone(g->region, 0, y, &v[i]));
    }
    n[a] = (v[1] - v[0]) / (2 * e);
  }
  size = PetscMax(PetscSqrtReal(dot3(n, n)), PETSC_SMALL);
  for (PetscInt a = 0; a < 3; a++) n[a] /= size;
  *d = value / size;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode region_closest(Drops b, const DropGroup *g, const PetscReal x[3], PetscReal y[3])
{
  PetscReal size = 0;

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    y[a] = x[a];
    size = PetscMax(size, b->upper[a] - b->lower[a]);
  }
  for (PetscInt step = 0; step < NSTEP; step++) {
    PetscReal d, n[3];

    PetscCall(region_distance(b, g, y, &d, n));
    for (PetscInt a = 0; a < 3; a++) y[a] -= PetscMax(-size, PetscMin(size, d)) * n[a];
    if (PetscAbsReal(d) < CLOSE * size) break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartBox(Drops b, const PetscReal lower[3], const PetscReal upper[3])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(b->lower, lower, 3));
  PetscCall(PetscArraycpy(b->upper, upper, 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartNearest(Drops b, const PetscReal x[3], PetscInt *number, PetscReal *d)
{
  PetscFunctionBeginUser;
  *number = 0; /* at the start drops have the numbers of their groups */
  *d      = PETSC_MAX_REAL;
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    PetscReal r[3], far;

    if (b->group[g].region) PetscCall(region_distance(b, b->group + g, x, &far, r));
    else {
      PetscCall(to_frame(b->group + g, x, r));
      PetscCall(ShapeDistance(b->group[g].shape, 1, r, &far));
    }
    if (far >= *d) continue;
    *d      = far;
    *number = g;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartDistance(Drops b, PetscInt n, const PetscReal x[], PetscReal d[])
{
  PetscInt group;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) PetscCall(DropsStartNearest(b, x + 3 * i, &group, d + i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartClosest(Drops b, PetscInt n, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt  g;
    PetscReal d, r[3], at[3];

    PetscCall(DropsStartNearest(b, x + 3 * i, &g, &d));
    if (b->group[g].region) {
      PetscCall(region_closest(b, b->group + g, x + 3 * i, y + 3 * i));
      continue;
    }
    PetscCall(to_frame(b->group + g, x + 3 * i, r));
    PetscCall(ShapeProject(b->group[g].shape, 1, r, at));
    PetscCall(from_frame(b->group + g, at, y + 3 * i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The ball around a group's shape; a region is in the domain */
static PetscErrorCode find_ball(Drops b, const DropGroup *g, PetscReal x[3], PetscReal *radius, PetscReal *volume)
{
  PetscReal r[3];
  ShapeMass mass;

  PetscFunctionBeginUser;
  *volume = 1;
  for (PetscInt a = 0; a < 3; a++) {
    x[a] = g->shape ? g->x[a] : 0.5 * (b->lower[a] + b->upper[a]);
    r[a] = b->upper[a] - x[a];
    *volume *= b->upper[a] - b->lower[a];
  }
  *radius = PetscSqrtReal(dot3(r, r));
  if (!g->shape) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ShapeGetMass(g->shape, &mass));
  PetscCall(ShapeGetRadius(g->shape, radius));
  *volume = mass.volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartBall(Drops b, PetscReal centre[3], PetscReal *radius, PetscReal *volume)
{
  PetscReal x[3], own, more;

  PetscFunctionBeginUser;
  *radius = *volume = 0;
  for (PetscInt a = 0; a < 3; a++) centre[a] = 0;
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    PetscCall(find_ball(b, b->group + g, x, &own, &more));
    for (PetscInt a = 0; a < 3; a++) centre[a] += x[a] / (PetscReal)b->s.ngroups;
    *volume += more;
  }
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    PetscCall(find_ball(b, b->group + g, x, &own, &more));
    for (PetscInt a = 0; a < 3; a++) x[a] -= centre[a];
    *radius = PetscMax(*radius, PetscSqrtReal(dot3(x, x)) + own);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
