/* Meet: see meet.h. */
#include "compat.h"
#include "meet.h"

PetscErrorCode MeetIsSolved(const SimParts *part, PetscBool *solved)
{
  PetscBool flow, contact;

  PetscFunctionBeginUser;
  PetscCall(CoupleIsImplicit(part->couple, &flow));
  PetscCall(ContactIsImplicit(part->contact, &contact));
  *solved = (PetscBool)(flow && contact);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeetCheckOptions(const SimParts *part)
{
  PetscBool solved, given;

  PetscFunctionBeginUser;
  PetscCall(MeetIsSolved(part, &solved));
  PetscCall(PetscOptionsHasName(NULL, NULL, "-contact_substeps", &given));
  PetscCheck(!solved || !given, PETSC_COMM_WORLD, PETSC_ERR_USER_INPUT,
             "-contact_substeps has no meaning where contact is solved with the flow: remove it, or give -contact_coupling explicit");
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeetEstimate(const SimParts *part, PetscReal dt, PetscReal dt_old, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  BodyState *s;

  PetscFunctionBeginUser;
  PetscCall(BodiesGetState(part->bodies, &s));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal mass, inertia[6], start[3];

    PetscCall(ContactGetMass(part->contact, k, &mass, inertia));
    PetscCall(ContactGetStart(part->contact, k, dt, start));
    for (PetscInt d = 0; d < 3; d++) {
      const PetscReal moment = inertia[d];

      a[k][d]     = dt_old > 0 ? (s->u[k][d] - s->u_old[k][d]) / dt_old - s->contact_force[k][d] / mass : start[d];
      alpha[k][d] = dt_old > 0 ? (s->w[k][d] - s->w_old[k][d]) / dt_old - (moment > 0 ? s->contact_torque[k][d] / moment : 0) : 0;
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeetFind(const SimParts *part, PetscReal dt, PetscBool start, PetscReal (*a)[3], PetscReal (*alpha)[3])
{
  const ContactSpring *spring = NULL;
  PetscInt             n      = 0;
  PetscBool            solved;

  PetscFunctionBeginUser;
  PetscCall(MeetIsSolved(part, &solved));
  if (solved) PetscCall(ContactFindSprings(part->contact, dt, start, a, &n, &spring));
  else PetscCall(ContactStep(part->contact, dt, a, alpha));
  PetscCall(CoupleSetContact(part->couple, n, spring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode MeetTake(const SimParts *part)
{
  const PetscReal *force;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetContact(part->couple, &force));
  PetscCall(ContactTakeForces(part->contact, force));
  PetscFunctionReturn(PETSC_SUCCESS);
}
