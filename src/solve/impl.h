/* Inside of FlowSolver; for its files only. system.c: life cycle, set-up, solve. fields.c: vectors of the system and
   their parts. rhs.c: its right-hand side. settings.c: what is asked for. choice.c: what a step takes. stop.c: how
   far the outer iteration goes. shift.c: start value of the pressure. precondition.c: the projection
   preconditioner. operator.c: products with the operators of the system. near.c: rows of the velocity matrix around
   bodies. integrals.c: mean velocities and others held by forces. conserve.c: the balance of momentum. nonlinear.c: for
   solvers of nonlinear problems. On a device: ondevice.c, devicestep.c, devicebodies.c, devicesums.c,
   deviceimpulse.c. */
#pragma once
#include "solve/system.h"
#include "pressure/pressure.h"
#include "devicevec.h"
#include "relax.h"
#include "rigid/rigid.h"
#include "twostage.h"

/* Diagonal entries of A in the sweeps, at least, in lumped masses: convection that the mesh does not resolve takes from
   the entry, and would leave nothing or less (runs/studies/flow-solver) */
#define MIN_DIAGONAL 0.1

/* -flow_solver, in its order */
typedef enum {
  SOLVER_FAST,
  SOLVER_BALANCED,
  SOLVER_ACCURATE,
  SOLVER_DIRECT
} SolverKind;

/* What follows the solves for velocity and pressure: -flow_schur, in its order, and what auto may also choose */
typedef enum {
  SCHUR_AUTO,
  SCHUR_PROJECTION,
  SCHUR_COMMUTATOR,
  SCHUR_TWO_STAGE,
  SCHUR_MASS /* the mass of the pressure alone */
} SchurType;

/* Solver balanced: residual that it leaves as fraction of the start value's, and, with bodies that move, of the
   right-hand side */
#define FLOW_BALANCED_RESIDUAL 1e-2
#define FLOW_BALANCED_MAX      2e-5
#define FLOW_BALANCED_ERROR    2e-3 /* of velocities, of the largest (runs/studies/flow-solver) */

#define SMOOTHER_AUTO (RELAX_ILU + 1) /* -flow_velocity_smoother: by the step */

/* What is asked for, as options say */
typedef struct {
  PetscInt  kind;              /* SolverKind */
  PetscInt  schur, smoother;   /* SchurType; RelaxKind or SMOOTHER_AUTO */
  PetscBool stages;            /* two stages may be taken */
  PetscBool single_projection; /* solver fast without bodies: one sweep, without norms */
  PetscBool moving;            /* there are bodies that do not stand still */
  PetscBool need_Ar, need_whole;
  PetscBool print_choice;
} SolverSettings;

/* What a step takes: choice.c decides all of it, in one place, from the numbers of the step */
typedef struct {
  SchurType schur;             /* not SCHUR_AUTO, but before the first step */
  RelaxKind smoother;          /* of the velocity */
  PetscBool relax_cells;       /* with two stages: of cells that bodies cut, see twostage.h */
  PetscBool large_cfl;         /* the flow goes far in this step: more care where the velocities' error ends a solve */
  PetscBool loose_pressure;    /* first pressure solves of a step may be, see precondition.c */
  PetscReal mass_fraction;     /* of Mp^{-1} over the viscosity beside the commutator */
  PetscReal pressure_fraction; /* of the pressure correction that a single projection takes */
} StepChoice;

/* Numbers of the equations in this step */
typedef struct {
  PetscBool steady;           /* no time step */
  PetscReal scale;            /* rho c_t (steady: mu/h^2): of B, C and the masses */
  PetscReal viscous;          /* mu theta / scale */
  PetscReal mu_reference;     /* mu of the flow's parameters */
  PetscReal mu_min;           /* of the thinnest fluid, where that varies in a time step */
  PetscReal h_max;            /* largest cell of the whole mesh */
  PetscReal shift;            /* of FlowSolverSetShift, or 0 */
  PetscReal continuity_scale; /* length: of the continuity rows in the outer iteration, see the header */
} StepNumbers;

/* K = [Ar G; B C] with balanced rows, of shells P^T A P + D, -P^T B^T, B P, C of PressureGetShared; assembled forms
   when needed */
