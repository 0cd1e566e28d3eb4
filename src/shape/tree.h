/* Tree: square (cubic) cells over [-r, r]^dim, refined where the surface of a shape may cut them; the distance is
   1-Lipschitz. In the cells of the last level the distance is linear on 2 triangles (6 tetrahedra). Vertices are
   numbered by integers: neighbours see identical values. */
#pragma once
#include "impl.h"

typedef struct {
  PetscReal v, x[3], xx[6]; /* integrals of 1, x, and x_a x_b: xx yy zz xy xz yz */
} Moments;

typedef struct {
  Shape     shape;
  PetscInt  dim, level; /* cells have width 2 half / 2^level */
  PetscReal half;       /* of the box */
  PetscInt  n, *cell;   /* [n][dim] integer position of cells that may be cut */
  Moments   full;       /* of the cells found to lie inside */
} Tree;

/* The components of a symmetric tensor: xx yy zz xy xz yz */
static const PetscInt TREE_PAIR[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
/* Corners of the triangles of a square, as bit patterns, counter-clockwise */
static const int TREE_TRIANGLE[2][3] = {{0, 1, 3}, {0, 3, 2}};
/* Of the tetrahedra of a cube: paths from 0 to 7, one for each order of the axes */
static const int TREE_TETRAHEDRON[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                           {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

static inline PetscReal VectorLength(PetscInt dim, const PetscReal v[])
{
  PetscReal s = 0;

  for (PetscInt a = 0; a < dim; a++) s += v[a] * v[a];
  return PetscSqrtReal(s);
}

static inline PetscReal TreeCellWidth(const Tree *t)
{
  return 2.0 * t->half / (PetscReal)((PetscInt)1 << t->level);
}

static inline PetscReal TreeHalfDiagonal(const Tree *t)
{
  return 0.5 * TreeCellWidth(t) * PetscSqrtReal((PetscReal)t->dim);
}

static inline void TreeCellCentre(const Tree *t, const PetscInt cell[], PetscReal x[])
{
  const PetscReal h = TreeCellWidth(t);

  for (PetscInt a = 0; a < t->dim; a++) x[a] = -t->half + ((PetscReal)cell[a] + 0.5) * h;
}

PetscErrorCode TreeCreate(Shape, PetscReal r, PetscInt dim, Tree *);
PetscErrorCode TreeDestroy(Tree *);
/* Go down one level: the children of all cells; full ones are added to t->full, empty ones dropped. */
PetscErrorCode TreeRefine(Tree *);
/* Positions x [m][2^dim][dim] and distances d of the corners of m cells. */
PetscErrorCode TreeEvaluateCorners(const Tree *, PetscInt m, const PetscInt cell[], PetscReal x[], PetscReal d[]);
/* Gather simplex k of a cell from its corners: v [dim + 1][3], dv [dim + 1]. */
void TreeTakeSimplex(PetscInt dim, PetscInt k, const PetscReal x[], const PetscReal d[], PetscReal v[][3],
                     PetscReal dv[]);
/* Add the moments of the inside of the cells that may be cut. */
PetscErrorCode TreeAddCutCells(const Tree *, Moments *);
/* In space: add what the bend of the surface within these cells adds to that. */
PetscErrorCode TreeAddBends(const Tree *, Moments *);
/* In space: move the cells in which the distance bends by more than so many cell widths (a ball of n cells' radius by
   1/8n, edges and thin parts by more at every level) from a tree into another (full: none). */
PetscErrorCode TreeSplit(Tree *, PetscReal curvature, Tree *rough);
/* Add area, and area times centre, of the cut through a tetrahedron. Changes the order of v and d. */
void TreeAddCut(PetscReal v[][3], PetscReal d[], PetscReal *area, PetscReal centre[]);
