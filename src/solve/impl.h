/* Inside of FlowSolver; for its files only. system.c: life cycle, set-up, solve. recipe.c: choice of methods. stop.c:
   how far the outer iteration goes. shift.c: start value of the pressure. precondition.c: the projection
   preconditioner. operator.c: products with the operators of the system. near.c: rows of the velocity matrix around
   bodies. held.c: mean velocities held by uniform forces. conserve.c: the balance of momentum. nonlinear.c: for solvers
   of nonlinear problems. */
#pragma once
#include "solve/system.h"
#include "pressure/pressure.h"
#include "relax.h"
#include "rigid/rigid.h"
#include "twostage.h"

typedef enum {
  SCHUR_AUTO,
  SCHUR_PROJECTION,
  SCHUR_COMMUTATOR,
  SCHUR_TWO_STAGE
} SchurType;

/* Recipe balanced: residual that it leaves as share of the start value's, and, with bodies that move, of the right-hand
   side */
#define FLOW_BALANCED_RESIDUAL 1e-2
#define FLOW_BALANCED_MOST     2e-5
#define FLOW_BALANCED_ERROR    2e-3 /* of velocities, of the largest (runs/studies/flow-solver) */

struct _p_FlowSolver {
  Flow             flow;
  Constraint       constraint;
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nodal, nur, np, nr;            /* local sizes: nodal slots, u_r, p */
  PetscInt         nbodies, room;                 /* of all ranks; that the arrays below have room for */
  PetscInt         schur, sweep_type;             /* what the user wants */
  PetscBool        fitted, commute, viscous_only; /* no staircase of rigid nodes; in this step */
  PetscReal        share_of_mass;                 /* likewise: of Mp^{-1} over the viscosity beside the commutator */
  Mat              S_all, A, A_outer;             /* scalar matrix or product of the flow for all components; in use:
                                                     that, or of FlowSolverSetVelocity; of the system alone, or NULL */
  PetscBool        outer;                         /* a product with the system is being made */
  PetscReal        shift;                         /* of FlowSolverSetShift, or 0 */
  PetscBool        stages;                        /* two stages may be taken */
  PetscBool        two_stage, relax_cells;        /* in this step, see twostage.h */
  /* shells P^T A P + D, -P^T B^T, B P, C of PressureGetShared; assembled forms when needed */
  Mat                Ar, G, B, C, Ar_assembled, whole;
  PetscBool          need_Ar, need_whole;
  Vec                xn, yn;           /* nodal views of parts of reduced vectors */
  PetscReal          viscous;          /* mu theta / scale */
  PetscReal          reference;        /* mu of the flow's parameters */
  PetscReal          thinnest;         /* mu of the thinnest fluid, where that varies in a time step */
  PetscBool          steady;           /* no time step */
  PetscReal          h_max;            /* largest cell of the whole mesh */
  PetscReal          scale;            /* rho c_t (steady: mu/h^2): of B, C and the masses */
  PetscReal          balance;          /* length: of the continuity rows in the outer iteration, see the header */
  Mat                K;                /* shell [Ar G; B C] with balanced rows */
  PetscReal         *D;                /* [room][nr][nr] */
  PetscReal         *body_inverse;     /* [own bodies][nr][nr] inverse of the body's diagonal block of Ar */
  PetscReal         *mass_inverse;     /* [room][nr][nr] of M_r / scale, of own and known bodies; zero where known */
  PetscReal         *diagonal_inverse; /* [nodal] of A, zero at inert slots */
  const PetscReal   *weight;           /* [nnode_all][dim] of M_r / scale, inverse; times eps on body nodes, 0 at
                                          walls; the pressure's */
  const PenaltyTerm *soft;             /* or NULL */
  PetscReal         *share;            /* [nnode_all] see PressureUpdate; NULL without bodies */
  PetscReal         *rigid_work;       /* [2][room][nr] by local numbers of the constraint */
  PetscReal         *saved, *local;    /* work: values at inert slots; nodal array with ghosts */
  PetscInt           nsaved;
  Relax              sweep;
  RelaxKind          relax; /* in this step */
  BodyCoupling       coupling;
  Rows               near_rows, *near; /* rows of the velocity matrix around bodies in this step; NULL: of the whole */
  Ties               ties;
  Pressure           pressure; /* the projected pressure operator */
  MatNullSpace       constant_pressure;
  KSP                ksp;
  KSP                sub[2];                          /* of velocity and pressure */
  PetscInt           limited[2];                      /* solves for velocity, pressure that stopped at their limit */
  PetscBool          fast;                            /* that recipe */
  PetscBool          loose;                           /* first pressure solves of a step may be, see precondition.c */
  PetscBool          single;                          /* recipe fast without bodies: one sweep, without norms */
  PetscInt           least;                           /* iterations of a solve, unless fewer leave less than `small` */
  PetscReal          small;                           /* residual that recipe balanced leaves around moving bodies */
  void              *test;                            /* of KSPConvergedDefault */
  PetscReal          share_of_pressure;               /* see WHOLE_PRESSURE */
  PetscReal          rtol, rtol_start, rtol_most;     /* see the header */
  TwoStage           two;                             /* or NULL: not wanted so far */
  PetscReal          error_most;                      /* see the header */
  PetscReal          once_most, before, after_one;    /* see FlowSolverSetBefore */
  PetscReal          rhs, last_norm, last_change[2];  /* of the outer iteration, see stop.c */
  PetscInt           judged;                          /* iteration: gmres asks twice where it starts anew */
  PetscReal          steepest[2];                     /* largest change by the residual before it, likewise */
  PetscBool          judge_tied;                      /* velocities count with ties, without error_most, too */
  PetscBool          moving;                          /* there are bodies that do not stand still */
  PetscBool          swift;                           /* the flow goes far in this step, see recipe.c */
  PetscBool          first;                           /* the next velocity solve is the first of such a step */
  PetscBool          light;                           /* a body is lighter than the fluid, as judged last */
  PetscBool          of_step;                         /* it solves for a step, not for what a force does or an update */
  Vec                iterate[2];                      /* the last two, or NULL */
  PetscBool          owing;                           /* what a step leaves over goes into the next */
  PetscBool          closes[3];                       /* nothing is left of the sum of r along the axis */
  PetscReal          factor[3];                       /* of the linear pressure that took that sum */
  PetscBool          solved;                          /* the residual r of the last step is small, see conserve.c */
  PetscReal          target;                          /* residual that the last solve was to leave, or left */
  FlowHeld          *held;                            /* or NULL */
  Vec                held_s[3], held_z[3], held_r[3]; /* see held.c */
  Vec                b, x, r, y, t_u, t_u2, t_p, t_p2;
  Vec                pressed;        /* see FlowSolverForgive, or NULL */
  Vec                x_p;            /* the pressure's rows of what is preconditioned */
  Vec                from[2], to[2]; /* see FlowSolverPlaceFields */
};