typedef struct {
  Mat          S_all;      /* scalar matrix or product of the flow for all components */
  Mat          A, A_outer; /* in use: that, or of FlowSolverSetVelocity; of the system alone, or NULL */
  PetscBool    outer;      /* a product with the system is being made */
  Mat          Ar, G, B, C, K, Ar_assembled, whole;
  MatNullSpace constant_pressure;
} SystemOperators;

typedef struct {
  Vec        b, x, r, y;     /* of the whole system */
  Vec        t_u, t_u2;      /* work: reduced velocities */
  Vec        t_p, t_p2;      /* work: pressures */
  Vec        x_p;            /* the pressure's rows of what is preconditioned */
  Vec        gap_reference;  /* see FlowSolverForgive, or NULL */
  Vec        xn, yn;         /* nodal views of parts of reduced vectors */
  Vec        from[2], to[2]; /* see FlowSolverPlaceFields */
  PetscReal *nodal, *local;  /* work: of products, [own nodes][dim]; nodal array with ghosts */
} SystemVectors;

/* Bodies, and what holds the fluid at them */
typedef struct {
  const PenaltyTerm *penalty;      /* or NULL */
  PetscBool          aligned;      /* the mesh lines up with bodies: no staircase of rigid nodes */
  PetscReal         *D;            /* [capacity][nr][nr] */
  PetscReal         *body_inverse; /* [own bodies][nr][nr] inverse of the body's diagonal block of Ar */
  PetscReal         *mass_inverse; /* [capacity][nr][nr] of M_r / scale, own and local bodies; zero: prescribed */
  PetscReal         *fraction;     /* [nnode_all] see PressureUpdate; NULL without bodies */
  PetscReal         *rigid_work;   /* [2][capacity][nr] by local numbers of the constraint */
  BodyCoupling       coupling;
  Rows               near_rows, *near; /* rows of the velocity matrix around bodies in this step; NULL: of the whole */
  ContactCoupling    contact_coupling;
} SystemBodies;

/* How far the outer iteration goes: stop.c */
typedef struct {
  void     *test;                        /* of KSPConvergedDefault */
  PetscReal rtol, rtol_start, rtol_max;  /* see the header */
  PetscReal velocity_tol;                /* see the header */
  PetscReal once_max, before, after_one; /* see FlowSolverSetBefore */
  PetscInt  min_it;                      /* iterations of a solve, unless fewer leave less than tol_floor */
  PetscReal tol_floor;                   /* residual that solver balanced leaves around moving bodies */
  PetscReal tol;                         /* residual that the last solve was to leave, or left */
  PetscBool check_contact;               /* velocities count with ties, without velocity_tol, too */
  PetscBool is_time_step;                /* it solves for a step, not for what a force does or an update */
  PetscBool first_velocity_solve;        /* the next one is the first of a step with two stages around moving bodies */
  PetscBool light;                       /* a body is lighter than the fluid, as last found */
  PetscReal rhs, last_norm, last_change[2];
  PetscReal steepest[2]; /* largest change by the residual before it */
  PetscInt  checked;     /* iteration: gmres asks twice where it starts anew */
  Vec       iterate[2];  /* the last two, or NULL */
} Stopping;

/* The residual of a step as part of the next right-hand side: conserve.c */
typedef struct {
  PetscBool on;
  PetscBool solved;    /* the residual r of the last step is small */
  PetscBool closes[3]; /* nothing is left of the sum of r along the axis */
  PetscReal factor[3]; /* of the linear pressure that took that sum */
} ResidualCarry;

/* Integrals of the velocity that are held by forces: integrals.c */
typedef struct {
  FlowIntegral *is;
  Vec           s, z, r;
  PetscBool     solved; /* for z, once */
} IntegralRow;
typedef struct {
  PetscInt     n;
  IntegralRow *row;
} IntegralRows;

/* A factorisation of the whole matrix that serves several steps: system.c */
typedef struct {
  PetscInt  age, its; /* steps since it was made; outer iterations of the last */
  PetscInt  wait;     /* steps that factorise, since one could not do with it */
  PetscReal scale;    /* of its step */
} KeptFactor;

/* A list of nodes, and how long its arrays may become */
typedef struct {
  DevicePairs on;
  size_t      capacity[4];
} RigidList;

