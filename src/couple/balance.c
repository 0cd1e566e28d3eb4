/* Couple, balance: rigid bodies in the balance of momentum (CoupleMomentum of couple.h). */
#include "compat.h"
#include "impl.h"
#include "bodies/local.h"
#include "bodies/mass.h"

PetscErrorCode RigidForceOnFluid(Couple c, PetscInt k, PetscReal inertia[3], PetscReal force_on_fluid[3])
{
  const PetscReal inside = BodiesGetGroup(c->s, k)->body_fitted ? 0 : CoupleInnerDensity(c, k);
  PetscReal       M[36], extra[3], inside_force[6];

  PetscFunctionBeginUser;
  PetscCall(RigidInteriorForce(c, k, inside_force));
  PetscCall(RigidGetMass(c->bodies, k, c->rigid.q[k], M));
  PetscCall(RigidCentripetal(c->bodies, k, c->rigid.q[k], c->rigid.U + k * c->nr + c->loc->dim, extra));
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    inertia[a] = M[0] * extra[a];
    for (PetscInt j = 0; j < c->nr; j++)
      inertia[a] += M[a * c->nr + j] *
                    (c->step->ct * c->rigid.U[k * c->nr + j] - c->step->d0 * c->rigid.U_old[k * c->nr + j] -
                     c->step->d1 * c->rigid.U_older[k * c->nr + j]);
    force_on_fluid[a] = inside * inertia[a] + inside_force[a] -
                        c->s->force[k][a]; /* -F + inertia of the fluid inside */
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forces of the bodies on the fluid; adds their sizes to *size */
static PetscErrorCode sum_bodies(Couple c, PetscReal out[3], PetscReal *size)
{
  PetscReal sum[4] = {0, 0, 0, CoupleCountsFirst(c) ? *size : 0};

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal inertia[3], force_on_fluid[3];

    if (!c->s->own[k]) continue;
    PetscCall(RigidForceOnFluid(c, k, inertia, force_on_fluid));
    for (PetscInt a = 0; a < c->loc->dim; a++) {
      sum[a] += force_on_fluid[a];
      sum[3] += PetscAbsReal(c->s->force[k][a]);
    }
  }
  PetscCall(BodiesSum(c->bodies, 4, sum));
  PetscCall(PetscArraycpy(out, sum, 3));
  *size = sum[3];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Mean velocity of fluid and bodies */
static PetscErrorCode take_mean(Couple c, const FlowDiagnostics *d, PetscReal mean[3])
{
  PetscReal inside[4] = {0, 0, 0, 0}; /* of bodies without fluid inside: velocity over volume, volume */

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < c->s->n; k++) {
    PetscReal weight[3][6];

    if (!CoupleIsInactiveInside(c, k) || !c->s->own[k] || c->s->removed[k]) continue; /* else u inside is the body's */
    inside[3] += BodiesVolume(c->s, k);
    PetscCall(RigidInteriorVolume(c, k, weight));
    for (PetscInt a = 0; a < c->loc->dim; a++)
      for (PetscInt j = 0; j < c->nr; j++) inside[a] += weight[a][j] * c->rigid.U[k * c->nr + j];
  }
  PetscCall(BodiesSum(c->bodies, 4, inside));
  for (PetscInt a = 0; a < 3; a++) mean[a] = (d->velocity[a] + inside[a]) / (d->volume + inside[3]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode CoupleBalanceBodies(Couple c, const FlowDiagnostics *d, CoupleBalance *b)
{
  PetscFunctionBeginUser;
  PetscCall(sum_bodies(c, b->bodies, &b->size));
  for (PetscInt a = 0; a < 3; a++) b->residual[a] -= b->bodies[a];
  PetscCall(take_mean(c, d, b->mean));
  PetscFunctionReturn(PETSC_SUCCESS);
}
