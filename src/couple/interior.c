/* Couple, interior: bodies whose inside is no part of the fluid (boundary method `aligned`), so that the body takes
   what the fluid there would. */
#include "compat.h"
#include "impl.h"
#include "bodies/mass.h"

PetscErrorCode CoupleGetInactiveVolume(Couple c, PetscReal *volume)
{
  PetscFunctionBeginUser;
  *volume = 0;
  for (PetscInt k = 0; k < c->s->n; k++)
    if (CoupleIsInactiveInside(c, k) && c->s->own[k] && !c->s->removed[k]) *volume += BodiesVolume(c->s, k);
  PetscCall(BodiesSum(c->bodies, 1, volume));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RigidGradientFormTorque(Couple c, PetscInt k, PetscReal *coefficient)
{
  PetscFunctionBeginUser;
  *coefficient = 0;
  if (!CoupleIsInactiveInside(c, k) || FlowHasSymmetricStress(c->flow))
    PetscFunctionReturn(PETSC_SUCCESS); /* symmetric form: none */
  *coefficient = BodiesVolume(c->s, k) * (2 * c->par->solvent);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RigidInteriorForce(Couple c, PetscInt k, PetscReal out[])
{
  const PetscReal none[3] = {0, 0, 0};
  PetscReal       force[3];

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(out, c->nr));
  if (!CoupleIsInactiveInside(c, k)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowForceAt(c->flow, c->rigid.X[k], force)); /* one that varies: that at the centre */
  for (PetscInt a = 0; a < 3; a++) force[a] *= BodiesVolume(c->s, k);
  PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], force, none, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode RigidInteriorVolume(Couple c, PetscInt k, PetscReal weight[3][6])
{
  const PetscReal none[3] = {0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(weight[0], 18));
  if (!CoupleIsInactiveInside(c, k) || c->s->removed[k]) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt a = 0; a < c->loc->dim; a++) {
    PetscReal force[3] = {0, 0, 0};

    force[a] = BodiesVolume(c->s, k);
    PetscCall(RigidReduceForce(c->bodies, k, c->rigid.q[k], force, none, weight[a]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_gradient_form_torque(Couple c, void *data)
{
  const PetscInt nr = c->nr;

  PetscFunctionBeginUser;
  (void)data;
  for (PetscInt k = 0; k < c->s->n && c->method.inactive_inside; k++) {
    PetscReal spin;

    PetscCall(RigidGradientFormTorque(c, k, &spin));
    for (PetscInt i = c->loc->dim; i < nr && spin > 0; i++) {
      c->rigid.D[(k * nr + i) * nr + i] += c->step->theta * spin;
      c->rigid.g[k * nr + i] -= (1 - c->step->theta) * spin * c->rigid.U_old[k * nr + i];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const CoupleParticipant INTERIOR = {.name = "interior", .rows = add_gradient_form_torque};

PetscErrorCode CoupleAddInterior(Couple c)
{
  PetscFunctionBeginUser;
  if (c->s->nall) PetscCall(CoupleAddParticipant(c, &INTERIOR, c));
  PetscFunctionReturn(PETSC_SUCCESS);
}
