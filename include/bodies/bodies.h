/* Bodies: rigid bodies in groups, their state and their motion. Knows nothing of the flow. Called by run (set-up,
   moving frame, restart), couple and contact (motion in a step), report (columns, outlines).

   Options of groups, equations of motion, reference points: src/bodies/README.md, "Conventions". Bodies that are spread
   over the ranks: local.h. Write access to the state: write.h.

   Shapes: vectors have 3 components (2D: the third is zero, angular velocities along z), orientations are unit
   quaternions. k is a local index, BodyState.number its permanent number. Units: any consistent system, angles in rad;
   in 2D mass, force and energy are per unit depth.
   Ownership: Bodies owns all arrays; they stay where they are until BodiesMigrate or BodiesDestroy.
   Collective: on BodiesComm. Local: without communication; every rank that knows a body must call alike with the same
   numbers where something is written. Errors of input are raised on all ranks. */
#pragma once
#include "shape/host.h"
#include "base/expr.h"
#include "base/state.h"

/* ---- a group and the state ---- */

/* A line from a point of a body to one in space. */
typedef struct {
  PetscReal point[3];                   /* in space; not used if the group is moored where it starts */
  PetscReal at[3];                      /* the end on the body, from its centre: axes and size of the shape */
  PetscReal stiffness, damping, length; /* length: without force; 0: a spring along every axis */
} Mooring;

/* What a scene says about the motion of a group beyond "free"; see motion.h and joint.h in src/bodies. */
typedef struct {
  PetscInt         dim;
  PetscBool        constant, rotate;    /* do velocity and angular velocity of the start act? */
  PetscBool        given;               /* -particle_<g>_motion, or velocities that change in time */
  PetscBool        named, has_u, has_w; /* -particle_<g>_motion, _velocity and _angular_velocity: are they given? */
  Expr             velocity, omega;     /* those of the start as expressions of t; NULL: numbers, which each body has */
  struct _p_Track *track;               /* motion from a file; NULL: none */
  PetscReal        amplitude[3], period[3], phase[3];
  PetscReal        rotation[3]; /* amplitude, period, phase of the angle about z */
  PetscReal        ramp;
  PetscBool        has_pivot, has_stops, has_hinge, has_slide;
  PetscReal        pivot[3];     /* in the frame of the shape */
  PetscReal hinge[3], slide[3];  /* unit vectors in space: axis of the angle (2D: z), the only direction of travel */
  PetscReal axis[3];             /* unit vector: of the angle at the start and of the turn of a file */
  PetscReal stops[2];            /* rad */
  PetscReal restitution;         /* of the stops */
  PetscReal force[3], torque[3]; /* external, on each body, without what the expressions give */
  Expr      force_of, torque_of; /* of the body's motion and t; NULL: none */
  PetscReal spring, spring_damping, spring_angle; /* torque about the hinge or z; rad */
  PetscInt  nmooring;
  Mooring  *mooring;    /* [nmooring] */
  PetscBool from_start; /* their points are where their ends on the body start */
  PetscBool slack;      /* lines pull and never push */
} Motion;

/* A group whose positions ContactPack finds: in lower .. upper, at least `margin` apart from all others and from the
   faces of the box; bodies with random orientations may turn on the way. */
typedef struct {
  PetscBool wanted, turns;
  PetscReal lower[3], upper[3], margin;
} Packing;

typedef enum {
  BODY_FREE_X        = 1,
  BODY_FREE_Y        = 2,
  BODY_FREE_Z        = 4,
  BODY_FREE_ROTATION = 8
} BodyFree; /* bit mask of moving degrees of freedom */

