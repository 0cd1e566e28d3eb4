/* Inside of the couple module; for its files only. couple.c: bodies drawn, one system for flow and bodies, bodies
   moved. explicit.c: bodies moved after the flow. force.c: what the flow exerts on bodies, and the balance of
   momentum. A rung sees all and changes hollow and mark. */
#pragma once
#include "couple/couple.h"
#include "ale.h"
#include "boundary.h"
#include "drive.h"
#include "fitted.h"
#include "indicator.h"
#include "moved.h"
#include "rung.h"
#include "surfaces.h"

struct _p_Couple {
  const FlowStep       *step; /* of the flow, as are these */
  const FlowParameters *par;
  /* what it couples, and with what */
  Flow               flow;
  Bodies             bodies;
  BodyState         *s;
  Mesh               mesh;
  const MeshLocal   *loc;
  Constraint         constraint;
  PetscInt           slots;   /* bodies that a rank has slots for, where not all are known */
  PetscBool          renewed; /* the solver has been made anew, and slots may become fewer */
  FlowSolver         solver;
  Fitted             hole;     /* bodies that are holes of the mesh: nothing is marked, forces are read there */
  PetscReal          supplied; /* power of prescribed nodes on this rank (CoupleMomentum) */
  Boundaries         boundaries;
  PetscInt           implicit, use_volume, nr;
  const Rung        *rung;
  void              *rung_data; /* what its create made */
  PetscInt           ncount;    /* numbers that it reports of every step */
  CoupleCount        count[RUNG_COUNTS];
  void              *left;  /* what it keeps of an old mesh between CoupleLeave and CoupleRemesh */
  const PenaltyTerm *terms; /* its terms in this step; NULL: none */
  Moved              moved;
  Drive              drive;            /* uniform force that the scene asks for; NULL: none */
  PetscReal          domain;           /* its volume; 0: not measured yet */
  PetscBool          driving_told;     /* that bodies and walls do not take the driving force */
  Surfaces           surfaces;         /* what the flow knows of the bodies' distance; NULL: nothing */
  Ale                follow;           /* -mesh_deform with bodies that move */
  const PetscBool   *hollow;           /* [n] the inside of the body is no part of the fluid; NULL: none */
  PetscBool          sides_move;       /* nodes move on sides of the domain that bodies pass through */
  PetscBool          met;              /* k stands for other bodies than when they were drawn */
  Indicator          mark;             /* nodes that move rigidly */
  PetscReal (*X)[3], (*q)[4], (*P)[3]; /* where the bodies are drawn: centre, orientation, reference point (of the rigid
                                          velocities) */
  PetscInt      *unknown;
  PetscReal     *U, *U_old, *U_older; /* [n][nr]: rigid velocities that the flow sees in this step and saw in the two
                                     before */
  PetscReal     *D, *g;               /* [n][nr][nr] inertia, [n][nr] right-hand side of the rigid rows */
  PetscInt       nspring, spring_room;
  ContactSpring *spring;   /* of CoupleSetContact */
  BodyTie       *tie;      /* [nspring] */
  PetscReal     *pushed;   /* [nspring] the forces on the right of the rigid rows: by known velocities, then all */
  PetscReal     *joint;    /* [n][nr + 1][nr]: A and b of loads b - A U in the rows (joint.c); NULL: there are none */
  PetscReal     *residual; /* [n][nr]: -sum of the momentum residual over the body's nodes */
  PetscReal     *u, *p, *dp, *rhs;
  PetscReal     *du_old; /* [n] explicit coupling: size of the last velocity change, for the detection of blow-up */
  PetscInt      *growth;
  PetscInt       nrim, *rim; /* own nodes of the boundary, and their normals [nrim][dim], CoupleFindNormals */
  PetscReal     *outward;
  PetscReal     *force_old; /* [n][3][2] force and torque of the last step */
  /* owed.c: momentum that the last step left over, [nnode_all][dim] and of the bodies' own inertia [n][nr], and that of
     this one, [nnode][dim] and [n][nr]. owed NULL: no velocities of bodies are solved for. */
  PetscReal *owed, *owed_U, *owed_next, *owed_U_next;
  /* left: of FlowSolverGetLeft in the last step; steps so far; those whose momentum left over was dropped, since a new
     mesh followed or the residual was too large. Reals alone: they are visited as an array. */
  struct {
    PetscReal left, steps, meshes, large;
  } residue;
};

/* Component s (0 .. nr - 1) of a rigid velocity as element of 3-vectors: translation s < dim, otherwise rotation */
static inline PetscReal *CoupleRigidComponent(Couple c, PetscReal (*u)[3], PetscReal (*w)[3], PetscInt k, PetscInt s)
{
  const PetscInt dim = c->loc->dim;

  return s < dim ? &u[k][s] : dim == 2 ? &w[k][2] : &w[k][s - dim];
}

static inline PetscReal CoupleRigidValue(Couple c, const PetscReal (*u)[3], const PetscReal (*w)[3], PetscInt k, PetscInt s)
{
  const PetscInt dim = c->loc->dim;

  return s < dim ? u[k][s] : w[k][dim == 2 ? 2 : s - dim];
}

/* Where sums of own bodies are added over the ranks: is this the one that begins with what all ranks have? */
PetscBool CoupleCountsFirst(Couple);

