/* Inside of the couple module; for its files only. couple.c: the loops of a step. participants.c: who takes part, one
   file each. setup.c: what all of them share on a mesh. Files below: inertia.c (momentum of bodies in time), interior.c
   (bodies without fluid inside). */
#pragma once
#include "couple/couple.h"
#include "couple/participant.h"
#include "ale.h"
#include "boundary.h"
#include "fitted.h"
#include "indicator.h"
#include "meshupdate.h"
#include "boundarymethod.h"
#include "base/rigid.h"
#include "bodies/local.h"

typedef struct _p_Carry           *Carry;
typedef struct _p_FlowRateControl *FlowRateControl;
typedef struct _p_CoupleContact   *CoupleContact;
typedef struct _p_Walls           *Walls;
typedef struct _p_CoupleSlip      *CoupleSlip;
typedef struct _p_CoupleScalars   *CoupleScalars;

typedef struct {
  const CoupleParticipant *op;
  void                    *data;
} CoupleEntry;

/* [n] local bodies, as the system has them */
typedef struct {
  PetscReal (*X)[3], (*q)[4], (*P)[3]; /* predicted position of the centre, orientation, reference point (of the rigid
                                          velocities) */
  PetscInt  *unknown;                  /* bits of the slots that are solved for */
  PetscReal *U, *U_old, *U_older;      /* [n][nr]: rigid velocities that the flow sees in this step and saw in the two
                                          before */
  PetscReal *D, *g;                    /* [n][nr][nr] inertia, [n][nr] right-hand side of the rigid rows */
  PetscReal *residual;                 /* [n][nr]: -sum of the momentum residual over the body's nodes */
  PetscReal *slip;  /* [n][nr]: what the slip of surfaces takes from g, no force of others (slip.c); NULL: there is
                      none */
  PetscReal *joint; /* [n][nr + 1][nr]: A and b of loads b - A U in the rows (joint.c); NULL: there
                                          are none */
  /* explicit coupling: the last velocity change, steps for which it has grown; force and torque of the last step
     [n][3][2] */
  PetscReal *du_old, *force_old;
  PetscInt  *growth;
} CoupleRigid;

/* How the flow sees their surfaces (method.c) */
typedef struct {
  const BoundaryMethod *table;
  void                 *data;   /* what its create made */
  void                 *left;   /* what it keeps of an old mesh from before_remesh to after_remesh */
  PetscInt              ncount; /* numbers that it reports of every step */
  CoupleCount           count[METHOD_COUNTS];
  CoupleBound           bound;           /* name NULL: it has none */
  const PenaltyTerm    *terms;           /* its terms in this step; NULL: none */
  const PetscBool      *inactive_inside; /* [n] the inside of the body is no part of the fluid; NULL: none */
  const PetscBool      *on_surface;      /* [nnode_all] nodes on the surface of such a body; NULL: none */
  PetscBool             sides_move;      /* nodes move on sides of the domain that bodies pass through */
  PetscBool             current;         /* bodies are where they were when nodes and cells were last found */
  PetscBool             others;          /* k stands for other bodies than then */
  PetscBool             rows_changed;    /* rows of the constraint, in this step */
} CoupleMethod;

enum {
  FORCE_RESIDUAL,
  FORCE_VOLUME
};

struct _p_Couple {
  /* what it couples, and with what */
  Flow                  flow;
  const FlowStep       *step; /* of the flow, as are these */
  const FlowParameters *par;
  Bodies                bodies;
  BodyState            *s;
  Mesh                  mesh;
  MPI_Comm              comm; /* the mesh's */
  const MeshLocal      *loc;
  /* the system on this mesh */
  Constraint constraint;
  FlowSolver solver;
  MeshUpdate mesh_update;
  Indicator  indicator; /* nodes that move rigidly */
  PetscInt   nr;        /* rigid slots of a body */
  PetscInt   slots;     /* bodies that a rank has slots for, where not all are local */
  PetscBool  renewed;   /* the solver has been made anew, and slots may become fewer */
  PetscBool  needs_solver;
  PetscBool  sets_up; /* CoupleSetUpGeometry: no step is taken */
  struct {
    PetscReal *u, *p, *dp, *rhs;
  } field;            /* the solution, and the right-hand side of the flow */
  PetscReal dt_asked; /* length of the steps that were asked for, see CoupleSetStep; 0: none */
  PetscBool implicit;
  PetscInt  force_form;
  /* who takes part, and those of them that others ask */
  PetscInt        nparticipants, participant_capacity;
  CoupleEntry    *participant;
  CoupleRigid     rigid;
  CoupleMethod    method;
  Fitted          fitted; /* bodies that are holes of the mesh: nothing is marked, forces are read there */
  Walls           walls;
  Carry           carry;
  CoupleContact   contact_coupling;
  CoupleSlip      slip;      /* velocities of surfaces beside the rigid motion; NULL: none */
  FlowRateControl flow_rate; /* uniform force that the scene asks for; NULL: none */
  struct Elastic *elastic;   /* NULL: no particle is elastic */
  Ale             ale;       /* -mesh_deform with bodies that move; NULL: none */
  CoupleScalars   scalars;   /* -scalars; NULL: none */
  struct {
    PetscReal domain; /* its volume; 0: not measured yet */
    PetscBool told;   /* that bodies and walls do not take the driving force */
    /* of the run, int over time: what convection took of the momentum, and the driving force, by axes */
    PetscReal taken[3], pulled[3];
    PetscInt  steps;
    PetscBool settled; /* it took much: told, unless openings, bodies or the form explain it */
  } driving;
};

