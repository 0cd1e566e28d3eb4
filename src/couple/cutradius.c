/* CutCells: sizes of cells, see cutcells.h. */
#include "compat.h"
#include "cutcells.h"

PetscErrorCode CutCellRadius(Mesh mesh, PetscInt cell, PetscReal *radius)
{
  const MeshLocal *l;
  PetscReal        xc[MESH_MAX_NB * 3], r2 = 0;
  const PetscReal *centre;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  PetscCall(MeshCellCoordinates(mesh, cell, xc));
  centre = xc + (l->nb / 2) * l->dim;
  for (PetscInt j = 0; j < l->nb; j++) {
    PetscReal s = 0;

    for (PetscInt a = 0; a < l->dim; a++) s += PetscSqr(xc[j * l->dim + a] - centre[a]);
    r2 = PetscMax(r2, s);
  }
  *radius = 1.1 * PetscSqrtReal(r2);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CutCellReach(Mesh mesh, PetscReal *reach)
{
  const MeshLocal *l;

  PetscFunctionBeginUser;
  PetscCall(MeshGetLocal(mesh, &l));
  *reach = 0;
  for (PetscInt c = 0; c < l->ncell_all; c++) {
    PetscReal radius;

    PetscCall(CutCellRadius(mesh, c, &radius));
    *reach = PetscMax(*reach, radius);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
