/* StepCheck: is a step that was solved and accepted one to believe? Every step (part of one) is measured by four
   numbers without units, which cost what the diagnostics cost, and one that comes from the bodies' way.

   divergence  h |div u| / |u|, both norms L2 over the domain (div u: cell means), h the smallest cell, |u| the largest
               so far. The system makes it the solver's tolerance.
   momentum    what the balance of momentum (CoupleMomentum) leaves over, relative to the sizes of all forces, the
               largest so far. Likewise the solver's tolerance, where forces are residuals. Not with -couple_force
               volume, where it is the error of that form.
   growth      (E - E_old - W) / (E_old + E_max/1000). E: kinetic energy of fluid and bodies, W = dt max(0, P), P the
               power of all that acts from outside (CoupleGetPower). The equations tested with u^{n+1} give
               rho (c_t u - d, u) = P - viscous dissipation - what flows out, where the left side is for implicit Euler
               the rate of E plus rho |u^{n+1} - u^n|^2 / 2dt, so that E - E_old <= W; for bdf2 and cn the same holds
               for an energy that differs from E by parts of the order of |u^{n+1} - u^n|^2, and under methods with
               fluid inside, E flickers with the nodes that bodies cover. Therefore the bound leaves room (0.2), and
               one step alone is no reason to stop. What it finds is energy out of nothing, as unstable schemes make it.
   inner solve 1 if the solve for velocity or pressure inside of the preconditioner ended at its largest number of
               iterations, which counts as failed: for solver fast, which has no outer iteration to make up for it
               (around bodies two), it is out of bounds; for others a remark, once.

   Bounds are 0.1, 0.05, 0.2 (solver fast without bodies: momentum 0.3). Measured, largest of 5 steps in a row over the
   scenes of runs/: balanced 2e-5, 3e-3, 0 (0.06 where a grate is two cells thick, method nodal). A single sweep around
   the disc of the demo at dt .01, which no solver takes any more, blew up with 0.03 to 0.3, 0.1 to 0.9, 0.2 to 5.

   A step that exceeds a bound is in doubt; -sim_check_steps of them in a row (5; 0: never) stop the run, as does a
   whole run of fewer; with steps in doubt at its end it gets a remark. A step in doubt is no checkpoint. Not for
   steady scenes, whose solver has a residual of its own.

   passing     a body that goes more than -sim_max_displacement (1) of its bounding radii in a step, with its fastest
               point, is refused at once where a wall or another body is in its way, through which it would pass: it
               has left the place where it was altogether. Elsewhere that is remarked, once: the flow does not see the
               way between. On a mesh that is no box what is in the way is not known, and all of them are refused.

   Options (expert): -sim_check_divergence, _momentum, _growth (0: not checked), _steps; -sim_max_displacement. */
#pragma once
#include "couple/couple.h"
#include "steplimits.h"

typedef struct _p_StepCheck *StepCheck;

/* Reads the options, and adds a row to the limits for every bound. Collective. */
PetscErrorCode StepCheckCreate(Flow, Bodies, Couple, Limits, StepCheck *);
PetscErrorCode StepCheckDestroy(StepCheck *);
/* After CoupleMomentum, before CoupleAdvance: measure the step to `time` of length dt. Collective. */
PetscErrorCode StepCheckMeasure(StepCheck, const FlowDiagnostics *, const CoupleBalance *, const CouplePower *,
                                PetscReal time, PetscReal dt);
/* Before contact, which would hold such a body where it is: a [n][3] is the acceleration of the bodies without contact.
   Error: what it adds to a body's way in the step is too far; of bodies that contact held in the last step or, at the
   start, of all. (That of a body elsewhere may be a jump which does not go on.) As StepCheckDisplacement. */
PetscErrorCode StepCheckPredicted(StepCheck, PetscReal (*a)[3], PetscBool start, PetscReal time, PetscReal dt,
                                  PetscBool adapted);
/* After CoupleAdvance. Error: a body goes too far. adapted: by which option it can be shortened. Collective. */
PetscErrorCode StepCheckDisplacement(StepCheck, PetscReal time, PetscReal dt, PetscBool adapted);
/* Is the last step in doubt? Not collective. */
PetscBool StepCheckDoubts(StepCheck);
/* Is it time to stop, and why: what exceeds which bound in how many steps, "" if not. last: the run ends here, so that
   a run of which every step is in doubt (two at least) counts as well, and a remark is made where the last steps are.
   Not collective, same result on all ranks. */
PetscErrorCode StepCheckResult(StepCheck, PetscBool last, char why[], size_t size);
