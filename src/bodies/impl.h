/* Inside of Bodies; for its files only. bodies.c: the state. columns.c: its arrays. advance.c: its motion. load.c: what
   acts on it. flight.c: motion without a flow. group.c: options of the groups, where their bodies start.
   subdomains.c, local.c: who knows which. resume.c: runs that go on. */
#pragma once
#include "bodies/local.h"
#include "motion.h"

#define BODIES_MAX_GROUPS  256 /* of a scene */
#define BODIES_MAX_COLUMNS 96

/* An array per known body */
typedef struct {
  void    **array;
  size_t    bytes; /* of an entry */
  PetscBool stays; /* has room for all known bodies, but does not go with them */
} BodyColumn;

/* Which part of the domain is whose: see local.h. NULL: all know all. */
typedef struct _p_BodySubdomains BodySubdomains;

PetscErrorCode BodySubdomainsCreate(MPI_Comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                                    const PetscReal period[3], BodySubdomains **);
PetscErrorCode BodySubdomainsDestroy(BodySubdomains **);
/* Does a body with this centre belong to this rank? */
PetscBool BodySubdomainsOwn(const BodySubdomains *, const PetscReal x[3]);

/* First state of bodies of a group: of all, or of those that this rank owns */
typedef struct {
  PetscInt   n;
  PetscInt  *number; /* [n] within the group; NULL: of all, n is the group's count */
  Placement *body;   /* [n] */
} Placed;

struct _p_Bodies {
  union { /* the same fields */
    BodyArrays          state;
    struct _n_BodyState view;
  };
  PetscReal   lower[3], upper[3]; /* domain */
  PetscReal   period[3];          /* of a box that travels */
  PetscReal   box[3];             /* length of the domain's periodic axes, 0 in the others */
  PetscBool   fixed;              /* BodiesSetFixed */
  PetscReal  *left;               /* [n] when the body last left a stop */
  Placement **start;              /* [ngroups][count] what prescribed motion starts from; NULL for groups that have
                                     none */
  PetscReal (*clock)[4];          /* [ngroups] when that motion began: along x, y, z, of the turn. 0, or when a run that
                                      goes on gave the group another one (resume.c) */
  BodySubdomains *subdomains;
  PetscInt        ncolumns, capacity; /* capacity: entries that all columns have */
  BodyColumn      column[BODIES_MAX_COLUMNS];
  PetscMPIInt    *owner; /* [n] of ghosts: rank, and number k there; with sub-domains */
  PetscInt       *home;
};

/* Columns of the state, made with room for `capacity` bodies; zeros. */
PetscErrorCode BodyAddColumn(Bodies, size_t bytes, PetscBool stays, void **array);
/* Bodies that are not kept go, the others close up. */
void BodyKeep(Bodies, const PetscBool keep[]);
/* Bodies of m records come, each at the place of its number: from the highest downwards, so that none is in the way.
   own: of these bodies, if not that of the records; from [m]: the ranks they come from. */
PetscErrorCode BodyJoin(Bodies, PetscInt m, const char *record, PetscBool own, const PetscMPIInt from[]);
/* Records of bodies [n] to the ranks to [n], both of which are sorted; comes: records that come and the ranks they come
   from, to be freed. Collective. */
PetscErrorCode BodyExchange(Bodies, PetscInt n, PetscMPIInt to[], PetscInt body[], PetscInt *comes, char **in,
                            PetscMPIInt **from);

/* The groups and their names; refuses one that is described and not named. */
PetscErrorCode BodyGroupsName(BodyArrays *s);
/* Read -particle_groups and the options of all groups, load their shapes, place their bodies in the domain lower ..
   upper. Needs s->dim; sets s->nall, s->ngroups and s->group, of which all but what is known of holes; the rest is not
   touched. placed [ngroups]: first state of bodies, of the centre of mass or the pivot; with sub-domains, of groups
   that need no list, only the own ones; the caller frees the arrays. Collective. Errors: those of BodiesCreate but for
   bodies outside the domain. */
