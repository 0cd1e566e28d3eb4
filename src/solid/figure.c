/* Figure: see figure.h. */
#include "compat.h"
#include "figure.h"
#include "shape/host.h"

#define SAMPLES 2000 /* points that tell the box around a shape */

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  PetscFunctionBeginUser;
  (void)k;
  (void)at; /* there are no images */
  PetscCall(ShapeDistance(((Figure *)ctx)->shape, m, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  PetscFunctionBeginUser;
  (void)k;
  PetscCall(ShapeProject(((Figure *)ctx)->shape, m, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode corners(void *ctx, PetscInt k, PetscInt max, PetscInt *m, PetscReal x[])
{
  const PetscReal *corner;

  PetscFunctionBeginUser;
  (void)k;
  PetscCall(ShapeGetCorners(((Figure *)ctx)->shape, m, &corner));
  PetscCall(PetscArraycpy(x, corner, 2 * PetscMin(max, *m)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FigureDescribe(Shape shape, PetscInt dim, Figure *f)
{
  ShapeMass mass;

  PetscFunctionBeginUser;
  *f = (Figure){.shape = shape, .own = PETSC_TRUE};
  PetscCall(ShapeGetMass(shape, &mass));
  PetscCall(ShapeGetRadius(shape, &f->radius));
  PetscCall(ShapeGetDisc(shape, &f->round));
  f->volume = mass.volume;
  PetscCall(PetscArraycpy(f->centre[0], mass.centroid, 3));
  f->table = (AlignSurfaces){.ctx             = f,
                             .n               = 1,
                             .nall            = 1,
                             .largest         = f->radius,
                             .number          = &f->number,
                             .own             = &f->own,
                             .inactive_inside = &f->inactive,
                             .centre          = (const PetscReal(*)[3])f->centre,
                             .radius          = &f->radius,
                             .round           = &f->round,
                             .volume          = &f->volume,
                             .distance        = distance,
                             .project         = project,
                             .corners         = dim == 2 ? corners : NULL};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Corners and many points of the surface; of a disc exactly */
PetscErrorCode FigureFindBox(const Figure *f, PetscInt dim, PetscReal lower[], PetscReal upper[])
{
  PetscReal       *x, *w;
  const PetscReal *corner;
  PetscInt         n;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(SAMPLES * dim, &x, SAMPLES, &w));
  PetscCall(ShapeSurface(f->shape, SAMPLES, x, w));
  PetscCall(ShapeGetCorners(f->shape, &n, &corner));
  for (PetscInt d = 0; d < dim; d++) {
    lower[d] = PETSC_MAX_REAL;
    upper[d] = -PETSC_MAX_REAL;
    for (PetscInt i = 0; i < SAMPLES + n; i++) {
      const PetscReal at = i < SAMPLES ? x[dim * i + d] : corner[dim * (i - SAMPLES) + d];

      lower[d] = PetscMin(lower[d], at);
      upper[d] = PetscMax(upper[d], at);
    }
    if (f->round > 0) lower[d] = f->centre[0][d] - f->round;
    if (f->round > 0) upper[d] = f->centre[0][d] + f->round;
  }
  PetscCall(PetscFree2(x, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}
