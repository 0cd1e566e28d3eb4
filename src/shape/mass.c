/* Shape, mass: volume, moments, bounding radius about the centroid, whether it is a disc; by the tree of cells where a
   plugin gives none (see shape/host.h, impl.h, tree.h). */
#include "compat.h"
#include "guard.h"
#include "tree.h"
#include "base/log.h"

/* ---- mass ---- */

#define MAX_CELLS 100000 /* that may be cut, of a level that is refined once more: 2 s, 50 MB */

/* Raw moments about the body origin to centroid and inertia about it. */
static void ConvertMoments(PetscInt dim, const Moments *m, ShapeMass *mass)
{
  PetscReal s[6];

  for (PetscInt a = 0; a < 3; a++) mass->centroid[a] = a < dim ? m->x[a] / m->v : 0.0;
  for (PetscInt k = 0; k < 6; k++)
    s[k] = m->xx[k] - m->v * mass->centroid[TREE_PAIR[k][0]] * mass->centroid[TREE_PAIR[k][1]];
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
static PetscErrorCode add_cut_cells(const Tree *t, PetscReal curvature, Moments *m)
{
  Tree smooth = *t;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(t->n * t->dim, &smooth.cell));
  PetscCall(PetscArraycpy(smooth.cell, t->cell, t->n * t->dim));
  for (PetscInt level = 0; t->dim == 3 && level < DEEPER && smooth.n && smooth.n <= MAX_CELLS; level++) {
    Tree rough;

    PetscCall(TreeSplit(&smooth, curvature, &rough));
    PetscCall(TreeAddCutCells(&smooth, m));
    PetscCall(TreeAddBends(&smooth, m));
    PetscCall(TreeDestroy(&smooth));
    PetscCall(TreeRefine(&rough));
    for (size_t i = 0; i < sizeof(Moments) / sizeof(PetscReal); i++) (&m->v)[i] += (&rough.full.v)[i];
    PetscCall(PetscMemzero(&rough.full, sizeof(rough.full)));
    smooth = rough;
  }
  PetscCall(TreeAddCutCells(&smooth, m));
  if (t->dim == 3) PetscCall(TreeAddBends(&smooth, m));
  PetscCall(TreeDestroy(&smooth));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest relative change of volume and moment of inertia */
static PetscReal compare_masses(const ShapeMass *a, const ShapeMass *b)
{
  return PetscMax(PetscAbsReal(b->volume - a->volume) / b->volume,
                  PetscAbsReal(b->inertia[2] - a->inertia[2]) / b->inertia[2]);
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
  for (PetscInt level = 1; level <= last && (dim == 2 || t.n <= MAX_CELLS || old.volume <= 0); level++) {
    PetscCall(TreeRefine(&t));
    if (level < first) continue;
    m = t.full;
    PetscCall(add_cut_cells(&t, ldexp(BEND, (int)(first - level)), &m));
    PetscCheck(m.v > 0 || level < last, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
               "A shape has no inside: its distance is nowhere negative within its bounding radius %g, or it is thinner than %g",
               (double)r, (double)TreeCellWidth(&t));
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
    PetscCall(
      LogRemark("volume and inertia of shape '%s' by quadrature of its distance are uncertain by %.1g: give it the operation mass",
                s->loaded->type, (double)error));
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
               "Shape '%s' has volume %g, which must be positive and finite: check its options -%s* and 'tumble-test-shape %s'",
               s->loaded->type, (double)s->mass.volume, s->prefix, s->loaded->file);
    s->have_mass = PETSC_TRUE;
  }
  *m = s->mass;
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
  const PetscReal known = r + VectorLength(dim, c); /* the plugin's own bound: the extreme points reach it, mostly */
  Tree            t;
  PetscReal       lower = 0, upper = 0;

  PetscFunctionBeginUser;
  PetscCall(TreeCreate(s, r, dim, &t));
  for (PetscInt level = 1; level <= 20; level++) {
    PetscCall(TreeRefine(&t));
    PetscCall(PruneFar(&t, c, &lower, &upper));
    if (PetscMin(upper, known) - lower <= 1e-4 * r || t.n > 100000) break;
  }
  PetscCall(TreeDestroy(&t));
  /* nothing left: the distance is not 1-Lipschitz, so only the plugin's own bound holds */
  *radius = upper > 0 ? PetscMin(upper, known) : known;
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

/* ---- discs ---- */

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
      ShapeSpreadDirection(s->dim, k, N, e);
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
