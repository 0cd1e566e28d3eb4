/* Flow: the incompressible Navier-Stokes equations on the mesh, without bodies and without solvers. Called by run
   (scene set-up, restart), couple (one step, what its participants add), solve (operators), report (diagnostics).

   Equations, elements, time schemes and forms of the convection: src/flow/README.md, "Equations and schemes".
   Conditions on boundaries: condition.h. Arrays on a device: device.h.

   Shapes: nodal arrays are [nnode_all][dim], own nodes first, then ghosts; synced: ghosts have the values of their
   owners. Pressure arrays are [own cells][dim + 1]: coefficients of 1 and of (x - xc)/hc, an axis each.
   Units: those of the scene. Velocity in length/time, density in mass/length^3, dynamic viscosity in mass/(length
   time), forces per volume. Matrices and right-hand sides are integrated with the basis.
   Ownership: borrowed pointers belong to the flow (results) or to the caller (arguments), and are valid until the flow
   is destroyed or FlowRemesh is called, unless something else is said. NULL is allowed only where it is mentioned.
   Collective: on the communicator of the mesh. Local: without communication; so are functions that say neither.
   Errors are raised on all ranks. */
#pragma once
#include "flow/condition.h"
#include "mesh/mesh.h"
#include "base/expr.h"
#include "base/rows.h"
#include "base/state.h"

typedef struct _p_Flow *Flow;

/* ---- parameters and states ---- */

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

/* How the flow starts (-flow_initial; src/flow/initial.c). Steady and run are set by the room run (run/start.h), which
   also makes what an expression or another run says free of divergence. */
typedef enum {
  FLOW_START_REST,
  FLOW_START_UNIFORM,
  FLOW_START_SHEAR,
  FLOW_START_POISEUILLE,
  FLOW_START_EXPRESSION,
  FLOW_START_STEADY,
  FLOW_START_RUN
} FlowInitial;

/* ---- set-up of a scene: run, tests ---- */

/* The options of the fluid that scenes without a flow have as well: they stay as on entry where they are not given.
   gravity [dim]. *changing: NULL, or gravity as expressions of t, to be destroyed by the caller, with gravity that of
   the time 0. Collective. */
PetscErrorCode FlowReadFluid(PetscInt dim, PetscReal *density, PetscReal gravity[], Expr *changing);
/* *reach: number of cells beyond its own within which a rank must know surfaces for the law of -flow_rheology, 0: none.
   Before FlowCreate. Local. */
PetscErrorCode FlowFindReach(PetscInt *reach);
/* Read options, tabulate elements, allocate matrices and fields (at rest). Collective. Errors: unknown boundary names
   in options, slip on a boundary that is not a plane along an axis, inflow without velocity. */
PetscErrorCode FlowCreate(Mesh, Flow *);
/* Frees the flow and sets it to NULL; nothing happens with NULL. Collective. */
PetscErrorCode FlowDestroy(Flow *);
/* Prints fluid, scheme and boundary conditions. Collective. */
PetscErrorCode FlowView(Flow, PetscViewer);
/* Borrowed; values change where the scene gives expressions of t (FlowBeginStep). Local. */
PetscErrorCode FlowGetParameters(Flow, const FlowParameters **);
/* Borrowed. Local. */
PetscErrorCode FlowGetMesh(Flow, Mesh *);
/* Boundary conditions, set to the time of the step. Borrowed. Local. */
Conditions FlowConditions(Flow);
/* -flow_initial; *run (may be NULL): folder or file of -flow_initial_run. Borrowed. Local. */
PetscErrorCode FlowGetInitial(Flow, FlowInitial *, const char *run[]);
/* Sets the initial state: velocity u and, in the past, the same u (synced); p: first guess of the pressure (NULL:
   unchanged). Before the first step. Local. */
PetscErrorCode FlowStartFrom(Flow, const PetscReal u[], const PetscReal p[]);
/* Body force per volume that varies, in addition to -flow_force, interpolated from the nodes; for verification. NULL:
   none. ctx is borrowed. From the next FlowBeginStep on. Local. */
PetscErrorCode FlowSetSource(Flow, VectorField, void *ctx);

