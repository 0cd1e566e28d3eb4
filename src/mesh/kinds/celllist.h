/* CellList: quadrilaterals or hexahedra in the making, in reference coordinates, on one rank. */
#pragma once
#include <petscdmplex.h>

typedef struct {
  PetscInt   dim, nvertex, ncell, vertex_capacity, cell_capacity;
  PetscReal *x;    /* [nvertex][dim] */
  PetscInt  *cell; /* [ncell][2^dim]; quadrilaterals counter-clockwise; hexahedra: such a face seen from inside, then
                      the opposite one, vertex by vertex */
} CellList;

/* Room for so many vertices and cells; the caller clears it. Adding more is an error. Not collective. */
PetscErrorCode CellListCreate(PetscInt dim, PetscInt vertex_capacity, PetscInt cell_capacity, CellList *);
PetscErrorCode CellListClear(CellList *);
PetscErrorCode CellListAddVertex(CellList *, const PetscReal x[], PetscInt *id);
PetscErrorCode CellListAddCell(CellList *, const PetscInt vertex[]);

/* Layers of hexahedra over a list of quadrilaterals, unit steps along z from 0 on; periodic: the last layer ends where
   the first one starts. The caller clears `solid`. Not collective. */
PetscErrorCode CellListExtrude(const CellList *plane, PetscInt nlayer, PetscBool periodic, CellList *solid);

/* The mesh of the list on rank 0 (ignored elsewhere) with its edges and faces; period: length along z in reference
   coordinates, 0: none. Collective; the caller destroys dm. */
PetscErrorCode CellListCreateDM(MPI_Comm, PetscInt dim, const CellList *, PetscReal period, DM *dm);