/* Calls an operation of all participants that have it. */
#define CoupleEach(c, operation, ...) \
  for (PetscInt each = 0; each < (c)->nparticipants; each++) \
    if ((c)->participant[each].op->operation) \
  PetscCall((*(c)->participant[each].op->operation)((c), (c)->participant[each].data, ##__VA_ARGS__))

/* FlowGetGiven of all but the boundary method, which tells of its own terms by itself: *given to be freed. Local. */
PetscErrorCode CoupleGetGiven(Couple, PetscReal *given[]);
/* Where sums of own bodies are added over the ranks: is this the one that begins with what all ranks have? */
static inline PetscBool CoupleCountsFirst(Couple c)
{
  PetscMPIInt rank;

  (void)MPI_Comm_rank(BodiesComm(c->bodies), &rank);
  return (PetscBool)(rank == 0);
}

/* rigid.c: the reference point of body k for the place and orientation that the system has of it */
PetscErrorCode CoupleSetReferencePoint(Couple, PetscInt k);

/* ---- below: inertia.c ---- */

/* The time at which the rows of bodies hold */
static inline PetscReal CoupleLoadTime(Couple c)
{
  return c->step->time - (1 - c->step->theta) * c->step->dt;
}

/* Rigid velocity of slot i of body k at the last two times. A pivot's translation is prescribed, and is kept in the
   coupling, not in the state of the body. */
void CoupleGetHistory(Couple c, PetscInt k, PetscInt i, PetscReal *now, PetscReal *old);
/* out [nr] = d0 M now + d1 M old: momentum per density that body k brings into the step, M its inertia at the end of
   it, now and old [nr] its slots one and two steps before. In space the inertia about the reference point turns with
   the body, so each spin counts with the orientation of its own time: no gyroscopic torque is left over, and angular
   momentum is kept. */
PetscErrorCode CoupleHistory(Couple, PetscInt k, const PetscReal M[], const PetscReal now[], const PetscReal old[],
                             PetscReal out[]);
/* K [nr][nr], M the inertia per density: what resists motion across the hinge or slide of body k in its rigid rows, so
   stiff that K U is the force (torque) with which they hold it. Is there any? */
PetscBool CoupleConstrainAxes(Couple c, PetscInt k, const PetscReal M[], PetscReal K[]);

/* ---- below: interior.c ---- */

/* Is the inside of body k no part of the fluid? */
static inline PetscBool CoupleIsInactiveInside(Couple c, PetscInt k)
{
  return (PetscBool)(c->method.inactive_inside && c->method.inactive_inside[k]);
}

/* The density of the fluid inside body k */
static inline PetscReal CoupleInnerDensity(Couple c, PetscInt k)
{
  return CoupleIsInactiveInside(c, k) ? 0 : c->par->density;
}

/* Volume of all bodies in the domain whose inside is no part of the fluid. Collective. */
PetscErrorCode CoupleGetInactiveVolume(Couple, PetscReal *volume);

/* -flow_force on the fluid that body k displaces, on its rigid slots: it stands for a pressure gradient, which acts
   on bodies too. Fluid inside receives it; where there is none, the body does. */
PetscErrorCode RigidInteriorForce(Couple, PetscInt k, PetscReal out[]);
/* weight [dim][nr]: Vol times the velocity of the centre of body k along each axis for unit rigid velocities, or the
   load of a unit force per volume on its rigid rows, if its inside is no part of the fluid; else 0 */
PetscErrorCode RigidInteriorVolume(Couple, PetscInt k, PetscReal weight[3][6]);
/* In gradient form a rotating wall seems to feel 2 mu w Vol more than the true torque, which the gradient form
   inside would take away again; where the inside is no part of the fluid, this coefficient of w does. In space as in
   the plane: the integral over the surface of x x (grad u)^T n is -curl u times the volume, and curl u is 2 w */
PetscErrorCode RigidGradientFormTorque(Couple, PetscInt k, PetscReal *coefficient);

/* ---- forces ---- */

/* Of body k in the step solved, [dim]: inertia, rate of change of the momentum of what moves with it, per unit density;
   push, its force on the fluid */
PetscErrorCode RigidForceOnFluid(Couple, PetscInt k, PetscReal inertia[3], PetscReal force_on_fluid[3]);
/* All bodies, in the form that -couple_force names */
PetscErrorCode CoupleForceOnBodies(Couple);
/* After the solve, what loads of joints came to beyond those of the state before, on the rigid slots [nr] of body k */
PetscErrorCode CoupleGetJointForce(Couple, PetscInt k, PetscReal out[]);
/* Velocities and positions of the bodies at the end of the step, from the forces. Collective. Error: they oscillate
   with growing velocity. */
PetscErrorCode CoupleAdvanceExplicitly(Couple);
/* Bodies in the balance, and their energies (of CoupleMomentum and CoupleGetPower) */
PetscErrorCode CoupleBalanceBodies(Couple, const FlowDiagnostics *, CoupleBalance *);
PetscErrorCode CouplePowerOfBodies(Couple, CouplePower *);
/* Place of the scalar of that name, -1: there is none */
PetscErrorCode CoupleFindScalar(Couple, const char name[], PetscInt *i);
/* Phoretic slip of the bodies of a group, added to velocity [nnode_all][dim] at nodes of surfaces with the normals
   [nnode_all][dim] (phoretic.c). Collective. */
PetscErrorCode CoupleAddPhoreticSlip(Couple, PetscInt group, const PetscReal normal[], PetscReal velocity[]);
/* What the penalty takes of the power of slip, which CouplePower has, for velocities v, V in the middle of the step:
   s . Pen (s - u + R U) - (v - R V) . Pen s, added on this rank */
PetscErrorCode CoupleAddSlipLoss(Couple, const PetscReal v[], const PetscReal V[], PetscReal *power);
/* b->driving, from the balance; a remark (once) where it is large. Collective. */
PetscErrorCode CoupleMeasureDriving(Couple, const FlowDiagnostics *, CoupleBalance *b);

/* ---- participants, in the order of the list; all collective ---- */

PetscErrorCode CoupleAddWalls(Couple);
/* What else wall b of the mesh feels in this step, after the walls' own balance: force [3] of all ranks. Local. */
PetscErrorCode CoupleAddWallForce(Couple, PetscInt b, const PetscReal force[3]);
PetscErrorCode CoupleAddRigid(Couple);
PetscErrorCode CoupleAddFitted(Couple);
PetscErrorCode CoupleAddAle(Couple);
PetscErrorCode CoupleAddScalars(Couple);
PetscErrorCode CoupleAddMethod(Couple);
PetscErrorCode CoupleAddSurfaces(Couple);
PetscErrorCode CoupleAddJoints(Couple);
PetscErrorCode CoupleAddInterior(Couple);
PetscErrorCode CoupleAddSlip(Couple);
PetscErrorCode CoupleAddStartValues(Couple);
PetscErrorCode CoupleAddCarry(Couple);
PetscErrorCode CoupleAddContact(Couple);
PetscErrorCode CoupleAddFlowRate(Couple);
/* All of them */
PetscErrorCode CoupleAddParticipants(Couple);

/* ---- dissipation.c ---- */

/* 2 mu int D(u) : D(u) over own cells, with the viscosity of each [ncell_all]. Not collective. */
PetscErrorCode CoupleViscousPower(Couple, const PetscReal viscosity[], const PetscReal u[], PetscReal *power);

/* ---- setup.c, local.c: what they share on a mesh ---- */

PetscErrorCode CoupleCreateSystem(Couple);
PetscErrorCode CoupleDestroySystem(Couple);
PetscErrorCode CoupleCreateSolver(Couple);
/* For the bodies known now; where these are not all, CoupleUpdateLocalBodies must follow. Collective. */
PetscErrorCode CoupleCreateConstraint(Couple);
/* What the constraint is to know of each body: whether it unites with others, and a length, since rotation counts by
   the speed it gives the surface (that of the group's shape: no number of the state). Collective. */
PetscErrorCode CoupleDescribeBodies(Couple);