/* With -device, bodies: devicebodies.c. By local numbers of the constraint. */
typedef struct {
  RigidList  place, penalty, coupling, relative; /* rows of P; G; E of BodyCoupling; what M_r^{-1} adds at nodes */
  double    *U, *sum;                            /* [nlocal][nr] there: rigid velocities; [2][nlocal][nr] sums */
  size_t     capacity[2];
  PetscReal *here, *slots;             /* [2][capacity][nr] on the host; [2][count][nr] rigid slots of two vectors */
  PetscInt   ncut, *cut, cut_capacity; /* own nodes with a penalty, each once, on the host */
  int       *rigid; /* [nrigid] slots of pressures that no equation knows (FlowSolverCellIsRigid), there */
  int        nrigid;
  size_t     rigid_capacity;
} BodiesOnDevice;

/* With -device, E made there: devicecoupling.c */
typedef struct {
  FlowNear      near; /* cells around bodies */
  DeviceEntries on;
  const int    *list[3]; /* on their way to kernels */
  double       *sum;     /* of pairs of bodies */
  size_t        capacity[8];
  PetscInt     *of_node, *at_node, *at_cell; /* work of its lists: -1 of all nodes, twice, and own cells in between */
} CouplingOnDevice;

/* With -device: ondevice.c */
typedef struct {
  Vec        jacobi;     /* diagonal_inverse, 1 at inert slots */
  Vec        mass;       /* of M_r, inverse, 0 at inert slots */
  Vec        free;       /* a velocity without what stands in inert slots */
  Vec        constant;   /* constant pressure */
  Vec        part;       /* is lent pressures */
  PetscReal  scale;      /* of `mass` */
  PetscReal *value_here; /* [nknown] what is known there, on the host */
  int        ninert, nknown, nfixed;
  const int *inert;             /* [nknown] slots, there: inert ones, then those relative to a body */
  double    *value;             /* [nknown] c of these */
  size_t     capacity[2], room; /* of these, of value_here */
  const int *fixed;             /* [nfixed] slots that boundary conditions fix; NULL: not listed so far */
  double    *sums;              /* [DEVICE_PARTIAL + 2] of reductions */

  BodiesOnDevice   body;
  CouplingOnDevice coupling;
} SystemOnDevice;

struct _p_FlowSolver {
  Flow             flow;
  Constraint       constraint;
  Mesh             mesh;
  const MeshLocal *loc;
  MPI_Comm         comm;               /* of the mesh */
  PetscInt         nodal, nur, np, nr; /* local sizes: nodal slots, u_r, p */
  PetscInt         nbodies, capacity;  /* of all ranks; that the arrays of bodies hold */
  SolverSettings   set;
  StepChoice       choice;
  StepNumbers      step;
  SystemOperators  op;
  SystemVectors    vec;
  SystemBodies     body;
  Stopping         stop;
  ResidualCarry    carry;
  IntegralRows     integrals;
  KeptFactor       kept;

  SystemOnDevice        device;
  PetscReal            *diagonal_inverse; /* [nodal] of A, zero at inert slots */
  const PetscReal      *weight; /* [nnode_all][dim] of M_r / scale, inverse; times eps on body nodes, 0 at walls;
                                         the pressure's */
  Relax                 smoother;
  Pressure              pressure;    /* the projected pressure operator */
  struct _p_SolidBlock *solid;       /* NULL: no operators of others, or a direct solver */
  TwoStage              two;         /* or NULL: not wanted so far */
  KSP                   ksp, sub[2]; /* of the system; of velocity and pressure */
  PetscInt              limited[2];  /* solves for velocity, pressure that stopped at their limit */
};

#define GAP_FRACTION   1e-3 /* see FlowSolverGapFraction */
#define VELOCITY       "-flow_fieldsplit_velocity_"
#define LOOSE_VELOCITY 1e-2

/* Does the step take two stages? */
static inline PetscBool FlowSolverTwoStages(FlowSolver fs)
{
  return (PetscBool)(fs->choice.schur == SCHUR_TWO_STAGE);
}

/* Is there a penalty in this step? */
static inline PetscBool FlowSolverHasPenalty(FlowSolver fs)
{
  return (PetscBool)(fs->body.penalty && fs->body.penalty->any);
}

