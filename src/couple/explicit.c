/* Couple, explicit: bodies move after the flow, under the force that it exerted with their old velocity. */
#include "compat.h"
#include "impl.h"

/* Explicit coupling of a light body: the velocity change alternates in sign and grows from step to step (the added
   mass acts one step late). */
static PetscErrorCode detect_blow_up(Couple c)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    const BodyGroup *group = BodiesGetGroup(c->s, k);
    const PetscReal *o = c->rigid.du_old + 3 * k, old_size = o[0] * o[0] + o[1] * o[1] + o[2] * o[2];
    PetscReal        du[3], size = 0, dot = 0;

    if (!group->free) continue;
    for (PetscInt a = 0; a < 3; a++) {
      du[a] = c->s->u[k][a] - c->s->u_old[k][a];
      size += du[a] * du[a];
      dot += du[a] * c->rigid.du_old[3 * k + a];
      size = PetscIsInfOrNanReal(du[a]) ? PETSC_INFINITY : size;
    }
    c->rigid.growth[k] = dot < 0 && size > 1.1 * old_size ? c->rigid.growth[k] + 1 : 0;
    PetscCheck(size < PETSC_INFINITY && c->rigid.growth[k] < 4 &&
                 PetscSqrtReal(size) * c->step->dt < 2 * BodiesGetRadius(c->s, k),
               c->s->n < c->s->nall ? PETSC_COMM_SELF : c->comm, PETSC_ERR_USER_INPUT,
               "Body %" PetscInt_FMT
               " (group '%s', density ratio %g) oscillates with growing velocity, |dU| = %g in one step: explicit coupling is unstable for light bodies because the added mass acts one step late, "
               "and a smaller -sim_dt makes it worse. Use -couple_type implicit",
               c->s->number[k], group->name, (double)(c->s->density[k] / c->par->density), (double)PetscSqrtReal(size));
    for (PetscInt a = 0; a < 3; a++) c->rigid.du_old[3 * k + a] = du[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Explicit coupling moves the bodies under the mean of the present and the last hydrodynamic force, as Wan & Turek
   (2006) do. Force and torque act one step late; with their added inertia m (added mass and what the boundary layer
   gains in a step) the mean is stable for m < 2 M, the present force alone only for m < M. */
PetscErrorCode CoupleAdvanceExplicitly(Couple c)
{
  const PetscInt n = c->s->n;
  PetscReal(*force)[3], (*torque)[3];

  PetscFunctionBeginUser;
  PetscCall(BodiesWriteForces(c->bodies, &force, &torque));
  for (PetscInt i = 0; i < 3 * n; i++) {
    PetscReal *f[2]   = {&force[i / 3][i % 3], &torque[i / 3][i % 3]},
              *old[2] = {&c->rigid.force_old[2 * i], &c->rigid.force_old[2 * i + 1]};

    for (PetscInt j = 0; j < 2; j++) {
      const PetscReal now = *f[j];

      *f[j]   = 0.5 * (now + *old[j]);
      *old[j] = now;
    }
  }
  PetscCall(BodiesAdvanceVelocity(c->bodies, c->step->dt, c->par->density, c->par->gravity));
  for (PetscInt i = 0; i < 3 * n; i++) {
    force[i / 3][i % 3]  = c->rigid.force_old[2 * i];
    torque[i / 3][i % 3] = c->rigid.force_old[2 * i + 1];
  }
  PetscCall(detect_blow_up(c));
  PetscCall(BodiesAdvancePosition(c->bodies, c->step->dt, 1));
  PetscFunctionReturn(PETSC_SUCCESS);
}
