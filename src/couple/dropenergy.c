/* CoupleDrops, energy: what the step does with it beside drops. The momentum equation is tested with the velocity at
   the end of the step: viscosity takes 2 mu D : D, with the viscosity of the cells, and friction at walls mu u^2 over
   the slip length; tension takes what it does not give back as length of the interface, which is the scheme's like
   inertia. */
#include "compat.h"
#include "drops.h"
#include "impl.h"

/* sum: viscosity, friction, M u . u and force . u of this rank */
static PetscErrorCode sum_losses(CoupleDrops *f, Couple c, const PetscReal u[], PetscReal sum[4])
{
  const MeshLocal *l   = c->loc;
  const PetscInt   dim = l->dim, nb = l->nb;

  PetscFunctionBeginUser;
  PetscCall(CoupleViscousPower(c, f->viscosity, u, &sum[0]));
  for (PetscInt e = 0; e < l->ncell; e++) {
    const PetscInt *node = l->cell_node + e * nb;
    PetscReal       xc[3 * MESH_MAX_NB], v[3 * MESH_MAX_NB], M[MESH_MAX_NB * MESH_MAX_NB] = {0};

    if (!f->side || !DropsHasFriction(f, l, e)) continue;
    PetscCall(MeshCellCoordinates(c->mesh, e, xc));
    for (PetscInt i = 0; i < dim * nb; i++) v[i] = u[dim * node[i / dim] + i % dim];
    DropsAddFriction(f, l, e, xc, M);
    for (PetscInt i = 0; i < nb * nb * dim; i++)
      sum[1] += v[dim * (i / dim / nb) + i % dim] * M[i / dim] * v[dim * (i / dim % nb) + i % dim];
  }
  for (PetscInt t = 0; t < f->nterm; t++) {
    const PetscInt  *node = l->cell_node + f->term_cell[t] * nb;
    const PetscReal *M    = f->term + nb * nb * t;

    for (PetscInt a = 0; a < dim && f->term_cell[t] < l->ncell; a++)
      for (PetscInt i = 0; i < nb * nb; i++) sum[2] += u[dim * node[i / nb] + a] * M[i] * u[dim * node[i % nb] + a];
  }
  for (PetscInt i = 0; i < dim * l->nnode_all; i++) sum[3] += f->force[i] * u[i];
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