/* Where the viscosity varies: by what the lumped mass in M_r is multiplied where it is mu. The mass of the commutator
   is best weighted by sqrt(mu) (w-BFBT: Rudi, Stadler & Ghattas 2017), and by the density alone where that rules; in a
   time step against the thinnest fluid. */
static inline PetscReal FlowSolverMassWeight(FlowSolver fs, PetscReal mu)
{
  const PetscReal number = fs->step.viscous / (fs->step.mu_reference * PetscSqr(fs->loc->h));

  return PetscSqrtReal(fs->step.steady ? mu / fs->step.mu_reference
                                       : (1 + number * mu) / (1 + number * fs->step.mu_min));
}

/* Share of the compressibility of cells between two surfaces that is part of K now: little of it once it applies to the
   change of pressures alone, so that few solves take that change away */
static inline PetscReal FlowSolverGapFraction(FlowSolver fs)
{
  return fs->vec.gap_reference ? GAP_FRACTION : 1;
}

/* Do bodies hold all nodes of own cell c? No equation knows its pressure then. */
static inline PetscBool FlowSolverCellIsRigid(FlowSolver fs, PetscInt c)
{
  const MeshLocal *l = fs->loc;
  PetscInt         j = 0;

  while (fs->nbodies && j < l->nb && ConstraintGetView(fs->constraint)->node_body[l->cell_node[c * l->nb + j]] >= 0)
    j++;
  return (PetscBool)(j == l->nb);
}

/* Are there cells whose pressure makes them give way (FlowAddVolume)? The same on all ranks. */
PetscBool FlowSolverIsCompressible(FlowSolver);
/* fs->vec.b = [P^T (r - A c) + g; -B c]. Collective. */
PetscErrorCode FlowSolverBuildRhs(FlowSolver, const PetscReal r[], const PetscReal g[]);
/* Parts of it: rigid [count][nr] = g of unknown slots; the penalty's share of known velocities U and of known nodal
   values c, of entries' nodes: y -= G U, rigid -= H U - G^T c (own bodies). The second is collective. */
void           FlowSolverTakeLoads(FlowSolver, const PetscReal g[], PetscReal rigid[]);
PetscErrorCode FlowSolverAddPrescribedPenalty(FlowSolver, const PetscReal c[], PetscReal y[], PetscReal rigid[]);
/* After FlowAssemble: the values that fs->op.S_all looks at, which a flow without a matrix assembles when asked alone.
   Collective. */
PetscErrorCode FlowSolverUpdateMatrix(FlowSolver);
/* Create fs->op.S_all; the shells K, Ar (with its diagonal and its sweep), G, B and, where there are bodies, C.
   Collective. */
PetscErrorCode FlowSolverCreateShells(FlowSolver);
/* Does -device say where its vectors lie? Then: shells for vectors there; what they need of the step; the end. */
PetscBool      FlowSolverIsOnDevice(FlowSolver);
PetscErrorCode FlowSolverCreateOnDevice(FlowSolver);
PetscErrorCode FlowSolverSetUpOnDevice(FlowSolver);
PetscErrorCode FlowSolverApplyMassOnDevice(FlowSolver, Vec x, Vec y);
PetscErrorCode FlowSolverFillInertOnDevice(FlowSolver, PetscReal value, PetscReal a[]);
/* Where there are bodies (devicebodies.c): lists of the step. x, y: reduced velocities there. Collective. */
PetscErrorCode FlowSolverListBodiesOnDevice(FlowSolver);
PetscErrorCode FlowSolverFreeBodiesOnDevice(FlowSolver);
/* v += P of its rigid slots at its nodes; slots and velocities stay at hand until the next call */
PetscErrorCode FlowSolverExpandOnDevice(FlowSolver, PetscReal v[]);
/* Rows of bodies of y = P^T y + what more there is (penalty, ties, bodies), after FlowSolverExpandOnDevice of v; -G U
   is added to y before */
