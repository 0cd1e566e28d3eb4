/* Drops, start in space: where there is no curve to begin with, the mesh is lined up with the shapes themselves
   (phase/drops.h). Overlapping shapes are one. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "shape/host.h"

/* Places of a group's shape, in its frame */
static PetscErrorCode to_frame(const DropGroup *g, PetscInt n, const PetscReal x[], PetscReal sign, PetscReal r[])
{
  ShapeMass mass;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(g->shape, &mass));
  for (PetscInt i = 0; i < 3 * n; i++) r[i] = x[i] - sign * (g->x[i % 3] - mass.centroid[i % 3]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The group that is nearest to x, and the distance of its surface */
static PetscErrorCode find_group(Drops b, const PetscReal x[3], PetscInt *group, PetscReal *d)
{
  PetscFunctionBeginUser;
  *group = 0;
  *d     = PETSC_MAX_REAL;
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    PetscReal r[3], far;

    PetscCall(to_frame(b->group + g, 1, x, 1, r));
    PetscCall(ShapeDistance(b->group[g].shape, 1, r, &far));
    if (far >= *d) continue;
    *d     = far;
    *group = g;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartDistance(Drops b, PetscInt n, const PetscReal x[], PetscReal d[])
{
  PetscInt group;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) PetscCall(find_group(b, x + 3 * i, &group, d + i));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartClosest(Drops b, PetscInt n, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) {
    PetscInt  g;
    PetscReal d, r[3], at[3];

    PetscCall(find_group(b, x + 3 * i, &g, &d));
    PetscCall(to_frame(b->group + g, 1, x + 3 * i, 1, r));
    PetscCall(ShapeProject(b->group[g].shape, 1, r, at));
    PetscCall(to_frame(b->group + g, 1, at, -1, y + 3 * i));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartNearest(Drops b, const PetscReal x[3], PetscInt *number)
{
  PetscReal d;

  PetscFunctionBeginUser;
  PetscCall(find_group(b, x, number, &d)); /* at the start drops have the numbers of their groups */
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsStartBall(Drops b, PetscReal centre[3], PetscReal *radius, PetscReal *volume)
{
  PetscFunctionBeginUser;
  *radius = *volume = 0;
  for (PetscInt a = 0; a < 3; a++) {
    centre[a] = 0;
    for (PetscInt g = 0; g < b->s.ngroups; g++) centre[a] += b->group[g].x[a] / (PetscReal)b->s.ngroups;
  }
  for (PetscInt g = 0; g < b->s.ngroups; g++) {
    PetscReal r[3], own;
    ShapeMass mass;

    PetscCall(ShapeGetMass(b->group[g].shape, &mass));
    PetscCall(ShapeGetRadius(b->group[g].shape, &own));
    *volume += mass.volume;
    for (PetscInt a = 0; a < 3; a++) r[a] = b->group[g].x[a] - centre[a];
    *radius = PetscMax(*radius, PetscSqrtReal(dot3(r, r)) + own);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
