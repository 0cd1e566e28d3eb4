/* Closest point of a surface of triangles, by the tree of boxes; signed distance by the normal of its feature. */
#include "compat.h"
#include "triangles.h"

static inline PetscReal box_square(const TriNode *b, const Vec3 x)
{
  PetscReal sum = 0;

  for (int a = 0; a < 3; a++) sum += PetscSqr(PetscMax(PetscMax(b->lower[a] - x[a], x[a] - b->upper[a]), 0.0));
  return sum;
}

static void closest_on_edge(const Surface *f, PetscInt t, int e, const Vec3 x, Closest *best)
{
  const PetscReal *p = f->x[f->triangle[t][e]], *q = f->x[f->triangle[t][(e + 1) % 3]];
  Vec3             d, r, y, gap;
  PetscReal        s;

  subtract3(q, p, d);
  subtract3(x, p, r);
  s = PetscMin(PetscMax(dot3(r, d) / dot3(d, d), 0.0), 1.0);
  for (int a = 0; a < 3; a++) y[a] = s < 1 ? p[a] + s * d[a] : q[a];
  subtract3(x, y, gap);
  if (dot3(gap, gap) >= best->square) return;
  *best = (Closest){dot3(gap, gap), {y[0], y[1], y[2]}, t, s <= 0 ? 4 + e : s >= 1 ? 4 + (e + 1) % 3 : 1 + e};
}

/* Where x lies above the triangle the foot is in it, otherwise on one of the edges that it lies beyond. */
static void closest_on_triangle(const Surface *f, PetscInt t, const Vec3 x, Closest *best)
{
  const PetscReal *n = f->face[t], *p = f->x[f->triangle[t][0]];
  PetscBool        beyond = dot3(n, n) > 0 ? PETSC_FALSE : PETSC_TRUE;
  Vec3             r;
  PetscReal        height;

  subtract3(x, p, r);
  height = dot3(r, n);
  if (height * height >= best->square) return;
  for (int e = 0; e < 3; e++) {
    Vec3 d, out;

    subtract3(f->x[f->triangle[t][(e + 1) % 3]], f->x[f->triangle[t][e]], d);
    subtract3(x, f->x[f->triangle[t][e]], r);
    cross(d, n, out);
    if (dot3(n, n) > 0 && dot3(r, out) <= 0) continue;
    beyond = PETSC_TRUE;
    closest_on_edge(f, t, e, x, best);
  }
  if (beyond) return;
  *best = (Closest){height * height, {x[0] - height * n[0], x[1] - height * n[1], x[2] - height * n[2]}, t, 0};
}

/* best->square: only what is closer counts */
static void closest_on_surface(const Surface *f, const Vec3 x, Closest *best)
{
  PetscInt  stack[TRI_DEPTH], top = 0;
  PetscReal square[TRI_DEPTH];

  stack[top]    = 0;
  square[top++] = 0;
  while (top) {
    const TriNode *b = &f->node[stack[--top]];
    PetscInt       child[2];
    PetscReal      d[2];
    int            far;

    if (square[top] >= best->square) continue;
    for (PetscInt t = b->first; t < b->first + b->count; t++) closest_on_triangle(f, t, x, best);
    if (b->count) continue;
    child[0] = (PetscInt)(b - f->node) + 1;
    child[1] = b->first;
    for (int c = 0; c < 2; c++) d[c] = box_square(&f->node[child[c]], x);
    far = d[0] > d[1] ? 0 : 1;
    for (int c = 0; c < 2; c++) { /* the closer one on top */
      const int which = c ? 1 - far : far;

      if (d[which] >= best->square) continue;
      stack[top]    = child[which];
      square[top++] = d[which];
    }
  }
}

void SurfaceFindClosest(const Surface *f, const Vec3 x, PetscInt *guess, Closest *c)
{
  *c = (Closest){.square = PETSC_MAX_REAL};
  closest_on_triangle(f, *guess, x, c);
  closest_on_surface(f, x, c);
  *guess = c->triangle;
}

/* Not of unit length */
static void feature_normal(const Surface *f, const Closest *c, Vec3 n)
{
  const PetscReal *face = f->face[c->triangle], *other = face;

  if (c->feature > 3) other = face = f->corner[f->triangle[c->triangle][c->feature - 4]];
  else if (c->feature > 0) other = f->face[f->next[c->triangle][c->feature - 1]];
  for (int a = 0; a < 3; a++) n[a] = face[a] + other[a];
}

PetscReal SurfaceMeasure(const Surface *f, const Vec3 x, PetscInt *guess, PetscReal g[])
{
  Closest   c;
  Vec3      r, n;
  PetscReal d, size;

  SurfaceFindClosest(f, x, guess, &c);
  feature_normal(f, &c, n);
  subtract3(x, c.y, r);
  d = dot3(r, n) < 0 ? -PetscSqrtReal(c.square) : PetscSqrtReal(c.square);
  if (!g) return d;
  size = PetscSqrtReal(dot3(n, n));
  for (int a = 0; a < 3; a++) g[a] = PetscAbsReal(d) > 1e-9 * f->radius ? r[a] / d : size > 0 ? n[a] / size : a == 0;
  return d;
}
