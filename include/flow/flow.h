/* Flow: the incompressible Navier-Stokes equations on the mesh, without bodies and without solvers.

   Q2 velocity, P1 discontinuous pressure (unmapped, centred on the cell: 1, (x - xc)/hc, (y - yc)/hc, with hc =
   volume^(1/dim)), gradient form of the viscous term, 3-point Gauss quadrature an axis. One step n -> n+1 is linear,
   convection with the extrapolated velocity w:

     rho (c_t u - d, v) + rho (w.grad u_theta, v) + mu (grad u_theta, grad v) - (p, div v) = (f, v),   (q, div u) = 0,
     u_theta = theta u + (1 - theta) u^n

   be:   c_t = 1/dt,     d = u^n/dt,                      theta = 1,   w = u^n
   cn:   c_t = 1/dt,     d = u^n/dt,                      theta = 1/2, w = (3u^n - u^{n-1})/2, p at the middle of the
   step bdf2: c_t = 3/(2dt),  d = (2u^n - u^{n-1}/2)/dt,       theta = 1,   w = 2u^n - u^{n-1}
         (as in cn, variable steps: interpolation through the unequal times)
   fstheta: three substeps of lengths a dt, (1 - 2a) dt, a dt with a = 1 - sqrt(1/2), each with its own pressure, c_t
         = 1/length, d = u^n/length, theta = (1 - 2a)/(1 - a) in the first and the last and a/(1 - a) in the middle one
         (Bristeau, Glowinski, Periaux 1987; Turek 1999, section 3.2), w extrapolated to the point theta of the substep.
         Here n is the beginning of the substep. c_t/theta is the same in all three.
   The first step of cn, bdf2 and fstheta extrapolates from one field (bdf2: one step of be). -flow_extrapolation
   quadratic: w is the parabola through u^n, u^{n-1}, u^{n-2} instead. Linear extrapolation makes most of the error in
   time of cn and bdf2 (runs/studies/cylinder); w only convects, so that neither form limits the step. For bodies that
   stay where they are. auto, the default: quadratic in steps of CFL numbers from 2 to 5 while bodies stay, since
   the error of the linear form then turns the amplitudes of vortex streets into noise; what it adds is as much
   as the linear form at most, at every node, since noise in time would grow seven times in three steps.

   -flow_convection_form skew adds (div w) u_theta/2 (Temam 1968): convection then neither adds nor takes energy inside,
   though div w is zero on the average over a cell only, which helps where the flow is under-resolved (the discs of
   runs/dkt.yaml). Not the default, being less accurate elsewhere (runs/studies/flow-solver).

   The velocity operator is the same scalar matrix S = rho c_t M + theta (rho C(w) + mu K) for every component. With
   -flow_rheology the viscosity mu(g) varies with the rate of strain g (src/flow/material/rheology.h), is taken at the
   velocity of FlowSetRheologyVelocity, and the viscous term is the symmetric one, mu (grad u + grad u^T, grad v): S
   then has its part within a component, for the preconditioner, the operator is a matrix of all components, and
   outflow means that the stress sigma n is zero. Nodal arrays are [nnode_all][dim], velocity in length/time; pressure
   arrays [own cells] [dim + 1]. Boundary conditions: condition.h. */
#pragma once
#include "flow/condition.h"
#include "mesh/mesh.h"
#include "base/expr.h"
#include "base/rows.h"
#include "base/state.h"

typedef struct _p_Flow *Flow;