/* b->driving, with the rest of the balance of momentum and its size; a remark (once) where it is large. Collective. */
PetscErrorCode CoupleMeasureDriving(Couple, const FlowDiagnostics *, const PetscReal rest[3], CoupleBalance *b);

/* The density of the fluid inside body k */
static inline PetscReal CoupleInnerDensity(Couple c, PetscInt k, const FlowParameters *par)
{
  return c->hollow && c->hollow[k] ? 0 : par->density;
}

/* out [nr] = d0 M now + d1 M old: momentum per density that body k brings into the step, M its inertia at the end of
   it, now and old [nr] its slots one and two steps before. In space the inertia about the reference point turns with
   the body, so each spin counts with the orientation of its own time: no gyroscopic torque is left over, and angular
   momentum is kept. */
PetscErrorCode CoupleHistory(Couple, PetscInt k, const PetscReal M[], const PetscReal now[], const PetscReal old[], PetscReal out[]);
/* K [nr][nr], M the inertia per density: what resists motion across the hinge or slide of body k in its rigid rows, so
   stiff that K U is the force (torque) with which they hold it. Is there any? */
PetscBool CoupleHoldAxes(Couple, PetscInt k, const PetscReal M[], PetscReal K[]);
/* Velocities and positions of the bodies at the end of the step, from the forces. Collective. Error: they oscillate
   with growing velocity. */
PetscErrorCode CoupleAdvanceExplicitly(Couple);
/* joint.c. Loads that change with the motion of body k: into its rows, M its inertia per density; and, after the solve,
   what they came to beyond those of the state before, on its rigid slots [nr]. */
PetscErrorCode CoupleAddJoint(Couple, PetscInt k, const PetscReal M[]);
PetscErrorCode CoupleGetJointForce(Couple, PetscInt k, PetscReal out[]);
/* Rigid velocity of slot i of body k at the last two times. A pivot's translation is prescribed, and is kept in the
   coupling, not in the state of the body. */
void CoupleGetHistory(Couple, PetscInt k, PetscInt i, PetscReal *now, PetscReal *old);
/* The time at which the rows of bodies hold */
static inline PetscReal CoupleLoadTime(Couple c)
{
  return c->step->time - (1 - c->step->theta) * c->step->dt;
}

/* In gradient form a rotating wall seems to feel 2 mu w Vol more than the true torque, which the gradient form
   inside would take away again; where the inside is no part of the fluid, this coefficient of w does. In space as in
   the plane: the integral over the surface of x x (grad u)^T n is -curl u times the volume, and curl u is 2 w */
PetscErrorCode CoupleSpinStress(Couple, PetscInt k, const FlowParameters *, PetscReal *coefficient);
/* -flow_force on the fluid that body k displaces, on its rigid slots: it stands for a pressure gradient, which acts
   on bodies too. Fluid inside receives it; where there is none, the body does. */
PetscErrorCode CoupleDeadForce(Couple, PetscInt k, const FlowParameters *, PetscReal out[]);
/* weight [dim][nr]: Vol times the velocity of the centre of body k along each axis for unit rigid velocities, or the
   load of a unit force per volume on its rigid rows, if its inside is no part of the fluid; else 0 */
PetscErrorCode CoupleHollowWeights(Couple, PetscInt k, PetscReal weight[3][6]);
/* Of body k in the step solved, [dim]: inertia, rate of change of the momentum of what moves with it, per unit density;
   push, its force on the fluid */
PetscErrorCode CoupleBodyPush(Couple, PetscInt k, PetscReal inertia[3], PetscReal push[3]);
/* touch.c. Before ConstraintSetBodies; when the rigid rows are filled; when the step is solved: what the forces came
   to, in pushed and on the right of the rigid rows. Collective. */
PetscErrorCode CoupleTellPartners(Couple);
PetscErrorCode CoupleAddTies(Couple);
PetscErrorCode CoupleTakeTies(Couple);
/* owed.c. Does a step owe the next one something? Arrays on the mesh, zeros; into the right-hand sides of the step; out
   of the step solved; the step is taken. Collective. */
PetscBool      CoupleOwes(Couple);
PetscErrorCode CoupleCreateOwed(Couple);
PetscErrorCode CoupleDestroyOwed(Couple);
void           CoupleAddOwed(Couple);
PetscErrorCode CoupleFindOwed(Couple);
PetscErrorCode CoupleAcceptOwed(Couple);
/* startvalues.c. Before the solve, bodies drawn: u, p, dp of FlowExtrapolate become start values that go with the
   bodies, dp counts less where p does. Nothing happens where no body moves. Collective. */
PetscErrorCode CoupleStartValues(Couple, PetscReal u[], PetscReal p[], PetscReal dp[]);
/* Fill `rim` and `outward`, of the domain without bodies. Collective. */
PetscErrorCode CoupleFindNormals(Couple);
/* Arrays per known body, zeros; detached before the bodies end */
PetscErrorCode CoupleAttachArrays(Couple);
PetscErrorCode CoupleDetachArrays(Couple);
/* For the bodies known now; where these are not all, CoupleMeetBodies must follow. Collective. */
PetscErrorCode CoupleCreateConstraint(Couple);
/* What goes by the mesh: solver, marks, boundary rung, arrays. Collective. */
PetscErrorCode CoupleCreateParts(Couple);
PetscErrorCode CoupleDestroyParts(Couple);
PetscErrorCode CoupleCreateSolver(Couple);