typedef struct {
  char      name[64];
  Shape     shape;
  PetscReal density;      /* rho_s, of bodies for which nothing else is said */
  PetscInt  free;         /* BodyFree bits; 0 = fixed (or prescribed) */
  PetscBool with_fluid;   /* what is free starts with the velocity of the fluid (-particle_<g>_initial_velocity) */
  Motion    motion;       /* of what is not free; pivot, stops, external load */
  PetscReal arm[3];       /* from the reference point to the centroid, body axes */
  PetscInt  first, count; /* bodies with the numbers [first, first + count) */
  ShapeMass mass;   /* of the shape, for unit density; a body of size s has s^dim its volume, s^(dim + 2) its inertia */
  PetscReal radius; /* of the shape: bounding radius about the centroid */
  PetscReal disc;   /* of the shape: radius if it is a disc/sphere, else 0 */
  Packing   pack;
  PetscReal largest;     /* size of the largest body, 1 without bodies */
  PetscBool grows;       /* its bodies change their size in time (BodiesResize) */
  PetscBool body_fitted; /* the body is a hole of the mesh (fitted.h): nothing is drawn */
  char      surface[64]; /* of a hole: name of the boundary that is its surface */
  PetscBool everywhere;  /* all ranks know its bodies (BodiesSetEverywhere, local.h) */
  PetscBool guided;      /* without a flow it moves by flight.h: joint, load, springs, prescribed motion */
  PetscBool obstacle; /* part of the geometry: held, may overlap walls and other obstacles, stick out of the domain */
  struct _p_BodySlip *slip; /* velocity of the surface beside the rigid motion (slip.h); NULL: none */
} BodyGroup;
/* State of all bodies that this rank knows: a view that only reads; Bodies owns the arrays. n: number of these bodies,
   mostly all nall (local.h says when not); ngroups, dim; time: of this state, advanced by BodiesAdvancePosition;
   dt_old: length of the last step, 0: none.

     array                       shape    meaning
     number                      [n]      permanent number of body k, ascending; k itself where all bodies are known
     own                         [n]      does this rank own it? Sums over all bodies count these alone
     group                       [ngroups]
     body_group                  [n]      the group of body k is group[body_group[k]]: BodiesGetGroup
     scale, density              [n]      size relative to the shape of its group (BodiesResize); rho_s
     x, u, w                     [n][3]   centre of mass, its velocity, angular velocity in rad/time, all in space axes
     u_old, w_old                [n][3]   velocities one step earlier
     q, q_old                    [n][4]   orientation, unit quaternion; one step earlier
     angle                       [n]      2D and hinge: angle in rad, not wrapped; else the integral of w_z, for reports
     force, torque               [n][3]   of the fluid without buoyancy; torque about the centre of mass
     contact_force, _torque      [n][3]   of contact, likewise
     stopped                     [n]      rests on its lower (-1) or upper (1) stop, or on none (0)
     gap                         [n]      smallest gap to a wall or another body (set by contact; PETSC_MAX_REAL if far)
     lighter                     [n]      by how much less density it weighs than it has (BodiesSetLighter)
     removed                     [n]      has left the domain and takes part in nothing any more
     travels, frame, frame_next  [3]      moving frame: does the box move, its displacement now, at the end of the step
     frame_u                     [3]      its velocity in the step. x is the position in the box, x + frame that in the
                                          laboratory; velocities are those of the laboratory

   The list is a macro, because write.h has it once more without the const. */
/* clang-format off */
#define BODY_STATE(CONST) \
  PetscInt n, nall, ngroups, dim; \
  PetscReal time, dt_old, frame[3], frame_next[3], frame_u[3]; \
  PetscBool travels; \
  CONST BodyGroup *group; \
  CONST PetscInt *number, *body_group, *stopped; \
  CONST PetscReal *scale, *density, *lighter; \
  CONST PetscReal (*x)[3], (*q)[4], (*q_old)[4], *angle, (*u)[3], (*w)[3], (*u_old)[3], (*w_old)[3]; \
  CONST PetscReal (*force)[3], (*torque)[3], (*contact_force)[3], (*contact_torque)[3], *gap; \
  CONST PetscBool *removed, *own;
/* clang-format on */

struct _n_BodyState {
  BODY_STATE(const)
};
typedef const struct _n_BodyState BodyState;
typedef struct _p_Bodies         *Bodies;

/* ---- questions about a body or group: all rooms ---- */

/* Group of body k. Local. */
static inline const BodyGroup *BodiesGetGroup(BodyState *s, PetscInt k)
{
  return &s->group[s->body_group[k]];
}

/* Index of body k within its group, for messages. Local. */
static inline PetscInt BodiesIndexInGroup(BodyState *s, PetscInt k)
{
  return s->number[k] - BodiesGetGroup(s, k)->first;
}

/* Local index of the body with that permanent number, -1: this rank does not know it. Local. */
static inline PetscInt BodiesFind(BodyState *s, PetscInt number)
{
  PetscInt from = 0, to = s->n;

  while (to - from > 1) {
    const PetscInt middle = (from + to) / 2;

    if (s->number[middle] <= number) from = middle;
    else to = middle;
  }
  return to > from && s->number[from] == number ? from : -1;
}