PetscErrorCode FlowSolverReduceOnDevice(FlowSolver, const PetscReal v[], PetscReal y[]);
/* Rows of bodies of y = P^T y alone */
PetscErrorCode FlowSolverReducePlainOnDevice(FlowSolver, PetscReal y[]);
/* The preconditioner about bodies: before the nodes r -= E U with U of the rigid rows b, after them x of the bodies */
PetscErrorCode FlowSolverBodiesBeforeOnDevice(FlowSolver, const PetscReal b[], PetscReal r[]);
PetscErrorCode FlowSolverBodiesAfterOnDevice(FlowSolver, PetscReal x[]);
/* What bodies have in y = M_r^{-1} x */
PetscErrorCode FlowSolverMassOfBodiesOnDevice(FlowSolver, const PetscReal x[], PetscReal y[]);
/* What operator.c has on rigid slots [count][nr] of the host, with a device or without: y = (D + H) x, identity where
   nothing is unknown; x = S_b^{-1} b; x += S_b^{-1} (sum + ties U), sum [nlocal][nr] of nodes and U what
   ConstraintFetchRigid fetched last, sum is lost; y = mass_inverse x with ties. The last two: collective. */
void           FlowSolverMultBodies(FlowSolver, const PetscReal x[], PetscReal y[]);
void           FlowSolverSolveBodies(FlowSolver, const PetscReal b[], PetscReal x[]);
PetscErrorCode FlowSolverAnswerBodies(FlowSolver, PetscReal sum[], PetscReal x[]);
PetscErrorCode FlowSolverInvertMasses(FlowSolver, const PetscReal x[], PetscReal y[]);
PetscErrorCode FlowSolverDestroyOnDevice(FlowSolver);
/* Where fields stay there in this step (FlowStaysOnDevice; devicestep.c), in place of functions of these names: */
PetscErrorCode FlowSolverBuildRhsOnDevice(FlowSolver, const PetscReal g[]);
PetscErrorCode FlowSolverPackOnDevice(FlowSolver, const PetscReal U[]);
PetscErrorCode FlowSolverUnpackOnDevice(FlowSolver, PetscReal U[]);
PetscErrorCode FlowSolverShiftOnDevice(FlowSolver);
/* Where it says so (devicesums.c): what conserve.c and stop.c do on arrays of the host. measure: of fs->stop.iterate;
   translation: e of conserve.c; a linear pressure is added to q in the cells whose pressure an equation knows; sums
   over e of the rows v. The last but one is local. */
PetscErrorCode FlowSolverMeasureOnDevice(FlowSolver, PetscReal sum[3], PetscReal max[3]);
PetscErrorCode FlowSolverTranslationOnDevice(FlowSolver, Vec e);
PetscErrorCode FlowSolverAddLinearOnDevice(FlowSolver, const PetscReal factor[], PetscReal q[]);
PetscErrorCode FlowSolverSumRowsOnDevice(FlowSolver, const PetscReal v[], const PetscReal e[], PetscReal sum[6]);
/* t_u = M_r^{-1} of the residual that is carried, rigid [nbodies][nr] its part of bodies, unless there is none (any);
   sum += rigid, then summed over ranks. Collective. */
PetscErrorCode FlowSolverTakeImpulse(FlowSolver, PetscReal rigid[], PetscBool *any);
PetscErrorCode FlowSolverSumLoads(FlowSolver, const PetscReal rigid[], PetscReal sum[6]);
/* Is E made on the device in this step, and no row of the matrix is wanted on the host? Then own as
   BodyCouplingUpdate has it (devicecoupling.c), after G has gone over. Local. */
PetscBool      FlowSolverCouplesOnDevice(FlowSolver);
PetscErrorCode FlowSolverCoupleOnDevice(FlowSolver, const PenaltyTerm *, const PetscReal *own[]);
PetscErrorCode FlowSolverFreeCouplingOnDevice(FlowSolver);
PetscErrorCode FlowSolverListPenaltyOnDevice(FlowSolver);
/* Rows of bodies of y: slots [count][nr] of the host + P^T y */
PetscErrorCode FlowSolverReduceIntoOnDevice(FlowSolver, PetscReal slots[], PetscReal y[]);
/* Rigid velocities of slots of the host go over to the local bodies, for fs->device.body.U */
PetscErrorCode FlowSolverSpreadSlots(FlowSolver, const PetscReal slots[]);
/* Rigid slots [count][nr] of a reduced velocity or a vector of the system, on the host; its entries a lie where vectors
   do */
