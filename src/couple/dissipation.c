/* Couple, dissipation of fluids that each have their viscosity (FlowSetProperties), whose stress is symmetric. */
#include "compat.h"
#include "impl.h"
#include "base/algebra.h"
#include "fem/element.h"
#include "fem/gauss.h"

/* 2 mu int D : D over a cell with nodes xc [nb][dim], velocities v [nb][dim], by the points of the flow: so the books
   of energy close in flat cells too */
static PetscReal dissipation_of_cell(PetscInt dim, PetscReal mu, const PetscReal xc[], const PetscReal v[])
{
  const PetscInt nb  = dim == 2 ? 9 : 27;
  PetscReal      sum = 0;

  for (PetscInt q = 0; q < nb; q++) {
    const PetscReal xi[3] = {GAUSS3_POINT[q % 3], GAUSS3_POINT[q / 3 % 3], GAUSS3_POINT[q / 9]};
    PetscReal       phi[MESH_MAX_NB], dphi[3 * MESH_MAX_NB], x[3], J[9], inverse[9], det, G[9] = {0}, square = 0;

    ElementBasis(dim, xi, phi, dphi);
    ElementMap(dim, xc, xi, x, J);
    det = DenseInvertMap(dim, J, inverse);
    for (PetscInt j = 0; j < nb; j++)
      for (PetscInt b = 0; b < dim; b++) {
        PetscReal d = 0;

        for (PetscInt e = 0; e < dim; e++) d += dphi[nb * e + j] * inverse[dim * e + b];
        for (PetscInt a = 0; a < dim; a++) G[dim * a + b] += d * v[dim * j + a];
      }
    for (PetscInt e = 0; e < dim * dim; e++) square += 0.5 * PetscSqr(G[e] + G[e % dim * dim + e / dim]);
    sum += GAUSS3_WEIGHT[q % 3] * GAUSS3_WEIGHT[q / 3 % 3] * (dim == 3 ? GAUSS3_WEIGHT[q / 9] : 1) * det * mu * square;
  }
  return sum;
}

PetscErrorCode CoupleViscousPower(Couple c, const PetscReal viscosity[], const PetscReal u[], PetscReal *power)
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim;

  PetscFunctionBeginUser;
  *power = 0;
  for (PetscInt e = 0; e < l->ncell; e++) {
    PetscReal xc[3 * MESH_MAX_NB], v[3 * MESH_MAX_NB];

    PetscCall(MeshCellCoordinates(c->mesh, e, xc));
    MeshCellValues(l, e, dim, u, v);
    *power += dissipation_of_cell(dim, viscosity[e], xc, v);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
