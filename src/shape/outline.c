/* Shape, outline: corners of a shape in the plane, which meshes lined up with it ask for, and its outline for pictures
   (see shape/host.h).

   The surface points of the shape, many, with the corners between them, thinned to what a tolerance needs (Douglas &
   Peucker 1973). A corner lies where the normal turns by more than a polygon of that many sides would; it is the
   meeting of the tangents on both sides of it, exact where these are straight. */
#include "compat.h"
#include "guard.h"
#include "impl.h"

#define DENSE      1536 /* points that are thinned */
#define CORNER_COS 0.9  /* of the turn between neighbours that is a corner */
#define AROUND     256  /* directions in which a corner is looked at */

static PetscReal dot2(const PetscReal a[], const PetscReal b[])
{
  return a[0] * b[0] + a[1] * b[1];
}

static PetscReal distance2(const PetscReal a[], const PetscReal b[])
{
  return PetscSqrtReal(PetscSqr(a[0] - b[0]) + PetscSqr(a[1] - b[1]));
}

/* Where the tangents at x and y, with normals m and n, meet */
static void intersect_tangents(const PetscReal x[], const PetscReal m[], const PetscReal y[], const PetscReal n[],
                               PetscReal c[])
{
  const PetscReal det = m[0] * n[1] - m[1] * n[0], a = dot2(m, x), b = dot2(n, y);

  c[0] = (a * n[1] - b * m[1]) / det;
  c[1] = (b * m[0] - a * n[0]) / det;
}

