/* Edges and corners of a triangulated surface, which a grid cuts off (Attene, Falcidieno, Rossignac, Spagnuolo 2005).

   The points of a triangulation lie on the surface. Where the normals at the ends of an edge differ, the surface turns
   between them: the edge gets a point where their tangent planes meet, found again between points ever closer to it, so
   that curved faces are right, too. A triangle between three such edges gets the corner where its planes meet. What
   only bends is left as it is: closer points have the same normal. */
#include "compat.h"
#include "base/algebra.h"
#include "impl.h"
#include <stdlib.h>

#define TURN   0.9 /* cosine of the turn between the ends of an edge that is sharp */
#define PASSES 8   /* each four times closer */

typedef struct {
  PetscInt low, high, side; /* points; 3 triangle + edge */
} Edge;

static int compare_edges(const void *a, const void *b)
{
  const Edge *p = a, *q = b;

  if (p->low != q->low) return p->low < q->low ? -1 : 1;
  if (p->high != q->high) return p->high < q->high ? -1 : 1;
  return p->side < q->side ? -1 : p->side > q->side;
}

/* Where n planes through x with normals m meet, closest to the middle of x: middle + sum of c_i m_i. n: 2 or 3 */
static PetscBool intersect_planes(PetscInt n, const PetscReal x[], const PetscReal m[], PetscReal y[3])
{
  PetscReal gram[9], inverse[9], rhs[3], det, middle[3] = {0, 0, 0};

  for (PetscInt i = 0; i < 3 * n; i++) middle[i % 3] += x[i] / (PetscReal)n;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal r[3] = {x[3 * i] - middle[0], x[3 * i + 1] - middle[1], x[3 * i + 2] - middle[2]};

    rhs[i] = dot3(m + 3 * i, r);
    for (PetscInt j = 0; j < n; j++) gram[n * i + j] = dot3(m + 3 * i, m + 3 * j);
  }
  det = n == 2 ? 1 - gram[1] * gram[1]
               : 1 + 2 * gram[1] * gram[2] * gram[5] - gram[1] * gram[1] - gram[2] * gram[2] - gram[5] * gram[5];
  if (det < 1e-3) return PETSC_FALSE;
  DenseInvert(n, gram, inverse);
  for (int a = 0; a < 3; a++) {
    y[a] = middle[a];
    for (PetscInt i = 0; i < n * n; i++) y[a] += m[3 * (i / n) + a] * inverse[i] * rhs[i % n];
  }
  return PETSC_TRUE;
}

static PetscReal gap3(const PetscReal a[], const PetscReal b[])
{
  return PetscSqrtReal(PetscSqr(a[0] - b[0]) + PetscSqr(a[1] - b[1]) + PetscSqr(a[2] - b[2]));
}

