/* Steady: the steady Navier-Stokes equations with bodies held in place, by PETSc SNES.

   Unknowns and constraint are those of a time step (system.h) with c_t = 0: rho (u.grad) u - div sigma = f, div u = 0.
   Degrees of freedom of a body that are free take the velocity at which its forces balance where it is drawn; it does
   not move. The Jacobian is that of Picard's iteration (the scalar matrix S with the velocity of the last iterate) or
   of Newton's method, which adds rho (du.grad) u and so couples the components: then it is assembled for all of them.
   When the iteration fails, pseudo-time steps (backward Euler, one Newton step each, whose length grows as the residual
   falls: switched evolution relaxation, Mulder & van Leer 1985, Kelley & Keyes 1998) lead from rest to where Newton's
   method converges.

   Where the viscosity varies, cells that a penalty cuts take theirs from the fluid beside them: Newton's method holds
   it, and evaluates it again, damped by Aitken's method, until that no longer changes the stress. A yield stress, and
   what does not converge at once, comes in stages of the viscosity at rest (runs/studies/rheology).

   Options: -flow_linearization newton|picard, -flow_picard_steps n (Picard iterations before Newton's),
   -flow_pseudo_steps n (at most; 0: none), and those of SNES under prefix -flow_: -flow_snes_rtol, -flow_snes_max_it,
   -flow_snes_monitor, -flow_snes_linesearch_type, ... The linear solver is that of the time step under -flow_ksp_,
   -flow_pc_, -flow_solver. */
#pragma once
#include "couple/couple.h"
#include "flow/finer.h"
#include <petscsnes.h>

typedef struct _p_Steady *Steady;

/* Reads the options; rtol: default of -flow_snes_rtol, a share of the larger one of two residuals, at the start and at
   rest. Collective. */
PetscErrorCode SteadyCreate(Flow, Couple, const char rtol[], Steady *);
PetscErrorCode SteadyDestroy(Steady *);
/* The mesh has been made anew, and flow and couple know: SteadySetUp is done again, from the fields there.
   Collective. */
PetscErrorCode SteadyRemesh(Steady);
/* Error: options of time steps. Collective. */
PetscErrorCode SteadyRefuseTime(void);
PetscErrorCode SteadyView(Steady, PetscViewer);
/* Whatever -flow_snes_rtol is. Local. */
PetscErrorCode SteadySetTolerance(Steady, PetscReal rtol);
/* Are its equations linear? Local. */
PetscBool SteadyIsLinear(Steady);
/* Draw the bodies, assemble and set up the linear solver for the first iteration, so that all its options are read.
   Collective. */
PetscErrorCode SteadySetUp(Steady);
/* The same from fields that `start` sets, once nodes lie where they will, and that are close to the solution: neither
   iterations of Picard's come before Newton's nor stages of a yield stress, and residuals count beside that at the
   start. Collective. */
PetscErrorCode SteadySetUpFrom(Steady, PetscErrorCode (*start)(void *), void *ctx);
/* Solve from the fields of the flow; the solution is in the couple as after CoupleSolve. Prints the history of the
   residual.
   *its: nonlinear iterations, pseudo-time steps included; *linear: outer linear iterations of all of them. Collective.
   When a signal ends it (base/interrupt.h) what stands there is the last iterate. Error when nothing converges: names
   the remedies. */
PetscErrorCode SteadySolve(Steady, PetscInt *its, PetscInt *linear);
/* After SteadySolve: what elements of the next order would find beside the solution (flow/finer.h), in several sweeps
   with one linear solve each, by the last Jacobian. After each `look` is called while fields and forces are those with
   it; at the end they are as before. *ok: the linear solver did it. Collective. */
#define STEADY_SWEEPS 3 /* at most: two where linear systems are solved by iteration */
PetscErrorCode SteadyFiner(Steady, PetscErrorCode (*look)(void *ctx, const FlowFinerResult *), void *ctx,
                           PetscBool *ok);