/* The corner between two neighbours on the outline: tangents close to it tell better where curves meet */
static PetscErrorCode find_corner(Shape s, const PetscReal x[], const PetscReal m[], const PetscReal y[],
                                  const PetscReal n[], PetscReal c[], PetscBool *found)
{
  PetscReal p[4] = {x[0], x[1], y[0], y[1]}, q[4] = {m[0], m[1], n[0], n[1]}, width = distance2(x, y), d;

  PetscFunctionBeginUser;
  *found = PETSC_FALSE;
  for (PetscInt pass = 0; pass < 6; pass++) {
    if (PetscAbsReal(q[0] * q[3] - q[1] * q[2]) < 1e-3 || dot2(q, q + 2) > CORNER_COS)
      PetscFunctionReturn(PETSC_SUCCESS);
    intersect_tangents(p, q, p + 2, q + 2, c);
    PetscCall(ShapeDistance(s, 1, c, &d));
    if (distance2(c, p) > 2 * width || distance2(c, p + 2) > 2 * width) PetscFunctionReturn(PETSC_SUCCESS);
    if (PetscAbsReal(d) < 1e-10 * s->radius) break;
    for (PetscInt i = 0; i < 4; i++) p[i] = c[i % 2] + 0.25 * (p[i] - c[i % 2]);
    PetscCall(ShapeProject(s, 2, p, p));
    PetscCall(ShapeNormal(s, 2, p, q));
    width = distance2(p, p + 2);
  }
  *found = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Dense points with the corners between them; corner [n] marks these */
static PetscErrorCode trace_curve(Shape s, PetscInt *n, PetscReal x[], PetscBool corner[])
{
  PetscReal *y, *normal, *w;
  PetscBool  found;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc3(2 * DENSE, &y, 2 * DENSE, &normal, DENSE, &w));
  PetscCall(ShapeSurface(s, DENSE, y, w));
  PetscCall(ShapeNormal(s, DENSE, y, normal));
  *n = 0;
  for (PetscInt i = 0; i < DENSE; i++) {
    const PetscInt j = (i + 1) % DENSE;

    corner[*n] = PETSC_FALSE;
    PetscCall(PetscArraycpy(x + 2 * (*n)++, y + 2 * i, 2));
    if (dot2(normal + 2 * i, normal + 2 * j) > CORNER_COS) continue;
    PetscCall(find_corner(s, y + 2 * i, normal + 2 * i, y + 2 * j, normal + 2 * j, x + 2 * *n, &found));
    if (found) corner[(*n)++] = PETSC_TRUE;
  }
  PetscCall(PetscFree3(y, normal, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does the outline turn at the point c on it? By the wedge of the inside on a small circle around it: nothing inside is
   a cusp, more than one wedge two parts that touch */
static PetscErrorCode is_corner(Shape s, const PetscReal c[], PetscBool *yes)
{
  PetscReal x[2 * AROUND], d[AROUND];
  PetscInt  inside = 0, change = 0;

  PetscFunctionBeginUser;
  *yes = PETSC_FALSE;
  PetscCall(ShapeDistance(s, 1, c, d));
  if (PetscAbsReal(d[0]) > 1e-8 * s->radius) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < AROUND; i++) {
    x[2 * i]     = c[0] + 1e-4 * s->radius * PetscCosReal(2 * PETSC_PI * (PetscReal)i / AROUND);
    x[2 * i + 1] = c[1] + 1e-4 * s->radius * PetscSinReal(2 * PETSC_PI * (PetscReal)i / AROUND);
  }
  PetscCall(ShapeDistance(s, AROUND, x, d));
  for (PetscInt i = 0; i < AROUND; i++) {
    inside += d[i] < 0;
    change += (d[i] < 0) != (d[(i + 1) % AROUND] < 0);
  }
  *yes = (PetscBool)(change <= 2 && PetscAbsReal(1 - 2 * (PetscReal)inside / AROUND) * PETSC_PI > acos(CORNER_COS));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeDefaultCorners(Shape s, PetscInt *n, PetscReal *points[])
{
  PetscReal *x;
  PetscBool *corner, yes;
  PetscInt   m = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(4 * DENSE, &x, 2 * DENSE, &corner));
  PetscCall(trace_curve(s, &m, x, corner));
  *n = 0;
  for (PetscInt i = 0; i < m; i++) {
    if (!corner[i]) continue;
    PetscCall(is_corner(s, x + 2 * i, &yes));
    if (yes) PetscCall(PetscArraymove(x + 2 * (*n)++, x + 2 * i, 2));
  }
  PetscCall(PetscMalloc1(2 * *n, points));
  PetscCall(PetscArraycpy(*points, x, 2 * *n));
  PetscCall(PetscFree2(x, corner));
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
                 "Shape '%s' counts %" PetscInt_FMT " corners, then %" PetscInt_FMT
                 ": check the plugin with 'tumble-test-shape %s'",
                 s->loaded->type, s->ncorner, again, s->loaded->file);
    } else if (s->dim == 2) PetscCall(ShapeDefaultCorners(s, &s->ncorner, &s->corner));
    s->have_corners = PETSC_TRUE;
  }
  *n = s->ncorner;
  *x = s->corner;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- outline ---- */

static PetscReal distance_to_line(const PetscReal p[], const PetscReal a[], const PetscReal b[])
{
  const PetscReal t[2] = {b[0] - a[0], b[1] - a[1]}, r[2] = {p[0] - a[0], p[1] - a[1]}, l2 = dot2(t, t);
  const PetscReal at = l2 > 0 ? PetscMax(0, PetscMin(1, dot2(r, t) / l2)) : 0, e[2] = {at * t[0], at * t[1]};

  return distance2(r, e);
}

/* Marks the points of the closed curve x [n] that are needed between the marked points first and last */
static void keep_far(PetscInt n, const PetscReal x[], PetscReal tolerance, PetscInt first, PetscInt last,
                     PetscBool keep[])
{
  PetscReal far = tolerance;
  PetscInt  at  = -1;

  for (PetscInt i = first + 1; i < last; i++) {
    const PetscReal d = distance_to_line(x + 2 * (i % n), x + 2 * (first % n), x + 2 * (last % n));

    if (d <= far) continue;
    far = d;
    at  = i;
  }
  if (at < 0) return;
  keep[at % n] = PETSC_TRUE;
  keep_far(n, x, tolerance, first, at, keep);
  keep_far(n, x, tolerance, at, last, keep);
}

