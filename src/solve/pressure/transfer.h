/* Transfer: between discontinuous P1 pressures of cells and continuous Q1 pressures on vertices (coarse.h). On every
   cell the linear function that fits its vertex values; down, the transpose. Of cells of one form the numbers stand
   once. Dead cells take nothing. Own vertices are numbered first here, then those of own and ghost cells that other
   ranks own. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_Transfer *Transfer;

/* nk pressures a cell. Collective. */
PetscErrorCode TransferCreate(Mesh, PetscInt nk, Transfer *);
PetscErrorCode TransferDestroy(Transfer *);
/* The n listed local cells have changed their shape or have become inactive: cell_material [ncell_all] < 0 for
   inactive ones, or NULL. Not collective. */
PetscErrorCode TransferUpdateCells(Transfer, PetscInt n, const PetscInt cell[], const PetscInt cell_material[]);
/* Own vertices, all of the numbers here; global numbers [all], and [nnode_all] of the vertex at a node, or -1.
   Borrowed. Not collective. */
PetscErrorCode TransferGetVertices(Transfer, PetscInt *own, PetscInt *all, const PetscInt *global[],
                                   const PetscInt *node[]);
/* Vertices [2^dim] of local cell c by their numbers here, and fit [nk][2^dim] from their values. Borrowed until cells
   change. Not collective. */
void TransferGetCell(Transfer, PetscInt c, const PetscInt *vertex[], const PetscReal *fit[]);
/* Derivative J [dim][dim] of a cell's map at its centre. Not collective. */
PetscErrorCode TransferMapCell(Mesh, PetscInt c, PetscReal J[]);

/* b [all] = what r [ncell][nk] is at the vertices; own ones are sums over the ranks. Collective. */
PetscErrorCode TransferRestrict(Transfer, const PetscReal r[], PetscReal b[]);
/* x [ncell][nk] += the fit of v, and ghost [ncell_all - ncell][nk] likewise where there are other ranks; v [all], of
   which the own ones are given. Collective. */
PetscErrorCode TransferInterpolateAdd(Transfer, PetscReal v[], PetscReal x[], PetscReal ghost[]);
/* The same as a matrix, for others' multigrid. Collective. */
PetscErrorCode TransferCreateMat(Transfer, Mat *);
