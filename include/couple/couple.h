/* Couple: one step of flow and bodies together. Called by run (set-up, one step, restart, new meshes) and report
   (columns, fields). Who takes part in a step adds itself by participant.h.

   Method, boundary methods, what each of them leaves out, literature: src/couple/README.md, "Method".

   Shapes: k counts the n local bodies of BodyState, nr = 3 (2D) or 6 (3D) rigid slots each: velocity of the reference
   point, angular velocity. Nodal arrays are [nnode_all][dim], pressure arrays [own cells][dim + 1] as in flow/flow.h.
   Units: those of the scene; in 2D forces, energies and powers are per unit depth.
   Ownership: Flow, Bodies, Deform, Solids and Drops are borrowed until CoupleDestroy; results that are borrowed are
   valid until the next step or change of the mesh, unless something else is said.
   Collective: on the communicator of the flow. Local: without communication. Errors are raised on all ranks. */
#pragma once
#include "bodies/bodies.h"
#include "contact/contact.h"
#include "mesh/deform.h"
#include "flow/flow.h"
#include "solve/system.h"

typedef struct _p_Couple *Couple;

/* ---- set-up of a scene: run ---- */

typedef struct _p_Solids *Solids; /* solid/solid.h */
typedef struct _p_Drops  *Drops;  /* phase/drops.h */
/* *reach: number of cells beyond its own within which a rank must know bodies for the method of -couple_method. Groups
   whose bodies all ranks must know are marked (BodiesSetEverywhere). Before CoupleCreate. Collective. */
PetscErrorCode CoupleFindReach(Mesh, Bodies, PetscInt *reach);
/* The sub-domains by which bodies are spread become those of the mesh, with `reach` cells beyond. Bodies move there
   with the next BodiesMigrate. Nothing happens where all ranks know all bodies. Collective. */
PetscErrorCode CoupleSetSubdomains(Mesh, Bodies, PetscInt reach);
/* *even: has the mesh cells of one size around the bodies where they are, as -couple_method aligned needs?
   Collective. */
PetscErrorCode CoupleHasEvenCells(Mesh, Bodies, PetscBool *even);
/* Reads -couple_*, creates the constraint, the solver and the participants of src/couple/participants.c. Collective.
   Errors: a method or scheme that does not work with the bodies or the mesh (the message names the option). */
PetscErrorCode CoupleCreate(Flow, Bodies, Couple *);
/* Frees it and sets it to NULL; nothing happens with NULL. Collective. */
PetscErrorCode CoupleDestroy(Couple *);
/* Prints method, coupling and participants. Collective. */
PetscErrorCode CoupleView(Couple, PetscViewer);
/* Borrowed; another one after CoupleRenewSolver, CoupleAfterRemesh and CoupleUpdateLocalBodies. Local. */
PetscErrorCode CoupleGetSolver(Couple, FlowSolver *);
/* The mesh, deformed for the bodies where they are, follows them from now on (src/couple/ale.h). Borrowed. Collective.
   Error: method aligned, which moves the nodes itself. */
PetscErrorCode CoupleSetDeform(Couple, Deform);
/* Elastic solids take part in the step from now on. Borrowed. Collective. Errors: solvers and schemes that do not work
   with them. */
PetscErrorCode CoupleSetSolids(Couple, Solids);
/* Why the mesh cannot be lined up with elastic particles (-couple_method aligned), beside these bodies, in a mesh that
   follows them or not (`tracks`): the error as it is printed; NULL: it can. Collective. */
PetscErrorCode CoupleCanAlignSolids(PetscInt dim, Bodies, Solids, PetscBool tracks, const char **why);
/* Drops take part in the step from now on. Borrowed. Collective. Errors: methods, solvers and schemes that do not work
   with them, particles of other materials. */
PetscErrorCode CoupleSetDrops(Couple, Drops);
/* Before the first step: the length of the steps that are asked for, of which some may be shorter. Local. */
PetscErrorCode CoupleSetStep(Couple, PetscReal dt);
/* Are flow and bodies solved together (-couple_type implicit)? Local. */
PetscErrorCode CoupleIsImplicit(Couple, PetscBool *);
/* At the start of a run, with the bodies where they begin and the flow as it begins: the fluid inside bodies that move
   freely takes their velocity, but for those that were given the fluid's. (That inside elastic ones, whose velocities
   are given, follows with the geometry of the first step.) Nothing with a method that has no fluid inside, or with
   nodal, where a remark says so unless the flow will be solved for with the bodies held at their velocities.
   Collective. */
