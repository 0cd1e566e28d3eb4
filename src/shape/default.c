/* Defaults of shape operations, from the signed distance alone: normal, mass, bounding radius (impl.h, tree.h). */
#include "compat.h"
#include "tree.h"
#include "base/log.h"

/* ---- normal ---- */

/* Differences for up to SHAPE_CHUNK points; `shift` moves the points off a place where they vanish. */
static PetscErrorCode DifferenceChunk(Shape s, PetscReal h, PetscInt dim, PetscInt n, const PetscReal x[], const PetscReal shift[], PetscReal g[])
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

PetscErrorCode ShapeDefaultNormal(Shape s, PetscReal r, PetscInt dim, PetscInt n, const PetscReal x[], PetscReal normal[])
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

/* ---- mass ---- */

#define MOST_CELLS 100000 /* that may be cut, of a level that is refined once more: 2 s, 50 MB */
#define SPEAK      1e-5

/* Raw moments about the body origin to centroid and inertia about it. */
static void ConvertMoments(PetscInt dim, const Moments *m, ShapeMass *mass)
{
  PetscReal s[6];

  for (PetscInt a = 0; a < 3; a++) mass->centroid[a] = a < dim ? m->x[a] / m->v : 0.0;
  for (PetscInt k = 0; k < 6; k++) s[k] = m->xx[k] - m->v * mass->centroid[TREE_PAIR[k][0]] * mass->centroid[TREE_PAIR[k][1]];
  mass->volume = m->v;
  for (PetscInt k = 0; k < 6; k++) mass->inertia[k] = 0;
  mass->inertia[2] = s[0] + s[1];
  if (dim == 2) return;
  mass->inertia[0] = s[1] + s[2];
  mass->inertia[1] = s[0] + s[2];
  for (PetscInt k = 3; k < 6; k++) mass->inertia[k] = -s[k];
}

/* The cut is linear in a cell, so that moments converge with the square of its width: the error of the finer level is a
   third of the difference. In space, where levels are dear, it is taken off. */
static void extrapolate(const Moments *coarse, const Moments *fine, Moments *out)
{
  const PetscReal *a = &coarse->v, *b = &fine->v;
  PetscReal       *c = &out->v;

  for (size_t i = 0; i < sizeof(Moments) / sizeof(PetscReal); i++) c[i] = b[i] + (b[i] - a[i]) / 3;
}

PetscErrorCode ShapeDefaultMass(Shape s, PetscReal r, PetscInt dim, ShapeMass *mass)
{
  const PetscInt  first = dim == 2 ? 8 : 4, last = dim == 2 ? 14 : 12;
  const PetscReal tolerance = 1e-6;
  Tree            t;
  Moments         m, better, coarse = {0};
  ShapeMass       old;
  PetscReal       error = 1;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(&old, sizeof(old)));
  PetscCall(TreeCreate(s, r, dim, &t));
  for (PetscInt level = 1; level <= last && (dim == 2 || t.n <= MOST_CELLS || old.volume <= 0); level++) {
    PetscCall(TreeRefine(&t));
    if (level < first) continue;
    m = t.full;
    PetscCall(TreeAddCutCells(&t, &m));
    PetscCheck(m.v > 0 || level < last, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "A shape has no inside: its distance is nowhere negative within its bounding radius %g, or it is thinner than %g", (double)r,
               (double)TreeCellWidth(&t));
    if (m.v <= 0) continue;
    better = m;
    if (dim == 3 && coarse.v > 0) extrapolate(&coarse, &m, &better);
    coarse = m;
    ConvertMoments(dim, &better, mass);
    error = PetscMax(PetscAbsReal(mass->volume - old.volume) / mass->volume, PetscAbsReal(mass->inertia[2] - old.inertia[2]) / mass->inertia[2]);
    if (error <= tolerance) break;
    old = *mass;
  }
  PetscCall(TreeDestroy(&t));
  if (dim == 3 && error > SPEAK)
    PetscCall(LogRemark("volume and inertia of shape '%s' by quadrature of its distance are uncertain by %.1g: give it the operation mass",
                        s->loaded->type, (double)error));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- bounding radius about the centroid ---- */

/* Keep the cells that may hold a point farther from c than *lower, raise *lower by what is known to be inside, return
   the upper bound. */
static PetscErrorCode PruneFar(Tree *t, const PetscReal c[], PetscReal *lower, PetscReal *upper)
{
  const PetscInt  dim   = t->dim;
  const PetscReal reach = TreeHalfDiagonal(t);
  PetscReal      *far;
  PetscInt        n = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(t->n, &far));
  *upper = 0;
  for (PetscInt i = 0; i < t->n; i++) {
    PetscReal x[3], d, rel[3];

    TreeCellCentre(t, t->cell + i * dim, x);
    for (PetscInt a = 0; a < dim; a++) rel[a] = x[a] - c[a];
    far[i] = VectorLength(dim, rel);
    PetscCall(ShapeDistance(t->shape, 1, x, &d));
    if (d <= 0) *lower = PetscMax(*lower, far[i] - d); /* a ball of radius -d around x is inside */
  }
  for (PetscInt i = 0; i < t->n; i++) {
    if (far[i] + reach < *lower * (1.0 - 1e-12)) continue;
    *upper = PetscMax(*upper, far[i] + reach);
    for (PetscInt a = 0; a < dim; a++) t->cell[n * dim + a] = t->cell[i * dim + a];
    n++;
  }
  t->n = n;
  PetscCall(PetscFree(far));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDefaultRadius(Shape s, PetscReal r, PetscInt dim, const PetscReal c[3], PetscReal *radius)
{
  Tree      t;
  PetscReal lower = 0, upper = 0;

  PetscFunctionBeginUser;
  PetscCall(TreeCreate(s, r, dim, &t));
  for (PetscInt level = 1; level <= 20; level++) {
    PetscCall(TreeRefine(&t));
    PetscCall(PruneFar(&t, c, &lower, &upper));
    if (upper - lower <= 1e-4 * r || t.n > 100000) break;
  }
  PetscCall(TreeDestroy(&t));
  *radius = upper > 0 ? upper : r + VectorLength(dim, c); /* nothing left: the distance is not 1-Lipschitz, so only the
                                                             plugin's own bound holds */
  PetscFunctionReturn(PETSC_SUCCESS);
}
