/* ContactPhase: see contactphase.h. */
#include "compat.h"
#include "contactphase.h"
#include "base/algebra.h"
#include "contact/bonds.h"
#include "flow/device.h"

#define FLOW_PRESSES 20 /* seen: up to 6 (runs/studies/contact, "Loads of bodies that touch") */

PetscErrorCode ContactPhaseIsSolved(const SimComponents *sim, PetscBool *solved)
{
  PetscBool flow, contact;

  PetscFunctionBeginUser;
  PetscCall(CoupleIsImplicit(sim->couple, &flow));
  PetscCall(ContactIsImplicit(sim->contact, &contact));
  *solved = (PetscBool)(flow && contact);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPhaseCheckOptions(const SimComponents *sim)
{
  PetscBool solved, given, coupled;

  PetscFunctionBeginUser;
  PetscCall(ContactPhaseIsSolved(sim, &solved));
  PetscCall(CoupleIsImplicit(sim->couple, &coupled));
  PetscCheck(coupled || !ContactHasBonds(sim->contact), sim->comm, PETSC_ERR_USER_INPUT,
             "-contact_bond_law needs bodies and flow that are solved together: remove it, or -couple_type explicit");
  PetscCheck(coupled || !ContactHasCohesion(sim->contact), sim->comm, PETSC_ERR_USER_INPUT,
             "-contact_cohesion needs bodies and flow that are solved together: remove it, or -couple_type explicit");
  PetscCall(PetscOptionsHasName(NULL, NULL, "-contact_substeps", &given));
  PetscCheck(!solved || !given, sim->comm, PETSC_ERR_USER_INPUT,
             "-contact_substeps has no meaning where contact is solved with the flow: remove it, or give -contact_coupling explicit");
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The acceleration with which a flow like this one can press a body: by what it brings along in a step dt and past a
   cell, and by its viscosity. Collective. */
static PetscErrorCode bound_flow_load(const SimComponents *sim, PetscReal dt, PetscReal *bound)
{
  const FlowParameters *par;
  const MeshLocal      *l;
  const PetscReal       still[3] = {0, 0, 0};
  PetscReal            *u = NULL, speed = 0;

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(sim->flow, &par));
  PetscCall(MeshGetLocal(sim->mesh, &l));
  if (FlowStaysOnDevice(sim->flow)) PetscCall(FlowGetSpeedOnDevice(sim->flow, still, &speed));
  else PetscCall(FlowGetFields(sim->flow, &u, NULL, NULL));
  for (PetscInt i = 0; i < l->nnode * l->dim && u; i++) speed = PetscMax(speed, PetscAbsReal(u[i]));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &speed, 1, MPIU_REAL, MPIU_MAX, sim->comm));
  *bound = FLOW_PRESSES * speed * (1 / dt + (speed + par->viscosity / (par->density * l->h)) / l->h);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The share of the contact force on body k that answers a load. Where rigid cells alone lie between two bodies, the
   flow holds them and answers any force of contact: were all of that a load, contact would stiffen by its own force,
   fourfold in every step. */
