/* Inside of Deform, for its files only. deform.c: monitor, steps. potential.c: displacements from sizes. */
#pragma once
#include "base/algebra.h"
#include "base/grid.h"
#include "mesh/deform.h"
#include <petscksp.h>

#define MAX_NV 8  /* vertices of a cell */
#define MAX_NQ 27 /* Gauss points */

/* Surfaces and their periodic images, where they are */
typedef struct {
  Grid     grid; /* entries, with the width around them */
  PetscInt n, capacity, *surface;
  PetscReal (*at)[3]; /* [n] centre */
} DeformNear;

/* The vertex functions of a cell at its Gauss points */
typedef struct {
  PetscInt  nv, nq;         /* vertices, points */
  PetscInt  corner[MAX_NV]; /* lattice position of vertex j */
  PetscReal phi[MAX_NQ][MAX_NV], dphi[MAX_NQ][MAX_NV][3], weight[MAX_NQ];
} DeformElement;

/* [ncell_all] */
typedef struct {
  PetscReal *start;       /* size at the start */
  PetscReal *now, *count; /* present size; integral of 1/m */
  PetscReal *slope;       /* [nv][dim] derivative of count/k by the positions of the vertices */
} DeformCells;

/* [nnode_all] */
typedef struct {
  PetscBool *vertex;
  PetscInt  *fixed;    /* bit mask of components that do not move */
  PetscReal *inverse;  /* 1/m at vertices */
  PetscReal *mobility; /* 1/(rho^2 mass): how willingly a vertex moves */
  PetscReal *damp;     /* SMOOTH */
  PetscReal *v;        /* [dim] displacement */
  PetscReal *start;    /* [dim] positions at the start */
  PetscReal *relax;    /* [dim] part of what smoothing would change in the displacements from there */
  PetscReal *trial;    /* [dim] positions */
} DeformNodes;

struct _p_Deform {
  Mesh                  mesh;
  MPI_Comm              comm;
  const MeshLocal      *l;
  const DeformSurfaces *surfaces;
  PetscBool             meets; /* surfaces anew wherever nodes come: before the first time step */
  PetscReal             size, width;
  PetscReal             fraction; /* of the relaxation in a step */
  PetscReal             scale;    /* k */
  PetscInt              steps, dim;
  DeformNear            near;
  DeformElement         element;
  DeformCells           cell;
  DeformNodes           node;
  Mat                   K;
  KSP                   ksp;
  Vec                   x, b;
};

/* Jacobian matrix dx_a/dxi_b of vertices xv with gradients g of the vertex functions */
static inline void DeformMapGradient(const struct _p_Deform *d, PetscReal xv[][3], const PetscReal g[][3],
                                     PetscReal jac[])
{
  for (PetscInt a = 0; a < d->dim; a++)
    for (PetscInt b = 0; b < d->dim; b++) {
      jac[a * d->dim + b] = 0;
      for (PetscInt j = 0; j < d->element.nv; j++) jac[a * d->dim + b] += xv[j][a] * g[j][b];
    }
}

static inline PetscInt DeformVertex(const struct _p_Deform *d, PetscInt c, PetscInt j)
{
  return d->l->cell_node[c * d->l->nb + d->element.corner[j]];
}

/* Positions of the vertices of local cell c. */
PetscErrorCode DeformGetVertices(const struct _p_Deform *, PetscInt c, PetscReal xv[][3]);
/* Wanted size over k times the size at the start, at x [dim]. A product over the surfaces is smooth also where two of
   them are equally far. */
PetscErrorCode DeformEvaluateMonitor(const struct _p_Deform *, const PetscReal x[], PetscReal *m);
/* The potential, in d->x, for the wanted sizes after the relaxation too. After the cells are measured. Collective. */
PetscErrorCode DeformSolvePotential(Deform);
/* d->node.v: the displacement mobility slope^T w and the relaxation, at all local nodes. Collective. */
PetscErrorCode DeformFindDisplacement(Deform);
