/* FlowSolver: the coupled linear system of one step for free velocities, rigid velocities and pressure.

     [ P^T A P + D   -P^T B^T ] [u_r]   [ P^T (r - A c) + g ]
     [ B P               C    ] [ p ] = [ -B c              ]   A = S (x) identity of components,
                                                                C = 0 but in cells between two surfaces

   FGMRES around a preconditioner in three steps: the fields as PCFIELDSPLIT splits them (Schur, lower: velocity solve,
   then pressure solve with the projected operator), then the projection u_r += M_r^{-1} P^T B^T p, with bodies or large
   convective numbers followed by the least-squares commutator as a correction (twostage.h). M_r is the projected lumped
   mass. Steady flows take the commutator in place of the projection. Without bodies, and where viscosity dominates
   convection too, p += mu theta Mp^{-1} takes its place (Cahouet & Chabard 1988). The pressure operator is
   S_p = B_r M_r^{-1} B_r^T + eps B_c M_c^{-1} B_c^T (Turek 1999, ch. 2; Elman, Silvester, Wathen 2014, ch. 9; the
   softness eps keeps cut cells well conditioned and is in the preconditioner only).
   Where the viscosity varies, M_r is weighted by its root, and a steady flow takes a mean of the commutator and of the
   mass of the pressure over the viscosity (runs/studies/rheology).

   The outer iteration measures one norm over rows of one unit, force, so that it takes the same iterations whatever the
   units of a scene (tests/runs/test_units.py): continuity rows are multiplied by rho c_t, which makes them a pressure
   gradient's, and by twelve mean cell sizes; rotation of a body counts by its radius (ConstraintSetLengths). Vectors x
   below hold w times that length, residuals f have rows of that kind.

   Start value x0: velocity extrapolated, pressure of the last step, shifted along its last change by what makes the
   residual r0 smallest (a single sweep: not shifted, which would make it unstable: Guermond, Minev, Shen
   2006). The correction of x0 is solved for until |r| <= -flow_ksp_rtol |b|, or |r| <= min(-flow_rtol_start |r0|,
   -flow_rtol_max |b|). r0 is what the step adds that could not be foreseen, of second order in dt like the error of
   the scheme, so that a share of it is the right tolerance at every step size, where a share of |b| is too loose for
   small steps (errors add up) and too tight for large ones (runs/studies/flow-solver). Recipe balanced: 1e-8, 1e-2,
   1e-5 (with bodies that move 2e-5); if -flow_ksp_rtol is given, that alone holds. Recipe accurate: 1e-9, 0.
   Around bodies that move recipe balanced also stops where the estimated error of the velocities is at most the share
   -flow_velocity_tol of the largest (stop.c; light bodies, ties and large convective numbers count more): what users
   read, whatever a body's mass. Not where -flow_rtol_max is given, nor on periodic meshes or with a held mean
   velocity, where the residual is what the balance of momentum lacks. With ties it is to be that small in any case,
   also on such meshes and where the residual would do, up to 60 iterations. What a solve leaves over is told by
   FlowSolverGetOwed.

   Everything is reachable with PETSc options under prefix -flow_ (outer), -flow_fieldsplit_velocity_,
   -flow_fieldsplit_pressure_, names of that split. Products with the projected operators are matrix-free; matrices are
   assembled only when a chosen preconditioner needs them (hypre, gamg, lu, ... of the velocity; any -flow_pc_type other
   than the default).
   Options: -flow_solver fast|balanced|accurate|direct, -flow_schur auto|projection|commutator|two_stage,
   -flow_velocity_smoother auto|sor|ilu (relax.h), -flow_rtol_start, -flow_rtol_max, -flow_velocity_tol,
   -flow_min_it, -flow_pressure_regularisation eps.

   Recipe fast: without bodies a single sweep of the projection, unscaled and without norms. Around bodies that is a
   fixed-point iteration for the pressure whose eigenvalues reach 3 in cells that a penalty cuts, and grows; there it
   takes two iterations of FGMRES around the two stages of twostage.h, more if a tenth of |r0| is left
   (runs/studies/fast). Around bodies that move freely one is enough where it leaves little, for recipe balanced too:
   FlowSolverSetBefore. */
#pragma once
#include "solve/constraint.h"
#include "flow/flow.h"
#include "solve/penaltyterm.h"