/* ---- one step, in the order of the calls: run, couple ---- */

/* Substeps of a time step (1, or 3 with fstheta): *fraction [n] of dt, sum 1 (may be NULL). Borrowed. Local. */
PetscErrorCode FlowGetSubsteps(Flow, PetscInt *n, const PetscReal *fraction[]);
/* Begins the step (or substep) of length dt that ends at `time`: coefficients of the scheme, conditions and forces of
   that time. Collective. Errors: an expression of the scene that is not finite. */
PetscErrorCode FlowBeginStep(Flow, PetscReal time, PetscReal dt);
/* Begins a steady problem in place of a step: theta = 1, dt = 0, convection with u^n until FlowSetConvection, c_t =
   `rate` of a pseudo-time step from u^n (0: none). Collective. */
PetscErrorCode FlowBeginSteady(Flow, PetscReal rate);
/* Adds `more` to c_t of FlowBeginSteady for what is assembled from now on; *now: the sum. Local. */
PetscErrorCode FlowAddRate(Flow, PetscReal more, PetscReal *now);
/* Coefficients of the present step. Borrowed, valid until the next FlowBeginStep. Local. */
PetscErrorCode FlowGetStep(Flow, const FlowStep **);
/* The velocity of the step before is no longer one that the present one goes on from (drops have merged, say): the next
   step, or after another FlowBeginStep this one, is of first order, as at the start. Not collective. */
PetscErrorCode FlowForgetHistory(Flow);
/* The whole mesh travels at v in this step: README, "Meshes that move". After FlowBeginStep, until the next call.
   Local. */
PetscErrorCode FlowSetFrame(Flow, const PetscReal v[3]);
/* The nodes have come to their positions x^{n+1} at the end of the step with the velocity v = c_t x^{n+1} - d(x),
   [nnode_all][dim] (borrowed until the next call or FlowRemesh): README, "Meshes that move". After FlowBeginStep, in
   every step once it was called. Errors: schemes other than be and bdf2, no convection, skew form, quadratic
   extrapolation. Local. */
PetscErrorCode FlowSetMeshVelocity(Flow, const PetscReal v[]);
/* Velocity of the nodes in this step, NULL: they do not move. Borrowed. Local. */
PetscErrorCode FlowGetMeshVelocity(Flow, const PetscReal *v[]);
/* No body moves: -flow_extrapolation auto may use the quadratic extrapolation. Local. */
PetscErrorCode FlowAllowParabola(Flow, PetscBool);
/* Initial guesses of the next step: u extrapolated in time, p of the last step, dp: change of the pressure in the last
   step, for FlowSolverSolve (zero in the first two; NULL: not wanted). Filled in. Local. */
PetscErrorCode FlowExtrapolate(Flow, PetscReal u[], PetscReal p[], PetscReal dp[]);
/* Convecting velocity w of the next FlowAssemble, synced. Copied. Local. */
PetscErrorCode FlowSetConvection(Flow, const PetscReal w[]);
/* With -flow_rheology, the velocity [nnode_all][dim] (synced) whose rate of strain sets the viscosity from the next
   FlowAssemble or FlowRhs on; until then that of the step: extrapolated to its point theta, u^n in a steady problem. A
   fluid that is at rest everywhere has, in a steady problem, the viscosity of the parameters. Local. */
PetscErrorCode FlowSetRheologyVelocity(Flow, const PetscReal v[]);
/* Assembles S (or prepares FlowMultiply) for the step. Parts that did not change are kept. Collective. */
PetscErrorCode FlowAssemble(Flow);
/* r = right-hand side (rho d, v) + (f, v) - (1 - theta) (...)^n for all nodes, complete on own nodes. r
   [nnode_all][dim]. Collective. */
PetscErrorCode FlowRhs(Flow, PetscReal r[]);
/* Accepts the solution u (synced), p of the step: the history of the scheme moves on. Collective. */
PetscErrorCode FlowAcceptStep(Flow, const PetscReal u[], const PetscReal p[]);
/* u^n, u^{n-1} (synced) and p; any may be NULL. Writable for initial states. Borrowed, valid until the next
   FlowAcceptStep. Local. */