PetscErrorCode CoupleStartInside(Couple, PetscBool solved);
/* The flow of the start has been solved for, with elastic particles in it: they begin with what was found, given or
   not; what they lost or won has gone to the flow. Not collective. */
PetscErrorCode CoupleStartSolids(Couple);
/* Does the mesh line up with surfaces (method aligned)? Local. */
PetscErrorCode CoupleIsLinedUp(Couple, PetscBool *lined_up);
/* A film in space that is as wide as a cell or narrower resists like one that is wider by this offset, in cells, with
   the method in use. Local. */
PetscErrorCode CoupleGetFilmGapOffset(Couple, PetscReal *film_gap_offset);

/* ---- one step, in the order of the calls after FlowBeginStep: run ---- */

/* Shortens *dt to the smallest limit of the participants, before the step begins; *who (may be NULL): the participant
   that set it, or NULL. Collective. */
PetscErrorCode CoupleLimitStep(Couple, PetscReal *dt, const char **who);
/* The same of the step solved: *ratio, its length over what the participants stand (0: they stand any); *who went
   furthest beyond. Before the next step begins. Collective. */
PetscErrorCode CoupleOverstep(Couple, PetscReal *ratio, const char **who);
/* Name of the i-th participant with a limit, NULL: there are no more. Local. */
const char *CoupleLimitName(Couple, PetscInt i);

/* A bound that a step should keep, but that is measured during the step, so that it limits no step */
typedef struct {
  const char *name, *what, *option, *unit, *then; /* of a row of the table of limits (src/run/steplimits.h) */
  PetscReal   value;
  PetscInt    exceeded; /* steps so far, of this process, that went beyond it; the same on all ranks */
} CoupleBound;
/* That of the boundary method, NULL: it has none. Borrowed. Local. */
PetscErrorCode CoupleGetBound(Couple, const CoupleBound **);
/* After BodiesMigrate, before the next CoupleUpdateGeometry: bodies went to their owners, local indices k changed.
   Nothing happens where all ranks know all bodies. Collective. */
PetscErrorCode CoupleUpdateLocalBodies(Couple);
/* The n springs of contact (ContactFindSprings) that are solved with the flow in this step; NULL with n 0: none. Before
   CoupleUpdateGeometry, implicit coupling only. Copied. Collective. */
PetscErrorCode CoupleSetContact(Couple, PetscInt n, const ContactSpring spring[]);
/* Bodies at their predicted positions, indicator, constraint, what participants prepare. Collective. */
PetscErrorCode CoupleUpdateGeometry(Couple);
/* The same for solvers that are set up before a step begins: what the flow has carried to where it is (drops) stays
   there. Collective. */
PetscErrorCode CoupleSetUpGeometry(Couple);
/* Assembles and solves for flow and bodies; *its: iterations, *reason < 0: the solver failed, which is no error. The
   solution is not accepted yet. Collective. */
PetscErrorCode CoupleSolve(Couple, PetscInt *its, KSPConvergedReason *reason);
/* Forces of the springs of CoupleSetContact after CoupleSolve, force [n], in their order. Borrowed. Local. */
PetscErrorCode CoupleGetContact(Couple, const PetscReal *force[]);
/* Hydrodynamic forces and torques of all bodies from the solution, into BodyState. Collective. */
PetscErrorCode CoupleForce(Couple);
/* Accepts the step: velocities and positions of the bodies, fields of the flow. Collective. Error: explicit coupling
   blows up (added mass); the message names -couple_type implicit. */
PetscErrorCode CoupleAdvance(Couple);

/* ---- nonlinear solvers (steady states): run ---- */

/* The first part of CoupleSolve, matrix and right-hand side, for another convecting velocity. Collective. */
PetscErrorCode CoupleAssemble(Couple);
/* Solution of the step, writable, with rigid velocities U [n][nr] and right-hand sides rhs [nnode_all][dim], g [n][nr].
   Any may be NULL. Borrowed. Local. */
PetscErrorCode CoupleGetSystem(Couple, PetscReal *u[], PetscReal *p[], PetscReal *U[], PetscReal *rhs[],
                               PetscReal *g[]);
/* Forgets what the solver carries from step to step, as a restart does. Collective. */
PetscErrorCode CoupleRenewSolver(Couple);

/* ---- balances of the step: run, report ---- */

/* Balance of momentum over the step: fluid = bodies + walls + openings + volume + others. Each [3], force units.
   Where the force of a body comes from its own equation or from the residual, the balance closes up to the solver's
   tolerance; with -couple_force volume the error is that of the volume form. */
