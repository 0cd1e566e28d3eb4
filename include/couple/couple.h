/* Couple: where flow and bodies meet.

   Marks the nodes that bodies cover, fills the projection P, solves the step for flow and free bodies together
   (implicit, monolithic) or with the bodies' known velocity (explicit, the classical algorithm of the method), reads
   the hydrodynamic forces, and moves the bodies. References: Glowinski, Pan, Hesla, Joseph 1999; Turek, Wan, Rivkind
   2003; Wan, Turek 2006; for the monolithic form src/solve/README.md.

   How the flow sees the surface of a body is the boundary method (src/couple/boundarymethod.h). nodal: nodes inside
   take the velocity of the body. penalty: the body's part of cut cells is held by a force. Both leave fictitious fluid
   inside, so that the rigid rows carry c_t (rho_s - rho_f) (Vol; I) with exact Vol and I of the shape. aligned: the
   mesh lines up with the bodies, whose inside is no part of the fluid. The volume form of the force is taken around
   all held nodes, one or two cells out, and misses what flows through there; under penalty around the nodes held
   whole, with the force that holds the cut cells.

   -mesh_deform with bodies that move: the mesh follows them in every step, its velocity is part of the convection;
   not with method aligned.

   -flow_force (the gradient of a mean pressure) acts on the fluid and on the bodies in it alike: their force and the
   balance of momentum contain its share, force per volume times Vol. Bodies that are holes of the mesh report the
   force on their surface alone. */
#pragma once
#include "bodies/bodies.h"
#include "contact/contact.h"
#include "mesh/deform.h"
#include "flow/flow.h"
#include "solve/system.h"

typedef struct _p_Couple *Couple;

/* Of the method that -couple_method names: *reach, so many cells beyond its own a rank is to know bodies; groups whose
   bodies all ranks are to know are marked. Before CoupleCreate. Collective. */
PetscErrorCode CoupleFindReach(Mesh, Bodies, PetscInt *reach);
/* The parts of bodies that are spread become those of the mesh and `reach` cells beyond. Collective. */
PetscErrorCode CoupleSetSubdomains(Mesh, Bodies, PetscInt reach);
/* Creates the constraint and the solver. Collective. */
PetscErrorCode CoupleCreate(Flow, Bodies, Couple *);
PetscErrorCode CoupleDestroy(Couple *);
PetscErrorCode CoupleView(Couple, PetscViewer);
PetscErrorCode CoupleGetSolver(Couple, FlowSolver *);
/* From now on the mesh, deformed for the bodies where they are, follows them (ale.h). Error: method aligned, which
   moves nodes itself. Borrowed. Collective. */
PetscErrorCode CoupleSetDeform(Couple, Deform);
/* What the mesh of the last step was like, NULL: it does not move. Borrowed. */
PetscErrorCode CoupleGetDeform(Couple, const DeformResult **);
/* Numbers that the boundary method reports of the last step, n = 0: none; columns of series.csv under these names.
   Borrowed: names stay, values change. Not collective. */
typedef struct {
  const char *name;
  PetscInt    value;
  PetscBool   summed; /* its sum over all steps belongs into the summary */
} CoupleCount;
PetscErrorCode CoupleGetCounts(Couple, PetscInt *n, const CoupleCount *count[]);

/* Body whose rigid motion a local node follows in this step, or -1: [nnode_all]. What follows a body is the method's
   choice: under penalty thin bodies and small ones have no such node. */
PetscErrorCode CoupleGetNodeBody(Couple, const PetscInt *node_body[]);

/* Body that a local node lies in, or -1, whatever the method: body [nnode_all], by the sign of the distance, bodies
   where the flow last saw them. Bodies that are holes of the mesh hold no node. For output: the cost is that of
   marking all bodies. Not collective. */
PetscErrorCode CoupleMarkInside(Couple, PetscInt body[]);

/* Does the mesh line up with surfaces (method aligned)? */
PetscErrorCode CoupleIsLinedUp(Couple, PetscBool *lined_up);
/* Under this method a film in space of one cell or somewhat less resists as one that is wider by this offset, in cells.
   Not collective. */
PetscErrorCode CoupleGetFilmGapOffset(Couple, PetscReal *film_gap_offset);
/* Own cells that are fluid alone, as the flow last saw the bodies: fluid [ncell]. Not those that a surface cuts or
   that are lined up with it. Not collective. */