/* As BodiesFind, among bodies that this rank owns. Local. */
static inline PetscInt BodiesFindOwn(BodyState *s, PetscInt number)
{
  const PetscInt k = BodiesFind(s, number);

  return k >= 0 && s->own[k] ? k : -1;
}

/* Bounding radius of body k about its centroid. Local. */
static inline PetscReal BodiesGetRadius(BodyState *s, PetscInt k)
{
  return s->scale[k] * BodiesGetGroup(s, k)->radius;
}

/* Radius of body k if it is a disc or sphere, else 0. Local. */
static inline PetscReal BodiesGetDisc(BodyState *s, PetscInt k)
{
  return s->scale[k] * BodiesGetGroup(s, k)->disc;
}

/* Volume (2D: area) of body k. Local. */
static inline PetscReal BodiesVolume(BodyState *s, PetscInt k)
{
  const PetscReal a = s->scale[k];

  return BodiesGetGroup(s, k)->mass.volume * (s->dim == 2 ? a * a : a * a * a);
}

/* Do springs, dampers or expressions act on the bodies of a group? Local. */
static inline PetscBool BodiesGroupResists(const BodyGroup *g)
{
  const Motion *m = &g->motion;

  return (PetscBool)(m->force_of || m->torque_of || m->nmooring || m->spring > 0 || m->spring_damping > 0);
}
/* Does degree of freedom d of body k (0, 1, 2: translation; 3: rotation) move freely at present? Not if it is
   prescribed, nor rotation while the body rests on a stop. */
PetscBool BodiesIsFree(Bodies, PetscInt k, PetscInt d);

/* ---- set-up of a scene: run, tests ---- */

/* Read -particle_groups and all group options, load shapes, place bodies. A scene without groups gives n = 0.
   Collective. Errors: unknown place, bad table (file:line), random placement that does not fit, overlapping random
   bodies impossible to avoid. */
PetscErrorCode BodiesCreate(PetscInt dim, const PetscReal lower[3], const PetscReal upper[3], Bodies *);
/* Frees it and sets it to NULL; nothing happens with NULL. Collective. */
PetscErrorCode BodiesDestroy(Bodies *);
/* Prints one line a group. Collective. */
PetscErrorCode BodiesView(Bodies, PetscViewer);
/* The state. Borrowed, always the same pointer. Local. */
PetscErrorCode BodiesGetState(Bodies, BodyState **);
/* The body of a group is a hole of the mesh; `surface`: name of the boundary that is its surface. Copied. Local. */
PetscErrorCode BodiesSetBodyFitted(Bodies, PetscInt group, const char surface[]);
/* Body k starts at centre x, orientation q and, in 2D, angle. Before the first step. Local. */
PetscErrorCode BodiesSetInitialPositions(Bodies, PetscInt k, const PetscReal x[3], const PetscReal q[4],
                                         PetscReal angle);
/* The box moves from now on (moving frame); period [3] of its axes, 0: none. Before the first BodiesAreStill. Local. */
PetscErrorCode BodiesStartFrame(Bodies, const PetscReal period[3]);
/* TRUE: no degree of freedom is free or prescribed, and every body keeps the velocity of the state, until FALSE.
   Local. */
PetscErrorCode BodiesSetFixed(Bodies, PetscBool fixed);

/* ---- geometry of a body where it is: couple, contact, run ---- */

/* Vector from the reference point to the centre of body k at orientation q[4] (NULL: the current one), space axes: zero
   without a pivot. */
PetscErrorCode BodiesGetArm(Bodies, PetscInt k, const PetscReal q[], PetscReal arm[3]);
/* Volume (2D: area) of body k. Local. */
PetscErrorCode BodiesGetVolume(Bodies, PetscInt k, PetscReal *volume);
/* Inertia tensor of body k about its centre in space axes, at orientation q [4] (NULL: the current one), times the
   density unless per_density: xx yy zz xy xz yz; 2D: zz alone. Local. */
PetscErrorCode BodiesGetInertia(Bodies, PetscInt k, const PetscReal q[], PetscBool per_density, PetscReal inertia[6]);
/* Signed distance d [n], negative inside, of n points x [n][dim] in space to body k at centre X [3], orientation q [4]
   (NULL: the current ones). Allocates nothing. Local. */
