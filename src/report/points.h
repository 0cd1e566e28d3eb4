/* Points: the points of a mesh in a file for pictures. A point is a node of the mesh; where the mesh is periodic, a
   node that a cell needs on the far side of the period has further points there, so that no cell is stretched over
   the picture. Points of a rank are its own nodes, then these images of them, in the order of `node`. Where
   cells of two sizes meet, the small ones have points of their own, last, with the values of the large face. */
#pragma once
#include "mesh/mesh.h"

#define POINTS_MAX_CODES 27 /* shifts by -1, 0, 1 periods an axis: digits of base 3, 13 stands for none */

typedef struct {
  PetscInt  n, start, total;          /* own points, number of the first, all */
  PetscInt  nhang, *cell, *row;       /* the last nhang: own cell, and row of its MeshHang */
  PetscInt *node, *code;              /* [n - nhang] local node, shift */
  PetscInt *number[POINTS_MAX_CODES]; /* [nnode_all] point of a node at this shift; NULL: there are none */
} Points;

/* Place in a cell's lattice (ix + 3 iy + 9 iz) of VTK's k-th node, [3^dim]. */
const PetscInt *PointsVtkOrder(PetscInt dim);

/* Collective. */
PetscErrorCode PointsCreate(Mesh, Points *);
PetscErrorCode PointsDestroy(Points *);
/* Places x [n][3] of the own points. Not collective. */
PetscErrorCode PointsGetPositions(const Points *, Mesh, PetscReal x[]);
/* Values w [n][bs] at the points of nodal values v [nnode_all][bs], ghosts up to date; of integers those of the node
   that counts most. Not collective. */
PetscErrorCode PointsEvaluate(const Points *, Mesh, PetscInt bs, const PetscReal v[], PetscReal w[]);
PetscErrorCode PointsPick(const Points *, Mesh, const PetscInt v[], PetscInt w[]);
/* Numbers of the points of own cell c in the order of its nodes, number [nb]. Not collective. */
PetscErrorCode PointsOfCell(const Points *, Mesh, PetscInt c, PetscInt number[]);