#define FORGIVEN       1e-3 /* see FlowSolverEase */
#define VELOCITY       "-flow_fieldsplit_velocity_"
#define LOOSE_VELOCITY 1e-2

/* Is there a penalty in this step? */
static inline PetscBool FlowSolverIsSoft(FlowSolver fs)
{
  return (PetscBool)(fs->soft && fs->soft->any);
}

/* Where the viscosity varies: by what the lumped mass in M_r is multiplied where it is mu. The mass of the commutator
   is best weighted by sqrt(mu) (w-BFBT: Rudi, Stadler & Ghattas 2017), and by the density alone where that rules; in a
   time step against the thinnest fluid. */
static inline PetscReal FlowSolverGetLift(FlowSolver fs, PetscReal mu)
{
  const PetscReal number = fs->viscous / (fs->reference * PetscSqr(fs->loc->h));

  return PetscSqrtReal(fs->steady ? mu / fs->reference : (1 + number * mu) / (1 + number * fs->thinnest));
}

/* Share of the compressibility of cells between two surfaces that is part of K now: little of it once it applies to the
   change of pressures alone, so that few solves take that change away */
static inline PetscReal FlowSolverEase(FlowSolver fs)
{
  return fs->pressed ? FORGIVEN : 1;
}

/* Do bodies hold all nodes of own cell c? No equation knows its pressure then. */
static inline PetscBool FlowSolverCellIsRigid(FlowSolver fs, PetscInt c)
{
  const MeshLocal *l = fs->loc;
  PetscInt         j = 0;

  while (fs->nbodies && j < l->nb && ConstraintGetView(fs->constraint)->node_body[l->cell_node[c * l->nb + j]] >= 0) j++;
  return (PetscBool)(j == l->nb);
}

