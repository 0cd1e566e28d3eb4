/* Winding number of a surface of triangles: how often it goes around a point, 1 inside and 0 outside of a closed one
   (Jacobson, Kavan, Sorkine-Hornung 2013). Each triangle adds its solid angle (van Oosterom & Strackee 1983). Seen from
   far the triangles of a node are a few multipoles (Barill, Dickson, Schmidt, Levin, Jacobson 2018): with
   f(d) = d / (4 pi |d|^3) the node adds the integral of n . f over it, and f is expanded about the node's centre. */
#include "compat.h"
#include "triangles.h"

#define FAR 2.0 /* distances, in radii of a node, from which on it is expanded */

PetscReal TriangleWinding(const Vec3 p, const Vec3 q, const Vec3 r, const Vec3 x)
{
  Vec3      a, b, c, n;
  PetscReal la, lb, lc;

  subtract3(p, x, a);
  subtract3(q, x, b);
  subtract3(r, x, c);
  la = PetscSqrtReal(dot3(a, a));
  lb = PetscSqrtReal(dot3(b, b));
  lc = PetscSqrtReal(dot3(c, c));
  cross(b, c, n);
  return PetscAtan2Real(dot3(a, n), la * lb * lc + dot3(a, b) * lc + dot3(b, c) * la + dot3(c, a) * lb) /
         (2 * PETSC_PI);
}

static inline PetscReal winding_of(const Surface *f, PetscInt t, const Vec3 x)
{
  return TriangleWinding(f->x[f->triangle[t][0]], f->x[f->triangle[t][1]], f->x[f->triangle[t][2]], x);
}

PetscReal SurfaceWinding(const Surface *f, const Vec3 x)
{
  PetscReal sum = 0;

  for (PetscInt t = 0; t < f->n; t++) sum += winding_of(f, t, x);
  return sum;
}

/* ---- expansions ---- */

/* The triangles [first, end) of a node are those of its leaves, which follow one another. */
static void get_range(const Surface *f, PetscInt node, PetscInt *first, PetscInt *end)
{
  PetscInt left = node, right = node;

  while (!f->node[left].count) left++;
  while (!f->node[right].count) right = f->node[right].first;
  *first = f->node[left].first;
  *end   = f->node[right].first + f->node[right].count;
}

static void place_centre(const Surface *f, PetscInt first, PetscInt end, Moment *m)
{
  PetscReal area = 0;

  for (PetscInt t = first; t < end; t++) {
    const PetscReal *p = f->x[f->triangle[t][0]], *q = f->x[f->triangle[t][1]], *r = f->x[f->triangle[t][2]];
    Vec3             n;
    PetscReal        twice;

    triangle_normal(p, q, r, n);
    twice = PetscSqrtReal(dot3(n, n)) + PETSC_MACHINE_EPSILON * f->area;
    area += twice;
    for (int a = 0; a < 3; a++) m->centre[a] += twice * (p[a] + q[a] + r[a]) / 3;
  }
  for (int a = 0; a < 3; a++) m->centre[a] /= area;
}

/* Integrals over one triangle: of d its middle, of d d (sum of v v + sum v sum v) / 12 times the area */
static void add_moment(const Surface *f, PetscInt t, Moment *m)
{
  Vec3      v[3], n, sum = {0, 0, 0};
  PetscReal second[3][3];

  for (int i = 0; i < 3; i++) {
    subtract3(f->x[f->triangle[t][i]], m->centre, v[i]);
    m->radius = PetscMax(m->radius, dot3(v[i], v[i]));
    for (int a = 0; a < 3; a++) sum[a] += v[i][a];
  }
  triangle_normal(v[0], v[1], v[2], n);
  for (int a = 0; a < 3; a++) n[a] *= 0.5;
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++)
      second[a][b] = (v[0][a] * v[0][b] + v[1][a] * v[1][b] + v[2][a] * v[2][b] + sum[a] * sum[b]) / 12;
  for (int a = 0; a < 3; a++) {
    const int b = (a + 1) % 3, c = (a + 2) % 3, pair = b + c + 2; /* 01 -> 3, 02 -> 4, 12 -> 5 */

    m->n[a] += n[a];
    m->trace += n[a] * sum[a] / 3;
    m->nd[a] += n[a] * sum[a] / 3;
    m->nd[pair] += 0.5 * (n[b] * sum[c] + n[c] * sum[b]) / 3;
    m->ndd[a] += n[a] * second[a][a];
    for (int k = 0; k < 3; k++) m->contract[a] += 2 * n[k] * second[k][a] + n[a] * second[k][k];
  }
  for (int a = 0, k = 3; a < 3; a++)
    for (int b = 0; b < 3; b++)
      if (b != a) m->ndd[k++] += n[b] * second[a][a] + 2 * n[a] * second[a][b]; /* all orders of a a b */
  m->ndd[9] += 2 * (n[0] * second[1][2] + n[1] * second[0][2] + n[2] * second[0][1]);
}

PetscErrorCode SurfaceMakeMoments(const Surface *f, Moment **moments)
{
  Moment *m;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(f->nnode, &m));
  for (PetscInt i = 0; i < f->nnode; i++) {
    PetscInt first, end;

    get_range(f, i, &first, &end);
    place_centre(f, first, end, m + i);
    for (PetscInt t = first; t < end; t++) add_moment(f, t, m + i);
    m[i].radius = PetscSqrtReal(m[i].radius);
  }
  *moments = m;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* 4 pi times what a node adds; d: from the point to its centre */
static inline PetscReal expand(const Moment *m, const Vec3 d, PetscReal r2)
{
  const PetscReal x = d[0], y = d[1], z = d[2], i2 = 1 / r2, i3 = i2 * PetscSqrtReal(i2), i5 = i3 * i2, i7 = i5 * i2;
  const PetscReal two = m->nd[0] * x * x + m->nd[1] * y * y + m->nd[2] * z * z +
                        2 * (m->nd[3] * x * y + m->nd[4] * x * z + m->nd[5] * y * z);
  const PetscReal three = x * x * (m->ndd[0] * x + m->ndd[3] * y + m->ndd[4] * z) +
                          y * y * (m->ndd[1] * y + m->ndd[5] * x + m->ndd[6] * z) +
                          z * z * (m->ndd[2] * z + m->ndd[7] * x + m->ndd[8] * y) + m->ndd[9] * x * y * z;

  return i3 * (dot3(m->n, d) + m->trace) - i5 * (3 * two + 1.5 * dot3(m->contract, d)) + 7.5 * i7 * three;
}

PetscReal SurfaceWindingFast(const Surface *f, const Moment moment[], const Vec3 x)
{
  PetscInt  stack[TRI_DEPTH], top = 0;
  PetscReal far = 0, near = 0;

  stack[top++] = 0;
  while (top) {
    const PetscInt i = stack[--top];
    const Moment  *m = &moment[i];
    Vec3           d;
    PetscReal      r2;

    subtract3(m->centre, x, d);
    r2 = dot3(d, d);
    if (r2 > PetscSqr(FAR * m->radius)) far += expand(m, d, r2);
    else if (f->node[i].count)
      for (PetscInt t = f->node[i].first; t < f->node[i].first + f->node[i].count; t++) near += winding_of(f, t, x);
    else {
      stack[top++] = i + 1;
      stack[top++] = f->node[i].first;
    }
  }
  return near + far / (4 * PETSC_PI);
}