PetscErrorCode FlowGetFields(Flow, PetscReal *u[], PetscReal *u_old[], PetscReal *p[]);

/* ---- what participants of a step add: couple ----

   Each adds under its own name `owner`: any pointer that is nobody else's, up to 16 owners. The same owner again
   replaces what it had; n = 0 or NULL removes it. All arrays are borrowed and must stay valid. FlowRemesh removes
   everything, and each owner adds again, or calls with NULL, before the next FlowRhs (an error otherwise). Residuals,
   forces and diagnostics of this module contain none of it. */

/* Terms of S: matrices [n][nb][nb] of local cells, own and ghost; a cell may appear twice. Local. */
PetscErrorCode FlowAddCellTerms(Flow, const void *owner, PetscInt n, const PetscInt cell[], const PetscReal matrix[]);
/* lumped [nnode_all], borrowed: what of the same terms counts as mass for the pressure, complete on all nodes. After
   FlowAddCellTerms, on ranks without terms too. Local. */
PetscErrorCode FlowCountCellTerms(Flow, const void *owner, const PetscReal lumped[]);
/* Force, integrated with the basis, [nnode_all][dim]: contributions of own cells; FlowRhs sums over ranks. Local. */
PetscErrorCode FlowAddForce(Flow, const void *owner, const PetscReal force[]);
/* *given [nnode_all][dim], to be freed: these forces less the products of the terms with u (synced), of all owners but
   `except` (NULL: of all), contributions of own cells; NULL if there are none. Whoever sums residuals at nodes with a
   prescribed velocity takes it from them. Local. */
PetscErrorCode FlowGetGiven(Flow, const void *except, const PetscReal u[], PetscReal *given[]);

/* Operator of all components, in products next to S for every component. */
typedef struct {
  Mat              E;         /* own nodes x dim, component fastest; with P: rows of the owner's own */
  Mat              P;         /* from own nodes x dim to these rows, MATMAIJ; the operator is P^T E P (NULL: E) */
  const PetscReal *lumped;    /* [nnode_all] inertia that the owner has among cell terms, for the lumped mass of
                              preconditioners (NULL: none) */
  const PetscReal *force;     /* [own nodes][dim] right-hand side that belongs to it (NULL: none) */
  PetscBool        compliant; /* it is no more than a few times the flow's viscous part: it needs no block */
  PetscBool        stiff;     /* so much more, where its solid cuts cells, that their pressures need factors too */
} FlowOperator;
/* Adds it to the operator; the same owners in the same order on all ranks. The solver multiplies with it in its
   iterations, with P, E, P^T one after the other: P^T E P may have several times their entries. That is made where a
   matrix is needed: -flow_solver direct adds it to its own; others factorise the nodes that it has entries at
   (solve/solidblock.h) where it is not compliant. Collective. */
PetscErrorCode FlowAddOperator(Flow, const void *owner, const FlowOperator *);

/* Continuity of own cells that give way or have a source: B u + C p = g with C [n][dim + 1][dim + 1] (1/viscosity times
   volume), g [n][dim + 1], integrated with the basis of the pressure. A cell may appear twice. Borrowed. C needs
   -flow_solver direct. Local, with the same owners on all ranks. */
typedef struct {
  PetscInt         n;
  const PetscInt  *cell;
  const PetscReal *C, *g; /* NULL: none */
  PetscBool        any_C; /* on some rank: the constant pressure is determined */
} FlowVolume;
/* Adds terms of continuity; the same owners on all ranks. C needs -flow_solver direct. Local. */
PetscErrorCode FlowAddVolume(Flow, const void *owner, const FlowVolume *);
/* Density and viscosity by cell [ncell_all], own and ghost, borrowed until the next call; NULL: the number of the
   parameters, which stay the reference: the pressure contains density x gravity of that, and cells whose density
   differs have the force (rho - rho_ref) g. Again when values in the arrays have changed, and after FlowRemesh.
   Viscosities make the stress symmetric and the operator one of all components: set before a solver is made.
   Collective. Errors: viscosities next to a matrix-free operator or -flow_rheology. */