typedef struct {
  PetscReal density, viscosity; /* rho_f, mu (dynamic) */
  PetscReal gravity[3];  /* acts on bodies through M - M_f; the fluid's part is absorbed in the pressure. An expression
                           of t: that of the step, theta at its end + (1 - theta) at its beginning */
  PetscReal force[3];    /* body force per volume on the fluid, likewise, with that of FlowSetMeanPressureGradient; one
                           that depends on the position: FlowGetSource */
  PetscReal velocity[3]; /* at the start, where numbers give it */
  PetscInt  rate_axes;   /* bit mask of axes along which -flow_rate holds the mean velocity */
  PetscReal rate[3];     /* and the mean velocities there */
  PetscReal solvent;     /* viscosity of the gradient form alone, `viscosity` where the fluid is not viscoelastic */
  PetscReal matrix;      /* viscosity in the matrix of the step: solvent, with what stands for a part of the polymer */
  PetscBool convection;
  PetscReal skew;          /* factor of (div w) u in the convection: 0 convective, 1/2 skew-symmetric form */
  PetscInt  extrapolation; /* of the convecting velocity */
} FlowParameters;

enum { /* of FlowParameters.extrapolation, in the order of the option's words */
  FLOW_LINEAR,
  FLOW_QUADRATIC,
  FLOW_AUTO
};

typedef struct {
  PetscReal time, dt;   /* end of the step; its length */
  PetscReal dt_old;     /* length of the step before, 0: none */
  PetscReal ct, d0, d1; /* du/dt is c_t u - d with d(y) = d0 y^n + d1 y^{n-1} */
  PetscReal theta;
  PetscReal frame[3]; /* velocity of the whole mesh, FlowSetFrame */
  PetscInt  order;    /* of the scheme in this step: 1 or 2 */
  PetscReal error;    /* the scheme's local error over dt^(order + 1) and the derivative of that order (leading part;
                      fstheta: 0, not known) */
} FlowStep;

/* How the flow starts (-flow_initial). Shear: linear between two walls that face each other, of which one moves.
   Poiseuille: 4 s (1 - s) times -flow_velocity over each axis with walls on both sides (or what -flow_force drives
   between two walls), added to the shear of walls that move. Walls count with the velocity after their ramp, times the
   first number of their factor. Steady and run are set by the room run (run/start.h), which also makes what an
   expression or another run says free of divergence. */
typedef enum {
  FLOW_START_REST,
  FLOW_START_UNIFORM,
  FLOW_START_SHEAR,
  FLOW_START_POISEUILLE,
  FLOW_START_EXPRESSION,
  FLOW_START_STEADY,
  FLOW_START_RUN
} FlowInitial;

/* Read options, tabulate elements, allocate matrices and fields (at rest). Collective. Errors: unknown boundary names
   in options, slip on a boundary that is not a plane along an axis, inflow without velocity. */
PetscErrorCode FlowCreate(Mesh, Flow *);
/* The options of the fluid that scenes without a flow have as well: they stay as on entry where they are not given.
   gravity [dim]. *changing: NULL, or gravity as expressions of t, to be destroyed by the caller, with gravity that of
   the time 0. Collective. */
PetscErrorCode FlowReadFluid(PetscInt dim, PetscReal *density, PetscReal gravity[], Expr *changing);
PetscErrorCode FlowDestroy(Flow *);
/* The mesh has been rebuilt (mesh/carry.h): fields of both times are carried over, the scheme goes on. Values of
   ConditionsSetField, properties by cell and what owners have added are gone, since they belong to cells and nodes of
   the old mesh; whoever had some gives them again or takes them back before the next FlowRhs, which is an error
   without. Collective. */
PetscErrorCode FlowRemesh(Flow, Mesh old);
PetscErrorCode FlowView(Flow, PetscViewer);
PetscErrorCode FlowGetParameters(Flow, const FlowParameters **);
PetscErrorCode FlowGetMesh(Flow, Mesh *);
/* Density and viscosity by cell [ncell_all], own and ghost, borrowed until the next call; NULL: the number of the
   parameters, which stay the reference: the pressure contains density x gravity of that, and cells whose density
   differs have the force (rho - rho_ref) g. Again when values in the arrays have changed, and after FlowRemesh.
   Viscosities make the stress symmetric and the operator one of all components; whether there are any must be known
   before a solver is made. Collective. Errors: viscosities next to a matrix-free operator or -flow_rheology. */