typedef struct {
  PetscReal fluid[3];  /* rate of change of the momentum in the domain, rho int (c_t u - d); fluid inside bodies counts
                         where it is part of the flow */
  PetscReal bodies[3]; /* force of the bodies on it */
  PetscReal walls[3];  /* force of walls (no_slip, moving_wall, slip) */
  PetscReal openings[3]; /* traction where an inflow prescribes the velocity, less the momentum that flows out, rho int
                            w.grad u */
  PetscReal volume[3];   /* -flow_force over the domain */
  PetscReal others[3];   /* force of other participants of the step (participant.h) */
  PetscReal residual[3]; /* fluid less all of them */
  PetscReal mean[3]; /* velocity, mean over the domain with the bodies in it (less those that are holes of the mesh) */
  PetscReal error;   /* largest component of fluid - the rest, over the sum of the sizes of all forces */
  PetscReal size;    /* that sum */
  /* of the uniform force on the whole domain, the fraction that bodies, walls and acceleration do not take (of half of
     size, if that is larger): the mesh has lost (negative: gained) volume. 0 where no force drives, or bodies pass
     through sides */
  PetscReal driving;
} CoupleBalance;
/* FlowDiagnose of the step's solution, wherever that lies. After CoupleForce, before CoupleAdvance. Collective. */
PetscErrorCode CoupleDiagnose(Couple, FlowDiagnostics *);
/* Balance of momentum, of flow rates and of boundaries. After CoupleForce and FlowDiagnose, before CoupleAdvance.
   Collective. */
PetscErrorCode CoupleMomentum(Couple, const FlowDiagnostics *, CoupleBalance *);
/* Has a participant a force of its own in CoupleBalance.others? Local. */
PetscBool CoupleHasOthers(Couple);

/* The uniform force of -flow_rate and -couple_backflow, measured by CoupleMomentum. */
typedef struct {
  PetscInt  controlled, backflow; /* bit masks of axes: mean velocity held; under -couple_backflow flux or force */
  PetscReal force[3];             /* per volume, with -flow_force */
  PetscReal error; /* of the back-flow condition. flux: mean velocity over its root mean square; force: what accelerates
                      fluid and bodies beyond walls, openings and held bodies, over the sum of the loads */
} FlowRateResult;
/* NULL: neither -flow_rate nor -couple_backflow is given. Borrowed. Local. */
PetscErrorCode CoupleGetFlowRate(Couple, const FlowRateResult **);
/* Does a uniform force drive the flow (-flow_force, -flow_rate, -couple_backflow)? Local. */
PetscBool CoupleIsDriven(Couple);

/* A named boundary of the mesh: a wall, an opening (inflow, outflow), or neither (the surface of a body). */
typedef struct {
  const char *name;
  PetscBool   wall, open;
  PetscReal   force[3]; /* of the fluid on the wall, as in the balance of momentum */
  PetscReal   rate;     /* volume (2D: area) a time that flows out through the opening */
} CoupleBoundary;
/* The n named boundaries, as CoupleMomentum found them in this step. Borrowed: names stay, values change. Local. */
PetscErrorCode CoupleGetBoundaries(Couple, PetscInt *n, const CoupleBoundary *boundary[]);

/* Energy of fluid and bodies after CoupleMomentum, and the power of all that acts on them from outside: weight less
   buoyancy, external loads and contact on bodies that move freely, what moves walls and prescribed bodies, inflow
   (its pressure and its kinetic energy), -flow_force. Bodies with a degree of freedom that is prescribed and moves
   count as outside. In exact arithmetic and time the energy grows by no more than the work: viscosity takes the
   rest. */
typedef struct {
  PetscReal energy; /* to be added to the kinetic energy of the flow: 1/2 (rho_s - rho_i) U^T M U, rho_i the density of
                       the fluid inside, which the flow counts; of bodies outside without rho_s */
  PetscReal size;   /* kinetic energy of all bodies */
  PetscReal power;
  PetscReal inflow; /* of it, kinetic energy that flows in */
} CouplePower;
/* After CoupleMomentum. Collective. */
PetscErrorCode CoupleGetPower(Couple, CouplePower *);

/* Where the energy goes in the step, of fluid and bodies, after CoupleForce and before CoupleAdvance */
typedef struct {
  PetscReal inertia; /* of FlowPower and of the bodies */
  PetscReal viscous; /* taken by viscosity */
  /* taken by the boundary method: where the fluid slips past what the penalty holds, and where cells between two
     surfaces give way */
  PetscReal boundary;
  PetscReal contact; /* of contact_force and contact_torque on bodies that move freely; */
  PetscReal counted; /* its part of CouplePower.power, which goes by the velocity of the end */
} CoupleLosses;
/* For bodies and flow solved together and a constant viscosity; after CoupleForce, before CoupleAdvance. Collective. */
PetscErrorCode CoupleGetLosses(Couple, CoupleLosses *);
/* Force and torque on the body with this permanent number in both forms, whatever -couple_force says: residual,
   volume [6], and (may be NULL) force [3], the one that the step uses. The same on all ranks. After CoupleForce.
   Collective. */