PetscErrorCode FlowSetProperties(Flow, const PetscReal density[], const PetscReal viscosity[]);
/* Uniform force per volume [3] in addition to -flow_force, from the next FlowRhs on and in all diagnostics of the
   present solution. Copied. Local. */
PetscErrorCode FlowSetMeanPressureGradient(Flow, const PetscReal force[3]);

/* ---- cells that move or become inactive: couple ---- */

/* Nodes of the n listed local cells (own and ghost) have moved, or cells became part of the fluid or left it.
   cell_material [ncell_all] < 0: inactive, no part of the fluid; else the number of a material, within which pressures
   are carried (README, "Meshes that move"). Computes anew what depends on their shape; the fields in use must already
   hold their values at the new positions. Collective. Error: an active cell with a Jacobian that is not positive. */
PetscErrorCode FlowUpdateCells(Flow, PetscInt n, const PetscInt cells[], const PetscInt cell_material[]);
/* As FlowUpdateCells, for pressures that already belong to the cells as they are now (from a checkpoint).
   Collective. */
PetscErrorCode FlowRestoreCells(Flow, PetscInt n, const PetscInt cells[], const PetscInt cell_material[]);

/* ---- the stress of the fluid (-flow_rheology): couple, run ---- */

/* TRUE: the stress is mu (grad u + grad u^T) with a viscosity that varies, and the operator is that of all components
   (FlowGetComponents). FALSE: mu grad u, with the stress of a polymer or of eddies added. Local. */
PetscBool FlowHasSymmetricStress(Flow);
/* Is there a conformation (FlowGetConformation)? Local. */
PetscBool FlowIsViscoelastic(Flow);
/* Is there a yield stress? Local. */
PetscBool FlowHasYield(Flow);
/* Is the viscosity at zero rate, as FlowSetRegularisation leaves it, above that of the parameters? Local. */
PetscBool FlowIsShearThinning(Flow);
/* A yield stress and a power of the rate below 1 are regularised with a viscosity at rest of at most `rigid` times
   that of the parameters; *less: less than the options say, so that more is to follow. Other fluids: FALSE. Local. */
PetscErrorCode FlowSetRegularisation(Flow, PetscReal rigid, PetscBool *less);
/* Local cells, own and ghost, that bodies cover at least in part and are part of the fluid all the same (a cell may
   appear twice), until the next call: what -flow_rheology makes of the velocity there is replaced by that of the fluid
   next to them, continued. Nothing to do for a Newtonian fluid. Copied. Collective. */
PetscErrorCode FlowSetCutCells(Flow, PetscInt n, const PetscInt cell[]);

/* Steady problems: the viscosity of these cells goes with the velocity (UPDATE, the default), stays as it is (FROZEN),
   or is evaluated once more, damped, and then frozen (RELAXED). change: what the last evaluation wanted to change of
   the stress there, over the largest one (0: no such cells, largest number: none since UPDATE); may be NULL. Local, the
   same on all ranks. */
typedef enum {
  CUT_UPDATE,
  CUT_FROZEN,
  CUT_RELAXED
} FlowCutViscosity;
PetscErrorCode FlowSetCutViscosity(Flow, FlowCutViscosity, PetscReal *change);
/* Surfaces in the fluid, for laws that know how far they are (-flow_rheology smagorinsky): at n points x [n][dim],
   distance [n], zero inside, and velocity v [n][3] of the nearest surface replace what is there where it is nearer, and
   nearer than `reach`. Local. */
typedef PetscErrorCode (*FlowSurfaces)(void *owner, PetscReal reach, PetscInt n, const PetscReal x[],
                                       PetscReal distance[], PetscReal v[]);
/* Surfaces of this owner from the next step on, up to 8 owners. They are asked in the order of their first call, each
   with the result of those before it. The same owner again replaces its own, NULL removes it. The owner is borrowed.
   Local. */
PetscErrorCode FlowSetSurfaces(Flow, void *owner, FlowSurfaces);
/* Does the law of -flow_rheology ask for surfaces? If not, FlowSetSurfaces has no effect. Local. */
PetscBool FlowSeesSurfaces(Flow);
/* Kinematic viscosity of the eddies at the nodes, nu [nnode_all], zeros without large-eddy simulation: the mean over
   the cells around a node, weighted with its basis. Collective. */