PetscErrorCode FlowSetProperties(Flow, const PetscReal density[], const PetscReal viscosity[]);
/* What the stress is (-flow_rheology). Symmetric: mu (grad u + grad u^T) with a viscosity that varies, and an operator
   of all components (FlowGetComponents); otherwise mu grad u, with what a polymer or eddies add. Local. */
PetscBool FlowHasSymmetricStress(Flow);
PetscBool FlowIsViscoelastic(Flow);

/* Nodes of the n listed local cells (own and ghost) have moved, or cells became part of the fluid or left it.
   cell_material [ncell_all] is < 0 for inactive cells, no part of the fluid (no mass, no viscosity, no convection, no
   rows of B), else the number of a material (0 where there is one alone): a pressure is carried within the cells that
   stay active, and one that joins takes the mean of those around it that were, of its own material if there are any.
   What a number means for density and viscosity is the caller's to say (FlowSetProperties). Computes anew what depends
   on their shape; the fields in use must already hold their values at the new
   positions. Collective. Error: an active cell with a Jacobian that is not positive. */
PetscErrorCode FlowUpdateCells(Flow, PetscInt n, const PetscInt cells[], const PetscInt cell_material[]);
/* The same where the pressures already belong to the cells as they are now, as those of a checkpoint do. Collective. */
PetscErrorCode FlowRestoreCells(Flow, PetscInt n, const PetscInt cells[], const PetscInt cell_material[]);

/* Surfaces in the fluid, for laws that know how far they are (-flow_rheology smagorinsky): at n points x [n][dim],
   distance [n], zero inside, and velocity v [n][3] of the nearest surface replace what is there where it is nearer, and
   nearer than `reach`. Not collective. */
typedef PetscErrorCode (*FlowSurfaces)(void *owner, PetscReal reach, PetscInt n, const PetscReal x[],
                                       PetscReal distance[], PetscReal v[]);
/* From the next step on, of any number of owners (up to 8), each of which sees what those before it have found; the
   same owner again: in place of his last, NULL: none. The owner is borrowed. Not collective. */
PetscErrorCode FlowSetSurfaces(Flow, void *owner, FlowSurfaces);
/* Does the law ask for them? To others they are not told. */
PetscBool FlowSeesSurfaces(Flow);
/* How many cells away the law of -flow_rheology looks for them, 0: not at all. Before FlowCreate. Not collective. */
PetscErrorCode FlowFindReach(PetscInt *reach);
/* Kinematic viscosity of the eddies at the nodes, nu [nnode_all], zeros without large-eddy simulation: the mean over
   the cells around a node, weighted with its basis. Collective. */
PetscErrorCode FlowGetEddies(Flow, PetscReal nu[]);

/* Parts into which the scheme divides a time step, to be taken one after another: fraction [n], sum 1 (may be NULL). */
PetscErrorCode FlowGetSubsteps(Flow, PetscInt *n, const PetscReal *fraction[]);
/* Begin the step (or substep) that ends at time and has length dt: sets the coefficients. */
PetscErrorCode FlowBeginStep(Flow, PetscReal time, PetscReal dt);
PetscErrorCode FlowGetStep(Flow, const FlowStep **);
/* The velocity of the step before is no longer one that the present one goes on from (drops have merged, say): the next
   step, or after another FlowBeginStep this one, is of first order, as at the start. Not collective. */
PetscErrorCode FlowForgetHistory(Flow);
/* Steady problem in place of a step: theta = 1, dt = 0, convection with u^n until FlowSetConvection, c_t = rate of a
   pseudo-time that starts from u^n (0: none). */
