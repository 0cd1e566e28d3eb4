/* FlowSolver: the coupled linear system of one step for free velocities, rigid velocities and pressure.

     [ P^T A P + D   -P^T B^T ] [u_r]   [ P^T (r - A c) + g ]
     [ B P               C    ] [ p ] = [ -B c              ]   A = S (x) identity of components,
                                                                C = 0 but in cells between two surfaces

   The method, its tolerances and the options are in src/solve/README.md ("The system and its solution"). Rows of the
   outer iteration have one unit, force: continuity rows are multiplied by rho c_t and by twelve mean cell sizes,
   rotations count by the body's radius (ConstraintSetLengths). Vectors x below hold w times that length, residuals f
   have rows of that kind.

   By caller: life cycle; what couple gives in every step, the solve, the carried residual; what couple says when cells
   change; what steady problems (run) use. */
#pragma once
#include "solve/constraint.h"
#include "flow/flow.h"
#include "solve/penaltyterm.h"

typedef struct _p_FlowSolver *FlowSolver;

/* ---- life cycle ---- */

/* Collective. Reads -flow_solver and sets the defaults of all solvers. moving: there are bodies that do not stand
   still. */
PetscErrorCode FlowSolverCreate(Flow, Constraint, PetscBool moving, FlowSolver *);
PetscErrorCode FlowSolverDestroy(FlowSolver *);
PetscErrorCode FlowSolverView(FlowSolver, PetscViewer);

/* ---- every step: what the system consists of ---- */

/* D: the bodies' own inertia (design: c_t (rho_s - rho_f) (Vol; I)), D [nbodies][nr][nr]; used for unknown rigid
   velocities only. Copied. */
PetscErrorCode FlowSolverSetRigid(FlowSolver, const PetscReal D[]);

/* A force between two bodies, or on one, that resists their motion: f = -stiffness (row_0 . U_0 + row_1 . U_1), with
   f row_s on the rigid rows of body s. In the plane rows have three numbers, in space six, as the rigid slots. */
typedef struct {
  PetscInt  body[2]; /* body[1] < 0: none */
  PetscReal row[2][6];
  PetscReal stiffness; /* force a speed */
} BodySpring;
/* The springs of the step, after ConstraintSetBodies, which has their bodies (ConstraintSetPairs): a spring is given
   on every rank that knows both, and counts once. Prescribed velocities do not count here. Copied. Collective. */
PetscErrorCode FlowSolverSetContactCoupling(FlowSolver, PetscInt n, const BodySpring spring[]);

/* Penalty of the bodies, whose scalar part is in the flow's matrix; NULL: none. Borrowed; what it points to may change
   between steps. */
PetscErrorCode FlowSolverSetPenalty(FlowSolver, const PenaltyTerm *);

/* Integrals of the velocity that are held, each by a force with the weights of the integral: one more unknown and one
   more row each, which hold up to rounding whatever the tolerances, and one more solve where the last does not serve
   (integrals.c). The right-hand side of FlowSolverSolve holds the forces as they were before. */
typedef struct {
  PetscInt         axis;   /* nodes count with their lumped mass along it, or else, */
  const PetscReal *nodal;  /* [own nodes][dim], with these weights (NULL: with their mass) */
  const PetscReal *rigid;  /* [nbodies][nr] weights of rigid velocities whose bodies hold no nodes; what the force does
                              to their rows (NULL: none) */
  PetscReal        target; /* the integral, plus */
  PetscReal        give;   /* this times the force (0: the integral alone) */
  PetscReal        force;  /* set by FlowSolverSolve: what is to be added to the force, in the unit of its weights */
  const char      *stuck;  /* what the error says of a force that moves nothing */
} FlowIntegral;
/* Adds to those that are held; borrowed, from the next FlowSolverSolve on. Collective. */
PetscErrorCode FlowSolverAddIntegrals(FlowSolver, PetscInt n, FlowIntegral[]);

/* ---- cells that change ---- */

/* Around a FlowUpdateCells: which cells are about to change, and afterwards which ones are no part of the fluid
   (PressureForgetCells, PressureSetInactive). Collective. */
PetscErrorCode FlowSolverForgetCells(FlowSolver, PetscInt n, const PetscInt cells[]);
PetscErrorCode FlowSolverSetInactive(FlowSolver, const PetscInt cell_material[], const PetscBool resolved[]);

/* ---- every step: the solve ---- */

/* After FlowAssemble and after every change of the constraint: update operators and preconditioners. Collective. */
PetscErrorCode FlowSolverSetUp(FlowSolver);

/* Solve. r [nnode_all][dim] right-hand side of the momentum rows (complete on own nodes), g [nbodies][nr] on the rigid
   rows. u [nnode_all][dim], p [own cells][dim + 1], U [nbodies][nr]: start values on entry, solution on exit
   (prescribed entries of U untouched, u synced). dp, as p: direction along which the start value of p may be shifted,
   such as its last change; NULL: none. A failed solve is reported through *reason (< 0), with u, p, U as far as they
   got. Collective. */
PetscErrorCode FlowSolverSolve(FlowSolver, const PetscReal r[], const PetscReal g[], PetscReal u[], PetscReal p[],
                               const PetscReal dp[], PetscReal U[], PetscInt *its, KSPConvergedReason *reason);