PetscErrorCode FlowSolverBringSlots(FlowSolver, const PetscReal a[], PetscReal slots[]);
PetscErrorCode FlowSolverSendSlots(FlowSolver, const PetscReal slots[], PetscReal a[]);
PetscErrorCode FlowSolverGetSlots(FlowSolver, Vec, PetscReal slots[]);
PetscErrorCode FlowSolverSetSlots(FlowSolver, Vec, const PetscReal slots[]);
PetscErrorCode FlowSolverRemoveConstantOnDevice(FlowSolver, Vec x);
/* The diagonals of the step, with entries of MIN_DIAGONAL lumped masses at least; *kept: nothing else has changed */
PetscErrorCode FlowSolverDiagonalsOnDevice(FlowSolver, PetscBool *kept);
/* Error: a net flux that is more than round-off of prescribed velocities up to `speed`. */
PetscErrorCode FlowSolverCheckFlux(FlowSolver, PetscReal flux, PetscReal speed);
/* Shift the pressure of the start value x along dp [own cells][dim + 1], and its residual r with it: shift.c.
   Collective. */
PetscErrorCode FlowSolverShiftPressure(FlowSolver, const PetscReal dp[]);
/* Entry of the diagonal of M_r^{-1} in slot i of u_r */
PetscReal FlowSolverMobility(FlowSolver, PetscInt i);
/* Take from a residual what nothing can take away: the round-off of a small one would be most of it. Collective. */
PetscErrorCode FlowSolverMakeConsistent(FlowSolver, Vec r);
/* Make fs->vec.from, fs->vec.to the velocities and pressures in arrays [nur + np], until FlowSolverResetFields.
   Local. */
PetscErrorCode FlowSolverPlaceFields(FlowSolver, const PetscReal from[], const PetscReal to[]);
PetscErrorCode FlowSolverResetFields(FlowSolver);
/* y = M_r^{-1} x with the projected lumped mass; inert slots give zero. Collective. */
PetscErrorCode FlowSolverApplyMassInverse(FlowSolver, Vec x, Vec y);
/* p += factor Mp^{-1} r. Local. */
PetscErrorCode FlowSolverAddPressureMass(FlowSolver, PetscReal factor, Vec r, Vec p);

/* Read the recipe, set the defaults of all solvers, and find out which matrices the chosen preconditioners need; moving
   as for FlowSolverCreate. Collective. */
PetscErrorCode FlowSolverReadSettings(FlowSolver, PetscBool moving);
/* Where nothing else of a step needs the velocity matrix: fs->body.near, the rows that bodies need of it, else NULL.
   Local. */
PetscErrorCode FlowSolverGatherRows(FlowSolver);
/* Is an own body lighter than the fluid in its place? Not collective. */
PetscBool FlowSolverHasLightBody(FlowSolver);
/* Decide fs->choice for the step, by its viscous and its convective number. Collective. */
PetscErrorCode FlowSolverChooseStep(FlowSolver);
/* The tolerance of the correction y; converged: the start value (or zero, if that is better) meets it. Collective. */
PetscErrorCode FlowSolverSetTolerance(FlowSolver, PetscBool *converged);
/* The outer iteration's convergence test, which minds -flow_min_it. Collective. */
PetscErrorCode FlowSolverSetTest(FlowSolver);
/* Make pc the projection preconditioner. Collective. */
PetscErrorCode FlowSolverCreateProjection(FlowSolver, PC pc);
/* KSPSolve of the whole system; MUMPS gets more work space when it needs it (direct.c). Collective. */
PetscErrorCode FlowSolverIterate(FlowSolver, Vec b, Vec x);
/* Remark an outer iteration that takes the preconditioner for fixed. Collective. */
PetscErrorCode FlowSolverRemarkMethod(FlowSolver);
/* After the solve for fs->vec.x, which u, p, U are: add the forces of fs->integrals and what they do. Adds to
   *its; *reason < 0: a solve for that failed. Collective. */
PetscErrorCode FlowSolverHoldIntegrals(FlowSolver, PetscReal u[], PetscReal p[], PetscReal U[], PetscInt *its,
                                       KSPConvergedReason *reason);
PetscErrorCode FlowSolverDestroyIntegrals(FlowSolver);
/* Add a linear pressure to a solution x of fs->vec.b, so that its residual holds no momentum along axes that have ends,
   unless that residual is large; fs->vec.r is undefined then. Collective. */
PetscErrorCode FlowSolverConserve(FlowSolver, Vec x);
