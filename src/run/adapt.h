/* Adapt: how long the next time step is.

   Error. The solution of a step is compared with the extrapolation of the fields before it (linear for be, quadratic
   for cn and bdf2; with the second-order difference for the acceleration the quadratic one is the generalised
   leapfrog predictor of Gresho, Lee & Sani 1980, Gresho & Sani 1998, section 3.16.4). Both differ from the exact
   solution by known multiples of the same derivative, so that the local error of the scheme is a known part of their
   difference. Measured: root mean square over the fluid in units of the largest speed so far, and over the bodies
   that are free and not in contact what it moves them, in radii; the larger of the two. Nodes that a body or a moving
   mesh has touched within the last three steps are left out: their history is not smooth.

   The first step of a run with free bodies that are all at rest, without slip, which has no history, is compared with a
   longer attempt at it in place of that: it is taken again, half as long at first, until its error is small enough
   (runs/studies/adaptive-step).

   Control. With the error e of a step and the tolerance T the next step is 0.9 (T/e)^(1/(order + 1)) times as long,
   at most -sim_adapt_growth times. It stays as it is as long as it would grow by less than -sim_adapt_hysteresis, so
   that what depends on it alone (matrices of a Stokes flow, factorisations) is kept. A step with e > 2 T is taken
   again, shorter, as is one whose solve failed. Where e does not fall with the step, it is a jump (a node enters a
   body, a wall starts), which no step resolves: the step is accepted, and the next two are not judged. Limits before
   the step: CFL number; the way of a body in cells (by its last velocities, at the start by its weight; a step in which
   one went twice as far is taken again); its approach to the next body or wall in gaps (gaps within the
   range of the contact count as the range). Steps end exactly at given times: the last two before them share what is
   left. After a step that was shortened for such reasons the next is at most twice as long.

   Options: -sim_adapt, -sim_adapt_tolerance, _speed, _cfl, _displacement, _gap, _min, _max, _growth, _hysteresis. The
   first step is -sim_dt or shorter; steps without estimate keep their length.
   Not for -flow_time fstheta, whose parts of a step cannot be taken back. */
#pragma once
#include "contact/contact.h"
#include "couple/couple.h"
#include "steplimits.h"

typedef struct _p_Adapt *Adapt;

/* Reads the options. *adapt is NULL without -sim_adapt, else columns step_error, rejected_steps (so far) and step_limit
   are added to the monitor, and its rows to the limits. dt: first step. Collective.
   Errors: fstheta, smallest step above the largest or the first. */
PetscErrorCode AdaptCreate(Flow, Bodies, Couple, Contact, Monitor, Limits, PetscReal dt, Adapt *);
PetscErrorCode AdaptDestroy(Adapt *);
PetscErrorCode AdaptView(Adapt, PetscViewer);

/* Length of the step that begins at time and must not pass `until`, by all rows of the limits; *hits: it ends there.
   Collective, same result on all ranks. */
PetscErrorCode AdaptGetStep(Adapt, PetscReal time, PetscReal until, PetscReal *dt, PetscBool *hits);
/* After CoupleSolve with its outcome, before CoupleForce: is the step good? If not, *accept is false, the next
   AdaptGetStep is shorter, and the step can be taken again from FlowBeginStep on (contact: ContactRevert). A solve
   that fails with the smallest step is accepted: what to do is the caller's business. Collective. */
PetscErrorCode AdaptCheck(Adapt, KSPConvergedReason, PetscBool *accept);
/* The step was accepted: remember what the next estimate needs; before CoupleAdvance. cfl: of the step. */
PetscErrorCode AdaptAccept(Adapt, PetscReal cfl);
/* Quantities of the run: rejected_steps, dt_min, dt_max; who it was that shortened steps, LimitsFinish says. */
PetscErrorCode AdaptFinish(Adapt);
/* The mesh has been made anew, and the flow knows (FlowRemesh): what the estimate remembers is carried over from the
   old one. Collective. */
PetscErrorCode AdaptRemesh(Adapt, Mesh old);
/* StateVisit of an Adapt. */
PetscErrorCode AdaptVisitState(void *adapt, State);