/* ---- every step: the residual that is carried to the next ---- */

/* What the last FlowSolverSolve left of the momentum equations, as momentum that the flow would have if it had solved
   for it, about: load [own nodes][dim], rigid [nbodies][nr] of the bodies' own inertia. An error of the velocities of
   this size adds up from step to step unless c_t times it goes into the right-hand sides r, g of the next step
   (conserve.c). Zero where the solve failed or a mean velocity is held, and for steady flows. Collective. */
PetscErrorCode FlowSolverGetResidualImpulse(FlowSolver, PetscReal load[], PetscReal rigid[]);
/* The same, load in the memory of a device (flow/device.h). Collective. */
PetscErrorCode FlowSolverGetImpulseOnDevice(FlowSolver, PetscReal load[], PetscReal rigid[]);
/* The residual is carried in every step, so that errors do not add up, and steps may end accordingly (stop.c).
   Local. */
PetscErrorCode FlowSolverSetCarry(FlowSolver, PetscBool);

/* Of the last FlowSolverSolve: left, the residual after its first iteration as fraction of the right-hand side's, and
   is what it left small enough to be carried? FlowSolverSetBefore: left of the step before; 0: of none, or of the
   first. A step ends after one iteration where that leaves at most -flow_one_it_rtol, and no more than three times
   what it left before, with bodies that move freely, without contact; solver balanced asks for small errors of their
   velocities, too (stop.c). Not collective, the same on all ranks. */
PetscErrorCode FlowSolverSetBefore(FlowSolver, PetscReal left);
PetscErrorCode FlowSolverGetLeft(FlowSolver, PetscReal *left, PetscBool *solved);

/* How many inner solves for the velocity and for the pressure ended in the last FlowSolverSolve without meeting their
   tolerance (-flow_fieldsplit_velocity_ksp_max_it, -flow_fieldsplit_pressure_ksp_max_it). The outer iteration makes up
   for them where there is one; solver fast has none, or a short one. Not collective, same on all ranks. */
PetscErrorCode FlowSolverGetLimited(FlowSolver, PetscInt limited[2]);

/* ---- steady problems, whose solver repeats these ---- */

/* x holds on every rank the reduced velocity (own nodes x dim, rigid slots of own bodies), then the pressure of own
   cells. Collective. */
PetscErrorCode FlowSolverCreateVec(FlowSolver, Vec *x);
/* Between x and nodal arrays as in FlowSolverSolve. Collective. */
PetscErrorCode FlowSolverPack(FlowSolver, const PetscReal u[], const PetscReal p[], const PetscReal U[], Vec x);
PetscErrorCode FlowSolverUnpack(FlowSolver, Vec x, PetscReal u[], PetscReal p[], PetscReal U[]);
/* Velocity matrix of all components (own nodes x dim) to use in place of S from the next FlowSolverSetUp on, NULL:
   that of the flow again (FlowGetComponents, or S); S stays the preconditioner of the matrix-free solvers. Borrowed.
   Collective. */
PetscErrorCode FlowSolverSetVelocity(FlowSolver, Mat A);
/* From the next FlowSolverSetUp on a steady system, whose velocity matrix is A until FlowSolverSetVelocity, is
   preconditioned as a time step of that rate is, with the flow's own velocity matrix; what the step leaves, the outer
   iteration takes away (runs/studies/flow-solver, "Steady flows by iteration"). A NULL: the flow's matrix is the
   system's, too. The rate weighs the rows of continuity in K and in residuals. 0: none. FlowSolverCanShift: that
   serves this flow and its methods. Collective. */
PetscErrorCode FlowSolverSetShift(FlowSolver, PetscReal rate, Mat A);
PetscErrorCode FlowSolverCanShift(FlowSolver, PetscBool *can);
/* f = K x - b with the system's K and right-hand side b. Collective. */
PetscErrorCode FlowSolverResidual(FlowSolver, const PetscReal r[], const PetscReal g[], Vec x, Vec f);
/* The 2-norm of that b, the residual of x = 0. Collective. */
PetscErrorCode FlowSolverGetRhsNorm(FlowSolver, PetscReal *norm);
/* Solve K y = f from y = 0, to the tolerance of the solver or until the residual is atol. Collective. */
PetscErrorCode FlowSolverCorrect(FlowSolver, Vec f, PetscReal atol, Vec y, PetscInt *its, KSPConvergedReason *reason);
/* Cells between two surfaces are a little compressible (-flow_pressure_gap_compressibility), in K and in residuals; in
   residuals from now on for what the pressure differs from that of x alone, NULL: for all of it. *any (may be NULL):
   there are such cells. Collective. */
PetscErrorCode FlowSolverForgive(FlowSolver, Vec x, PetscBool *any);
/* Does it factorise the whole system? Not collective, the same on all ranks. */
PetscErrorCode FlowSolverIsDirect(FlowSolver, PetscBool *);
/* The block operator K for products. Borrowed. */
PetscErrorCode FlowSolverGetOperator(FlowSolver, Mat *K);

/* Number of unknowns: free or not, velocity + pressure + rigid slots (global). */
PetscErrorCode FlowSolverGetUnknowns(FlowSolver, PetscInt *n);