PetscErrorCode FlowGetEddies(Flow, PetscReal nu[]);
/* The mean of the viscosity over each local cell [ncell_all] and around each local node [nnode_all]; NULL where it does
   not vary. May be NULL. Borrowed. Collective. */
PetscErrorCode FlowGetViscosity(Flow, const PetscReal *cell[], const PetscReal *node[]);
/* Logarithm of the conformation at the beginning of the step, [nnode_all][2 dim]: xx yy xy zz in the plane, xx yy zz xy
   xz yz in space; NULL: none. shift (may be NULL): by how much it is more, at nodes that have gone with the surface of
   a body, than at the point of the surface that has come there; such points keep theirs in the step. 0 after it. Both
   writable, synced. */
PetscErrorCode FlowGetLogConformation(Flow, PetscReal *psi[], PetscReal *shift[]);
/* The conformation itself, c [nnode_all][6]: xx xy xz yy yz zz. Error: the fluid is not viscoelastic. Local. */
PetscErrorCode FlowGetConformation(Flow, PetscReal c[]);

/* Viscoelastic fluids (src/flow/material/conformation.h), of the step's solution; all over the fluid */
typedef struct {
  PetscReal energy; /* free energy of the polymer, 0 at rest */
  PetscReal trace;  /* largest trace of the conformation (three axes; 3 at rest) */
  PetscReal c_min;  /* its smallest eigenvalue */
} FlowElasticity;
/* Of the last FlowDiagnose; NULL: the fluid is not viscoelastic. Borrowed. Local. */
PetscErrorCode FlowGetElasticity(Flow, const FlowElasticity **);

/* ---- forces and residuals: couple ---- */

/* Body force per volume of this step that varies: of FlowSetSource, and of a -flow_force that depends on the position.
   NULL: none. Borrowed. Local. */
PetscErrorCode FlowGetSource(Flow, const PetscReal *source[]);
/* -flow_force of this step at a point x [dim], with all that drives the flow: force [3]. Local. Error: not finite. */
PetscErrorCode FlowForceAt(Flow, const PetscReal x[], PetscReal force[3]);
/* Adds -int P n phi_i over openings of type pressure in this step to r [nnode_all][dim], contributions of own cells.
   After FlowRhs. Local. */
PetscErrorCode FlowAddTraction(Flow, PetscReal r[]);
/* Are there openings of type pressure? Local. */
PetscBool FlowHasTraction(Flow);
/* r [nb][dim] = contribution of cell c to the momentum residual of the solution u, p of the step. Local. */
PetscErrorCode FlowCellResidual(Flow, PetscInt c, const PetscReal u[], const PetscReal p[], PetscReal r[]);
#define FLOW_CELLS 8
/* The same of n <= FLOW_CELLS cells, r [n][nb][dim], at little more than the cost of one. Local. */
PetscErrorCode FlowCellResiduals(Flow, PetscInt n, const PetscInt cells[], const PetscReal u[], const PetscReal p[],
                                 PetscReal r[]);
/* *power = int mu du_b/dx_a ds_a/dx_b over cell c, u that of the point theta of the step, s [nb][dim] at the nodes of
   the cell: by this much the power of the whole stress on s exceeds that of the residual in gradient form; 0 where that
   has the symmetric stress. Local. */
PetscErrorCode FlowCellTransposedPower(Flow, PetscInt c, const PetscReal u[], const PetscReal s[], PetscReal *power);
/* Integral over cell c of -sigma_sym . grad(alpha) and of its moment about X, alpha [nb] nodal: adds to force [3],
   torque [3]. Local. */
PetscErrorCode FlowCellStressForce(Flow, PetscInt c, const PetscReal u[], const PetscReal p[], const PetscReal alpha[],
                                   const PetscReal X[3], PetscReal force[3], PetscReal torque[3]);
/* Pressure of cell c at the point x [dim], evaluated there also when it lies outside of the cell. Local. */
PetscErrorCode FlowCellPressure(Flow, PetscInt c, const PetscReal p[], const PetscReal x[], PetscReal *value);

