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

#define BEND   0.05 /* in cells at the first level, half as much at each next one: as smooth surfaces bend less */
#define DEEPER 6    /* levels, where the surface bends more: at edges the number of cells doubles with each */

/* Add the moments of the inside of the cells that may be cut; in space those that bend are refined first. */
static PetscErrorCode add_cut_cells(const Tree *t, PetscReal bend, Moments *m)
{
  Tree part = *t;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(t->n * t->dim, &part.cell));
  PetscCall(PetscArraycpy(part.cell, t->cell, t->n * t->dim));
  for (PetscInt level = 0; t->dim == 3 && level < DEEPER && part.n && part.n <= MOST_CELLS; level++) {
    Tree rough;

    PetscCall(TreeSplit(&part, bend, &rough));
    PetscCall(TreeAddCutCells(&part, m));
    PetscCall(TreeAddBends(&part, m));
    PetscCall(TreeDestroy(&part));
    PetscCall(TreeRefine(&rough));
    for (size_t i = 0; i < sizeof(Moments) / sizeof(PetscReal); i++) (&m->v)[i] += (&rough.full.v)[i];
    PetscCall(PetscMemzero(&rough.full, sizeof(rough.full)));
    part = rough;
  }
  PetscCall(TreeAddCutCells(&part, m));
  if (t->dim == 3) PetscCall(TreeAddBends(&part, m));
  PetscCall(TreeDestroy(&part));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest relative change of volume and moment of inertia */
static PetscReal compare_masses(const ShapeMass *a, const ShapeMass *b)
{
  return PetscMax(PetscAbsReal(b->volume - a->volume) / b->volume, PetscAbsReal(b->inertia[2] - a->inertia[2]) / b->inertia[2]);
}

/* Error of the last of three levels whose moments changed by `before` and by `now`: four times smaller from level to
   level at edges and where the cut is linear, sixteen times where smooth surfaces bend */
static PetscReal estimate_error(PetscReal before, PetscReal now)
{
  const PetscReal ratio = now > 0 ? before / now : 16;

  return now / (PetscMax(4, PetscMin(16, ratio)) - 1);
}

PetscErrorCode ShapeDefaultMass(Shape s, PetscReal r, PetscInt dim, ShapeMass *mass)
{
  const PetscInt  first = dim == 2 ? 8 : 4, last = dim == 2 ? 14 : 12;
  const PetscReal tolerance = 1e-6;
  Tree            t;
  Moments         m;
  ShapeMass       old;
  PetscReal       change = 0, error = 1;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(&old, sizeof(old)));
  PetscCall(TreeCreate(s, r, dim, &t));
  for (PetscInt level = 1; level <= last && (dim == 2 || t.n <= MOST_CELLS || old.volume <= 0); level++) {
    PetscCall(TreeRefine(&t));
    if (level < first) continue;
    m = t.full;
    PetscCall(add_cut_cells(&t, ldexp(BEND, (int)(first - level)), &m));
    PetscCheck(m.v > 0 || level < last, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "A shape has no inside: its distance is nowhere negative within its bounding radius %g, or it is thinner than %g", (double)r,
               (double)TreeCellWidth(&t));
    if (m.v <= 0) continue;
    ConvertMoments(dim, &m, mass);
    if (old.volume > 0) {
      const PetscReal now = compare_masses(&old, mass);

      error  = dim == 2 ? now : estimate_error(change, now);
      change = now;
    }
    if (error <= tolerance) break;
    old = *mass;
  }
  PetscCall(TreeDestroy(&t));
  if (dim == 3 && error > tolerance)
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
