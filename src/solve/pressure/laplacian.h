/* Laplacian: the Q1 Laplacian on the vertices as coarse operator of the pressure (coarse.h), in place of the Galerkin
   one: 9 (27) entries a row for 25 (125), 8 x 8 for each changed cell in place of 27 x 27 for each changed node.

   S_p = B M^{-1} B^T is -div (1/m) grad with the inverse masses of the velocity slots. A cell has one coefficient for
   each axis a: the mean of inverse mass times volume over its nodes, weighted by their shares of the cell; nodes on the
   boundary of the domain have no part in it. Where pressure acts through an open boundary, which holds it to zero,
   those slots add their (inverse mass) (int phi n)^2 to the diagonal of the vertices at them. Elman, Silvester, Wathen
   2014, section 4; counts in runs/studies/flow-solver. Changes of weights are gathered, so a moving body costs what it
   touches. */
#pragma once
#include "mesh/mesh.h"
#include <petscmat.h>

typedef struct _p_Laplacian *Laplacian;

/* Collective. */
PetscErrorCode LaplacianCreate(Mesh, Laplacian *);
PetscErrorCode LaplacianDestroy(Laplacian *);
/* The inverse masses of own node i grow by change [dim]; b [ncell_all][nk][nb dim]: the cells' divergence, the constant
   pressure first. Not collective. */
PetscErrorCode LaplacianAddNode(Laplacian, const PetscReal *const b[], PetscInt nk, PetscInt i,
                                const PetscReal change[]);
/* What was gathered goes into A (ADD_VALUES), whose rows are the vertices (global numbers vertex [nnode_all]): before
   cells change their shape, and before A is assembled. Not collective. */
PetscErrorCode LaplacianFlush(Laplacian, const PetscInt vertex[], Mat A);
/* Or it goes to the caller, who adds it elsewhere: n cells with changes [n][dim] of their coefficients, and vertices
   with values of the diagonal, by their numbers. All four are to be freed. Not collective. */
PetscErrorCode LaplacianTake(Laplacian, const PetscInt vertex[], PetscInt *n, PetscInt *cell[], PetscReal *change[],
                             PetscInt *nvertex, PetscInt *row[], PetscReal *value[]);