PetscErrorCode FlowBeginSteady(Flow, PetscReal rate);
/* Add to that rate, for what is assembled from now on; *now: what it is then. Not collective. */
PetscErrorCode FlowAddRate(Flow, PetscReal more, PetscReal *now);
/* Bodies stay where they are: -flow_extrapolation auto may take the parabola. Not collective. */
PetscErrorCode FlowAllowParabola(Flow, PetscBool);
/* The nodes have come to their positions x^{n+1} at the end of the step with the velocity v = c_t x^{n+1} - d(x),
   [nnode_all][dim], as the scheme differentiates (borrowed until the next call): u^n and u^{n-1} count as values of
   these nodes, and w.grad u becomes (w - v).grad u (arbitrary Lagrangian-Eulerian form, convective: Hirt, Amsden &
   Cook 1974). Velocities linear in space that do not change in time are then kept exactly; a geometric conservation law
   is not needed, since nothing is integrated over the moving cells of two times. Boundary values and the source are
   taken at the new positions. After FlowBeginStep, in every step once it was called. Errors: schemes other than be and
   bdf2, no convection, skew form, quadratic extrapolation. Local. */
PetscErrorCode FlowSetMeshVelocity(Flow, const PetscReal v[]);
/* That of this step, NULL: the nodes stand still. Borrowed. */
PetscErrorCode FlowGetMeshVelocity(Flow, const PetscReal *v[]);
/* The whole mesh travels at v in this step (c_t X - d(X) of its displacement X): w.grad u becomes (w - v).grad u, as
   in FlowSetMeshVelocity and next to it, with every scheme. Velocities, conditions and the pressure stay those of the
   space in which it travels; what depends on the position sees that in the mesh. After FlowBeginStep, until the next
   call. Local. */
PetscErrorCode FlowSetFrame(Flow, const PetscReal v[3]);
/* Convecting velocity w of the next FlowAssemble, [nnode_all][dim] synced. Local. */
PetscErrorCode FlowSetConvection(Flow, const PetscReal w[]);

/* A uniform force per volume in addition to -flow_force, from the next FlowRhs on and in all that tells of the present
   solution. */
PetscErrorCode FlowSetMeanPressureGradient(Flow, const PetscReal force[3]);

/* Body force per volume that varies, in addition to -flow_force, taken at the nodes and interpolated; for verification.
   NULL: none. From the next FlowBeginStep on. */
PetscErrorCode FlowSetSource(Flow, VectorField, void *ctx);
/* Body force per volume of this step in addition to the parameters' force: of FlowSetSource, and of a -flow_force that
   depends on the position: [nnode_all][dim], NULL: none. Borrowed. */
PetscErrorCode FlowGetSource(Flow, const PetscReal *source[]);
/* What acts on openings of type pressure in this step, integrated: adds -int P n phi_i to r [nnode_all][dim], the part
   of own cells. After FlowRhs. Local. */
PetscErrorCode FlowAddTraction(Flow, PetscReal r[]);
PetscBool      FlowHasTraction(Flow);
/* -flow_force of this step at a point x [dim]: force [3]. */
PetscErrorCode FlowForceAt(Flow, const PetscReal x[], PetscReal force[3]);

/* How the flow starts; run: folder or file of -flow_initial_run (may be NULL). Borrowed. */
PetscErrorCode FlowGetInitial(Flow, FlowInitial *, const char *run[]);
/* Before the first step: the flow has this velocity, and before it (synced); p: the pressure, as a first guess (NULL:
   as it is). Local. */
PetscErrorCode FlowStartFrom(Flow, const PetscReal u[], const PetscReal p[]);

/* The boundary conditions, set to the time of the step. Borrowed. */
Conditions FlowConditions(Flow);

/* Assemble S for the step. Constant parts are kept; a Stokes flow with an unchanged step costs nothing. Collective. */
PetscErrorCode FlowAssemble(Flow);
/* What participants of a step add to the equations, each under its own name `owner` (any pointer that is nobody else's,
   up to 16): the same owner again replaces what it had, n = 0 or NULL removes it. All is borrowed and must stay valid;
   FlowRemesh removes all, and wants to hear of each owner again. Residuals, forces and diagnostics of this module do
   not contain any of it.
   Cell terms: of S, as matrices [n][nb][nb] of local cells, own and ghost (a cell may appear twice). Not collective. */
