static char help[] =
  "Conformance suite for shape plugins: runs every check of the shape contract (include/shape.h) on one plugin.\n"
  "  conformance path/to/x.so [-shape_<option> value ...] [-conformance_dim 2|3] [-conformance_points n] [-conformance_grid file.csv]\n"
  "Prints one line a property, FAIL lines with the point that breaks it, and last 'N passed, N failed'. The exit status is 1 if any failed.\n\n";
/* Each check is a function that leaves in `why` what is wrong, or nothing. An error raised inside a check fails that
   check.
   Random points come from a fixed sequence, so a failure repeats. Needs one rank. What it cannot see: a distance that
   is consistent but belongs to another shape than its author meant; look at the picture that tools/view-shape draws. */
#include "compat.h"
#include "shape/host.h"
#include "base/opt.h"
#include <stdarg.h>
#include <stdlib.h>

#define PREFIX "shape_"
#define WHY    1024

typedef struct {
  Shape       shape;
  const char *type;
  PetscInt    dim, n;    /* points in each random cloud */
  PetscReal   radius;    /* about the body origin */
  PetscReal  *cloud;     /* [n][dim] in the box of 1.5 radius */
  PetscReal  *near;      /* [n][dim] within a tenth of the radius of the surface */
  PetscReal  *d, *dnear; /* [n] their distances */
  PetscInt    nsurface;
  PetscReal  *xs, *ws; /* surface points and weights */
  PetscReal   total;   /* sum of weights */
  PetscInt    passed, failed;
} Suite;

typedef PetscErrorCode (*Check)(Suite *, char why[]);

/* ---- helpers ---- */

static PetscReal Random(PetscReal lo, PetscReal hi)
{
  static unsigned long long state = 88172645463325252ULL;

  state ^= state << 13;
  state ^= state >> 7;
  state ^= state << 17;
  return lo + (hi - lo) * ((PetscReal)(state >> 11) / 9007199254740992.0);
}

static PetscReal Separation(PetscInt dim, const PetscReal a[], const PetscReal b[])
{
  PetscReal s = 0;

  for (PetscInt k = 0; k < dim; k++) s += PetscSqr(a[k] - b[k]);
  return PetscSqrtReal(s);
}