typedef struct _p_FlowSolver *FlowSolver;

/* Collective. Reads the recipe and sets the defaults of all solvers. moving: there are bodies that do not stand still.
   */
PetscErrorCode FlowSolverCreate(Flow, Constraint, PetscBool moving, FlowSolver *);
PetscErrorCode FlowSolverDestroy(FlowSolver *);
PetscErrorCode FlowSolverView(FlowSolver, PetscViewer);

/* D: the bodies' own inertia (design: c_t (rho_s - rho_f) (Vol; I)), D [nbodies][nr][nr]; used for unknown rigid
   velocities only. Copied. */
PetscErrorCode FlowSolverSetRigid(FlowSolver, const PetscReal D[]);

/* A force between two bodies, or on one, that resists their motion: f = -stiffness (row_0 . U_0 + row_1 . U_1), with
   f row_s on the rigid rows of body s. In the plane rows have three numbers, in space six, as the rigid slots. */
typedef struct {
  PetscInt  body[2]; /* body[1] < 0: none */
  PetscReal row[2][6];
  PetscReal stiffness; /* force a speed */
} BodyTie;
/* The ties of the step, after ConstraintSetBodies, which has been told of their bodies (ConstraintSetPairs): a tie
   is given on every rank that knows both, and counts once. Known velocities do not count here. Copied. Collective. */
PetscErrorCode FlowSolverSetTies(FlowSolver, PetscInt n, const BodyTie tie[]);

/* Penalty of the bodies, whose scalar part is in the flow's matrix; NULL: none. Borrowed; what it points to may change
   between steps. */
PetscErrorCode FlowSolverSetSoft(FlowSolver, const PenaltyTerm *);

/* Integrals of the velocity over the domain that are held, each by a uniform force along its axis: one more unknown
   and one more row each, which hold up to rounding whatever the tolerances (flowrate.c). Nodes count with their
   lumped mass. The right-hand side of FlowSolverSolve holds the forces as they were before. */
typedef struct {
  PetscInt   n; /* at most 3 */
  PetscInt   axis[3];
  PetscReal *rigid[3];  /* [nbodies][nr] weights of rigid velocities whose bodies hold no nodes; what the force does to
                           their rows */
  PetscReal  target[3]; /* the integrals */
  PetscReal  force[3];  /* set by FlowSolverSolve: what is to be added to the force per volume */
} FlowHeld;
/* Borrowed, from the next FlowSolverSolve on; n and axis must not change. Collective. */
PetscErrorCode FlowSolverSetHeld(FlowSolver, FlowHeld *);

/* Around a FlowUpdateCells: which cells are about to change, and afterwards which ones are no part of the fluid
   (PressureForgetCells, PressureSetInactive). Collective. */
PetscErrorCode FlowSolverForgetCells(FlowSolver, PetscInt n, const PetscInt cells[]);
PetscErrorCode FlowSolverSetDead(FlowSolver, const PetscInt cell_body[], const PetscBool resolved[]);

/* After FlowAssemble and after every change of the constraint: update operators and preconditioners. Collective. */
PetscErrorCode FlowSolverSetUp(FlowSolver);

/* Solve. r [nnode_all][dim] right-hand side of the momentum rows (complete on own nodes), g [nbodies][nr] on the rigid
   rows. u [nnode_all][dim], p [own cells][dim + 1], U [nbodies][nr]: start values on entry, solution on exit (known
   entries of U untouched, u synced). dp, as p: direction along which the start value of p may be shifted, such as its
   last change; NULL: none. A failed solve is reported through *reason (< 0), with u, p, U as far as they got.
   Collective. */
PetscErrorCode FlowSolverSolve(FlowSolver, const PetscReal r[], const PetscReal g[], PetscReal u[], PetscReal p[],
                               const PetscReal dp[], PetscReal U[], PetscInt *its, KSPConvergedReason *reason);

/* What the last FlowSolverSolve left of the momentum equations, as momentum that the flow would have if it had solved
   for it, about: load [own nodes][dim], rigid [nbodies][nr] of the bodies' own inertia. An error of the velocities of
   this size adds up from step to step unless c_t times it goes into the right-hand sides r, g of the next step
   (conserve.c). Zero where the solve failed or a mean velocity is held, and for steady flows. Collective. */