/* ---- operators: solve ---- */

/* -flow_velocity_operator: matrix-free, FlowAssemble prepares FlowMultiply alone, and S is assembled when FlowGetMatrix
   asks for it; else FlowAssemble assembles it. */
PetscBool FlowIsMatrixFree(Flow);
/* S of the step, rows of own nodes. Borrowed, valid until the next FlowAssemble. Collective. */
PetscErrorCode FlowGetMatrix(Flow, Mat *S);
/* Of the S that FlowGetMatrix gave: own columns, block[0], and those of other ranks, block[1] (NULL on one rank), with
   their global numbers. Borrowed. */
PetscErrorCode FlowGetMatrixBlocks(Flow, Mat block[2], const PetscInt *columns[]);
/* Rows of S of the step around marked nodes, marked [nnode_all], without that matrix: of own nodes, and of ghost nodes
   of own cells. The row of a marked node is complete, that of another one has the columns of marked nodes. Columns are
   local nodes, unsorted. rows: n = nnode_all, no mat; borrowed, valid until the next call or FlowRemesh. Costs and
   memory: src/flow/rows.c. After FlowAssemble. Local. */
PetscErrorCode FlowGatherRows(Flow, const PetscBool marked[], Rows *rows);
/* Matrix-free: y = S x for every component; x, y [own nodes][dim]; few: cells where x is zero are passed over, at the
   price of a look at the others. Collective. */
PetscErrorCode FlowMultiply(Flow, PetscBool few, const PetscReal x[], PetscReal y[]);
/* Diagonal of S, d [nnode_all], complete on own nodes. Collective. */
PetscErrorCode FlowGetDiagonal(Flow, PetscReal d[]);
/* The velocity matrix of all components (own nodes x dim), that FlowAssemble has made where the viscosity varies; NULL
   elsewhere: S for each component is the whole operator. Borrowed. */
PetscErrorCode FlowGetComponents(Flow, Mat *A);
/* For any fluid, after FlowAssemble: S for every component, the coupling of components, and the terms of Newton's
   method at u (synced; NULL: without). *A is the matrix of FlowGetComponents with other values; borrowed.
   Collective. */
PetscErrorCode FlowAssembleComponents(Flow, const PetscReal u[], Mat *A);
/* What Newton's method adds to S: n [nb*dim][nb*dim] = rho theta int phi_i (phi_j du_a/dx_b + skew u_a dphi_j/dx_b),
   row (i, a), column (j, b), of cell c; where the viscosity varies also theta (mu grad u^T, grad v) and what its
   derivative adds. u = NULL: theta (mu grad u^T, grad v) alone. Local. */
PetscErrorCode FlowCellNewton(Flow, PetscInt c, const PetscReal u[], PetscReal n[]);
/* Has any owner an operator (FlowAddOperator)? Local. */
PetscBool FlowHasOperators(Flow);
/* Is any of them stiff? Local, on all ranks the same. */
PetscBool FlowHasStiffOperators(Flow);
/* marked [own nodes] = true where any that is not compliant has an entry that is not 0. Collective. */
PetscErrorCode FlowMarkOperators(Flow, PetscBool marked[]);
/* y += sum of the owners' operators times x; own nodes x dim. Collective. */
PetscErrorCode FlowMultiplyOperators(Flow, Vec x, Vec y);
/* A += sum of the owners' operators; A: an assembled matrix of the same rows. Collective. */
PetscErrorCode FlowAddOperatorsTo(Flow, Mat A);
/* Sum of the owners' `lumped` [nnode_all], of operators and terms, NULL: there are none. Borrowed. Local. */
PetscErrorCode FlowGetOperatorDiagonal(Flow, const PetscReal *diagonal[]);
/* The i-th owner's terms of continuity; FALSE: there are no more. Borrowed. Local. */
PetscBool FlowGetVolume(Flow, PetscInt i, const FlowVolume **);
/* y = B u on own cells [own cells][dim + 1], u synced. Local. */
PetscErrorCode FlowDivergence(Flow, const PetscReal u[], PetscReal y[]);
/* r = scale B^T p, [nnode_all][dim], complete on own nodes. Collective. */
PetscErrorCode FlowGradient(Flow, PetscReal scale, const PetscReal p[], PetscReal r[]);
/* Cell matrices of B, [ncell_all] blocks of [dim + 1][nb*dim], for operators built from B. Cells of one form (their
   matrices differ by round-off) share one. Borrowed; valid until cells change their shape. */