PetscErrorCode CoupleMarkFluid(Couple, PetscBool fluid[]);
/* What the bodies give this rank to do in this step: own cells with a node in a body, and bodies that cover an own
   node. Not collective. */
PetscErrorCode CoupleGetLoad(Couple, PetscInt *ncells, PetscInt *nbodies);

/* Bodies that are spread have gone to their owners (BodiesMigrate), and local indices k have changed: before the next
   CoupleUpdateGeometry. Nothing happens where all know all. Collective. */
PetscErrorCode CoupleUpdateLocalBodies(Couple);

/* Forces of contact to solve with the flow, before CoupleUpdateGeometry (ContactFindSprings; NULL with n 0: none), and
   what they came to after CoupleSolve, force [n], borrowed. Implicit coupling only. Copied. Collective. */
PetscErrorCode CoupleSetContact(Couple, PetscInt n, const ContactSpring spring[]);
PetscErrorCode CoupleGetContact(Couple, const PetscReal *force[]);
PetscErrorCode CoupleIsImplicit(Couple, PetscBool *);

/* Elastic solids take part in the step from now on. Borrowed. Collective. Errors: solvers and schemes that they do not
   work with. */
typedef struct _p_Solids *Solids; /* solid/solid.h */
PetscErrorCode            CoupleSetSolids(Couple, Solids);
/* Drops likewise. Errors: methods, solvers and schemes that they do not work with, particles of other materials. */
typedef struct _p_Drops *Drops; /* phase/drops.h */
PetscErrorCode           CoupleSetDrops(Couple, Drops);
/* Force [3] of the fluid on solid k in the last step, without buoyancy. 0 without solids. */
PetscErrorCode CoupleGetSolidForce(Couple, PetscInt k, PetscReal force[3]);

/* The four parts of a step, in this order after FlowBeginStep. Collective. UpdateGeometry: bodies at their predicted
   position, indicator, constraint. Solve: assembly and the linear system; *reason < 0 reports failure without raising
   an error. The solution is not yet accepted. Force: hydrodynamic forces of all bodies, from the solution. Advance:
   velocities and positions of the bodies; accepts the flow. Error when explicit coupling blows up (added mass): names
   -couple_type implicit. */
PetscErrorCode CoupleUpdateGeometry(Couple);
/* The first part of CoupleSolve, which nonlinear solvers repeat for other convecting velocities: matrix and
   right-hand side. Collective. */
PetscErrorCode CoupleAssemble(Couple);
PetscErrorCode CoupleSolve(Couple, PetscInt *its, KSPConvergedReason *reason);
PetscErrorCode CoupleForce(Couple);
PetscErrorCode CoupleAdvance(Couple);

/* *dt becomes no longer than participants of the step stand, before it begins; *who (may be NULL): the one that set
   it, or NULL. Collective. */
PetscErrorCode CoupleLimitStep(Couple, PetscReal *dt, const char **who);
/* The i-th participant that has such a limit, NULL: there are no more. Not collective. */
const char *CoupleLimitName(Couple, PetscInt i);
/* A bound that a step should keep and that is measured when it is taken: no limit, since then it is too late */
typedef struct {
  const char *name, *what, *option, *unit, *then; /* of a row of the table of limits (src/run/steplimits.h) */
  PetscReal   value;
  PetscInt    exceeded; /* steps so far, of this process, that went beyond it; the same on all ranks */
} CoupleBound;
/* Of the boundary method; NULL: it has none. Borrowed. Not collective. */
PetscErrorCode CoupleGetBound(Couple, const CoupleBound **);
/* Is there a participant with a force of its own in CoupleBalance.others? Not collective. */
PetscBool CoupleHasOthers(Couple);

/* Solution of the step before CoupleAdvance: u [nnode_all][dim], p [own cells][dim + 1]. */
PetscErrorCode CoupleGetSolution(Couple, const PetscReal *u[], const PetscReal *p[]);
/* The same, writable, with the rigid velocities U [n][nr] and the right-hand sides rhs [nnode_all][dim], g [n][nr]
   of the step, for solvers of their own. Any may be NULL. */
PetscErrorCode CoupleGetSystem(Couple, PetscReal *u[], PetscReal *p[], PetscReal *U[], PetscReal *rhs[],
                               PetscReal *g[]);
/* Both forms of force and torque on the body with this permanent number, whatever -couple_force says, and (NULL: not)
   the force that the step has. The same on all ranks. Collective. */
