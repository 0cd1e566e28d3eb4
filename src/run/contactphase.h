/* ContactPhase: contact forces of a step in a flow. They are solved with the flow where coupling and contact are
   implicit (ContactFindSprings), and otherwise found in sub-steps before it (ContactStep). */
#pragma once
#include "sim.h"

/* Is contact solved with the flow? Not collective. */
PetscErrorCode ContactPhaseIsSolved(const SimComponents *, PetscBool *solved);
/* Refuse -contact_substeps where there are none: contact is solved with the flow. Not collective. */
PetscErrorCode ContactPhaseCheckOptions(const SimComponents *);
/* Accelerations of the bodies without contact, a, alpha [n][3], over the last step, of length dt_old, with the inertia
   that the contact counts with; dt_old 0, at the start: that of free bodies over the step dt to come. Where contact is
   solved with the flow, no more than what this flow and the loads on a body can press it with counts of its contact
   force. Collective. */
PetscErrorCode ContactPhaseEstimate(const SimComponents *, PetscReal dt, PetscReal dt_old, PetscReal (*a)[3],
                                    PetscReal (*alpha)[3]);
/* Before CoupleUpdateGeometry: the forces of the step dt, or what they are for the system of flow and bodies, of which
   ContactPhaseTake takes what they came to, after CoupleSolve. start: a is to be expected, nobody has felt it.
   Collective. */
PetscErrorCode ContactPhaseFind(const SimComponents *, PetscReal dt, PetscBool start, PetscReal (*a)[3],
                                PetscReal (*alpha)[3]);
PetscErrorCode ContactPhaseTake(const SimComponents *);