PetscErrorCode CoupleForceForms(Couple, PetscInt number, PetscReal force[3], PetscReal residual[6],
                                PetscReal volume[6]);
/* Force [3] of the fluid on elastic solid k in the last step, without buoyancy; 0 without solids. Local. */
PetscErrorCode CoupleGetSolidForce(Couple, PetscInt k, PetscReal force[3]);
/* Error of the volume of elastic solid k that was put right at the end of the last step. Local. */
PetscReal CoupleGetVolumeKept(Couple, PetscInt k);
/* Steps of this run in which -couple_method aligned left some elastic solid immersed; -1: another method. Local. */
PetscInt CoupleCountImmersed(Couple);
/* The largest share of the momentum of fluid and elastic solids that lining the mesh up with these changed in a step;
   -1: it is not measured. Local. */
PetscReal CoupleGetMomentumCarried(Couple);
/* Has any body slip (bodies/slip.h)? Local. */
PetscBool CoupleHasSlip(Couple);
/* After CoupleForce: *speed, mean of the velocities of bodies with slip along their directions of swimming, *power, sum
   of the powers of their slip on the fluid. Collective. */
PetscErrorCode CoupleGetSwimming(Couple, PetscReal *speed, PetscReal *power);

/* A number that the boundary method reports of the last step: a column of series.csv */
typedef struct {
  const char *name;
  PetscInt    value;
  PetscBool   summed; /* its sum over all steps belongs into the summary */
} CoupleCount;
/* The n of them (0: none). Borrowed: names stay, values change. Local. */
PetscErrorCode CoupleGetCounts(Couple, PetscInt *n, const CoupleCount *count[]);
/* Number of steps so far in which the residual of the step before was not added to the right-hand side: because the
   mesh was rebuilt (*meshes), or because it was above a twentieth of the right-hand side (*residuals). The same on all
   ranks. Local. */
PetscErrorCode CoupleGetDropped(Couple, PetscReal *meshes, PetscReal *residuals);
/* Work of this rank in the step: own cells with a node in a body, bodies that cover an own node. Local. */
PetscErrorCode CoupleGetLoad(Couple, PetscInt *ncells, PetscInt *nbodies);
/* How well the mesh of the last step follows the bodies, NULL: it does not move. Borrowed. Local. */
PetscErrorCode CoupleGetDeform(Couple, const DeformResult **);

/* ---- fields for output: run, report ---- */

/* Solution u (synced), p of the step, before CoupleAdvance. Borrowed. Local. */
PetscErrorCode CoupleGetSolution(Couple, const PetscReal *u[], const PetscReal *p[]);
/* node_body [nnode_all]: local index of the body whose rigid motion a node takes in this step, or -1. With method
   penalty thin and small bodies have no such node. Borrowed. Local. */
PetscErrorCode CoupleGetNodeBody(Couple, const PetscInt *node_body[]);
/* body [nnode_all]: local index of the body that a node lies in (by the sign of the distance, where the flow last saw
   the bodies), or -1, whatever the method; none for bodies that are holes of the mesh. Costs as much as the indicator
   of all bodies. Filled in. Local. */
PetscErrorCode CoupleMarkInside(Couple, PetscInt body[]);
/* fluid [own cells]: cells of fluid alone where the flow last saw the bodies, neither cut by a surface nor lined up
   with one. Filled in. Local. */
PetscErrorCode CoupleMarkFluid(Couple, PetscBool fluid[]);

/* ---- restart and new meshes: run ---- */

/* Before the mesh is rebuilt (mesh/carry.h): keeps what the new one needs. Without this call nothing of the old mesh is
   kept, as where fields are about to be loaded. Collective. */
PetscErrorCode CoupleBeforeRemesh(Couple);
/* After the mesh is rebuilt and FlowRemesh is called: rebuilds what depends on cells and nodes; the history of the
   bodies stays. *old may be taken over, then it becomes NULL. Collective. */
PetscErrorCode CoupleAfterRemesh(Couple, Mesh *old);
/* StateVisit of a Couple: velocities that the flow saw in the last steps, history of explicit coupling, states of the
   participants. Collective. */
PetscErrorCode CoupleVisitState(void *couple, State);