PetscErrorCode FlowSolverGetOwed(FlowSolver, PetscReal load[], PetscReal rigid[]);
/* This is done in every step, so that errors do not add up, and steps may end accordingly (stop.c). Local. */
PetscErrorCode FlowSolverSetOwing(FlowSolver, PetscBool);

/* Of the last FlowSolverSolve: left, the residual after its first iteration as share of the right-hand side's, and is
   what it left small enough to be owed? SetBefore: left of the step before; 0: of none, or of the first. A step
   ends after one iteration where that leaves at most -flow_one_it_rtol, and no more than three times what it left
   before, with bodies that move freely, without ties; recipe balanced asks for small errors of their velocities,
   too (stop.c). Not collective, the same on all ranks. */
PetscErrorCode FlowSolverSetBefore(FlowSolver, PetscReal left);
PetscErrorCode FlowSolverGetLeft(FlowSolver, PetscReal *left, PetscBool *solved);

/* How many inner solves for the velocity and for the pressure ended in the last FlowSolverSolve without meeting their
   tolerance (-flow_fieldsplit_velocity_ksp_max_it, -flow_fieldsplit_pressure_ksp_max_it). The outer iteration makes up
   for them where there is one; recipe fast has none, or a short one. Not collective, same on all ranks. */
PetscErrorCode FlowSolverGetLimited(FlowSolver, PetscInt limited[2]);

/* For nonlinear problems, whose solver repeats these. x holds on every rank the reduced velocity (own nodes x dim,
   rigid slots of own bodies), then the pressure of own cells. SetVelocity: velocity matrix of all components (own
   nodes x dim) to use in place of S from the next SetUp on, NULL: that of the flow again (FlowGetComponents, or S);
   S stays the preconditioner of the matrix-free solvers. Borrowed. Pack, Unpack: between x and nodal arrays as in
   FlowSolverSolve. Residual: f = K x - b with the system's K and right-hand side b. GetRest: the 2-norm of that b,
   the residual of x = 0. Correct: solve K y = f from y = 0, to the tolerance of the solver or until the residual is
   `enough`. SetShift: from the next SetUp on a steady system, whose velocity matrix is A until SetVelocity, is
   preconditioned as a time step of that rate is, with the flow's own velocity matrix; what the step leaves, the
   outer iteration takes away (runs/studies/flow-solver, "Steady flows by iteration"). A NULL: the flow's matrix is
   the system's, too. The rate weighs the rows of continuity in K and in residuals. 0: none. CanShift: that serves
   this flow and its methods. Forgive: cells between two surfaces are a little compressible
   (-flow_pressure_gap_compressibility), in K and in residuals; in residuals from now on for what the pressure
   differs from that of x alone, NULL: for all of it. *any (may be NULL): there are such cells. Collective. */
PetscErrorCode FlowSolverCreateVec(FlowSolver, Vec *x);
PetscErrorCode FlowSolverSetVelocity(FlowSolver, Mat A);
PetscErrorCode FlowSolverSetShift(FlowSolver, PetscReal rate, Mat A);
PetscErrorCode FlowSolverCanShift(FlowSolver, PetscBool *can);
PetscErrorCode FlowSolverPack(FlowSolver, const PetscReal u[], const PetscReal p[], const PetscReal U[], Vec x);
PetscErrorCode FlowSolverUnpack(FlowSolver, Vec x, PetscReal u[], PetscReal p[], PetscReal U[]);
PetscErrorCode FlowSolverResidual(FlowSolver, const PetscReal r[], const PetscReal g[], Vec x, Vec f);
PetscErrorCode FlowSolverIsDirect(FlowSolver, PetscBool *); /* does it factorise the whole system? */
PetscErrorCode FlowSolverForgive(FlowSolver, Vec x, PetscBool *any);
PetscErrorCode FlowSolverGetRest(FlowSolver, PetscReal *norm);
PetscErrorCode FlowSolverCorrect(FlowSolver, Vec f, PetscReal enough, Vec y, PetscInt *its, KSPConvergedReason *reason);
/* The block operator K for products. Borrowed. */
PetscErrorCode FlowSolverGetOperator(FlowSolver, Mat *K);

/* Number of unknowns: free or not, velocity + pressure + rigid slots (global). */
PetscErrorCode FlowSolverGetUnknowns(FlowSolver, PetscInt *n);
