/* Tree: refinement and the integrals over cut cells (see tree.h). A cell that the surface cannot reach (distance at its
   centre larger than half its diagonal) is full or empty; clipped simplices have closed-form moments. Thin parts below
   the smallest cell are not resolved. */
#include "compat.h"
#include "base/algebra.h"
#include "tree.h"

PetscErrorCode TreeCreate(Shape s, PetscReal r, PetscInt dim, Tree *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(t, sizeof(*t)));
  t->shape = s;
  t->dim   = dim;
  t->half  = 1.0173 * r; /* an odd margin: grid lines should not run along flat faces */
  t->n     = 1;
  PetscCall(PetscCalloc1(dim, &t->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TreeDestroy(Tree *t)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(t->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void AddBox(PetscInt dim, const PetscReal c[], PetscReal h, Moments *m)
{
  const PetscReal v = dim == 2 ? h * h : h * h * h;

  m->v += v;
  for (PetscInt a = 0; a < dim; a++) m->x[a] += v * c[a];
  for (PetscInt k = 0; k < 6; k++) {
    const PetscInt a = TREE_PAIR[k][0], b = TREE_PAIR[k][1];

    if (a < dim && b < dim) m->xx[k] += v * (c[a] * c[b] + (a == b ? h * h / 12.0 : 0.0));
  }
}

PetscErrorCode TreeRefine(Tree *t)
{
  const PetscInt dim = t->dim, nc = 1 << dim, nold = t->n;
  PetscInt      *old = t->cell, n = 0;
  PetscReal      x[SHAPE_CHUNK * 8 * 3], d[SHAPE_CHUNK * 8], reach;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(nold * nc * dim, &t->cell));
  t->level++;
  reach = TreeHalfDiagonal(t) * (1.0 + 1e-10);
  for (PetscInt start = 0; start < nold; start += SHAPE_CHUNK) {
    const PetscInt m = PetscMin(SHAPE_CHUNK, nold - start) * nc;

    for (PetscInt i = 0; i < m; i++) {
      PetscInt *cell = t->cell + (n + i) * dim;

      for (PetscInt a = 0; a < dim; a++) cell[a] = 2 * old[(start + i / nc) * dim + a] + ((i % nc) >> a & 1);
      TreeCellCentre(t, cell, x + i * dim);
    }
    PetscCall(ShapeDistance(t->shape, m, x, d));
    for (PetscInt i = 0, first = n; i < m; i++) { /* compact in place: n never overtakes first + i */
      if (d[i] <= -reach) AddBox(dim, x + i * dim, TreeCellWidth(t), &t->full);
      else if (d[i] < reach) {
        for (PetscInt a = 0; a < dim; a++) t->cell[n * dim + a] = t->cell[(first + i) * dim + a];
        n++;
      }
    }
  }
  t->n = n;
  PetscCall(PetscFree(old));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- simplices ---- */

static PetscReal SimplexVolume(PetscInt dim, PetscReal v[][3])
{
  PetscReal e[3][3], c[3];

  for (PetscInt k = 0; k < dim; k++)
    for (PetscInt a = 0; a < 3; a++) e[k][a] = v[k + 1][a] - v[0][a];
  if (dim == 2) return 0.5 * PetscAbsReal(e[0][0] * e[1][1] - e[0][1] * e[1][0]);
  cross(e[0], e[1], c);
  return PetscAbsReal(c[0] * e[2][0] + c[1] * e[2][1] + c[2] * e[2][2]) / 6.0;
}

static void AddSimplex(PetscInt dim, PetscReal v[][3], PetscReal sign, Moments *m)
{
  const PetscReal vol = sign * SimplexVolume(dim, v), nv = (PetscReal)(dim + 1);
  PetscReal       sum[3] = {0, 0, 0};

  for (PetscInt k = 0; k <= dim; k++)
    for (PetscInt a = 0; a < dim; a++) sum[a] += v[k][a];
  m->v += vol;
  for (PetscInt a = 0; a < dim; a++) m->x[a] += vol * sum[a] / nv;
  for (PetscInt k = 0; k < 6; k++) {
    const PetscInt a = TREE_PAIR[k][0], b = TREE_PAIR[k][1];
    PetscReal      q = sum[a] * sum[b];

    if (a >= dim || b >= dim) continue;
    for (PetscInt i = 0; i <= dim; i++) q += v[i][a] * v[i][b];
    m->xx[k] += vol * q / (nv * (nv + 1.0));
  }
}

static void CutEdge(const PetscReal a[], PetscReal da, const PetscReal b[], PetscReal db, PetscReal p[])
{
  const PetscReal t = da / (da - db);

  for (PetscInt k = 0; k < 3; k++) p[k] = a[k] + t * (b[k] - a[k]);
}

/* Order the corners with the inside ones (d < 0) first; returns how many are inside. */
static PetscInt SortCorners(PetscInt dim, PetscReal v[][3], PetscReal d[])
{
  PetscInt in = 0;

  for (PetscInt k = 0; k <= dim; k++) {
    if (d[k] >= 0) continue;
    for (PetscInt a = 0; a < 3; a++) {
      const PetscReal tmp = v[k][a];

      v[k][a]  = v[in][a];
      v[in][a] = tmp;
    }
    {
      const PetscReal tmp = d[k];

      d[k]  = d[in];
      d[in] = tmp;
    }
    in++;
  }
  return in;
}

/* The small simplex at corner k, cut off by the surface, is inside (sign 1) or missing from the inside (sign -1). */
static void AddCorner(PetscInt dim, PetscReal v[][3], const PetscReal d[], PetscInt k, PetscReal sign, Moments *m)
{
  PetscReal p[4][3];

  for (PetscInt i = 0; i <= dim; i++) {
    if (i == k)
      for (PetscInt a = 0; a < 3; a++) p[i][a] = v[i][a];
    else CutEdge(v[k], d[k], v[i], d[i], p[i]);
  }
  AddSimplex(dim, p, sign, m);
}

/* Two corners of a tetrahedron inside: the wedge between edge 0-1 and the quadrilateral of cuts, as three parts. */
static void AddWedge(PetscReal v[][3], const PetscReal d[], Moments *m)
{
  PetscReal w[6][3], p[4][3];
  const int tetrahedron[3][4] = {{0, 1, 2, 3}, {1, 2, 3, 4}, {1, 3, 4, 5}};

  for (PetscInt a = 0; a < 3; a++) {
    w[0][a] = v[0][a];
    w[1][a] = v[1][a];
  }
  CutEdge(v[0], d[0], v[2], d[2], w[2]);
  CutEdge(v[0], d[0], v[3], d[3], w[3]);
  CutEdge(v[1], d[1], v[2], d[2], w[4]);
  CutEdge(v[1], d[1], v[3], d[3], w[5]);
  for (PetscInt k = 0; k < 3; k++) {
    for (PetscInt i = 0; i < 4; i++)
      for (PetscInt a = 0; a < 3; a++) p[i][a] = w[tetrahedron[k][i]][a];
    AddSimplex(3, p, 1.0, m);
  }
}

/* Moments of the part of a simplex where the linear interpolant is negative. Changes the order of v and d. */
static void AddClipped(PetscInt dim, PetscReal v[][3], PetscReal d[], Moments *m)
{
  const PetscInt in = SortCorners(dim, v, d);

  if (in == 0) return;
  if (in == 1) AddCorner(dim, v, d, 0, 1.0, m);
  else if (in == 2 && dim == 3) AddWedge(v, d, m);
  else {
    AddSimplex(dim, v, 1.0, m);
    if (in == dim) AddCorner(dim, v, d, dim, -1.0, m);
  }
}

void TreeAddCut(PetscReal v[][3], PetscReal d[], PetscReal *area, PetscReal centre[])
{
  const PetscInt in = SortCorners(3, v, d);
  PetscReal      p[4][3], e[2][3], c[3];
  PetscInt       ntri = 1;

  if (in == 0 || in == 4) return;
  if (in == 2) { /* in the order around the quadrilateral */
    CutEdge(v[0], d[0], v[2], d[2], p[0]);
    CutEdge(v[0], d[0], v[3], d[3], p[1]);
    CutEdge(v[1], d[1], v[3], d[3], p[2]);
    CutEdge(v[1], d[1], v[2], d[2], p[3]);
    ntri = 2;
  } else {
    const PetscInt k = in == 1 ? 0 : 3;

    for (PetscInt i = 0, j = 0; i < 4; i++)
      if (i != k) CutEdge(v[k], d[k], v[i], d[i], p[j++]);
  }
  for (PetscInt t = 0; t < ntri; t++) {
    PetscReal s;

    for (PetscInt a = 0; a < 3; a++) {
      e[0][a] = p[t + 1][a] - p[0][a];
      e[1][a] = p[t + 2][a] - p[0][a];
    }
    cross(e[0], e[1], c);
    s = 0.5 * VectorLength(3, c);
    *area += s;
    for (PetscInt a = 0; a < 3; a++) centre[a] += s * (p[0][a] + p[t + 1][a] + p[t + 2][a]) / 3.0;
  }
}

/* ---- cells of the last level ---- */

#define TABLE 1024 /* twice the corners of SHAPE_CHUNK cells in space, a power of two */

/* The place of a corner in an open table: slot[place] is its number among those seen, negative for a new one */
static PetscInt find_corner(const PetscInt cell[3], PetscInt slot[TABLE], const PetscInt seen[][3])
{
  const PetscInt64 mixed = (PetscInt64)cell[0] * 73856093 ^ (PetscInt64)cell[1] * 19349663 ^
                           (PetscInt64)cell[2] * 83492791;
  PetscInt at = (PetscInt)(mixed & (TABLE - 1));

  for (; slot[at] >= 0; at = (at + 1) & (TABLE - 1)) {
    const PetscInt *old = seen[slot[at]];

    if (old[0] == cell[0] && old[1] == cell[1] && old[2] == cell[2]) break;
  }
  return at;
}

/* Neighbours share corners, whose distances are asked for once among the cells at hand. */
PetscErrorCode TreeEvaluateCorners(const Tree *t, PetscInt m, const PetscInt cell[], PetscReal x[], PetscReal d[])
{
  const PetscInt  dim = t->dim, nc = 1 << dim;
  const PetscReal h = TreeCellWidth(t);
  PetscInt        slot[TABLE], seen[TABLE / 2][3], which[TABLE / 2], n = 0;
  PetscReal       y[TABLE / 2 * 3] = {0}, dy[TABLE / 2];

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < TABLE; i++) slot[i] = -1;
  for (PetscInt i = 0; i < m * nc; i++) {
    PetscInt corner[3] = {0, 0, 0}, at;

    for (PetscInt a = 0; a < dim; a++) {
      corner[a]      = cell[i / nc * dim + a] + ((i % nc) >> a & 1);
      x[i * dim + a] = -t->half + h * (PetscReal)corner[a];
    }
    at = find_corner(corner, slot, seen);
    if (slot[at] < 0) {
      PetscCall(PetscArraycpy(seen[n], corner, 3));
      PetscCall(PetscArraycpy(y + n * dim, x + i * dim, dim));
      slot[at] = n++;
    }
    which[i] = slot[at];
  }
  PetscCall(ShapeDistance(t->shape, n, y, dy));
  for (PetscInt i = 0; i < m * nc; i++) d[i] = dy[which[i]];
  PetscFunctionReturn(PETSC_SUCCESS);
}

void TreeTakeSimplex(PetscInt dim, PetscInt k, const PetscReal x[], const PetscReal d[], PetscReal v[][3],
                     PetscReal dv[])
{
  for (PetscInt i = 0; i <= dim; i++) {
    const int c = dim == 2 ? TREE_TRIANGLE[k][i] : TREE_TETRAHEDRON[k][i];

    v[i][2] = 0;
    for (PetscInt a = 0; a < dim; a++) v[i][a] = x[c * dim + a];
    dv[i] = d[c];
  }
}

PetscErrorCode TreeAddCutCells(const Tree *t, Moments *m)
{
  const PetscInt dim = t->dim, nc = 1 << dim, ns = dim == 2 ? 2 : 6;
  PetscReal      x[SHAPE_CHUNK * 8 * 3], d[SHAPE_CHUNK * 8], v[4][3], dv[4];

  PetscFunctionBeginUser;
  for (PetscInt start = 0; start < t->n; start += SHAPE_CHUNK) {
    const PetscInt n = PetscMin(SHAPE_CHUNK, t->n - start);

    PetscCall(TreeEvaluateCorners(t, n, t->cell + start * dim, x, d));
    for (PetscInt i = 0; i < n; i++)
      for (PetscInt k = 0; k < ns; k++) {
        TreeTakeSimplex(dim, k, x + i * nc * dim, d + i * nc, v, dv);
        AddClipped(dim, v, dv, m);
      }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
