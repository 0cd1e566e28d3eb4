/* Mesh: how large a cell is, and whether it is inverted. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"

/* Jacobian determinant on [0,1]^dim of the Q2 map of a cell at its corner (0 or 2 along each axis). xc [nb][dim] */
static PetscReal corner_jacobian(PetscInt dim, const PetscReal xc[], const PetscInt corner[3])
{
  const PetscInt stride[3] = {1, 3, 9};
  PetscReal      e[9];
  PetscInt       at = 0;

  for (PetscInt k = 0; k < dim; k++) at += corner[k] * stride[k];
  for (PetscInt k = 0; k < dim; k++) {
    const PetscInt step = corner[k] ? -stride[k] : stride[k];

    for (PetscInt d = 0; d < dim; d++)
      e[k * dim + d] = (corner[k] ? -1 : 1) *
                       (4 * xc[(at + step) * dim + d] - 3 * xc[at * dim + d] - xc[(at + 2 * step) * dim + d]);
  }
  return DenseDeterminant(dim, e);
}

void MeshMeasureCell(PetscInt dim, const PetscReal xc[], PetscReal *smallest, PetscReal *volume)
{
  *smallest = PETSC_MAX_REAL;
  *volume   = 0;
  for (PetscInt v = 0; v < 1 << dim; v++) {
    PetscInt  corner[3];
    PetscReal J;

    MeshCornerPosition(dim, v, corner);
    J         = corner_jacobian(dim, xc, corner);
    *smallest = PetscMin(*smallest, J);
    *volume += J / (1 << dim);
  }
}
