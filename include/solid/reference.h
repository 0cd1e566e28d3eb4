/* SolidMesh: the reference mesh of an elastic solid, Q2 cells that fill a shape.

   A small box mesh around the shape, in its own frame, is lined up with its surface (align/align.h); the cells inside
   stay. Vertices are where the fit puts them; in the plane nodes between two vertices of the surface lie on it, all
   others in the middle; in space all are where the fit puts them. Quadrature: 3 Gauss points an axis. Every rank makes
   the same mesh: nothing is collective.

   Of a membrane the mesh is its surface, closed: Q2 edges or faces, without anything inside. */
#pragma once
#include "shape.h"

typedef struct {
  PetscInt   dim, nd; /* of space; of a cell: dim, of a membrane dim - 1 */
  PetscInt   nb, nq;  /* nodes and quadrature points of a cell: 3^nd */
  PetscInt   nnode, ncell, nside;
  PetscInt  *cell_node; /* [ncell][nb], in the order of fem/element.h */
  PetscInt   nb_side;   /* nodes of a side: 3 in the plane, 9 in space */
  PetscInt  *side;      /* [nside][nb_side] nodes of the surface: along an edge, the solid on its left; of a face node
                           j at (j % 3, j/3), these two directions and the normal outwards right-handed */
  PetscReal *X;         /* [nnode][dim] about the centroid of the shape */
  PetscReal *phi;       /* [nq][nb] basis at the quadrature points */
  PetscReal *grad;      /* [ncell][nq][nb][nd] its gradients in the reference frame; of a membrane along two orthogonal
                           directions in it, with the normal outwards right-handed (in the plane one, it on the left) */
  PetscReal *weight;    /* [ncell][nq] */
  PetscReal  volume;    /* sum of the weights; of a membrane what it encloses, */
  PetscReal  area;      /* and the sum of the weights */
  PetscInt  *around, *neighbour;  /* of node i, those of the cells around it, itself too: around[i] to around[i + 1] */
  PetscReal *laplace, *curvature; /* what bending has of a membrane: a value for each neighbour, [nnode][dim + 1] */
  PetscReal  h;                   /* longest side of the box mesh's cells; of a membrane of its own */
  PetscReal  radius;              /* largest |X| */
} SolidMesh;

/* cells [dim] of the box around the shape; where they are 0 as many as have sides of `size`. `name` is that of the
   group, for messages. Errors: a shape that the cells cannot follow. */
PetscErrorCode SolidMeshCreate(Shape, const char name[], PetscInt dim, const PetscInt cells[], PetscReal size,
                               SolidMesh *);
/* The same of a membrane: cells [dim] of the box whose surface is drawn onto that of the shape. Errors: a shape that is
   not seen whole from its centroid (in space). */
PetscErrorCode SolidMeshCreateMembrane(Shape, const char name[], PetscInt dim, const PetscInt cells[], PetscReal size,
                                       SolidMesh *);
PetscErrorCode SolidMeshDestroy(SolidMesh *);
static inline PetscBool SolidIsMembrane(const SolidMesh *m)
{
  return (PetscBool)(m->nd < m->dim);
}
