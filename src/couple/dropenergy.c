/* CoupleDrops, energy: what the step does with it beside drops. The momentum equation is tested with the velocity at
   the end of the step: viscosity takes 2 mu D : D, with the viscosity of the cells, and friction at walls mu u^2 over
   the slip length; tension takes what it does not give back as length of the interface, which is the scheme's like
   inertia. */
#include "compat.h"
#include "drops.h"
#include "impl.h"
#include "base/algebra.h"
#include "fem/element.h"
#include "fem/gauss.h"

/* 2 mu int D : D over a cell with nodes xc [9][2], velocities v [9][2]: a rational function where it is curved */
static PetscReal dissipation_of_cell(PetscReal mu, const PetscReal xc[], const PetscReal v[])
{
  PetscReal sum = 0;

  for (PetscInt q = 0; q < 16; q++) {
    const PetscReal xi[2] = {GAUSS4_POINT[q % 4], GAUSS4_POINT[q / 4]};
    PetscReal       phi[9], dphi[18], x[2], J[4], det, G[2][2] = {{0}};

    ElementBasis(2, xi, phi, dphi);
    ElementMap(2, xc, xi, x, J);
    det = DenseDeterminant(2, J);
    for (PetscInt j = 0; j < 9; j++) {
      const PetscReal dx = (J[3] * dphi[j] - J[2] * dphi[9 + j]) / det,
                      dy = (J[0] * dphi[9 + j] - J[1] * dphi[j]) / det;

      for (PetscInt a = 0; a < 2; a++) {
        G[a][0] += dx * v[2 * j + a];
        G[a][1] += dy * v[2 * j + a];
      }
    }
    sum += GAUSS4_WEIGHT[q % 4] * GAUSS4_WEIGHT[q / 4] * det * mu *
           (2 * G[0][0] * G[0][0] + 2 * G[1][1] * G[1][1] + PetscSqr(G[0][1] + G[1][0]));
  }
  return sum;
}

/* sum: viscosity, friction, M u . u and force . u of this rank */
static PetscErrorCode sum_losses(CoupleDrops *f, Couple c, const PetscReal u[], PetscReal sum[4])
{
  const MeshLocal *l = c->loc;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt *node = l->cell_node + e * l->nb;
    PetscReal       xc[18], v[18], M[81] = {0};

    PetscCall(MeshCellCoordinates(c->mesh, e, xc));
    for (PetscInt i = 0; i < 18; i++) v[i] = u[2 * node[i / 2] + i % 2];
    sum[0] += dissipation_of_cell(f->viscosity[e], xc, v);
    if (!f->side || !DropsHasFriction(f, l, e)) continue;
    DropsAddFriction(f, l, e, xc, M);
    for (PetscInt i = 0; i < 162; i++) sum[1] += v[2 * (i % 81 / 9) + i / 81] * M[i % 81] * v[2 * (i % 9) + i / 81];
  }
  for (PetscInt t = 0; t < f->nterm; t++) {
    const PetscInt *node = l->cell_node + f->term_cell[t] * l->nb;

    for (PetscInt i = 0; i < 162 && f->term_cell[t] < l->ncell; i++)
      sum[2] += u[2 * node[i % 81 / 9] + i / 81] * f->term[81 * t + i % 81] * u[2 * node[i % 9] + i / 81];
  }
  for (PetscInt i = 0; i < 2 * l->nnode_all; i++) sum[3] += f->force[i] * u[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DropsAddLosses(CoupleDrops *f, Couple c, CoupleLosses *w)
{
  PetscReal sum[4] = {0};

  PetscFunctionBeginUser;
  PetscCall(sum_losses(f, c, c->field.u, sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 4, MPIU_REAL, MPIU_SUM, c->comm));
  w->viscous = sum[0] + sum[1];
  w->boundary -= sum[2];
  w->inertia += sum[2] - sum[1] - sum[3];
  PetscFunctionReturn(PETSC_SUCCESS);
}
