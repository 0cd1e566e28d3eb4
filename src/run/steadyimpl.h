/* Steady: what its files share. steady.c: SNES, life cycle. steadysystem.c: residual, linear solves. steadyroute.c:
   from a start value to the solution, by Newton's method, in stages or in pseudo-time, and then without the
   compressibility of gaps. */
#pragma once
#include "steady.h"

struct _p_Steady {
  MPI_Comm         comm;
  Flow             flow;
  Couple           couple;
  FlowSolver       solver;
  const MeshLocal *loc;
  SNES             snes;
  Vec              x, f, y;
  Vec              at;       /* what fields and matrices are of */
  PetscBool        still;    /* if they still are */
  Mat              jacobian; /* products with the system of the linear solver, all that SNES needs */
  PetscInt         linearization, picard_steps, pseudo_steps;
  PetscInt         its, linear, last_linear; /* iterations so far: nonlinear, linear; linear of the last solve */
  PetscBool        fresh;                    /* the solver is set up for the first Picard iteration */
  PetscReal        scale, last_norm;         /* what residuals are measured by; residual at the last linear solve */
  PetscReal        rel_tol, tol;             /* share of the scale to reach; residual to reach now */
  PetscReal        unsettled;                /* change of the stress that kept it from converging, or 0 */
  PetscInt         shown;                    /* iterations at the last printed residual */
  PetscReal       *zero_velocity;            /* [nnode_all][dim] zeros, of which the viscosity is to be; or NULL */
  PetscReal        shift;                    /* rate of the steps that precondition it, or 0: none do */
  PetscBool        slow;                     /* then the convecting velocity, too */
  Mat              newton;                   /* velocity matrix of the last set-up, NULL: not Newton's */
  PetscBool        near;                     /* it starts close to the solution */
  char             rtol[16];
};

/* A steady system, or a pseudo-time step of this rate, from now on: what was assembled is of another. Collective. */
PetscErrorCode SteadyBegin(Steady, PetscReal rate);
/* Put x into the couple's fields and assemble S and the right-hand side there. Collective. */
PetscErrorCode SteadyLinearize(Steady, Vec x);
/* f: the residual at x; for SNES, ctx is the Steady. Collective. */
PetscErrorCode SteadyEvaluate(SNES, Vec x, Vec f, void *ctx);
/* Set up the linear solver with the matrix of Newton's method or of Picard's iteration at x. Collective. */
PetscErrorCode SteadySetUpSolver(Steady, Vec x, PetscBool newton);
/* Is iteration number `its` one of Newton's method? */
PetscBool SteadyUsesNewton(Steady, PetscInt its);
/* Choose s->shift by the flow at s->x, or for one at rest, from the next SteadySetUpSolver on. Collective. */
PetscErrorCode SteadyChooseShift(Steady, PetscBool flows);
/* y = J^{-1} f by the solver of the flow. Collective. */
PetscErrorCode SteadySolveLinear(Steady, Vec f, Vec y, KSPConvergedReason *);
/* A line of the history. Collective. */
PetscErrorCode SteadyPrint(Steady, const char method[], PetscReal norm);
/* Size of the residual at s->x. Collective. */
PetscErrorCode SteadyMeasure(Steady, PetscReal *norm);
/* From s->x: a yield stress in stages, others at once and, if that fails, in stages; *ok: solved. Collective. */
PetscErrorCode SteadySolveFrom(Steady, PetscBool *ok);
/* Pseudo-time steps from s->x; whenever the residual has fallen a hundredfold, the nonlinear solver tries again.
   Collective. */
PetscErrorCode SteadyPseudoTime(Steady, PetscBool *ok);
/* After a solve: take back what the pressures of cells between two surfaces press out of them, as long as that helps
   (FlowSolverForgive). Collective. */
PetscErrorCode SteadyCloseGaps(Steady);
