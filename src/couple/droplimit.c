/* CoupleDrops, limits of a step: the interface goes half a cell at most, and a step is no longer than ten capillary
   times of a cell, dt_cap = ((rho_1 + rho_2) h^3/(4 pi sigma))^(1/2), or than viscosity takes to smooth a wave of a
   cell. Explicit surface tension is limited by dt_cap (Brackbill, Kothe & Zemach 1992). What presets promise asks for
   steps in a period of the slowest oscillation of drops, or in the time in which viscous ones come to rest. */
#include "compat.h"
#include "drops.h"
#include "impl.h"

#define WAY       0.5
#define CAPILLARY 10
#define VISCOUS   5 /* (mu_1 + mu_2) h/sigma */

/* Per cent off, 6 cells a radius: decay of a drop in a gas with 40, 80, 120 steps a period 4, .5, .1; crest of a wave
   with 35, 70 2.5, .4; deformation of a drop in shear with .8, 1.6, 3.2 steps in (viscosities) radius/tension 15, 2.6,
   .4 (runs/studies/drops/notes.md) */
#define VISCOUS_TIME 28    /* times (mu_1 + mu_2) R/sigma, that count as a period */
#define WEIGHT       0.303 /* g (difference of densities) R^2, that restores as tension does: 6^(1/3)/6 */

PetscErrorCode DropsFindLongest(CoupleDrops *f, Couple c)
{
  const FlowParameters *par     = c->par;
  PetscReal             gravity = 0;

  PetscFunctionBeginUser;
  f->longest = PETSC_MAX_REAL;
  if (f->steps == 0 || c->loc->dim == 3) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < c->loc->dim; a++) gravity += PetscSqr(par->gravity[a]);
  for (PetscInt k = 0; k < f->s->ngroups; k++) {
    const DropGroup *g  = f->s->group + k;
    const PetscReal  mu = par->viscosity + (g->viscosity > 0 ? g->viscosity : par->viscosity);
    PetscReal        R, sigma, period;

    PetscCall(DropsGetRadius(f->drops, k, c->loc, &R));
    sigma = g->tension + WEIGHT * PetscSqrtReal(gravity) * PetscAbsReal(g->density - par->density) * R * R;
    if (sigma <= 0) continue;
    period     = 2 * PETSC_PI * PetscSqrtReal((g->density + par->density) * R * R * R / (6 * sigma));
    f->longest = PetscMin(f->longest, (period + VISCOUS_TIME * mu * R / sigma) / f->steps);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Is local node i of a cell of a drop at the interface? */
static PetscBool is_at(const CoupleDrops *f, const MeshLocal *l, PetscInt cell, PetscInt i)
{
  if (f->regular) return (PetscBool)(f->fraction[cell] > 0 && f->fraction[cell] < 1);
  return DropsIsInterface(l, f->cell_drop, i);
}

/* Largest speed of the interface: at nodes between phases, now or `more` of the last change later. Local. */
static PetscReal find_speed(const CoupleDrops *f, const MeshLocal *l, PetscReal more, const PetscReal u[],
                            const PetscReal u_old[])
{
  PetscReal speed = 0;

  for (PetscInt e = 0; e < l->ncell * l->nb; e++) {
    const PetscInt i         = l->cell_node[e];
    PetscReal      square[2] = {0, 0};

    if (f->cell_drop[e / l->nb] < 0 || !is_at(f, l, e / l->nb, i)) continue;
    for (PetscInt a = 0; a < l->dim; a++) {
      const PetscReal v = u[l->dim * i + a];

      square[0] += v * v;
      square[1] += PetscSqr(v + more * (v - u_old[l->dim * i + a]));
    }
    speed = PetscMax(speed, PetscSqrtReal(PetscMax(square[0], square[1])));
  }
  return speed;
}

PetscErrorCode DropsLimitStep(CoupleDrops *f, Couple c, PetscReal *dt)
{
  const PetscReal h = c->loc->h, before = c->step->dt;
  PetscReal      *u, *u_old, speed;

  PetscFunctionBeginUser;
  PetscCall(FlowGetFields(c->flow, &u, &u_old, NULL));
  speed = find_speed(f, c->loc, f->first_order || before <= 0 ? 0 : PetscMin(1, *dt / before), u, u_old);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, c->comm));
  if (speed > 0) *dt = PetscMin(*dt, WAY * h / speed);
  *dt = PetscMin(*dt, f->longest);
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