/* Thin the curve: the start, corners, and what the tolerance needs stay */
static PetscInt thin_curve(PetscInt n, const PetscReal x[], const PetscBool corner[], PetscReal tolerance,
                           PetscBool keep[])
{
  PetscInt before = 0, count = 0;

  for (PetscInt i = 0; i < n; i++) keep[i] = (PetscBool)(corner[i] || i == 0 || i == n / 2);
  for (PetscInt i = 1; i <= n; i++) {
    if (i < n && !corner[i] && i != n / 2) continue;
    keep_far(n, x, tolerance, before, i, keep);
    before = i;
  }
  for (PetscInt i = 0; i < n; i++) count += keep[i];
  return count;
}

/* Begin with the point straight ahead of the centre c, along the first axis of the body: the farthest one there */
static PetscErrorCode begin_on_axis(Shape s, const PetscReal c[], PetscInt *n, PetscReal x[], PetscBool corner[])
{
  PetscReal *y, best = -PETSC_MAX_REAL, start[2] = {0};
  PetscBool *was, on_corner = PETSC_FALSE;
  PetscInt   first = 0;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < *n; i++) {
    const PetscReal *a = x + 2 * i, *b = x + 2 * ((i + 1) % *n), t = (c[1] - a[1]) / (b[1] - a[1]),
                    at = a[0] + t * (b[0] - a[0]);

    if ((a[1] < c[1]) == (b[1] < c[1]) || at <= c[0] || at <= best) continue;
    best     = at;
    first    = i;
    start[0] = at;
    start[1] = c[1];
  }
  if (best > c[0]) {
    const PetscInt near = distance2(start, x + 2 * first) < distance2(start, x + 2 * ((first + 1) % *n))
                          ? first
                          : (first + 1) % *n;

    on_corner = (PetscBool)(distance2(start, x + 2 * near) < 1e-9 * s->radius);
    if (on_corner) first = near;
    else PetscCall(ShapeProject(s, 1, start, start));
  }
  PetscCall(PetscMalloc2(2 * *n + 2, &y, *n + 1, &was));
  for (PetscInt i = 0; i < *n; i++) {
    const PetscInt from = (first + i + !on_corner) % *n;

    PetscCall(PetscArraycpy(y + 2 * i, x + 2 * from, 2));
    was[i] = corner[from];
  }
  corner[0] = PETSC_FALSE;
  if (best > c[0] && !on_corner) PetscCall(PetscArraycpy(x, start, 2));
  PetscCall(PetscArraycpy(x + 2 * !on_corner, y, 2 * *n));
  PetscCall(PetscArraycpy(corner + !on_corner, was, *n));
  if (!on_corner && best <= c[0]) PetscCall(PetscArraycpy(x, y + 2 * (*n - 1), 2));
  else *n += !on_corner;
  PetscCall(PetscFree2(y, was));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ShapeOutline(Shape s, PetscReal tolerance, PetscInt *n, PetscReal *points[])
{
  const PetscInt capacity = 2 * DENSE + 2;
  ShapeMass      mass;
  PetscReal     *x;
  PetscBool     *corner, *keep;
  PetscInt       m = 0, count;

  PetscFunctionBeginUser;
  PetscCall(ShapeGetMass(s, &mass));
  PetscCall(PetscMalloc3(2 * capacity, &x, capacity, &corner, capacity, &keep));
  PetscCall(trace_curve(s, &m, x, corner));
  PetscCall(begin_on_axis(s, mass.centroid, &m, x, corner));
  count = thin_curve(m, x, corner, tolerance * s->radius, keep);
  PetscCall(PetscMalloc1(2 * count, points));
  *n = 0;
  for (PetscInt i = 0; i < m; i++)
    if (keep[i]) PetscCall(PetscArraycpy(*points + 2 * (*n)++, x + 2 * i, 2));
  PetscCall(PetscFree3(x, corner, keep));
  PetscFunctionReturn(PETSC_SUCCESS);
}