PetscErrorCode BodiesDistance(Bodies, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt n,
                              const PetscReal x[], PetscReal d[]);
/* As BodiesDistance, to a body of this group and size, whether this rank knows it or not. Local. */
PetscErrorCode BodiesDistanceOf(Bodies, PetscInt group, PetscReal scale, const PetscReal X[], const PetscReal q[],
                                PetscInt n, const PetscReal x[], PetscReal d[]);
/* Closest points y [n][dim] on the surface of body k at X, q (NULL: the current ones) to the points x [n][dim], all in
   space (ShapeProject). Local. */
PetscErrorCode BodiesProject(Bodies, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt n,
                             const PetscReal x[], PetscReal y[]);
/* nface points of the surface of body k at X, q (NULL: the current ones), then its corners, in space: *x [*n][dim],
   freed by the caller; nface 0: the centre alone. *w (NULL: not wanted), freed likewise: weights of the nface points
   that add up to its length, in space area. Local. */
PetscErrorCode BodiesSurfacePoints(Bodies, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt nface,
                                   PetscInt *n, PetscReal **x, PetscReal **w);
/* Corners of body k at X, q (NULL: the current ones; ShapeGetCorners): *n their number, x [max][dim] the first `max` of
   them, in space. Local. */
PetscErrorCode BodiesGetCorners(Bodies, PetscInt k, const PetscReal X[], const PetscReal q[], PetscInt max, PetscInt *n,
                                PetscReal x[]);
/* Speed of the fastest point of body k (of a disc: its centre) in the box, under the velocities extrapolated by r of
   their last change; r = 0: the present ones. Not collective. */
PetscReal BodiesFastestPoint(BodyState *, PetscInt k, PetscReal r);
/* As BodiesFastestPoint, with velocity u of the centre and angular velocity w. Local. */
PetscReal BodiesPointSpeed(BodyState *, PetscInt k, const PetscReal u[3], const PetscReal w[3]);
/* Is no degree of freedom free, none moved by _motion, every velocity 0, and no size changes? Then positions need no
   update. Collective. */
PetscErrorCode BodiesAreStill(Bodies, PetscBool *still);

/* ---- one step: couple (contact for bodies without a flow) ---- */

/* Displacement of the box at the end of the step, and its velocity in the step, for BodiesPredict and
   BodiesAdvancePosition. Local. */
PetscErrorCode BodiesSetFrame(Bodies, const PetscReal next[3], const PetscReal velocity[3]);
/* Where body k is predicted to be at the next step: X + dt u (order 1), X + dt (u + r/2 (u - u_old)) with r = dt/dt_old
   (order 2; r = 1 at the start) or X (order 0: in the box, if that travels); likewise orientation. What is not free is
   where its prescribed motion puts it at time + dt, whatever the order. Stops are kept. */
PetscErrorCode BodiesPredict(Bodies, PetscInt k, PetscReal dt, PetscInt order, PetscReal X[3], PetscReal q[4],
                             PetscReal *angle);
/* Velocity u of the reference point and angular velocity w of body k at `time` as far as they are prescribed; entries
   of free degrees of freedom are the current ones. */
PetscErrorCode BodiesGetPrescribedVelocity(Bodies, PetscInt k, PetscReal time, PetscReal u[3], PetscReal w[3]);
/* By how much the density by which body k weighs is less than that of its mass; 0 at the start. Local. */
PetscErrorCode BodiesSetLighter(Bodies, PetscInt k, PetscReal less);
/* External load in the present state, springs included, plus weight minus buoyancy, (M - M_f) g: force, and torque
   about the centre (the weight has none). Error: an expression that is not finite. */
PetscErrorCode BodiesGetLoad(Bodies, PetscInt k, PetscReal rho_f, const PetscReal gravity[3], PetscReal force[3],
                             PetscReal torque[3]);
/* As BodiesGetLoad, with expressions of t at another time. Local. */
PetscErrorCode BodiesGetLoadAt(Bodies, PetscInt k, PetscReal time, PetscReal rho_f, const PetscReal gravity[3],
                               PetscReal force[3], PetscReal torque[3]);
/* How that load resists motion of body k from its present state, on its rigid slots (mass.h; [nr][nr]): stiffness K and
   damping C, symmetric and without negative eigenvalues, of springs, dampers and of expressions, as far as these fall
   with a body's own position or velocity. dt: step, for the size of differences. *any: are there such? Else K and C are
   not set. */