PetscErrorCode CoupleForceForms(Couple, PetscInt number, PetscReal force[3], PetscReal residual[6],
                                PetscReal volume[6]);
/* In how many steps so far the residual of the step before was not added to the right-hand side, since a new mesh
   was made or since it was more than a twentieth of the right-hand side. Not collective, the same on all ranks. */
PetscErrorCode CoupleGetDropped(Couple, PetscReal *meshes, PetscReal *residuals);
/* Forget what the solver carries from step to step, as a restart does: all depends on the state alone. Collective. */
PetscErrorCode CoupleRenewSolver(Couple);
/* Around a change of cells (mesh/carry.h): BeforeRemesh before the mesh is rebuilt, AfterRemesh when it is and the
   flow knows (FlowRemesh): what depends on cells and nodes is rebuilt, the bodies' history stays. *old may be taken
   over, then it is NULL. Without BeforeRemesh nothing of the old mesh is kept: fields are about to be loaded.
   Collective. */
PetscErrorCode CoupleBeforeRemesh(Couple);
PetscErrorCode CoupleAfterRemesh(Couple, Mesh *old);
/* StateVisit of a Couple: velocities that the flow saw in the last steps, history of explicit coupling. */
PetscErrorCode CoupleVisitState(void *couple, State);
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
  PetscReal
    driving; /* of the uniform force on the whole domain, what bodies, walls and what accelerates do not take, over
                        that force (or half of size): the mesh has lost (won: negative) room; 0 where none drives, or
                        bodies pass through sides */
} CoupleBalance;

/* The uniform force of -flow_rate and -couple_backflow, measured by CoupleMomentum. */
typedef struct {
  PetscInt  controlled, backflow; /* bit masks of axes: mean velocity held; under -couple_backflow flux or force */
  PetscReal force[3];             /* per volume, with -flow_force */
  PetscReal error; /* of the back-flow condition. flux: mean velocity over its root mean square; force: what accelerates
                      fluid and bodies beyond walls, openings and held bodies, over the sum of the loads */
} FlowRateResult;
/* -couple_method aligned needs cells of one size around a surface: has the mesh as it is that, around the bodies
   where they are? Collective. */
PetscErrorCode CoupleHasEvenCells(Mesh, Bodies, PetscBool *even);
/* Does a uniform force drive the flow (-flow_force, -flow_rate, -couple_backflow)? */
PetscBool CoupleIsDriven(Couple);
/* NULL: neither is asked for. Borrowed. */
PetscErrorCode CoupleGetFlowRate(Couple, const FlowRateResult **);

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
/* Collective. */
PetscErrorCode CoupleGetPower(Couple, CouplePower *);
/* Has any body slip (bodies/slip.h)? After CoupleForce: mean of the velocities of such bodies along their directions of
   swimming, sum of the powers of their slip on the fluid around them. The latter collective. */
PetscBool      CoupleHasSlip(Couple);
PetscErrorCode CoupleGetSwimming(Couple, PetscReal *speed, PetscReal *power);
/* Where the energy goes in the step, of fluid and bodies, after CoupleForce and before CoupleAdvance */
typedef struct {
  PetscReal inertia; /* of FlowPower and of the bodies */
  PetscReal viscous; /* taken by viscosity */
  PetscReal
    boundary;        /* taken by the boundary method: where the fluid slips past what the penalty holds, and where cells
                         between two surfaces give way */
  PetscReal contact; /* of contact_force and contact_torque on bodies that move freely; */
  PetscReal counted; /* its part of CouplePower.power, which goes by the velocity of the end */
} CoupleLosses;
/* Bodies and flow solved together, constant viscosity. Collective. */
PetscErrorCode CoupleGetLosses(Couple, CoupleLosses *);

/* After CoupleForce and FlowDiagnose. Collective. */
PetscErrorCode CoupleMomentum(Couple, const FlowDiagnostics *, CoupleBalance *);

/* A named boundary of the mesh: a wall, an opening (inflow, outflow), or neither (the surface of a body). */
typedef struct {
  const char *name;
  PetscBool   wall, open;
  PetscReal   force[3]; /* of the fluid on the wall, as in the balance of momentum */
  PetscReal   rate;     /* volume (2D: area) a time that flows out through the opening */
} CoupleBoundary;
/* As CoupleMomentum found them in this step. Borrowed: names stay, values change. Not collective. */
PetscErrorCode CoupleGetBoundaries(Couple, PetscInt *n, const CoupleBoundary *boundary[]);
