/* FileCells: the cells of a Gmsh file, brought into the order of our Q2 nodes. Not collective. */
#pragma once
#include "msh.h"

typedef struct {
  PetscInt  dim, nb, ncell, nvertex;
  PetscInt *lattice; /* [ncell][nb] nodes of the file by lattice position (mesh.h), -1: the file has none there */
  PetscInt *number;  /* [ncell] of the element in the file */
  PetscInt *vertex;  /* [nnode of the file] which corner of cells it is, -1: none; in the order of the file */
  PetscInt  turned;  /* cells that went round the other way in the file: the first two axes are exchanged here */
  PetscBool curved;  /* is any cell more than the straight one of its corners? */
} FileCells;

/* The caller clears it, also after a fault. Nodes that the file lacks are those of the cell with straight edges, or,
   where the middles of the edges are known, of transfinite interpolation (Gordon & Hall, Numer. Math. 21, 1973).
   fault: "" or what is wrong: no cells, shapes or orders that are no quadrilaterals or hexahedra of order 1 or 2, a
   plane that is not x, y, an inverted cell. */
PetscErrorCode FileCellsFind(const Msh *, FileCells *, char fault[MSH_FAULT]);
PetscErrorCode FileCellsClear(FileCells *);
/* Where the lattice positions of cell c are: xc [nb][dim] */
void FileCellsPositions(const Msh *, const FileCells *, PetscInt c, PetscReal xc[]);
