/* Bodies: distances, feet and corners of a body where it is, by its shape in the frame of that, see bodies.h. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

#define CHUNK 256 /* points handled at a time on the stack */

/* Points x [n][dim] in the frame of the shape of a body of group g and size `scale` at X, turned by R; dim is known to
   the compiler where it is called: it is a loop over points for registers */
static inline void turn_points(const BodyGroup *g, PetscReal scale, const PetscInt dim, const PetscReal X[],
                               const PetscReal R[9], PetscInt n, const PetscReal *restrict x, PetscReal *restrict y)
{
  const PetscReal inverse = 1 / scale, c[3] = {g->mass.centroid[0], g->mass.centroid[1], g->mass.centroid[2]};

  for (PetscInt p = 0; p < n; p++) {
    const PetscReal *xp = x + p * dim, r[3] = {xp[0] - X[0], xp[1] - X[1], dim == 3 ? xp[2] - X[2] : 0};

    for (PetscInt a = 0; a < dim; a++)
      y[p * dim + a] = (R[a] * r[0] + R[3 + a] * r[1] + R[6 + a] * r[2]) * inverse + c[a];
  }
}

static void into_frame(const BodyGroup *g, PetscReal scale, PetscInt dim, const PetscReal X[], const PetscReal R[9],
                       PetscInt n, const PetscReal x[], PetscReal y[])
{
  if (dim == 3) turn_points(g, scale, 3, X, R, n, x, y);
  else turn_points(g, scale, 2, X, R, n, x, y);
}

/* The other way: y [n][dim] in the frame of the shape, x in space */
static void out_of_frame(const BodyGroup *g, PetscReal scale, PetscInt dim, const PetscReal X[], const PetscReal R[9],
                         PetscInt n, const PetscReal y[], PetscReal x[])
{
  for (PetscInt p = 0; p < n; p++) {
    PetscReal r[3] = {0, 0, 0};

    for (PetscInt a = 0; a < dim; a++) r[a] = scale * (y[p * dim + a] - g->mass.centroid[a]);
    for (PetscInt a = 0; a < dim; a++)
      x[p * dim + a] = X[a] + R[3 * a] * r[0] + R[3 * a + 1] * r[1] + R[3 * a + 2] * r[2];
  }
}

PetscErrorCode BodiesDistanceOf(Bodies b, PetscInt group, PetscReal scale, const PetscReal X[], const PetscReal q[],
                                PetscInt n, const PetscReal x[], PetscReal d[])
{
  const PetscInt   dim = b->state.dim;
  const BodyGroup *g   = &b->state.group[group];
  PetscReal        R[9], y[CHUNK * 3];

  PetscFunctionBeginUser;
  RotationMatrix(q, R);
  for (PetscInt start = 0; start < n; start += CHUNK) {
    const PetscInt m = PetscMin(CHUNK, n - start);

    into_frame(g, scale, dim, X, R, m, x + start * dim, y);
    PetscCall(ShapeDistance(g->shape, m, y, d + start));
    for (PetscInt i = start; i < start + m && scale != 1; i++) d[i] *= scale;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesDistance(Bodies b, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt n,
                              const PetscReal x[], PetscReal d[])
{
  const BodyArrays *s = &b->state;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  PetscCall(BodiesDistanceOf(b, s->body_group[k], s->scale[k], X ? X : s->x[k], q ? q : s->q[k], n, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesProject(Bodies b, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt n,
                             const PetscReal x[], PetscReal y[])
{
  const PetscInt   dim = b->state.dim;
  const BodyGroup *g;
  PetscReal        R[9], local[CHUNK * 3], wall[CHUNK * 3], scale;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g     = BodiesGetGroup(&b->view, k);
  scale = b->state.scale[k];
  if (!X) X = b->state.x[k];
  RotationMatrix(q ? q : b->state.q[k], R);
  for (PetscInt start = 0; start < n; start += CHUNK) {
    const PetscInt m = PetscMin(CHUNK, n - start);

    into_frame(g, scale, dim, X, R, m, x + start * dim, local);
    PetscCall(ShapeProject(g->shape, m, local, wall));
    out_of_frame(g, scale, dim, X, R, m, wall, y + start * dim);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGetCorners(Bodies b, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt max,
                                PetscInt *n, PetscReal x[])
{
  const BodyGroup *g;
  const PetscReal *corner;
  PetscReal        R[9];

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  g = BodiesGetGroup(&b->view, k);
  PetscCall(ShapeGetCorners(g->shape, n, &corner));
  RotationMatrix(q ? q : b->state.q[k], R);
  out_of_frame(g, b->state.scale[k], b->state.dim, X ? X : b->state.x[k], R, PetscMin(*n, max), corner, x);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSurfacePoints(Bodies b, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt nface,
                                   PetscInt *n, PetscReal **x, PetscReal **weight)
{
  const BodyArrays *s   = &b->state;
  const BodyGroup  *g   = &s->group[s->body_group[k]];
  const PetscInt    dim = s->dim;
  const PetscReal  *corner;
  PetscReal         R[9], *at, *w;
  PetscInt          ncorner = 0;

  PetscFunctionBeginUser;
  PetscCall(check_body(b, k));
  if (nface) PetscCall(ShapeGetCorners(g->shape, &ncorner, &corner));
  *n = nface ? nface + ncorner : 1;
  PetscCall(PetscMalloc2(*n * dim, &at, *n, &w));
  PetscCall(PetscMalloc1(*n * dim, x));
  if (nface) PetscCall(ShapeSurface(g->shape, nface, at, w));
  else PetscCall(PetscArraycpy(at, g->mass.centroid, dim));
  if (ncorner) PetscCall(PetscArraycpy(at + nface * dim, corner, ncorner * dim));
  RotationMatrix(q ? q : s->q[k], R);
  out_of_frame(g, s->scale[k], dim, X ? X : s->x[k], R, *n, at, *x);
  if (weight) PetscCall(PetscMalloc1(nface, weight));
  for (PetscInt i = 0; weight && i < nface; i++) (*weight)[i] = w[i] * PetscPowRealInt(s->scale[k], (int)dim - 1);
  PetscCall(PetscFree2(at, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}
