/* Contact, the impulse of a step in a flow (law spring): what the scheme of the flow makes of it, see ContactSetShare.

   The scheme is linear in the history of velocities, so that forces D(I) = c_t I^{n+1} - d(I), with I the impulse up to
   a time, give velocities as if I had acted in an instant each. With I^{n+1} = I^n + dt f and 1 = c_t dt + what counts
   of the step before, D(I) = share f^n + (1 - share) f^{n-1}. The added mass of the fluid takes part, as its history is
   that of the same scheme. */
#include "compat.h"
#include "impl.h"

PetscErrorCode ContactSetShare(Contact c, PetscReal share)
{
  PetscFunctionBeginUser;
  c->share = share;
  if (c->mean || !c->law->pulls) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesAttach(c->bodies, sizeof(*c->mean), (void **)&c->mean));
  PetscCall(BodiesAttach(c->bodies, sizeof(*c->mean_next), (void **)&c->mean_next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactGetMean(Contact c, PetscInt k, PetscReal force[3], PetscReal torque[3])
{
  PetscFunctionBeginUser;
  for (PetscInt a = 0; a < 3; a++) {
    force[a]  = c->mean ? c->mean[k][a] : c->s->contact_force[k][a];
    torque[a] = c->mean ? c->mean[k][3 + a] : c->s->contact_torque[k][a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactWeighForces(Contact c)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; c->mean && e < 6 * c->s->n; e++) {
    const PetscInt   k = e / 6, a = e % 6;
    PetscReal *const f = a < 3 ? &c->s->contact_force[k][a] : &c->s->contact_torque[k][a - 3];

    c->mean_next[k][a] = *f;
    *f                 = c->share * *f + (1 - c->share) * c->mean[k][a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactAcceptForces(Contact c)
{
  PetscFunctionBeginUser;
  if (c->mean) PetscCall(PetscArraycpy((PetscReal *)c->mean, (PetscReal *)c->mean_next, 6 * c->s->n));
  PetscFunctionReturn(PETSC_SUCCESS);
}