PetscErrorCode BodyGroupsRead(BodyArrays *s, const BodySubdomains *, const PetscReal lower[3], const PetscReal upper[3],
                              Placed **placed);

/* What is not free of body number i of a group stays there from now on; the group has starts. */
void BodySetStart(Bodies, PetscInt group, PetscInt i, const PetscReal x[3], const PetscReal q[4], PetscReal angle);
/* BodyFree bits of a body of which nothing is held */
static inline PetscInt BodyAllFree(PetscInt dim)
{
  return BODY_FREE_X | BODY_FREE_Y | (dim == 3 ? BODY_FREE_Z : 0) | BODY_FREE_ROTATION;
}

/* Is all of the motion of a group free, and needs no start? */
static inline PetscBool BodyIsAllFree(const BodyGroup *g, PetscInt dim)
{
  const PetscInt all = BodyAllFree(dim);

  return (PetscBool)((g->free & all) == all && !g->motion.has_stops && !g->motion.has_pivot && !g->motion.has_hinge &&
                     !g->motion.from_start);
}

/* What the prescribed motion of body k starts from; of groups that have starts */
static inline Placement *BodyStart(Bodies b, PetscInt k)
{
  const PetscInt g = b->state.body_group[k];

  return &b->start[g][b->state.number[k] - b->state.group[g].first];
}

static inline PetscErrorCode check_body(Bodies b, PetscInt k)
{
  PetscFunctionBeginUser;
  PetscCheck(k >= 0 && k < b->state.n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE,
             "Body %" PetscInt_FMT " does not exist: there are %" PetscInt_FMT, k, b->state.n);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Prescribed state of body k as of MotionEvaluate; not of groups without starts. */
PetscErrorCode BodyEvaluateMotion(Bodies, PetscInt k, PetscReal time, PetscReal x[3], PetscReal u[3], PetscReal turn[3],
                                  PetscReal w[3]);
/* All ranks learn the starts that the owners of bodies hold. Collective */
PetscErrorCode BodyGatherStarts(Bodies);
/* Of BodiesVisitState: starts and clocks that are no longer those of the options. Collective. */
PetscErrorCode BodyVisitStarts(Bodies, const BodyRows *, State);
/* Where a body is and how it moves, for what acts on it */
typedef struct {
  PetscReal time, x[3], q[4], angle, u[3], w[3];
} BodyPose;

/* External load on body k there: force, and torque about its centre; weight apart. */
PetscErrorCode BodyGetExternal(Bodies, PetscInt k, const BodyPose *, PetscReal force[3], PetscReal torque[3]);
/* Lines of body k that are longer than their length there */
PetscInt BodyCountTaut(Bodies, PetscInt k, const BodyPose *);
/* Explicit coupling: gain [nr] of the rigid slots in a step under the load of its beginning, at the velocities U [nr],
   becomes that with springs, dampers and what falls with the motion taken at its end. */
PetscErrorCode BodyDampGain(Bodies, PetscInt k, PetscReal dt, const PetscReal U[], PetscReal gain[]);
/* Orientation of body k at an angle; in space it turns from q about its hinge, or by the vector `turn` */
void BodyOrient(Bodies, PetscInt k, PetscReal angle, const PetscReal turn[3], PetscReal q[4]);
/* What keeps a body on its stop after a rebound, saved or loaded. Collective. */
PetscErrorCode BodyVisitStops(Bodies, const BodyRows *, State);
/* Orientation of body k, and its angle, that are `turn` away from its start */
void BodyTurnFromStart(Bodies, PetscInt k, const PetscReal turn[3], PetscReal q[4], PetscReal *angle);
/* Put what is not free to its prescribed value at `time`: place, orientation and velocities of body k. */
PetscErrorCode BodiesApplyPrescribed(Bodies, PetscInt k, PetscReal time);