/* b = [P^T (r - A c) + g; -B c]. Collective. */
PetscErrorCode FlowSolverBuildRhs(FlowSolver, const PetscReal r[], const PetscReal g[]);
/* Create fs->S_all; the shells K, Ar (with its diagonal and its sweep), G, B and, where there are bodies, C.
   Collective. */
PetscErrorCode FlowSolverCreateShells(FlowSolver);
/* Shift the pressure of the start value x along dp [own cells][dim + 1], and its residual r with it: shift.c.
   Collective. */
PetscErrorCode FlowSolverShiftPressure(FlowSolver, const PetscReal dp[]);
/* Take from a residual what nothing can take away: the round-off of a small one would be most of it. Collective. */
PetscErrorCode FlowSolverMakeConsistent(FlowSolver, Vec r);
/* Make fs->from, fs->to the velocities and pressures in arrays [nur + np], until FlowSolverResetFields. Local. */
PetscErrorCode FlowSolverPlaceFields(FlowSolver, const PetscReal from[], const PetscReal to[]);
PetscErrorCode FlowSolverResetFields(FlowSolver);
/* Continuity rows of x [nur + np] times factor. Local. */
void FlowSolverBalance(FlowSolver, PetscReal factor, PetscReal x[]);
/* y = M_r^{-1} x with the projected lumped mass; inert slots give zero. Collective. */
PetscErrorCode FlowSolverApplyMassInverse(FlowSolver, Vec x, Vec y);

/* Read the recipe, set the defaults of all solvers, and find out which matrices the chosen preconditioners need; moving
   as for FlowSolverCreate. Collective. */
PetscErrorCode FlowSolverSetRecipe(FlowSolver, PetscBool moving);
/* Where nothing else of a step needs the velocity matrix: fs->near, the rows that bodies need of it, else NULL. Local.
   */
PetscErrorCode FlowSolverGatherRows(FlowSolver);
/* Is an own body lighter than the fluid in its place? Not collective. */
PetscBool FlowSolverHasLightBody(FlowSolver);
/* What follows the pressure solve, and the preconditioner of the velocity, by the viscous and the convective number of
   the step. Collective. */
PetscErrorCode FlowSolverChooseMethods(FlowSolver);
/* The tolerance of the correction y; enough: the start value (or zero, if that is better) meets it. Collective. */
PetscErrorCode FlowSolverSetTolerance(FlowSolver, PetscBool *enough);
/* The outer iteration's convergence test, which minds -flow_min_it. Collective. */
PetscErrorCode FlowSolverSetTest(FlowSolver);
/* Make pc the projection preconditioner. Collective. */
PetscErrorCode FlowSolverCreateProjection(FlowSolver, PC pc);
/* KSPSolve of the whole system; MUMPS gets more work space when it needs it (direct.c). Collective. */
PetscErrorCode FlowSolverIterate(FlowSolver, Vec b, Vec x);
/* Remark an outer iteration that takes the preconditioner for fixed. Collective. */
PetscErrorCode FlowSolverRemarkMethod(FlowSolver);
/* After the solve for fs->x, which u, p, U are: add the forces of fs->held and what they do. Adds to *its; *reason < 0:
   a solve for that failed. Collective. */
PetscErrorCode FlowSolverHold(FlowSolver, PetscReal u[], PetscReal p[], PetscReal U[], PetscInt *its, KSPConvergedReason *reason);
PetscErrorCode FlowSolverDestroyHeld(FlowSolver);
/* Add a linear pressure to a solution x of fs->b, so that its residual holds no momentum along axes that have ends,
   unless that residual is large; fs->r is undefined then. Collective. */
PetscErrorCode FlowSolverConserve(FlowSolver, Vec x);
