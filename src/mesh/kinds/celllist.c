/* CellList: see celllist.h. */
#include "compat.h"
#include "celllist.h"

PetscErrorCode CellListCreate(PetscInt dim, PetscInt vertex_capacity, PetscInt cell_capacity, CellList *l)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMemzero(l, sizeof(*l)));
  l->dim             = dim;
  l->vertex_capacity = vertex_capacity;
  l->cell_capacity   = cell_capacity;
  PetscCall(PetscMalloc2(dim * vertex_capacity, &l->x, cell_capacity << dim, &l->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellListClear(CellList *l)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree2(l->x, l->cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellListAddVertex(CellList *l, const PetscReal x[], PetscInt *id)
{
  PetscFunctionBeginUser;
  PetscCheck(l->nvertex < l->vertex_capacity, PETSC_COMM_SELF, PETSC_ERR_PLIB, "More than %" PetscInt_FMT " vertices",
             l->vertex_capacity);
  for (PetscInt d = 0; d < l->dim; d++) l->x[l->dim * l->nvertex + d] = x[d];
  *id = l->nvertex++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* In a hexahedron PETSc goes round the first face as seen from outside, where the cell starts: vertex 4 is over 0 */
PetscErrorCode CellListAddCell(CellList *l, const PetscInt vertex[])
{
  PetscFunctionBeginUser;
  PetscCheck(l->ncell < l->cell_capacity, PETSC_COMM_SELF, PETSC_ERR_PLIB, "More than %" PetscInt_FMT " cells",
             l->cell_capacity);
  for (PetscInt i = 0; i < 1 << l->dim; i++)
    l->cell[(l->ncell << l->dim) + i] = vertex[l->dim == 3 && i < 4 ? (4 - i) % 4 : i];
  l->ncell++;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellListExtrude(const CellList *plane, PetscInt nlayer, PetscBool periodic, CellList *solid)
{
  const PetscInt nlevel = periodic ? nlayer : nlayer + 1;
  PetscInt       id;

  PetscFunctionBeginUser;
  PetscCall(CellListCreate(3, nlevel * plane->nvertex, nlayer * plane->ncell, solid));
  for (PetscInt k = 0; k < nlevel; k++) {
    for (PetscInt v = 0; v < plane->nvertex; v++)
      PetscCall(CellListAddVertex(solid, (const PetscReal[]){plane->x[2 * v], plane->x[2 * v + 1], (PetscReal)k}, &id));
  }
  for (PetscInt k = 0; k < nlayer; k++) {
    for (PetscInt c = 0; c < plane->ncell; c++) {
      PetscInt vertex[8];

      for (PetscInt i = 0; i < 4; i++) {
        vertex[i]     = k * plane->nvertex + plane->cell[4 * c + i];
        vertex[4 + i] = (k + 1) % nlevel * plane->nvertex + plane->cell[4 * c + i];
      }
      PetscCall(CellListAddCell(solid, vertex));
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Cells across the seam of the period get coordinates of their own */
static PetscErrorCode make_periodic(DM dm, PetscReal period)
{
  const PetscReal max_cell[3] = {-1, -1, 1.1}, start[3] = {0, 0, 0}, length[3] = {-1, -1, period};

  PetscFunctionBeginUser;
  PetscCall(DMSetPeriodicity(dm, max_cell, start, length));
  PetscCall(DMLocalizeCoordinates(dm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CellListCreateDM(MPI_Comm comm, PetscInt dim, const CellList *l, PetscReal period, DM *dm)
{
  PetscMPIInt rank;
  PetscBool   here;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(comm, &rank));
  here = (PetscBool)(rank == 0);
  PetscCall(DMPlexCreateFromCellListPetsc(comm, dim, here ? l->ncell : 0, here ? l->nvertex : 0, 1 << dim, PETSC_TRUE,
                                          here ? l->cell : NULL, dim, here ? l->x : NULL, dm));
  if (period > 0) PetscCall(make_periodic(*dm, period));
  PetscFunctionReturn(PETSC_SUCCESS);
}
