/* Bend: what linear distances leave out of the moments of cut cells in space (see tree.h). The distance is taken to be
   quadratic on each tetrahedron, by its values in the middle of the edges; to first order the surface moves by the
   difference to the linear one over the gradient, and the moments by the integral of that over the linear cut. The
   difference is one function across tetrahedra, so that no gap opens between them: where the surface is smooth the
   error falls with the fourth power of the width. */
#include "compat.h"
#include "base/algebra.h"
#include "tree.h"

#define NMID 27
#define FLAT 0.5 /* a gradient below it is none: two surfaces, or an edge, within the tetrahedron */

/* Pairs of corners: the edges of a tetrahedron */
static const int EDGE[6][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* Six points and weights, exact for polynomials of degree 4 on a triangle (Dunavant 1985) */
#define NPOINT 6
static const PetscReal PAIR[2]   = {0.445948490915965, 0.091576213509771},
                       WEIGHT[2] = {0.223381589678011, 0.109951743655322};

typedef struct {
  PetscReal x[4][3], d[4],
    curvature[6]; /* corners; distances there; in the middle of edges, less the mean of the ends */
} Tetrahedron;

/* The edges that the linear surface cuts, in the order around the cut; 0, 3 or 4 */
static PetscInt list_cut(const PetscReal d[4], PetscInt edge[4][2])
{
  PetscInt in[4], out[4], nin = 0, nout = 0;

  for (PetscInt k = 0; k < 4; k++) {
    if (d[k] < 0) in[nin++] = k;
    else out[nout++] = k;
  }
  if (nin == 0 || nout == 0) return 0;
  for (PetscInt e = 0; e < 4; e++) {
    edge[e][0] = nin == 2 ? in[e / 2] : in[nin == 1 ? 0 : e % 3];
    edge[e][1] = nin == 2 ? out[e == 1 || e == 2] : out[nin == 1 ? e % 3 : 0];
  }
  return nin == 2 ? 4 : 3;
}

/* Size of the gradient of the linear distance */
static PetscReal measure_slope(const Tetrahedron *t)
{
  PetscReal e[9], b[3], g[3];

  for (PetscInt k = 0; k < 3; k++) {
    for (PetscInt a = 0; a < 3; a++) e[3 * k + a] = t->x[k + 1][a] - t->x[0][a];
    b[k] = t->d[k + 1] - t->d[0];
  }
  solve3(e, b, g);
  return VectorLength(3, g);
}

static void interpolate_point(const Tetrahedron *t, const PetscReal weight[4], PetscReal x[3])
{
  for (PetscInt a = 0; a < 3; a++) {
    x[a] = 0;
    for (PetscInt k = 0; k < 4; k++) x[a] += weight[k] * t->x[k][a];
  }
}

static PetscReal measure_area(const Tetrahedron *t, const PetscReal corner[3][4])
{
  PetscReal x[3][3], e[2][3], c[3];

  for (PetscInt i = 0; i < 3; i++) interpolate_point(t, corner[i], x[i]);
  for (PetscInt a = 0; a < 3; a++) {
    e[0][a] = x[1][a] - x[0][a];
    e[1][a] = x[2][a] - x[0][a];
  }
  cross(e[0], e[1], c);
  return 0.5 * VectorLength(3, c);
}

static void add_point(const PetscReal x[3], PetscReal volume, Moments *m)
{
  m->v += volume;
  for (PetscInt a = 0; a < 3; a++) m->x[a] += volume * x[a];
  for (PetscInt k = 0; k < 6; k++) m->xx[k] += volume * x[TREE_PAIR[k][0]] * x[TREE_PAIR[k][1]];
}

/* A triangle of the cut; corner: shares of the four corners of the tetrahedron (barycentric coordinates) */
static void add_triangle(const Tetrahedron *t, const PetscReal corner[3][4], PetscReal slope, Moments *m)
{
  const PetscReal area = measure_area(t, corner);

  for (PetscInt p = 0; p < NPOINT; p++) {
    PetscReal weight[4], x[3], curvature = 0;

    for (PetscInt k = 0; k < 4; k++) {
      weight[k] = 0;
      for (PetscInt i = 0; i < 3; i++) weight[k] += (i == p % 3 ? 1 - 2 * PAIR[p / 3] : PAIR[p / 3]) * corner[i][k];
    }
    for (PetscInt e = 0; e < 6; e++) curvature += 4 * t->curvature[e] * weight[EDGE[e][0]] * weight[EDGE[e][1]];
    interpolate_point(t, weight, x);
    add_point(x, -area * WEIGHT[p / 3] * curvature / slope, m);
  }
}

static void add_tetrahedron(const Tetrahedron *t, Moments *m)
{
  PetscInt        edge[4][2];
  const PetscInt  n            = list_cut(t->d, edge);
  PetscReal       corner[4][4] = {{0}}, triangle[3][4];
  const PetscReal slope        = n ? measure_slope(t) : 0;

  if (slope < FLAT) return;
  for (PetscInt i = 0; i < n; i++) {
    const PetscInt  a = edge[i][0], b = edge[i][1];
    const PetscReal s = t->d[a] / (t->d[a] - t->d[b]);

    corner[i][a] = 1 - s;
    corner[i][b] = s;
  }
  for (PetscInt i = 1; i + 1 < n; i++) {
    for (PetscInt k = 0; k < 4; k++) {
      triangle[0][k] = corner[0][k];
      triangle[1][k] = corner[i][k];
      triangle[2][k] = corner[i + 1][k];
    }
    add_triangle(t, triangle, slope, m);
  }
}

/* Tetrahedron k of a cell, from positions x and distances d of the 3 x 3 x 3 places of its corners and middles */
static void take_tetrahedron(PetscInt k, const PetscReal x[], const PetscReal d[], Tetrahedron *t)
{
  PetscInt bit[4][3];

  for (PetscInt i = 0; i < 4; i++) {
    for (PetscInt a = 0; a < 3; a++) bit[i][a] = TREE_TETRAHEDRON[k][i] >> a & 1;
    const PetscInt index = 2 * (bit[i][0] + 3 * bit[i][1] + 9 * bit[i][2]);

    t->d[i] = d[index];
    for (PetscInt a = 0; a < 3; a++) t->x[i][a] = x[3 * index + a];
  }
  for (PetscInt e = 0; e < 6; e++) {
    const PetscInt i = EDGE[e][0], j = EDGE[e][1];

    t->curvature[e] = d[bit[i][0] + bit[j][0] + 3 * (bit[i][1] + bit[j][1]) + 9 * (bit[i][2] + bit[j][2])] -
                      0.5 * (t->d[i] + t->d[j]);
  }
}

/* Places x and distances d of the corners of cell c and of the middles between them, [27] */
static PetscErrorCode evaluate_cell(const Tree *t, PetscInt c, PetscReal x[], PetscReal d[])
{
  const PetscReal half = 0.5 * TreeCellWidth(t);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < NMID; i++) {
    const PetscInt at[3] = {i % 3, i / 3 % 3, i / 9};

    for (PetscInt a = 0; a < 3; a++) x[3 * i + a] = -t->half + half * (PetscReal)(2 * t->cell[3 * c + a] + at[a]);
  }
  PetscCall(ShapeDistance(t->shape, NMID, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TreeAddBends(const Tree *t, Moments *m)
{
  PetscReal   x[NMID * 3], d[NMID];
  Tetrahedron tetrahedron;

  PetscFunctionBeginUser;
  for (PetscInt c = 0; c < t->n; c++) {
    PetscCall(evaluate_cell(t, c, x, d));
    for (PetscInt k = 0; k < 6; k++) {
      take_tetrahedron(k, x, d, &tetrahedron);
      add_tetrahedron(&tetrahedron, m);
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bends by more than `max`: curved, an edge, or two surfaces in one cell */
static PetscBool is_rough(const PetscReal x[], const PetscReal d[], PetscReal max)
{
  Tetrahedron tetrahedron;

  for (PetscInt k = 0; k < 6; k++) {
    take_tetrahedron(k, x, d, &tetrahedron);
    for (PetscInt e = 0; e < 6; e++)
      if (PetscAbsReal(tetrahedron.curvature[e]) > max) return PETSC_TRUE;
  }
  return PETSC_FALSE;
}

PetscErrorCode TreeSplit(Tree *t, PetscReal curvature, Tree *rough)
{
  PetscReal x[NMID * 3], d[NMID];
  PetscInt  smooth = 0;

  PetscFunctionBeginUser;
  *rough   = *t;
  rough->n = 0;
  PetscCall(PetscMemzero(&rough->full, sizeof(rough->full)));
  PetscCall(PetscMalloc1(3 * t->n, &rough->cell));
  for (PetscInt c = 0; c < t->n; c++) {
    PetscCall(evaluate_cell(t, c, x, d));
    if (is_rough(x, d, curvature * TreeCellWidth(t)))
      PetscCall(PetscArraycpy(rough->cell + 3 * rough->n++, t->cell + 3 * c, 3));
    else PetscCall(PetscArraycpy(t->cell + 3 * smooth++, t->cell + 3 * c, 3));
  }
  t->n = smooth;
  PetscFunctionReturn(PETSC_SUCCESS);
}