PetscErrorCode BodiesGetResistance(Bodies, PetscInt k, PetscReal time, PetscReal dt, PetscReal K[], PetscReal C[],
                                   PetscBool *any);
/* Removes from velocities of body k what its hinge or slide forbids: w keeps its component along the hinge, u that
   along the slide; either may be NULL. Local. */
void BodiesKeepAxes(BodyState *, PetscInt k, PetscReal u[3], PetscReal w[3]);
/* Bodies of groups that grow have the sizes scale [n] from now on, relative to the shapes of their groups; others keep
   theirs. All ranks that know a body give it the same. Collective. */
PetscErrorCode BodiesResize(Bodies, const PetscReal scale[]);
/* Body k is gone and takes part in nothing any more. Local. */
PetscErrorCode BodiesRemove(Bodies, PetscInt k);
/* Sets the time of the state. Local. */
PetscErrorCode BodiesSetTime(Bodies, PetscReal time);
/* Arrays of the state to be filled: *force, *torque [n][3]. Borrowed. Local. */
PetscErrorCode BodiesWriteForces(Bodies, PetscReal (**force)[3], PetscReal (**torque)[3]);
/* Sets velocity u of the centre and angular velocity w of body k; NULL: unchanged. Local. */
PetscErrorCode BodiesSetVelocity(Bodies, PetscInt k, const PetscReal u[3], const PetscReal w[3]);
/* As BodiesSetVelocity; the velocities so far become u_old, w_old. Local. */
PetscErrorCode BodiesStepVelocity(Bodies, PetscInt k, const PetscReal u[3], const PetscReal w[3]);
/* Explicit coupling: u_old, w_old <- u, w, then advance u, w by dt under force + contact + load + (M - M_f) g with
   fluid density rho_f. Euler step (semi-implicit together with BodiesAdvancePosition, theta = 1); in 3D the
   rotation by BodySpin; about a pivot with the inertia of the parallel axis. What is not free gets its
   prescribed velocity at the end of the step. Releases bodies from their stops. Does not move the bodies. Implicit
   coupling calls BodiesStepVelocity instead. */
PetscErrorCode BodiesAdvanceVelocity(Bodies, PetscReal dt, PetscReal rho_f, const PetscReal gravity[3]);
/* Move: x += dt U, orientation alike, with U = `theta` u + (1 - theta) u_old (be: theta = 1; bdf2, cn: 1/2); in 3D,
   without hinge, orientation by BodyTurn. What is not free goes to its prescribed position at time + dt. A body that
   passes a stop in the step is put back by the rebound from the moment of the impact: angle and angular velocities (w
   and w_old by the same jump, so that their difference stays the acceleration); one that arrives no faster than two
   steps of its acceleration, or that has left a stop less than eight steps ago, rests there.
   Advances the time of the state. Wraps nothing. Error: not finite. */
PetscErrorCode BodiesAdvancePosition(Bodies, PetscReal dt, PetscReal theta);
/* Releases body k from a stop if the torque on it points away from the stop. Local. */
PetscErrorCode BodiesRelease(Bodies, PetscInt k, PetscReal rho_f, const PetscReal gravity[3]);
/* The box has moved there: frame = frame_next. Local. */
PetscErrorCode BodiesAcceptFrame(Bodies);

/* ---- output: run, report ---- */

/* Kinetic energy of all bodies, translation and rotation. Collective. */
PetscErrorCode BodiesGetEnergy(Bodies, PetscReal *energy);
/* Energy stored in the springs and moorings of all bodies; *any (may be NULL): does any group have them? Collective. */
PetscErrorCode BodiesGetSpringEnergy(Bodies, PetscReal *energy, PetscBool *any);

/* ---- restart: run ---- */

/* After a checkpoint is loaded, frame included: bodies are where it has them, whatever the options say now. Where these
   prescribe another motion, or one of what was free, it begins anew for the group: from where its bodies are, with its
   time 0 (of formulas, ramp, oscillation, file) now; a remark says so. Nothing happens where the options put bodies
   where they are. Collective. Error: stops that do not hold the angle of a body. */
PetscErrorCode BodiesResume(Bodies);
/* StateVisit of Bodies: motion and forces of all bodies. Error of loading: other groups (names, numbers, volumes). */
PetscErrorCode BodiesVisitState(void *bodies, State);