PetscErrorCode FlowGetCellDivergence(Flow, const PetscReal *const *b[]);
/* y += scale Mp^{-1} r with the mass matrix of the pressure (own cells), times mean viscosity of the cell over that of
   the parameters where it varies. Local. */
PetscErrorCode FlowPressureMassSolve(Flow, PetscReal scale, const PetscReal r[], PetscReal y[]);
/* Size h = volume^(1/dim) of the local cells [ncell_all]. Borrowed. Local. */
PetscErrorCode FlowGetCellSize(Flow, const PetscReal *h[]);
/* Row sums of M, without density, [nnode_all]. Borrowed. Local. */
PetscErrorCode FlowGetLumpedMass(Flow, const PetscReal *m[]);
/* Masses of the nodes for preconditioners, [nnode_all]: row sums of M weighted with density over that of the
   parameters, the array of FlowGetLumpedMass where the density is constant. Where they are hardly positive or negative,
   in flat corners beside a light fluid, masses in proportion to the diagonal of M. Borrowed. Local. */
PetscErrorCode FlowGetInertialMass(Flow, const PetscReal *m[]);

/* ---- diagnostics and output: run, report ---- */

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
/* Of the solution u (synced), p of the step, before FlowAcceptStep; p may be NULL where no owner has C (FlowAddVolume).
   Where fields stay on a device (device.h) both NULL: of the solution there. Collective. */
PetscErrorCode FlowDiagnose(Flow, const PetscReal u[], const PetscReal p[], FlowDiagnostics *);
/* L2 norm of the cell means of grad u (u synced), all components; FlowDiagnostics.divergence is compared with it. Where
   fields stay on a device NULL: of u^n there. Collective. */
PetscErrorCode FlowGetGradientNorm(Flow, const PetscReal u[], PetscReal *norm);

/* The momentum equation of the step tested with v */
typedef struct {
  /* rho int v . (c_t u - d + w.grad v): growth of the kinetic energy a time and what flows out of it, apart from errors
     of scheme and convection */
  PetscReal inertia;
  PetscReal viscous; /* mu int grad v : grad (theta u + (1 - theta) u^n), with constant mu */
  PetscReal terms;   /* v . (FlowAddCellTerms u) */
} FlowPower;
/* As FlowDiagnose, for a test velocity v (synced). Costs about four products with S. Collective. */
PetscErrorCode FlowGetPower(Flow, const PetscReal u[], const PetscReal v[], FlowPower *);
/* Where the accepted steady solution is wrong: eta [own cells], what its residual and the jumps of its stress amount to
   in a cell, as an error of the velocity gradient times sqrt(mu); fluid [own cells]: which cells count, eta is 0 in
   others; *relative: root of the sum of the squares over that of the dissipation. Collective. Error: no viscosity. */
PetscErrorCode FlowEstimate(Flow, const PetscBool fluid[], PetscReal eta[], PetscReal *relative);
/* Pressure as value and gradient: out [own cells][dim + 1], p(x) = out_0 + sum_a out_a (x_a - centre_a) with the centre
   node of the cell. Local. */
PetscErrorCode FlowGetPressureGradient(Flow, const PetscReal p[], PetscReal out[]);

/* ---- restart and new meshes: run ---- */

/* The mesh has been rebuilt (mesh/carry.h): fields of both times are carried over, the scheme goes on. Values of
   ConditionsSetField, properties by cell and what owners have added are removed; whoever had some gives them again or
   takes them back before the next FlowRhs, which is an error without. Collective. */
PetscErrorCode FlowRemesh(Flow, Mesh old);
/* StateVisit of a Flow: fields and history of the time scheme. Collective. */
PetscErrorCode FlowVisitState(void *flow, State);
