/* CoupleDrops, limits of a step: the interface goes half a cell at most, and a step is no longer than ten capillary
   times of a cell, dt_cap = ((rho_1 + rho_2) h^3/(4 pi sigma))^(1/2), or than viscosity takes to smooth a wave of a
   cell. Explicit surface tension is limited by dt_cap (Brackbill, Kothe & Zemach 1992). */
#include "compat.h"
#include "drops.h"
#include "impl.h"

#define WAY       0.5
#define CAPILLARY 10
#define VISCOUS   5 /* (mu_1 + mu_2) h/sigma */

/* Largest speed of the interface: u at nodes between phases. Local. */
static PetscReal find_speed(const CoupleDrops *f, const MeshLocal *l, const PetscReal u[])
{
  PetscReal speed = 0;

  for (PetscInt e = 0; e < l->ncell * l->nb; e++) {
    const PetscInt i = l->cell_node[e];

    PetscReal square = 0;

    if (f->cell_drop[e / l->nb] < 0 || !DropsIsInterface(l, f->cell_drop, i)) continue;
    for (PetscInt a = 0; a < l->dim; a++) square += PetscSqr(u[l->dim * i + a]);
    speed = PetscMax(speed, PetscSqrtReal(square));
  }
  return speed;
}

PetscErrorCode DropsLimitStep(CoupleDrops *f, Couple c, PetscReal *dt)
{
  const PetscReal h = c->loc->h;
  PetscReal      *u, speed;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, NULL, NULL));
  speed = find_speed(f, c->loc, u);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, c->comm));
  if (speed > 0) *dt = PetscMin(*dt, WAY * h / speed);
  for (PetscInt k = 0; k < f->s->n; k++) {
    const DropGroup *g  = f->s->group + f->s->drop[k].group;
    const PetscReal  mu = g->viscosity > 0 ? g->viscosity : c->par->viscosity;

    if (g->tension <= 0) continue;
    *dt = PetscMin(*dt,
                   CAPILLARY * PetscSqrtReal((g->density + c->par->density) * h * h * h / (4 * PETSC_PI * g->tension)) +
                     VISCOUS * (mu + c->par->viscosity) * h / g->tension);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