PetscErrorCode FlowAddCellTerms(Flow, const void *owner, PetscInt n, const PetscInt cell[], const PetscReal matrix[]);
/* Force, integrated with the basis [nnode_all][dim], the part of own cells: the sum over ranks is FlowRhs's. Not
   collective. */
PetscErrorCode FlowAddForce(Flow, const void *owner, const PetscReal force[]);
/* Operator of all components, in products next to S for every component. */
typedef struct {
  Mat              E;      /* own nodes x dim, component fastest */
  const PetscReal *lumped; /* [nnode_all] what stands for its diagonal in preconditioners (NULL: nothing) */
  const PetscReal *force;  /* [own nodes][dim] right-hand side that belongs to it (NULL: none) */
} FlowOperator;
/* The same owners in the same order on all ranks. The solver multiplies with it in its iterations, -flow_solver direct
   adds it to its matrix; other preconditioners from an assembled matrix do not know it. */
PetscErrorCode FlowAddOperator(Flow, const void *owner, const FlowOperator *);
PetscBool      FlowHasOperators(Flow);
/* y += E x of all, own nodes x dim. Collective. */
PetscErrorCode FlowMultiplyOperators(Flow, Vec x, Vec y);
/* A += E of all, A: an assembled matrix of the same rows. Collective. */
PetscErrorCode FlowAddOperatorsTo(Flow, Mat A);
/* Continuity of own cells that give way or have a source: B u + C p = g with C [n][dim + 1][dim + 1] (1/viscosity times
   volume), g [n][dim + 1], integrated with the basis of the pressure. A cell may appear twice. Borrowed. C needs
   -flow_solver direct. Not collective, but the same owners on all ranks. */
typedef struct {
  PetscInt         n;
  const PetscInt  *cell;
  const PetscReal *C, *g; /* NULL: none */
  PetscBool        any_C; /* on some rank: the constant pressure is determined */
} FlowVolume;
PetscErrorCode FlowAddVolume(Flow, const void *owner, const FlowVolume *);
/* Number i of them, if there are so many. */
PetscBool FlowGetVolume(Flow, PetscInt i, const FlowVolume **);
/* Sum of their `lumped` [nnode_all], NULL: there are none. Borrowed. */
PetscErrorCode FlowGetOperatorDiagonal(Flow, const PetscReal *diagonal[]);
/* Local cells, own and ghost, that bodies cover at least in part and are part of the fluid all the same (a cell may
   appear twice), until the next call: what -flow_rheology makes of the velocity there is replaced by that of the fluid
   next to them, continued. Nothing to do for a Newtonian fluid. Copied. Collective. */
PetscErrorCode FlowSetCutCells(Flow, PetscInt n, const PetscInt cell[]);
/* Steady problems: the viscosity of these cells goes with the velocity (UPDATE, the default), stays as evaluated last
   (FROZEN), or is evaluated once more, damped against oscillation, and then frozen (RELAXED). change: by how much the
   last evaluation wanted to change the stress there, over the largest stress in such cells (0: there are none, largest
   number: none since UPDATE); may be NULL. Not collective, the same on all ranks. */
typedef enum {
  CUT_UPDATE,
  CUT_FROZEN,
  CUT_RELAXED
} FlowCutViscosity;
PetscErrorCode FlowSetCutViscosity(Flow, FlowCutViscosity, PetscReal *change);
/* -flow_velocity_operator: matrix-free, FlowAssemble prepares FlowMultiply alone, and S is assembled when FlowGetMatrix
   asks for it; else FlowAssemble assembles it. */
PetscBool FlowIsMatrixFree(Flow);
/* S of the step. Borrowed; rows: own nodes. Collective. */
PetscErrorCode FlowGetMatrix(Flow, Mat *S);
/* Of the S that FlowGetMatrix gave: own columns, block[0], and those of other ranks, block[1] (NULL on one rank), with
   their global numbers. Borrowed. */