/* The point of an edge (n = 2) or corner (3) between n points of the surface */
static PetscErrorCode find_sharp(Shape s, PetscInt n, const PetscReal x[], PetscReal y[3], PetscBool *found)
{
  PetscReal p[9], m[9], d, width = gap3(x, x + 3);

  PetscFunctionBeginUser;
  *found = PETSC_FALSE;
  PetscCall(PetscArraycpy(p, x, 3 * n));
  if (n == 3) width = PetscMax(width, PetscMax(gap3(x, x + 6), gap3(x + 3, x + 6)));
  for (PetscInt pass = 0; pass < PASSES; pass++) {
    PetscCall(ShapeNormal(s, n, p, m));
    for (PetscInt i = 0; i < n; i++)
      if (dot3(m + 3 * i, m + 3 * ((i + 1) % n)) > TURN) PetscFunctionReturn(PETSC_SUCCESS);
    if (!intersect_planes(n, p, m, y)) PetscFunctionReturn(PETSC_SUCCESS);
    for (PetscInt i = 0; i < n; i++)
      if (gap3(y, p + 3 * i) > 2 * width) PetscFunctionReturn(PETSC_SUCCESS);
    PetscCall(ShapeDistance(s, 1, y, &d));
    if (PetscAbsReal(d) < 1e-9 * s->radius) break;
    if (PetscAbsReal(d) > width) PetscFunctionReturn(PETSC_SUCCESS);
    for (PetscInt i = 0; i < 3 * n; i++) p[i] = y[i % 3] + 0.25 * (p[i] - y[i % 3]);
    PetscCall(ShapeProject(s, n, p, p));
    width *= 0.25;
  }
  *found = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* extra [3 ntriangle]: the new point on each edge of each triangle, or -1; appended to the points */
static PetscErrorCode split_edges(Shape s, PetscInt *npoint, PetscReal *x[], PetscInt ntriangle,
                                  const PetscInt triangle[], PetscInt extra[])
{
  const PetscInt n = *npoint;
  PetscReal     *normal, y[3];
  Edge          *e;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(3 * n, &normal, 3 * ntriangle, &e));
  PetscCall(ShapeNormal(s, n, *x, normal));
  for (PetscInt i = 0; i < 3 * ntriangle; i++) {
    const PetscInt a = triangle[i], b = triangle[i / 3 * 3 + (i + 1) % 3];

    e[i]     = (Edge){PetscMin(a, b), PetscMax(a, b), i};
    extra[i] = -1;
  }
  qsort(e, (size_t)(3 * ntriangle), sizeof(*e), compare_edges);
  for (PetscInt i = 0, j; i < 3 * ntriangle; i = j) {
    const PetscReal ends[6] = {(*x)[3 * e[i].low],  (*x)[3 * e[i].low + 1],  (*x)[3 * e[i].low + 2],
                               (*x)[3 * e[i].high], (*x)[3 * e[i].high + 1], (*x)[3 * e[i].high + 2]};
    PetscBool       found   = PETSC_FALSE;

    for (j = i; j < 3 * ntriangle && e[j].low == e[i].low && e[j].high == e[i].high; j++)
      ;
    if (dot3(normal + 3 * e[i].low, normal + 3 * e[i].high) < TURN) PetscCall(find_sharp(s, 2, ends, y, &found));
    if (!found) continue;
    PetscCall(PetscArraycpy(*x + 3 * *npoint, y, 3));
    for (PetscInt k = i; k < j; k++) extra[e[k].side] = *npoint;
    (*npoint)++;
  }
  PetscCall(PetscFree2(normal, e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The parts of a triangle v with new points p on some of its edges; returns how many */
static PetscInt split_triangle(const PetscInt v[3], const PetscInt p[3], PetscInt corner, const PetscReal x[],
                               PetscInt out[][3])
{
  PetscInt n = 0, polygon[6], m = 0, start = 0;

  for (int e = 0; e < 3; e++) {
    polygon[m++] = v[e];
    if (p[e] >= 0) polygon[m++] = p[e];
  }
  if (corner >= 0) { /* around it */
    for (PetscInt i = 0; i < m; i++) {
      const PetscInt t[3] = {corner, polygon[i], polygon[(i + 1) % m]};

      for (int k = 0; k < 3; k++) out[n][k] = t[k];
      n++;
    }
    return n;
  }
  if (m == 6) { /* the triangle of the new points and one at each corner */
    for (int e = 0; e < 3; e++) {
      const PetscInt t[3] = {v[e], p[e], p[(e + 2) % 3]};

      for (int k = 0; k < 3; k++) {
        out[n][k] = t[k];
        out[3][k] = p[k];
      }
      n++;
    }
    return n + 1;
  }
  for (PetscInt i = 0; i < m; i++) { /* a fan from a new point; of two from the one with the shorter diagonal */
    PetscBool is_new = PETSC_FALSE;

    for (int e = 0; e < 3; e++) is_new = (PetscBool)(is_new || polygon[i] == p[e]);
    if (is_new && (polygon[start] == v[0] || m == 4 ||
                   gap3(x + 3 * polygon[i], x + 3 * polygon[(i + 3) % m]) +
                       gap3(x + 3 * polygon[i], x + 3 * polygon[(i + 2) % m]) <
                     gap3(x + 3 * polygon[start], x + 3 * polygon[(start + 3) % m]) +
                       gap3(x + 3 * polygon[start], x + 3 * polygon[(start + 2) % m])))
      start = i;
  }
  for (PetscInt i = 1; i + 1 < m; i++) {
    const PetscInt t[3] = {polygon[start], polygon[(start + i) % m], polygon[(start + i + 1) % m]};

    for (int k = 0; k < 3; k++) out[n][k] = t[k];
    n++;
  }
  return n;
}

PetscErrorCode ShapeSharpen(Shape s, PetscInt *npoint, PetscReal *x[], PetscInt *ntriangle, PetscInt *triangle[])
{
  const PetscInt nold = *ntriangle;
  PetscInt      *extra, *old = *triangle, before = *npoint, (*t)[3];

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(3 * nold, &extra));
  PetscCall(PetscRealloc((size_t)(3 * (before + 4 * nold)) * sizeof(PetscReal), x));
  PetscCall(split_edges(s, npoint, x, nold, old, extra));
  if (*npoint == before) {
    PetscCall(PetscFree(extra));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(6 * nold, &t));
  *ntriangle = 0;
  for (PetscInt i = 0; i < nold; i++) {
    const PetscInt *v = old + 3 * i, *p = extra + 3 * i;
    PetscInt        corner = -1;

    if (p[0] >= 0 && p[1] >= 0 && p[2] >= 0) {
      PetscReal ends[9], y[3];
      PetscBool found;

      for (PetscInt k = 0; k < 9; k++) ends[k] = (*x)[3 * v[k / 3] + k % 3];
      PetscCall(find_sharp(s, 3, ends, y, &found));
      if (found) {
        corner = (*npoint)++;
        PetscCall(PetscArraycpy(*x + 3 * corner, y, 3));
      }
    }
    *ntriangle += split_triangle(v, p, corner, *x, t + *ntriangle);
  }
  PetscCall(PetscFree(extra));
  PetscCall(PetscFree(old));
  *triangle = &t[0][0];
  PetscFunctionReturn(PETSC_SUCCESS);
}