static PetscErrorCode get_load_fraction(const SimComponents *sim, const BodyState *s, PetscInt k, PetscReal bound,
                                        PetscReal *fraction)
{
  const FlowParameters *par;
  const PetscReal       force = PetscSqrtReal(dot3(s->contact_force[k], s->contact_force[k]));
  PetscReal             load[3], torque[3];

  PetscFunctionBeginUser;
  PetscCall(FlowGetParameters(sim->flow, &par));
  PetscCall(BodiesGetLoad(sim->bodies, k, par->density, par->gravity, load, torque));
  bound += PetscSqrtReal(dot3(load, load));
  *fraction = force > bound ? bound / force : 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the flow makes of forces of contact in the step that has begun */
static PetscErrorCode set_scheme(const SimComponents *sim, PetscReal dt)
{
  const FlowStep *step;
  ContactScheme   scheme;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(sim->flow, &step));
  PetscCall(CoupleIsImplicit(sim->couple, &scheme.implicit));
  scheme.weight = scheme.implicit ? step->ct * dt : 1;
  scheme.theta  = scheme.implicit && step->order == 2 ? 0.5 : 1;
  PetscCall(ContactSetScheme(sim->contact, &scheme));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPhaseEstimate(const SimComponents *sim, PetscReal dt, PetscReal dt_old, PetscReal (*a)[3],
                                    PetscReal (*alpha)[3])
{
  BodyState            *s;
  PetscReal             bound = 0;
  const FlowParameters *par;
  PetscReal             touched; /* by law spring */
  PetscBool             limit;   /* contact forces to what answers a load */

  PetscFunctionBeginUser;
  PetscCall(set_scheme(sim, dt));
  PetscCall(FlowGetParameters(sim->flow, &par));
  PetscCall(BodiesGetState(sim->bodies, &s));
  PetscCall(ContactPhaseIsSolved(sim, &limit));
  limit = (PetscBool)(limit && dt_old > 0);
  if (limit) PetscCall(bound_flow_load(sim, dt_old, &bound));
  for (PetscInt k = 0; k < s->n; k++) {
    PetscReal mass, inertia[6], start[3], force[3], torque[3], fraction = 1;

    PetscCall(ContactGetMass(sim->contact, k, &mass, inertia));
    PetscCall(ContactGetStart(sim->contact, k, dt, start));
    PetscCall(ContactGetMean(sim->contact, k, force, torque, &touched));
    if (limit) PetscCall(get_load_fraction(sim, s, k, bound * mass, &fraction));
    for (PetscInt d = 0; d < 3; d++) {
      const PetscReal moment = inertia[d];

      a[k][d]     = dt_old > 0 ? (s->u[k][d] - s->u_old[k][d]) / dt_old - fraction * force[d] / mass : start[d];
      alpha[k][d] = dt_old > 0
                    ? (s->w[k][d] - s->w_old[k][d]) / dt_old - (moment > 0 ? fraction * torque[d] / moment : 0)
                    : 0;
    }
    if (touched > 0 && dt_old > 0) {
      PetscCall(BodiesGetLoad(sim->bodies, k, par->density, par->gravity, force, torque));
      for (PetscInt d = 0; d < 3; d++) {
        a[k][d] += touched * (force[d] / mass - a[k][d]);
        alpha[k][d] += touched * ((inertia[d] > 0 ? torque[d] / inertia[d] : 0) - alpha[k][d]);
      }
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Springs of the bonds, in the times of the flow's scheme */
static PetscErrorCode add_bonds(const SimComponents *sim, PetscReal dt, PetscInt *n, const ContactSpring *spring[])
{
  const FlowStep *step;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStep(sim->flow, &step));
  PetscCall(ContactAddBonds(sim->contact, dt, step->theta, step->order, n, spring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPhaseFind(const SimComponents *sim, PetscReal dt, PetscBool start, PetscReal (*a)[3],
                                PetscReal (*alpha)[3])
{
  const ContactSpring *spring = NULL;
  PetscInt             n      = 0;
  PetscBool            solved;

  PetscFunctionBeginUser;
  PetscCall(ContactPhaseIsSolved(sim, &solved));
  if (solved) PetscCall(ContactFindSprings(sim->contact, dt, start, a, &n, &spring));
  else {
    PetscCall(ContactStep(sim->contact, dt, a, alpha));
    PetscCall(ContactGetSprings(sim->contact, &n, &spring));
  }
  if (ContactHasBonds(sim->contact)) PetscCall(add_bonds(sim, dt, &n, &spring));
  PetscCall(CoupleSetContact(sim->couple, n, spring));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ContactPhaseTake(const SimComponents *sim)
{
  const PetscReal *force;

  PetscFunctionBeginUser;
  PetscCall(CoupleGetContact(sim->couple, &force));
  PetscCall(ContactTakeForces(sim->contact, force));
  PetscFunctionReturn(PETSC_SUCCESS);
}