PetscErrorCode FlowGetMatrixBlocks(Flow, Mat block[2], const PetscInt *columns[]);
/* Rows of S of the step around marked nodes, marked [nnode_all], without that matrix, whatever the operator is: rows of
   own nodes, and of ghost nodes of own cells. The row of a marked node is complete; that of another one has its entries
   in the columns of marked nodes, and is empty where no cell has both. Columns are local nodes, ghosts too, unsorted.
   Ranks may mark what they like: nothing is exchanged. Costs the matrices of the cells with a marked node, and keeps
   12 bytes an entry (6 KB a cell where all nodes are marked: two thirds of what FlowGetMatrix takes). rows: n =
   nnode_all, no mat; borrowed, valid until the next call or FlowRemesh. After FlowAssemble. Local. */
PetscErrorCode FlowGatherRows(Flow, const PetscBool marked[], Rows *rows);
/* Matrix-free: y = S x for every component; x, y [own nodes][dim]; few: cells where x is zero are passed over, at the
   price of a look at the others. Collective. */
PetscErrorCode FlowMultiply(Flow, PetscBool few, const PetscReal x[], PetscReal y[]);
/* Diagonal of S, d [nnode_all], complete on own nodes. Collective. */
PetscErrorCode FlowGetDiagonal(Flow, PetscReal d[]);
/* r = right-hand side (rho d, v) + (f, v) - (1 - theta) (...)^n for all nodes, complete on own nodes. r
   [nnode_all][dim]. Collective. */
PetscErrorCode FlowRhs(Flow, PetscReal r[]);

/* y = B u (own cells), u synced [nnode_all][dim]. Local. */
PetscErrorCode FlowDivergence(Flow, const PetscReal u[], PetscReal y[]);
/* r = scale B^T p, complete on own nodes. Collective. */
PetscErrorCode FlowGradient(Flow, PetscReal scale, const PetscReal p[], PetscReal r[]);
/* Cell matrices of B, [ncell_all] blocks of [dim + 1][nb*dim], for operators built from B. Cells of one form (their
   matrices differ by round-off) share one. Borrowed; valid until cells change their shape. */
PetscErrorCode FlowGetCellDivergence(Flow, const PetscReal *const *b[]);
/* y += scale Mp^{-1} r with the mass matrix of the pressure (own cells), times mean viscosity of the cell over that of
   the parameters where it varies. Local. */
PetscErrorCode FlowPressureMassSolve(Flow, PetscReal scale, const PetscReal r[], PetscReal y[]);
/* Size h = volume^(1/dim) of the local cells [ncell_all]. */
PetscErrorCode FlowGetCellSize(Flow, const PetscReal *h[]);
/* Lumped mass (row sums of M, no density) [nnode_all]. */
PetscErrorCode FlowGetLumpedMass(Flow, const PetscReal *m[]);
/* The same weighted with density over that of the parameters, which times it is the lumped inertia; the very array of
   the former where density is constant. */
PetscErrorCode FlowGetInertialMass(Flow, const PetscReal *m[]);

/* Fields: u^n, u^{n-1} [nnode_all][dim] synced, p [own cells][dim + 1]. Writable for initial states. */
PetscErrorCode FlowGetFields(Flow, PetscReal *u[], PetscReal *u_old[], PetscReal *p[]);
/* Pressure as value and gradient: out [own cells][dim + 1] with p(x) = out_0 + out_1.. . (x - centre node). */
PetscErrorCode FlowGetPressureGradient(Flow, const PetscReal p[], PetscReal out[]);
/* Start value for the next step: u [nnode_all][dim] extrapolated in time, p of the last step, and dp, what the pressure
   changed by in the last step (zero in the first two; NULL: not wanted), for FlowSolverSolve. */
PetscErrorCode FlowExtrapolate(Flow, PetscReal u[], PetscReal p[], PetscReal dp[]);
/* Accept the solution of the step: shifts the history. u synced. */
PetscErrorCode FlowAcceptStep(Flow, const PetscReal u[], const PetscReal p[]);