/* "at (x, y[, z]): ..." */
static PetscErrorCode Blame(const Suite *t, char why[], const PetscReal x[], const char format[], ...)
{
  size_t  len;
  va_list args;

  PetscFunctionBeginUser;
  if (t->dim == 2) PetscCall(PetscSNPrintf(why, WHY, "at (%.8g, %.8g): ", (double)x[0], (double)x[1]));
  else PetscCall(PetscSNPrintf(why, WHY, "at (%.8g, %.8g, %.8g): ", (double)x[0], (double)x[1], (double)x[2]));
  PetscCall(PetscStrlen(why, &len));
  va_start(args, format);
  PetscCall(PetscVSNPrintf(why + len, WHY - len, format, NULL, args));
  va_end(args);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Keeps the first message instead of printing a trace. ctx: char[WHY]. */
static PetscErrorCode KeepMessage(MPI_Comm comm, int line, const char *func, const char *file, PetscErrorCode code,
                                  PetscErrorType type, const char *message, void *ctx)
{
  (void)comm;
  (void)line;
  (void)func;
  (void)file;
  if (type == PETSC_ERROR_INITIAL && message) (void)PetscStrncpy((char *)ctx, message, WHY);
  return code;
}

static void RunCheck(Suite *t, const char name[], Check check)
{
  char           why[WHY] = "", message[WHY] = "";
  PetscErrorCode ierr;

  (void)PetscPrintf(PETSC_COMM_SELF, "run  %" PetscInt_FMT "D %s\r", t->dim, name); /* in case it never ends */
  (void)fflush(PETSC_STDOUT);
  (void)PetscPushErrorHandler(KeepMessage, message);
  ierr = check(t, why);
  (void)PetscPopErrorHandler();
  if (ierr && !why[0]) (void)PetscSNPrintf(why, WHY, "error %d: %s", (int)ierr, message);
  if (why[0]) t->failed++;
  else t->passed++;
  (void)PetscPrintf(PETSC_COMM_SELF, "%s %" PetscInt_FMT "D %s%s%s\n", why[0] ? "FAIL" : "ok  ", t->dim, name,
                    why[0] ? ": " : "", why);
}

/* ---- sampling ---- */

static PetscErrorCode MakeClouds(Suite *t, char why[])
{
  PetscReal *normal;

  PetscFunctionBeginUser;
  (void)why;
  for (PetscInt i = 0; i < t->n * t->dim; i++) t->cloud[i] = Random(-1.5 * t->radius, 1.5 * t->radius);
  PetscCall(ShapeDistance(t->shape, t->n, t->cloud, t->d));
  PetscCall(ShapeSurface(t->shape, t->nsurface, t->xs, t->ws));
  t->total = 0;
  for (PetscInt i = 0; i < t->nsurface; i++) t->total += t->ws[i];
  PetscCall(PetscMalloc1(t->nsurface * t->dim, &normal));
  PetscCall(ShapeNormal(t->shape, t->nsurface, t->xs, normal));
  for (PetscInt i = 0; i < t->n; i++) {
    const PetscInt  k = (PetscInt)Random(0, (PetscReal)t->nsurface);
    const PetscReal r = 0.1 * t->radius * Random(-1, 1) * (i % 2 ? 1.0 : 1e-2);

    for (PetscInt a = 0; a < t->dim; a++)
      t->near[i * t->dim + a] = t->xs[k * t->dim + a] + r * normal[k * t->dim + a] +
                                0.3 * PetscAbsReal(r) * Random(-1, 1);
  }
  PetscCall(PetscFree(normal));
  PetscCall(ShapeDistance(t->shape, t->n, t->near, t->dnear));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- checks ---- */

/* Inside by the winding of the outline (2D; loops are told apart by jumps) or by Gauss's solid angle of the surface
   points (3D): about 1 inside, 0 outside. */
static PetscReal Winding2D(const Suite *t, const PetscReal x[])
{
  const PetscReal jump  = 1.5 * t->total / (PetscReal)t->nsurface;
  PetscInt        first = 0, winding = 0;

  for (PetscInt i = 0; i < t->nsurface; i++) {
    const PetscReal *a = t->xs + 2 * i, *b = i + 1 < t->nsurface ? a + 2 : t->xs + 2 * first;
    PetscReal        side;

    if (i + 1 < t->nsurface && Separation(2, a, b) > jump) {
      b     = t->xs + 2 * first;
      first = i + 1;
    }
    side = (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0]);
    if (a[1] <= x[1] && b[1] > x[1] && side > 0) winding++;
    if (a[1] > x[1] && b[1] <= x[1] && side < 0) winding--;
  }
  return (PetscReal)winding;
}

static PetscReal Winding3D(const Suite *t, const PetscReal normal[], const PetscReal x[])
{
  PetscReal sum = 0;

  for (PetscInt i = 0; i < t->nsurface; i++) {
    const PetscReal r    = Separation(3, t->xs + 3 * i, x);
    PetscReal       flux = 0;

    for (PetscInt a = 0; a < 3; a++) flux += (t->xs[3 * i + a] - x[a]) * normal[3 * i + a];
    sum += t->ws[i] * flux / (r * r * r);
  }
  return sum / (4.0 * PETSC_PI);
}

static PetscErrorCode CheckSign(Suite *t, char why[])
{
  const PetscReal spacing = t->dim == 2 ? t->total / (PetscReal)t->nsurface
                                        : PetscSqrtReal(t->total / (PetscReal)t->nsurface);
  PetscReal      *normal;
  PetscInt        tested = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(t->nsurface * t->dim, &normal));
  PetscCall(ShapeNormal(t->shape, t->nsurface, t->xs, normal));
  for (PetscInt i = 0; i < 2 * t->n && !why[0]; i++) {
    const PetscReal *x = i < t->n ? t->cloud + i * t->dim : t->near + (i - t->n) * t->dim,
                    d  = i < t->n ? t->d[i] : t->dnear[i - t->n];
    PetscReal inside;

    if (PetscAbsReal(d) < (t->dim == 2 ? 1.0 : 3.0) * spacing) continue; /* the outline is known to about its spacing */
    tested++;
    inside = t->dim == 2 ? Winding2D(t, x) : Winding3D(t, normal, x);
    if ((inside > 0.5) != (d < 0))
      PetscCall(Blame(t, why, x, "distance %g says %s, the surface points wind around it %g times", (double)d,
                      d < 0 ? "inside" : "outside", (double)inside));
  }
  PetscCall(PetscFree(normal));
  if (!why[0] && tested < t->n / 10)
    PetscCall(PetscSNPrintf(why, WHY, "only %d points are far enough from the surface to be tested", (int)tested));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode CheckLipschitz(Suite *t, char why[])
{
  PetscReal *y, *d, slack = 1e-10 * t->radius;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(t->n * t->dim, &y, t->n, &d));
  for (PetscInt round = 0; round < 8 && !why[0]; round++) { /* partners ever closer, from the cloud and from near the
                                                               surface */
    const PetscReal *x = round % 2 ? t->near : t->cloud, *dx = round % 2 ? t->dnear : t->d,
                    reach = t->radius * PetscPowReal(10.0, -(PetscReal)(round / 2));

    for (PetscInt i = 0; i < t->n * t->dim; i++) y[i] = x[i] + reach * Random(-1, 1);
    PetscCall(ShapeDistance(t->shape, t->n, y, d));
    for (PetscInt i = 0; i < t->n && !why[0]; i++) {
      const PetscReal r = Separation(t->dim, x + i * t->dim, y + i * t->dim);

      if (PetscAbsReal(d[i] - dx[i]) > r * (1.0 + 1e-8) + slack)
        PetscCall(
          Blame(t, why, x + i * t->dim, "the distance changes by %g on the way to (%.8g, %.8g), which is only %g away",
                (double)PetscAbsReal(d[i] - dx[i]), (double)y[i * t->dim], (double)y[i * t->dim + 1], (double)r));
    }
  }
  PetscCall(PetscFree2(y, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Gradient by central differences, its length, and how much the distance bends over the stencil: a kink if not
   small. */
static PetscErrorCode Gradient(const Suite *t, const PetscReal x[], PetscReal g[], PetscReal *length, PetscBool *kink)
{
  static const PetscReal zero[3] = {0, 0, 0};
  const PetscReal        h       = 1e-5 * t->radius;
  PetscReal              p[7 * 3], d[7];
  const PetscInt         m = 2 * t->dim; /* the last point is x itself */

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k <= m; k++)
    for (PetscInt a = 0; a < t->dim; a++) p[k * t->dim + a] = x[a] + (a == k / 2 && k < m ? (k % 2 ? h : -h) : 0.0);
  PetscCall(ShapeDistance(t->shape, m + 1, p, d));
  *kink = PETSC_FALSE;
  for (PetscInt a = 0; a < t->dim; a++) {
    g[a] = (d[2 * a + 1] - d[2 * a]) / (2.0 * h);
    if (PetscAbsReal(d[2 * a + 1] + d[2 * a] - 2.0 * d[m]) > 1e-2 * h) *kink = PETSC_TRUE;
  }
  *length = Separation(t->dim, g, zero);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The projection is on the surface and |d| away: then |d| is at least the distance; being 1-Lipschitz, it is also at
   most that. At kinks the closest point is not unique and the point is passed over. A shape that says so may stay below
   the distance, at no more than a third of the points. */
static PetscErrorCode CheckEuclidean(Suite *t, char why[])
{
  PetscReal *y;
  PetscInt   tested = 0, below = 0;
  PetscBool  bound;

  PetscFunctionBeginUser;
  PetscCall(ShapeIsBound(t->shape, &bound));
  PetscCall(PetscMalloc1(t->n * t->dim, &y));
  PetscCall(ShapeProject(t->shape, t->n, t->near, y));
  for (PetscInt i = 0; i < t->n && !why[0]; i++) {
    const PetscReal r = Separation(t->dim, t->near + i * t->dim, y + i * t->dim), d = PetscAbsReal(t->dnear[i]);
    /* the last term: differenced normals near sharp edges */
    const PetscReal slack = 1e-6 * d + 1e-9 * t->radius + PetscSqr(1e-5 * t->radius) / d;
    PetscReal       g[3], len;
    PetscBool       kink;

    PetscCall(Gradient(t, t->near + i * t->dim, g, &len, &kink));
    if (kink || d > 0.1 * t->radius) continue;
    tested++;
    below += r > d + slack;
    if (r < d - slack || (r > d + slack && !bound))
      PetscCall(Blame(t, why, t->near + i * t->dim,
                      "distance %.10g, but the closest surface point found is %.10g away (gradient %g)",
                      (double)t->dnear[i], (double)r, (double)len));
  }
  PetscCall(PetscFree(y));
  if (!why[0] && tested < t->n / 3)
    PetscCall(
      PetscSNPrintf(why, WHY, "only %d of %d points near the surface are away from kinks", (int)tested, (int)t->n));
  if (!why[0] && 3 * below > tested)
    PetscCall(PetscSNPrintf(why, WHY,
                            "the distance is below that to the closest surface point found at %d of %d points",
                            (int)below, (int)tested));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode CheckNormal(Suite *t, char why[])
{
  static const PetscReal zero[3] = {0, 0, 0};
  PetscReal             *normal, origin[3] = {0, 0, 0}, no[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(t->n * t->dim, &normal));
  for (PetscInt round = 0; round < 2 && !why[0]; round++) {
    const PetscReal *x = round ? t->near : t->cloud;

    PetscCall(ShapeNormal(t->shape, t->n, x, normal));
    for (PetscInt i = 0; i < t->n && !why[0]; i++) {
      PetscReal g[3], len, unit = Separation(t->dim, normal + i * t->dim, zero);
      PetscBool kink;

      if (!(PetscAbsReal(unit - 1.0) <= 1e-9))
        PetscCall(Blame(t, why, x + i * t->dim, "the normal has length %.10g", (double)unit));
      PetscCall(Gradient(t, x + i * t->dim, g, &len, &kink));
      /* off unit: a distance that is not Euclidean far away */
      if (why[0] || kink || PetscAbsReal(len - 1.0) > 1e-5) continue;
      if (Separation(t->dim, g, normal + i * t->dim) > 1e-3)
        PetscCall(Blame(t, why, x + i * t->dim,
                        "the normal (%.6g, %.6g) is not the gradient of the distance (%.6g, %.6g)",
                        (double)normal[i * t->dim], (double)normal[i * t->dim + 1], (double)g[0], (double)g[1]));
    }
  }
  PetscCall(PetscFree(normal));
  PetscCall(ShapeNormal(t->shape, 1, origin, no)); /* where symmetric shapes have no direction of their own */
  if (!why[0] && !(PetscAbsReal(Separation(t->dim, no, zero) - 1.0) <= 1e-9))
    PetscCall(Blame(t, why, origin, "the normal has length %g", (double)Separation(t->dim, no, zero)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode CheckRadius(Suite *t, char why[])
{
  static const PetscReal zero[3] = {0, 0, 0};
  const PetscReal        slack   = 1.0 + 1e-9;
  PetscReal              about_centroid;
  ShapeMass              m;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(t->shape, &m));
  PetscCall(ShapeGetRadius(t->shape, &about_centroid));
  for (PetscInt i = 0; i < t->nsurface + 2 * t->n && !why[0]; i++) {
    const PetscInt   j = i - t->nsurface;
    const PetscReal *x = j < 0 ? t->xs + i * t->dim : j < t->n ? t->cloud + j * t->dim : t->near + (j - t->n) * t->dim;
    const PetscReal  d = j < 0 ? 0.0 : j < t->n ? t->d[j] : t->dnear[j - t->n];

    if (d > 0) continue;
    if (Separation(t->dim, x, zero) > t->radius * slack)
      PetscCall(Blame(t, why, x, "inside or on the surface, but %.10g from the origin: the bounding radius is %.10g",
                      (double)Separation(t->dim, x, zero), (double)t->radius));
    else if (Separation(t->dim, x, m.centroid) > about_centroid * slack)
      PetscCall(Blame(t, why, x,
                      "inside or on the surface, but %.10g from the centroid: the bounding radius there is %.10g",
                      (double)Separation(t->dim, x, m.centroid), (double)about_centroid));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Quasi-Monte Carlo with n points of an additive sequence (powers of the root of g^(dim+1) = g + 1) over the box around
   the surface points. Only the sign of the distance counts, so thin bodies are no harder than thick ones; the error
   falls like n^-0.75 (2D), n^-0.67 (3D). */
static PetscErrorCode QuadratureMass(const Suite *t, PetscInt n, ShapeMass *m)
{
  enum {
    BATCH = 128
  };
  const PetscInt  dim = t->dim;
  const PetscReal g   = dim == 2 ? 1.324717957244746 : 1.220744084605760;
  PetscReal       x[BATCH * 3], d[BATCH], lo[3], hi[3], box = 1, v = 0, s[3] = {0, 0, 0}, xx[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < dim; a++) {
    lo[a] = PETSC_MAX_REAL;
    hi[a] = -PETSC_MAX_REAL;
    for (PetscInt i = 0; i < t->nsurface; i++) {
      lo[a] = PetscMin(lo[a], t->xs[i * dim + a]);
      hi[a] = PetscMax(hi[a], t->xs[i * dim + a]);
    }
    hi[a] += 0.05 * (hi[a] - lo[a]);
    lo[a] -= 0.05 * (hi[a] - lo[a]);
    box *= hi[a] - lo[a];
  }
  for (PetscInt start = 0; start < n; start += BATCH) {
    for (PetscInt i = 0; i < BATCH; i++)
      for (PetscInt a = 0; a < dim; a++) {
        const PetscReal u = 0.5 + (PetscReal)(start + i + 1) * PetscPowReal(g, -(PetscReal)(a + 1));

        x[i * dim + a] = lo[a] + (hi[a] - lo[a]) * (u - PetscFloorReal(u));
      }
    PetscCall(ShapeDistance(t->shape, BATCH, x, d));
    for (PetscInt i = 0; i < PetscMin(BATCH, n - start); i++) {
      const PetscReal part = d[i] < 0 ? box / (PetscReal)n : 0.0;

      v += part;
      for (PetscInt a = 0; a < dim; a++) {
        s[a] += part * x[i * dim + a];
        xx[a] += part * PetscSqr(x[i * dim + a]);
      }
    }
  }
  PetscCall(PetscMemzero(m, sizeof(*m)));
  m->volume = v;
  for (PetscInt a = 0; a < dim; a++) {
    m->centroid[a] = v > 0 ? s[a] / v : 0.0;
    xx[a] -= v * PetscSqr(m->centroid[a]);
  }
  m->inertia[2] = xx[0] + xx[1];
  if (dim == 3) {
    m->inertia[0] = xx[1] + xx[2];
    m->inertia[1] = xx[0] + xx[2];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Largest relative difference of two sets of mass properties, and which it is. */
static PetscReal CompareMass(const Suite *t, const ShapeMass *a, const ShapeMass *b, const char **what)
{
  const char *axis[3] = {"inertia xx", "inertia yy", "inertia zz"};
  PetscReal   worst   = PetscAbsReal(a->volume - b->volume) / b->volume,
            e         = Separation(3, a->centroid, b->centroid) / t->radius;

  *what = "volume";
  if (e > worst) {
    worst = e;
    *what = "centroid";
  }
  for (PetscInt k = t->dim == 2 ? 2 : 0; k < 3; k++) {
    e = PetscAbsReal(a->inertia[k] - b->inertia[k]) / b->inertia[k];
    if (e > worst) {
      worst = e;
      *what = axis[k];
    }
  }
  return worst;
}

static PetscErrorCode CheckMass(Suite *t, char why[])
{
  const PetscReal limit = t->dim == 2 ? 2e-3 : 1e-2;
  const PetscInt  few = t->dim == 2 ? 50000 : 12500, many = 4 * few; /* their errors are a tenth of the limits */
  ShapeMass       m, coarse, fine;
  PetscReal       e1, e2;
  const char     *what;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(t->shape, &m));
  PetscCall(QuadratureMass(t, few, &coarse));
  PetscCall(QuadratureMass(t, many, &fine));
  e1 = CompareMass(t, &coarse, &m, &what);
  e2 = CompareMass(t, &fine, &m, &what);
  if (!(e2 <= limit && e1 <= 3.0 * limit))
    PetscCall(
      PetscSNPrintf(why, WHY,
                    "%s differs from quadrature of the distance by %.3g (%d points) and %.3g (%d), relative; allowed %g. Volume %.8g, quadrature %.8g",
                    what, (double)e1, (int)few, (double)e2, (int)many, (double)limit, (double)m.volume,
                    (double)fine.volume));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Points on the surface, positive weights, and the divergence theorem: sum of w n.x = dim * volume. In 2D
   counter-clockwise. */
static PetscErrorCode CheckSurface(Suite *t, char why[])
{
  const PetscInt  dim   = t->dim;
  const PetscReal limit = dim == 2 ? 2e-3 : 3e-2, even = t->total / (PetscReal)t->nsurface;
  PetscReal      *d, *normal, flux = 0, area2 = 0, coarse = 0, *xc, *wc;
  const PetscInt  nc = t->nsurface / 8;
  ShapeMass       m;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(t->shape, &m));
  PetscCall(PetscMalloc4(t->nsurface, &d, t->nsurface * dim, &normal, nc * dim, &xc, nc, &wc));
  PetscCall(ShapeDistance(t->shape, t->nsurface, t->xs, d));
  PetscCall(ShapeNormal(t->shape, t->nsurface, t->xs, normal));
  PetscCall(ShapeSurface(t->shape, nc, xc, wc));
  for (PetscInt i = 0; i < nc; i++) coarse += wc[i];
  for (PetscInt i = 0; i < t->nsurface && !why[0]; i++) {
    const PetscReal *x = t->xs + i * dim, *next = t->xs + (i + 1) % t->nsurface * dim;

    if (!(PetscAbsReal(d[i]) <= 1e-9 * t->radius))
      PetscCall(Blame(t, why, x, "surface point %d has distance %g", (int)i, (double)d[i]));
    else if (!(t->ws[i] > 0)) PetscCall(Blame(t, why, x, "surface point %d has weight %g", (int)i, (double)t->ws[i]));
    for (PetscInt a = 0; a < dim; a++) flux += t->ws[i] * normal[i * dim + a] * (x[a] - m.centroid[a]);
    area2 += x[0] * next[1] - x[1] * next[0];
  }
  if (why[0]) { /* nothing to add */
  } else if (dim == 2 && !(area2 > 0)) PetscCall(PetscSNPrintf(why, WHY, "the surface points run clockwise"));
  else if (!(PetscAbsReal(coarse - t->total) <= limit * t->total))
    PetscCall(PetscSNPrintf(why, WHY, "the weights of %d points add up to %.8g, of %d points to %.8g", (int)nc,
                            (double)coarse, (int)t->nsurface, (double)t->total));
  else if (!(PetscAbsReal(flux - (PetscReal)dim * m.volume) <=
             limit * (PetscReal)dim * m.volume +
               /* the last for thin tips and rims */
               0.25 * even * t->radius * (dim == 2 ? 1.0 : PetscSqrtReal((PetscReal)t->nsurface))))
    PetscCall(PetscSNPrintf(why, WHY, "the divergence theorem gives volume %.8g from the weights, the shape says %.8g",
                            (double)(flux / (PetscReal)dim), (double)m.volume));
  PetscCall(PetscFree4(d, normal, xc, wc));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the normal turn by more than 25 degrees between surface points close to corner c? */
static PetscErrorCode NormalJumps(const Suite *t, const PetscReal c[], PetscBool *yes)
{
  enum {
    AROUND = 64
  };
  const PetscInt  dim = t->dim;
  const PetscReal eps = 1e-4 * t->radius;
  PetscReal       y[3 * AROUND], normal[3 * AROUND], least = 1;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < AROUND * dim; i++) y[i] = c[i % dim] + eps * Random(-1, 1);
  PetscCall(ShapeProject(t->shape, AROUND, y, y));
  PetscCall(ShapeNormal(t->shape, AROUND, y, normal));
  for (PetscInt i = 0; i < AROUND * AROUND; i++) {
    const PetscInt j = i / AROUND, k = i % AROUND;
    PetscReal      dot = 0;

    /* on it: any normal */
    if (Separation(dim, y + dim * j, c) < 1e-3 * eps || Separation(dim, y + dim * k, c) < 1e-3 * eps) continue;
    for (PetscInt a = 0; a < dim; a++) dot += normal[dim * j + a] * normal[dim * k + a];
    least = PetscMin(least, dot);
  }
  *yes = (PetscBool)(least < 0.906);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Between surface points x and y, whose normals differ: halve the way to the largest turn of the normal until it is as
   short as round-off lets it be; *at: where, if the turn is still 45 degrees */
static PetscErrorCode FollowTurn(const Suite *t, const PetscReal x[], const PetscReal y[], PetscReal at[],
                                 PetscBool *jumps)
{
  PetscReal p[6] = {x[0], x[1], 0, 0, y[0], y[1]}, normal[6];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 12; i++) {
    PetscReal dot[2];

    for (PetscInt a = 0; a < 2; a++) p[2 + a] = 0.5 * (p[a] + p[4 + a]);
    PetscCall(ShapeProject(t->shape, 3, p, p));
    PetscCall(ShapeNormal(t->shape, 3, p, normal));
    for (PetscInt v = 0; v < 2; v++) dot[v] = normal[2 * v] * normal[2 * v + 2] + normal[2 * v + 1] * normal[2 * v + 3];
    if (dot[0] < dot[1]) PetscCall(PetscArraycpy(p + 4, p + 2, 2));
    else PetscCall(PetscArraycpy(p, p + 2, 2));
    *jumps = (PetscBool)(PetscMin(dot[0], dot[1]) < PETSC_SQRT2 / 2);
    if (!*jumps) break;
  }
  for (PetscInt a = 0; a < 2; a++) at[a] = 0.5 * (p[a] + p[4 + a]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode FindMissingCorner(const Suite *t, PetscInt n, const PetscReal c[], char why[])
{
  const PetscReal even = t->total / (PetscReal)t->nsurface;
  PetscReal      *normal, at[2];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * t->nsurface, &normal));
  PetscCall(ShapeNormal(t->shape, t->nsurface, t->xs, normal));
  for (PetscInt i = 0; i < t->nsurface && !why[0]; i++) {
    const PetscInt j     = (i + 1) % t->nsurface;
    PetscBool      jumps = PETSC_FALSE, named = PETSC_FALSE;

    if (normal[2 * i] * normal[2 * j] + normal[2 * i + 1] * normal[2 * j + 1] > PETSC_SQRT2 / 2) continue;
    if (Separation(2, t->xs + 2 * i, t->xs + 2 * j) > 1.5 * even) continue; /* another loop */
    PetscCall(FollowTurn(t, t->xs + 2 * i, t->xs + 2 * j, at, &jumps));
    for (PetscInt k = 0; k < n; k++) named = (PetscBool)(named || Separation(2, c + 2 * k, at) < 2 * even);
    if (jumps && !named) PetscCall(Blame(t, why, at, "the outline has a corner here that the shape does not name"));
  }
  PetscCall(PetscFree(normal));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Corners: on the surface, the normal jumps there, no two the same, and the count does not depend on the room given.
   In 2D there is one wherever the normal turns by 45 degrees within next to nothing. */
static PetscErrorCode CheckCorners(Suite *t, char why[])
{
  const ShapePlugin *plugin;
  const PetscReal   *c;
  PetscInt           n, dim = t->dim;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetPlugin(t->shape, &plugin));
  PetscCall(ShapeGetCorners(t->shape, &n, &c));
  for (PetscInt i = 0; i < n && !why[0]; i++) {
    PetscReal d;
    PetscBool jumps;

    PetscCall(ShapeDistance(t->shape, 1, c + dim * i, &d));
    PetscCall(NormalJumps(t, c + dim * i, &jumps));
    if (!(PetscAbsReal(d) <= 1e-8 * t->radius))
      PetscCall(Blame(t, why, c + dim * i, "corner %d has distance %g", (int)i, (double)d));
    else if (!jumps) PetscCall(Blame(t, why, c + dim * i, "the normal does not jump at corner %d", (int)i));
    for (PetscInt j = 0; j < i && !why[0]; j++)
      if (Separation(dim, c + dim * i, c + dim * j) < 1e-8 * t->radius)
        PetscCall(Blame(t, why, c + dim * i, "corners %d and %d are the same", (int)j, (int)i));
  }
  if (!why[0] && plugin->interface > 1 && plugin->ops.corners) {
    PetscReal none[3] = {0};
    PetscInt  again;

    PetscCall(plugin->ops.corners(t->shape, 0, &again, none));
    if (again != n) PetscCall(PetscSNPrintf(why, WHY, "%d corners with room for them, %d without", (int)n, (int)again));
  }
  if (!why[0] && dim == 2) PetscCall(FindMissingCorner(t, n, c, why));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Same bits from a second call and a second object; the same to round-off one point at a time (vector and scalar code
   may round differently). */
static PetscErrorCode CheckDeterminism(Suite *t, char why[])
{
  Shape      twin;
  PetscReal *d, *xs, *ws;
  ShapeMass  m, m2;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(t->n, &d, 100 * t->dim, &xs, 100, &ws));
  PetscCall(ShapeCreate(t->type, PREFIX, t->dim, &twin));
  for (PetscInt round = 0; round < 2 && !why[0]; round++) {
    PetscCall(ShapeDistance(round ? twin : t->shape, t->n, t->cloud, d));
    for (PetscInt i = 0; i < t->n && !why[0]; i++)
      if (d[i] != t->d[i])
        PetscCall(Blame(t, why, t->cloud + i * t->dim, "distance %.17g, %s %.17g", (double)t->d[i],
                        round ? "of a second object" : "at the second call", (double)d[i]));
  }
  for (PetscInt i = 0; i < t->n && !why[0]; i++) {
    PetscCall(ShapeDistance(t->shape, 1, t->cloud + i * t->dim, d));
    if (PetscAbsReal(d[0] - t->d[i]) > 1e-13 * t->radius)
      PetscCall(
        Blame(t, why, t->cloud + i * t->dim, "distance %.17g in a batch, %.17g alone", (double)t->d[i], (double)d[0]));
  }
  PetscCall(ShapeGetMass(t->shape, &m));
  PetscCall(ShapeGetMass(twin, &m2));
  if (!why[0] && (m.volume != m2.volume || m.inertia[2] != m2.inertia[2]))
    PetscCall(PetscSNPrintf(why, WHY, "two objects have volumes %.17g and %.17g", (double)m.volume, (double)m2.volume));
  PetscCall(ShapeDestroy(&twin));
  PetscCall(PetscFree3(d, xs, ws));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode CheckEmptyBatch(Suite *t, char why[])
{
  PetscFunctionBeginUser;
  (void)why;
  PetscCall(ShapeDistance(t->shape, 0, NULL, NULL));
  PetscCall(ShapeNormal(t->shape, 0, NULL, NULL));
  PetscCall(ShapeProject(t->shape, 0, NULL, NULL));
  PetscCall(ShapeSurface(t->shape, 0, NULL, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Up to 1e6 radii away: positive, no larger than the way to the body, with a unit normal. Bodies in a large domain ask
   this. */
static PetscErrorCode CheckFarPoints(Suite *t, char why[])
{
  static const PetscReal zero[3] = {0, 0, 0};
  PetscReal              x[3], d, normal[3];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 200 && !why[0]; i++) {
    PetscReal r;

    for (PetscInt a = 0; a < t->dim; a++) x[a] = t->radius * 1e6 * Random(-1, 1);
    PetscCall(ShapeDistance(t->shape, 1, x, &d));
    PetscCall(ShapeNormal(t->shape, 1, x, normal));
    r = Separation(t->dim, x, zero);
    if (!(d > 0 && d <= r + t->radius * (1.0 + 1e-6)))
      PetscCall(Blame(t, why, x, "distance %g, the body is %g away", (double)d, (double)r));
    else if (!(PetscAbsReal(Separation(t->dim, normal, zero) - 1.0) <= 1e-9))
      PetscCall(Blame(t, why, x, "the normal is not unit"));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Creating the shape with one bad option must fail with a message that names the option. */
static PetscErrorCode RefuseOption(Suite *t, const char name[], const char value[], char why[])
{
  char           full[256], before[256], message[WHY] = "";
  PetscBool      given;
  PetscErrorCode ierr;
  Shape          s = NULL;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(full, sizeof(full), "-%s%s", PREFIX, name));
  PetscCall(PetscOptionsGetString(NULL, NULL, full, before, sizeof(before), &given));
  PetscCall(PetscOptionsSetValue(NULL, full, value));
  PetscCall(PetscPushErrorHandler(KeepMessage, message));
  ierr = ShapeCreate(t->type, PREFIX, t->dim, &s);
  PetscCall(PetscPopErrorHandler());
  if (given) PetscCall(PetscOptionsSetValue(NULL, full, before));
  else PetscCall(PetscOptionsClearValue(NULL, full));
  if (!ierr) {
    PetscCall(PetscSNPrintf(why, WHY, "%s %s is accepted, which is out of its range", full, value));
    PetscCall(ShapeDestroy(&s));
  } else if (!strstr(message, name))
    PetscCall(PetscSNPrintf(why, WHY, "%s %s is refused, but the message does not name the option: %.400s", full, value,
                            message));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The finite ends of a range are allowed values: they must work, or be refused (two options that do not fit) by a
   message that names the option. */
static PetscErrorCode TryEnd(Suite *t, const char name[], PetscReal end, char why[])
{
  char           full[256], before[256], value[64], message[WHY] = "";
  PetscBool      given;
  PetscErrorCode ierr;
  Shape          s = NULL;

  PetscFunctionBeginUser;
  PetscCall(PetscSNPrintf(full, sizeof(full), "-%s%s", PREFIX, name));
  PetscCall(PetscSNPrintf(value, sizeof(value), "%.17g", (double)end));
  PetscCall(PetscOptionsGetString(NULL, NULL, full, before, sizeof(before), &given));
  PetscCall(PetscOptionsSetValue(NULL, full, value));
  PetscCall(PetscPushErrorHandler(KeepMessage, message));
  ierr = ShapeCreate(t->type, PREFIX, t->dim, &s);
  PetscCall(PetscPopErrorHandler());
  if (given) PetscCall(PetscOptionsSetValue(NULL, full, before));
  else PetscCall(PetscOptionsClearValue(NULL, full));
  if (ierr && !strstr(message, name))
    PetscCall(PetscSNPrintf(why, WHY,
                            "%s %s is within its range, but fails with a message that does not name the option: %.400s",
                            full, value, message));
  PetscCall(ShapeDestroy(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode CheckOptions(Suite *t, char why[])
{
  const char *name;
  PetscReal   lower, upper;
  char        value[64];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; !why[0]; i++) {
    PetscCall(ShapeGetOption(t->shape, i, &name, &lower, &upper));
    if (!name) break;
    if (lower > -1e9 && lower != SHAPE_POSITIVE) PetscCall(TryEnd(t, name, lower, why));
    if (!why[0] && upper < 1e9) PetscCall(TryEnd(t, name, upper, why));
    if (!why[0] && lower > -1e9) {
      PetscCall(
        PetscSNPrintf(value, sizeof(value), "%g",
                      lower == SHAPE_POSITIVE ? 0.0 : (double)PetscFloorReal(lower - 1.0 - 0.1 * PetscAbsReal(lower))));
      PetscCall(RefuseOption(t, name, value, why));
    }
    if (!why[0] && upper < 1e9) {
      PetscCall(
        PetscSNPrintf(value, sizeof(value), "%g", (double)PetscCeilReal(upper + 1.0 + 0.1 * PetscAbsReal(upper))));
      PetscCall(RefuseOption(t, name, value, why));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One whole life of the shape. */
static PetscErrorCode LiveOnce(const Suite *t)
{
  Shape     s;
  PetscReal x[32 * 3], w[32], d[32], r;
  ShapeMass m;

  PetscFunctionBeginUser;
  PetscCall(ShapeCreate(t->type, PREFIX, t->dim, &s));
  PetscCall(ShapeDistance(s, 32, t->cloud, d));
  PetscCall(ShapeNormal(s, 32, t->cloud, x));
  PetscCall(ShapeGetMass(s, &m));
  PetscCall(ShapeGetRadius(s, &r));
  PetscCall(ShapeSurface(s, 32, x, w));
  PetscCall(ShapeDestroy(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode CheckLeaks(Suite *t, char why[])
{
  PetscLogDouble before, after;

  PetscFunctionBeginUser;
  PetscCall(LiveOnce(t)); /* the first life fills tables that stay */
  PetscCall(PetscMallocGetCurrentUsage(&before));
  PetscCall(LiveOnce(t));
  PetscCall(PetscMallocGetCurrentUsage(&after));
  if (before <= 0) PetscCall(PetscSNPrintf(why, WHY, "memory is not counted: run without -malloc 0"));
  else if (after != before)
    PetscCall(PetscSNPrintf(why, WHY, "%g bytes are lost each time a shape is created and destroyed",
                            (double)(after - before)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- driver ---- */

static PetscErrorCode RunDimension(const char type[], PetscInt dim, PetscInt n, PetscInt *passed, PetscInt *failed)
{
  const ShapePlugin *plugin;
  Suite              t;

  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(&t, sizeof(t)));
  t.type     = type;
  t.dim      = dim;
  t.n        = n;
  t.nsurface = dim == 2 ? 4096 : 2000;
  PetscCall(ShapeCreate(type, PREFIX, dim, &t.shape));
  PetscCall(ShapeGetPlugin(t.shape, &plugin));
  PetscCall(plugin->ops.radius(t.shape, &t.radius));
  PetscCall(ShapeView(t.shape, PETSC_VIEWER_STDOUT_SELF));
  PetscCall(PetscCalloc4(n * dim, &t.cloud, n * dim, &t.near, n, &t.d, n, &t.dnear));
  PetscCall(PetscCalloc2(t.nsurface * dim, &t.xs, t.nsurface, &t.ws));
  RunCheck(&t, "sampling", MakeClouds);
  RunCheck(&t, "sign", CheckSign);
  RunCheck(&t, "1-Lipschitz", CheckLipschitz);
  RunCheck(&t, "Euclidean near the surface", CheckEuclidean);
  RunCheck(&t, "normals", CheckNormal);
  RunCheck(&t, "bounding radius", CheckRadius);
  RunCheck(&t, "mass properties", CheckMass);
  RunCheck(&t, "surface points", CheckSurface);
  RunCheck(&t, "corners", CheckCorners);
  RunCheck(&t, "far points", CheckFarPoints);
  RunCheck(&t, "determinism", CheckDeterminism);
  RunCheck(&t, "empty batch", CheckEmptyBatch);
  RunCheck(&t, "options at and out of range", CheckOptions);
  RunCheck(&t, "leaks", CheckLeaks);
  *passed += t.passed;
  *failed += t.failed;
  PetscCall(PetscFree4(t.cloud, t.near, t.d, t.dnear));
  PetscCall(PetscFree2(t.xs, t.ws));
  PetscCall(ShapeDestroy(&t.shape));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* For tools/view-shape: kind (grid, surface), x, y, distance, normal; 3D: the plane z = 0. The line of the centroid has
   its bounding radius and the dimension. */
static PetscErrorCode WriteGrid(const char type[], PetscInt dim, const char file[])
{
  const PetscInt m = 161, ns = 400;
  PetscReal     *x, *w, *d, *normal, r;
  PetscInt       n = m * m;
  Shape          s;
  ShapeMass      mass;
  FILE          *f;

  PetscFunctionBeginUser;
  PetscCall(ShapeCreate(type, PREFIX, dim, &s));
  PetscCall(ShapeGetMass(s, &mass));
  PetscCall(ShapeGetRadius(s, &r));
  PetscCall(PetscCalloc4((n + ns) * dim, &x, n + ns, &w, n + ns, &d, (n + ns) * dim, &normal));
  for (PetscInt i = 0; i < n; i++) {
    x[i * dim]     = mass.centroid[0] + 1.4 * r * (2.0 * (PetscReal)(i % m) / (PetscReal)(m - 1) - 1.0);
    x[i * dim + 1] = mass.centroid[1] + 1.4 * r * (2.0 * (PetscReal)(i / m) / (PetscReal)(m - 1) - 1.0);
  }
  PetscCall(ShapeSurface(s, ns, x + n * dim, w + n));
  PetscCall(ShapeDistance(s, n + ns, x, d));
  PetscCall(ShapeNormal(s, n + ns, x, normal));
  f = fopen(file, "w");
  PetscCheck(f, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN, "Cannot write '%s': choose another file for -conformance_grid",
             file);
  fprintf(f, "kind,x,y,d,nx,ny\n");
  fprintf(f, "centroid,%.12g,%.12g,%.12g,%d,0\n", (double)mass.centroid[0], (double)mass.centroid[1], (double)r,
          (int)dim);
  for (PetscInt i = 0; i < n + ns; i++)
    fprintf(f, "%s,%.12g,%.12g,%.12g,%.12g,%.12g\n", i < n ? "grid" : "surface", (double)x[i * dim],
            (double)x[i * dim + 1], (double)d[i], (double)normal[i * dim], (double)normal[i * dim + 1]);
  fclose(f);
  PetscCall(PetscFree4(x, w, d, normal));
  PetscCall(ShapeDestroy(&s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* path/to/x.so -> folder on -shape_path and type x. */
static PetscErrorCode SplitFile(const char file[], char folder[], char type[], size_t len)
{
  const char *slash = strrchr(file, '/'), *base = slash ? slash + 1 : file;
  size_t      n = strlen(base);
  PetscBool   there;

  PetscFunctionBeginUser;
  PetscCheck(n > 3 && !strcmp(base + n - 3, ".so"), PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "'%s' is not a shape plugin: give the path of its .so file as first argument", file);
  PetscCall(PetscTestFile(file, 'r', &there));
  PetscCheck(there, PETSC_COMM_SELF, PETSC_ERR_FILE_OPEN,
             "There is no file '%s', or it cannot be read: compile the plugin, or correct the path", file);
  PetscCall(PetscStrncpy(type, base, len));
  type[n - 3] = 0;
  PetscCall(PetscStrncpy(folder, slash ? file : ".", PetscMin(len, slash ? (size_t)(slash - file) + 1 : 2)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Options that the shape reads in no dimension. */
static PetscErrorCode RefuseUnread(const char type[])
{
  char      message[WHY] = "";
  PetscBool works        = PETSC_FALSE;

  PetscFunctionBeginUser;
  for (PetscInt dim = 2; dim <= 3; dim++) {
    PetscErrorCode ierr;
    Shape          s = NULL;

    PetscCall(PetscPushErrorHandler(KeepMessage, message));
    ierr = ShapeCreate(type, PREFIX, dim, &s);
    PetscCall(PetscPopErrorHandler());
    if (ierr) continue;
    PetscCall(ShapeDestroy(&s));
    works = PETSC_TRUE;
  }
  if (works) PetscCall(OptCheckUnused());
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode RunSuite(const char file[], PetscInt *passed, PetscInt *failed)
{
  char      folder[PETSC_MAX_PATH_LEN], type[PETSC_MAX_PATH_LEN], grid[PETSC_MAX_PATH_LEN] = "";
  PetscInt  only = 0, n = 3000, dims = 0;
  PetscBool has_grid;

  PetscFunctionBeginUser;
  PetscCall(SplitFile(file, folder, type, sizeof(folder)));
  PetscCall(PetscOptionsSetValue(NULL, "-shape_path", folder));
  PetscCall(OptInt("-conformance_dim", &only));
  PetscCall(OptInt("-conformance_points", &n));
  PetscCall(OptString("-conformance_grid", grid, sizeof(grid)));
  has_grid = (PetscBool)(grid[0] != 0);
  PetscCall(RefuseUnread(type));
  for (PetscInt dim = 2; dim <= 3; dim++) {
    const ShapePlugin *plugin;
    char               message[WHY] = "";
    PetscErrorCode     ierr;
    Shape              s;

    if (only && only != dim) continue;
    PetscCall(PetscPushErrorHandler(KeepMessage, message));
    ierr = ShapeCreate(type, PREFIX, dim, &s);
    PetscCall(PetscPopErrorHandler());
    if (ierr && strstr(message, "works in")) continue;
    if (ierr) {
      PetscCall(PetscPrintf(PETSC_COMM_SELF, "FAIL %" PetscInt_FMT "D load and set up: %s\n", dim, message));
      (*failed)++;
      dims++;
      continue;
    }
    PetscCall(ShapeGetPlugin(s, &plugin));
    PetscCall(ShapeDestroy(&s));
    (*passed)++;
    dims++;
    PetscCall(PetscPrintf(PETSC_COMM_SELF, "ok   %" PetscInt_FMT "D load and set up: %s, %s\n", dim, plugin->type,
                          plugin->description ? plugin->description : ""));
    if (has_grid) PetscCall(WriteGrid(type, dim, grid));
    else PetscCall(RunDimension(type, dim, n, passed, failed));
    if (has_grid) break;
  }
  PetscCheck(dims, PETSC_COMM_SELF, PETSC_ERR_USER_INPUT,
             "Shape '%s' does not work in dimension %" PetscInt_FMT ": leave out -conformance_dim", type, only);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const OptSpec SPECS[] = {
  {"-conformance_dim", OPT_INT, "", 0, 3, "0", .help = "check this dimension only; 0: all the plugin works in"},
  {"-conformance_points", OPT_INT, "", 100, 1000000, "3000", .help = "random points in each cloud"},
  {"-conformance_grid", OPT_STRING, "", OPT_ANY, "",
   .help = "CSV file for distances on a grid, in place of the checks"},
};
OPT_TABLE("conformance suite", SPECS)

int main(int argc, char **argv)
{
  PetscInt       passed = 0, failed = 0;
  PetscErrorCode ierr;
  const char    *file         = NULL;
  char           message[WHY] = "";

  PetscCall(PetscMallocSetDebug(PETSC_TRUE, PETSC_FALSE)); /* so that memory is counted in an optimised PETSc too */
  if (argc > 1 && argv[1][0] != '-') {                     /* taken out: the other words are options */
    file = argv[1];
    for (int i = 1; i < argc; i++) argv[i] = argv[i + 1];
    argc--;
  }
  PetscCall(PetscInitialize(&argc, &argv, NULL, help));
  PetscCall(ShapeTrustDistances());
  PetscCall(ShapeGuardInstall());
  PetscCall(PetscPushErrorHandler(KeepMessage, message));
  ierr = file ? RunSuite(file, &passed, &failed) : PETSC_ERR_USER_INPUT;
  PetscCall(PetscPopErrorHandler());
  if (ierr) {
    fprintf(stderr, "error: %s\n",
            file ? message : "give the path of a shape plugin as first argument, such as ./circle.so");
    return 1;
  }
  PetscCall(PetscPrintf(PETSC_COMM_SELF, "%" PetscInt_FMT " passed, %" PetscInt_FMT " failed\n", passed, failed));
  if (failed) return 1; /* a check that broke off left objects behind, over which the end would stumble */
  PetscCall(ShapeFinalize());
  PetscCall(OptFinalize());
  PetscCall(PetscFinalize());
  return 0;
}
