/* Inside of Deform, for its files only. deform.c: monitor, steps. deform_potential.c: displacements from sizes. */
#pragma once
#include "base/algebra.h"
#include "base/grid.h"
#include "couple/deform.h"
#include <petscksp.h>

#define MAX_NV 8  /* vertices of a cell */
#define MAX_NQ 27 /* Gauss points */

struct _p_Deform {
  Mesh             mesh;
  Bodies           bodies;
  BodyState       *s;
  const MeshLocal *l;
  Grid             near;        /* entries of the list, with their widths around them */
  PetscInt         nnear, room; /* the list: bodies and their periodic images, where they are drawn */
  PetscInt        *body;
  PetscReal (*X)[3];              /* [nnear] */
  const PetscReal (*q)[4];        /* [bodies] */
  PetscBool  meets;               /* bodies anew wherever nodes come: before the first time step */
  PetscReal  size, width, radius; /* radius: of the largest body */
  PetscInt   steps, dim, nv, nq;  /* vertices of a cell, Gauss points */
  PetscInt   corner[MAX_NV];      /* lattice place of vertex j of a cell */
  PetscReal  phi[MAX_NQ][MAX_NV], dphi[MAX_NQ][MAX_NV][3], weight[MAX_NQ];
  PetscBool *vertex;       /* [nnode_all] */
  PetscInt  *held;         /* [nnode_all] bit mask of components that do not move */
  PetscReal *carried;      /* [ncell_all] size of the cell at the start */
  PetscReal *now, *count;  /* [ncell_all] present size; integral of 1/m */
  PetscReal *slope;        /* [ncell_all][nv][dim] derivative of count/k by the places of the vertices */
  PetscReal *inverse;      /* [nnode_all] 1/m at vertices */
  PetscReal *ease;         /* [nnode_all] 1/(rho^2 mass): how willingly a vertex moves */
  PetscReal *damp;         /* [nnode_all] SMOOTH */
  PetscReal *v;            /* [nnode_all][dim] displacement */
  PetscReal *start;        /* [nnode_all][dim] places at the start */
  PetscReal *relax, share; /* [nnode_all][dim] a share of what smoothing would change in the displacements from there */
  PetscReal *trial;        /* [nnode_all][dim] places */
  PetscReal  scale;        /* k */
  Mat        K;
  KSP        ksp;
  Vec        x, b;
};

/* Jacobian matrix dx_a/dxi_b of vertices xv with gradients g of the vertex functions */
static inline void DeformMapGradient(const struct _p_Deform *d, PetscReal xv[][3], const PetscReal g[][3], PetscReal jac[])
{
  for (PetscInt a = 0; a < d->dim; a++)
    for (PetscInt b = 0; b < d->dim; b++) {
      jac[a * d->dim + b] = 0;
      for (PetscInt j = 0; j < d->nv; j++) jac[a * d->dim + b] += xv[j][a] * g[j][b];
    }
}

static inline PetscInt DeformVertex(const struct _p_Deform *d, PetscInt c, PetscInt j)
{
  return d->l->cell_node[c * d->l->nb + d->corner[j]];
}

/* Places of the vertices of local cell c. */
PetscErrorCode DeformGetVertices(const struct _p_Deform *, PetscInt c, PetscReal xv[][3]);
/* Wanted size over k times the size at the start, at x [dim]. A product over the bodies is smooth also where two of
   them are equally far. */
PetscErrorCode DeformEvaluateMonitor(const struct _p_Deform *, const PetscReal x[], PetscReal *m);
/* The potential, in d->x, for the wanted sizes after the relaxation too. After the cells are measured. Collective. */
PetscErrorCode DeformSolvePotential(Deform);
/* d->v: the displacement ease slope^T w and the relaxation, at all local nodes. Collective. */
PetscErrorCode DeformFindDisplacement(Deform);