/* StateVisit of a Flow: fields and the history of the time scheme. */
PetscErrorCode FlowVisitState(void *flow, State);

/* Pressure of cell c at the point x [dim], evaluated there also when it lies outside of the cell. Not collective. */
PetscErrorCode FlowCellPressure(Flow, PetscInt c, const PetscReal p[], const PetscReal x[], PetscReal *value);

/* With -flow_rheology, the velocity [nnode_all][dim] (synced) whose rate of strain sets the viscosity from the next
   FlowAssemble or FlowRhs on; until then that of the step: extrapolated to its point theta, u^n in a steady problem. A
   fluid that is at rest everywhere has, in a steady problem, the viscosity of the parameters. Local. */
PetscErrorCode FlowSetRheologyVelocity(Flow, const PetscReal v[]);
/* A yield stress and a power of the rate below 1 are regularised with a viscosity at rest of at most `rigid` times
   that of the parameters; *less: that is less than the options say (-flow_rheology_max_viscosity_ratio,
   -flow_rheology_viscosity_bounds), so that more is to follow. Other fluids: FALSE. Local. */
PetscErrorCode FlowSetRegularisation(Flow, PetscReal rigid, PetscBool *less);
/* Is there a yield stress? */
PetscBool FlowHasYield(Flow);
/* Is the viscosity at rest by -flow_rheology, as FlowSetRegularisation leaves it, above that of the parameters?
   Local. */
PetscBool FlowIsShearThinning(Flow);
/* The mean of the viscosity over each local cell [ncell_all] and around each local node [nnode_all]; NULL where it does
   not vary. May be NULL. Borrowed. Collective. */
PetscErrorCode FlowGetViscosity(Flow, const PetscReal *cell[], const PetscReal *node[]);
/* The velocity matrix of all components (own nodes x dim), that FlowAssemble has made where the viscosity varies; NULL
   elsewhere: S for each component is the whole operator. Borrowed. */
PetscErrorCode FlowGetComponents(Flow, Mat *A);
/* The same for any fluid, after FlowAssemble: S for every component, what couples them, and the terms of Newton's
   method at u [nnode_all][dim] (NULL: without). *A is the matrix of FlowGetComponents with other values. Collective. */
PetscErrorCode FlowAssembleComponents(Flow, const PetscReal u[], Mat *A);

/* What cell c adds to the momentum residual with the step's solution u, p: r [nb][dim]. Not collective. */
PetscErrorCode FlowCellResidual(Flow, PetscInt c, const PetscReal u[], const PetscReal p[], PetscReal r[]);
/* The same of n <= FLOW_CELLS cells at the price of little more than one: r [n][nb][dim] */
#define FLOW_CELLS 8
PetscErrorCode FlowCellResiduals(Flow, PetscInt n, const PetscInt cells[], const PetscReal u[], const PetscReal p[],
                                 PetscReal r[]);
/* What Newton's method adds to S: n [nb*dim][nb*dim] = rho theta int phi_i (phi_j du_a/dx_b + skew u_a dphi_j/dx_b),
   row (i, a), column (j, b), of cell c; where the viscosity varies also theta (mu grad u^T, grad v) and what its
   derivative adds, which is all there is for u = NULL but for the derivative. Not collective. */
PetscErrorCode FlowCellNewton(Flow, PetscInt c, const PetscReal u[], PetscReal n[]);
/* *power = int mu du_b/dx_a ds_a/dx_b over cell c, u that of the point theta of the step, s [nb][dim] at the nodes of
   the cell: by this much the power of the whole stress on s exceeds that of the residual in gradient form; 0 where that
   has the symmetric stress. Not collective. */
PetscErrorCode FlowCellTransposedPower(Flow, PetscInt c, const PetscReal u[], const PetscReal s[], PetscReal *power);
/* Integral over cell c of -sigma_sym . grad(alpha) and of its moment about X, alpha [nb] nodal: adds to force [3],
   torque [3]. Not collective. */
PetscErrorCode FlowCellStressForce(Flow, PetscInt c, const PetscReal u[], const PetscReal p[], const PetscReal alpha[],
                                   const PetscReal X[3], PetscReal force[3], PetscReal torque[3]);

typedef struct {
  PetscReal cfl;                           /* largest |u| dt / h over cells */
  PetscReal divergence;                    /* L2 norm of the cell means of div u, less what owners impose */
  PetscReal kinetic_energy;                /* 1/2 rho int |u|^2 */
  PetscReal change[3], flux[3], driven[3]; /* rho int (c_t u - d), rho int w.grad u_theta and int f over the fluid:
                                              walls and bodies must supply change + flux - driven - traction */
  PetscReal traction[3];                   /* -int P n over openings of type pressure */
  PetscReal velocity[3], volume;           /* int u, int 1 over it */
  PetscReal speed_max;
  PetscReal cell_reynolds; /* largest of |u| h/nu, infinite without viscosity */
} FlowDiagnostics;
/* Viscoelastic fluids (src/flow/material/conformation.h), of the step's solution; all over the fluid */
typedef struct {
  PetscReal energy; /* free energy of the polymer, 0 at rest */
  PetscReal trace;  /* largest trace of the conformation (three axes; 3 at rest) */
  PetscReal c_min;  /* its smallest eigenvalue */
} FlowElasticity;
/* As the last FlowDiagnose found it; NULL: the fluid is not viscoelastic. Borrowed. */
PetscErrorCode FlowGetElasticity(Flow, const FlowElasticity **);
/* Logarithm of the conformation at the beginning of the step, [nnode_all][2 dim]: xx yy xy zz in the plane, xx yy zz xy
   xz yz in space; NULL: none. shift (may be NULL): by how much it is more, at nodes that have gone with the surface of
   a body, than at the point of the surface that has come there; such points keep theirs in the step. 0 after it. Both
   writable, synced. */
PetscErrorCode FlowGetLogConformation(Flow, PetscReal *psi[], PetscReal *shift[]);
/* The conformation itself, c [nnode_all][6]: xx xy xz yy yz zz. Error: the fluid is not viscoelastic. Local. */
PetscErrorCode FlowGetConformation(Flow, PetscReal c[]);
/* Where the accepted steady solution is wrong: eta [own cells], what its residual and the jumps of its stress amount to
   in a cell, as an error of the velocity gradient times sqrt(mu); fluid [own cells]: which cells count, eta is 0 in
   others; *relative: root of the sum of the squares over that of the dissipation. Collective. Error: no viscosity. */
PetscErrorCode FlowEstimate(Flow, const PetscBool fluid[], PetscReal eta[], PetscReal *relative);
/* Of the solution u (synced), p of the step, before FlowAcceptStep; p may be NULL where no owner has C (FlowAddVolume).
   Collective. */
PetscErrorCode FlowDiagnose(Flow, const PetscReal u[], const PetscReal p[], FlowDiagnostics *);
/* L2 norm of the cell means of the gradient of u (synced), all components: what their divergence is compared with.
   Collective. */
PetscErrorCode FlowGetGradientNorm(Flow, const PetscReal u[], PetscReal *norm);
/* The momentum equation of the step tested with v */
typedef struct {
  PetscReal
    inertia; /* rho int v . (c_t u - d + w.grad v): what the kinetic energy grows by a time and what flows out of
                        it, but for the errors of scheme and convection */
  PetscReal viscous; /* mu int grad v : grad (theta u + (1 - theta) u^n), with constant mu */
  PetscReal terms;   /* v . (FlowAddCellTerms u) */
} FlowPower;
/* As FlowDiagnose; v as u, [nnode_all][dim]. Costs some four products with S. Collective. */
PetscErrorCode FlowGetPower(Flow, const PetscReal u[], const PetscReal v[], FlowPower *);
