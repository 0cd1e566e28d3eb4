/* Inside of the contact room; for its files only, README.md says which does what. Vectors have 3 components, 2D ones a
   zero; a tensor is xx yy zz xy xz yz. nall: the bodies that this rank knows. */
#pragma once
#include "base/algebra.h"
#include "base/domain.h"
#include "bodies/local.h"
#include "bodies/write.h"
#include "contact/contact.h"

#define CONTACT_MAX_POINTS 1024 /* surface points of a shape */
#define CONTACT_BATCH      64   /* of them are placed at once */
#define CONTACT_SKIN       0.1  /* of a list of pairs, in radii */
#define FILM_OPEN          2    /* gap in ranges from which on a mesh with a recess resolves films (pairforce.c) */

typedef struct {
  PetscInt i, j; /* j = -1 - number for a wall */
} Pair;

/* A point where two bodies (or a body and a wall) meet. */
typedef struct {
  PetscReal gap, weight;
  PetscReal ri[3], rj[3]; /* from the centres of i and j to the point (rj zero for a wall) */
  PetscReal normal[3];    /* from the partner towards body i */
} Touch;

/* Force on body i over some time, its torque on i, and the torque on j; the force on j is the opposite. */
typedef struct {
  PetscReal f[3], ti[3], tj[3];
} Impulse;

/* What the contact knows of bodies of one group, size and density. */
typedef struct {
  PetscInt   group;
  PetscBool  moves;
  PetscReal  mass;            /* effective: with added mass */
  PetscReal  inverse_mass[3]; /* zero where not free */
  PetscReal  inverse_moment;  /* 2D */
  PetscReal  density, scale;  /* size in that of the shape */
  PetscReal  radius, disc;
  PetscReal  terminal;         /* speed scale from gravity */
  PetscReal  stiffness, speed; /* of this step: see the law; and u_ref of bodies at rest */
  PetscInt   npoints;
  PetscReal *point; /* [npoints][dim] surface points about the centroid, frame and size of the shape; of the group */
} Kind;

/* What a law is asked at one touch. */
typedef struct {
  PetscReal gap, weight;
  PetscReal inverse_mass; /* of the pair along the normal */
  PetscReal stiffness, speed;
  PetscReal heavier; /* mass with the added mass of bodies that touch, in the mass that counts */
} Meeting;

/* A damped force along the normal at a touch */
typedef struct {
  PetscReal value, rate;        /* force without damping, and how it grows with the speed of approach */
  PetscReal inverse_mass, of_i; /* of the pair along the normal, and the share of i */
  PetscReal normal[3];
  PetscReal ri[3], rj[3]; /* as in Touch */
  PetscReal gap, weight;  /* likewise; not of films */
  PetscBool has_levers;   /* else it acts at the centres, and ri and rj are not set */
  PetscBool film;         /* not of the law; has levers; a pull of cohesion too, which may have none */
} Dashpot;

/* Where a pair rubs: the mean of its touches */
typedef struct {
  PetscInt  pair; /* -1: it does not */
  Touch     touch;
  PetscReal normal, stiffness; /* what presses the bodies together; of the pair */
} Rub;

/* A law of contact. Forces act along the normal, positive apart. */
typedef struct {
  const char *name;
  PetscInt    lookahead; /* steps that ContactStep integrates, see contact.c; 0: the law has no forces */
  PetscReal   implicit;  /* its damping goes by 1: the speed after the sub-step, 0.5: the mean of before and after */
  PetscBool   impulses;  /* see impulse.c; without a flow the force may be negative */
  PetscErrorCode (*options)(Contact);
  PetscReal (*stiffness)(Contact, const Kind *); /* of a body, from its speed u_ref */
  /* stiffness of a pair that moves with speed; j NULL: a wall */
  PetscReal (*combine)(Contact, const Kind *i, const Kind *j, PetscReal speed);
  PetscReal (*force)(Contact, const Meeting *, PetscReal *rate);   /* value and rate of a Dashpot, gap within range */
  PetscReal (*energy)(Contact, const Meeting *);                   /* stored */
  PetscReal (*time)(Contact, PetscReal stiffness, PetscReal mass); /* in which the force changes: sqrt(mass/slope) */
} ContactLaw;

extern const ContactLaw *const contact_laws[]; /* NULL-terminated */

typedef struct {
  PetscReal x[3], reach;
} Listed;

typedef struct {
  PetscReal i[3], j[3];
  PetscBool film;
} Lever;

#define SLIP 5

/* What pairs remember away from their list: see slip.c */
typedef struct {
  PetscInt   max_partners;
  PetscReal *slot; /* [n][max][SLIP] partner (0: free), what the pair remembers */
} Slips;

/* The forces of all pairs at once: see atonce.c */
typedef struct {
  PetscInt capacity, ndashpots, dashpot_capacity, nlevers, lever_capacity, nrubs, rub_capacity;
  PetscReal (*force)[3], (*torque)[3];  /* [n] sums; torque, spin: NULL where no pair turns its bodies */
  PetscReal (*after)[4], (*angular)[3]; /* [n] u and w after forces without damping; [3]: sum of rate x inverse mass */
  struct _p_PendingDashpot *dashpot;    /* [ndashpots] dashpots */
  Lever                    *lever;
  Rub                      *rub;              /* [nrubs] */
  Impulse                  *of_pair, *by_law; /* [npairs] sums of all forces, of those of the law; NULL: not wanted */
} AtOnce;

/* Law repulsive, see law.c */
typedef struct {
  PetscReal multiple, eps, eps_overlap, wall_factor, damping_speed;
  PetscBool implicit; /* solved with the flow */
} RepulsiveParameters;

/* Law spring, likewise */
typedef struct {
  PetscReal stiffness, restitution, friction, tangential, damping_ratio, speed;
  PetscBool pulls; /* a force of the law may be negative: without a flow */
} SpringParameters;

/* Films thinner than the mesh resolves: pairforce.c */
typedef struct {
  PetscBool wanted;
  PetscReal range, begin, roughness; /* they act below the gap `begin` */
  PetscReal offset, step_offset;     /* by which films count as wider, in ranges; and what is left of it in this step */
} FilmParameters;

typedef struct {
  PetscReal    lower[3], upper[3], period[3];
  PetscInt     sides; /* bit mask of the sides of the box that are walls */
  ContactWalls wall;  /* beyond them */
} ContactDomain;

/* Bodies of one group, size and density are a kind */
typedef struct {
  PetscInt    n, capacity;
  PetscInt   *of_body; /* [nall] */
  Kind       *kind;    /* [n] */
  PetscReal **point;   /* [ngroups] that kinds of the group share */
  PetscInt   *npoints; /* [ngroups] */
} Kinds;

/* Speeds that scale stiffnesses; see momentum.c */
typedef struct {
  PetscReal  min;     /* u_ref of bodies without buoyancy */
  PetscReal  fastest; /* of all bodies, when the scales were set */
  PetscReal *of_body; /* [nall] of a body's fastest point, then */
} SpeedScales;

/* The list of pairs, ascending in i, then j: search.c */
typedef struct {
  Pair      *pair; /* [n] */
  PetscInt   n, capacity;
  PetscBool  valid;  /* there is one */
  Listed    *listed; /* [nall] place and reach when the list was made */
  PetscReal *reach;  /* [nall] way a body may go before the next search; NULL: none */
  /* packing: if > 0, how much farther than to own bodies ghosts are known, whose pairs are listed then */
  PetscReal halo;
  PetscBool remembers; /* there is friction, or pairs began within the range */
  /* [n] elongation of the tangential spring; by how much nearer the pair feels the law than at the range, because it
     began there (pairforce.c); with cohesion negative while the pair holds on (cohesionpair.c). NULL: nothing to
     remember */
  PetscReal (*slip)[4];
  Slips      carried; /* while the list is made again */
  PetscBool *bonded;  /* [n] see ContactIsBonded; NULL: there are no bonds */
} PairList;

/* Work of the last call */
typedef struct {
  PetscInt tests, near, substeps;
  PetscInt lists; /* that were made since the beginning */
} ContactCount;

/* Law spring in a flow, NULL else: impulse.c */
typedef struct {
  /* [nall] force and torque over the last step, and over this one; [6]: how far the law took part, 0 to 1 */
  PetscReal (*mean)[7], (*mean_next)[7];
  PetscReal (*shift)[3]; /* [nall] by which bodies end the step elsewhere than the scheme brings them */
  ContactScheme scheme;
  PetscBool     remarked;
} FlowImpulses;

typedef struct _p_Bonds    *Bonds;
typedef struct _p_Cohesion *Cohesion;

struct _p_Contact {
  Bodies              bodies;
  BodyState          *state;
  BodyArrays         *s; /* the same for writing */
  const ContactLaw   *law;
  PetscInt            substeps, dim;
  PetscReal           h, range, horizon; /* horizon >= range: no force of any kind beyond */
  PetscReal           g[3];
  ContactDomain       domain;
  RepulsiveParameters repulsive;
  SpringParameters    spring;
  FilmParameters      film;
  Kinds               kinds;
  SpeedScales         speed;
  struct {
    PetscReal density, viscosity;
  } fluid;
  PetscBool alone;        /* it has moved the bodies */
  PetscBool with_flow;    /* it finds springs */
  PetscReal packed_size;  /* packing: if > 0, size of the bodies that are packed, in their own: they alone move */
  PetscReal (*guided)[6]; /* [nall] velocities u, w of bodies that are guided before a sub-step; NULL: there are none */
  PetscBool *began_deep;  /* [nall] driven bodies that lay in a wall or another at the start; see driven.c */
  /* where the bodies are: the state's own arrays or copies */
  PetscReal (*x)[3], (*q)[4], (*u)[3], (*w)[3];
  struct {
    PetscReal (*x)[3], (*q)[4], (*u)[3], (*w)[3]; /* [nall], allocated when first needed */
  } copy;
  PetscReal (*inverse_inertia)[6]; /* [nall] 3D only, space axes */
  PairList     list;
  AtOnce       at_once;
  ContactCount count;
  PetscReal    work; /* done by contact on the bodies since the beginning */
  struct {
    PetscBool wanted;
    PetscReal largest; /* overlap that separation has found, in diameters */
  } separation;
  struct {
    PetscReal (*force)[7]; /* [nall] force, torque, gap */
    Slips slips;
  } kept; /* by ContactKeep */
  FlowImpulses impulse;
  Bonds        bonds;    /* bond.h; NULL: none */
  Cohesion     cohesion; /* cohesion.h; NULL: none */
  struct {
    PetscInt       n, capacity;
    ContactSpring *spring;
  } springs; /* what ContactFindSprings has found */
  Touch   touch[2 * CONTACT_MAX_POINTS];
  Dashpot dashpot[2 * CONTACT_MAX_POINTS + 3];
};

static inline Kind *ContactKind(Contact c, PetscInt k)
{
  return &c->kinds.kind[c->kinds.of_body[k]];
}

/* d <- the nearest of its periodic images */
static inline void ContactWrap(Contact c, PetscReal d[3])
{
  for (PetscInt a = 0; a < c->dim; a++) d[a] = DomainNearest(c->domain.period[a], d[a], 0);
}

static inline PetscReal ContactSmallerRadius(Contact c, const Pair *p)
{
  const PetscReal r = ContactKind(c, p->i)->radius;

  return p->j >= 0 ? PetscMin(r, ContactKind(c, p->j)->radius) : r;
}

/* Does pair number p of the list hold by a bond, and feel no law of contact? */
static inline PetscBool ContactIsBonded(Contact c, PetscInt p)
{
  return (PetscBool)(c->list.bonded && c->list.bonded[p]);
}

/* Are the centres of two bodies, or of the nearest image of one, closer than reach? */
static inline PetscBool ContactWithin(Contact c, PetscInt i, PetscInt j, PetscReal reach)
{
  PetscReal d[3] = {0, 0, 0};

  for (PetscInt a = 0; a < c->dim; a++) d[a] = c->x[i][a] - c->x[j][a];
  ContactWrap(c, d);
  return (PetscBool)(dot3(d, d) < reach * reach);
}

static inline PetscReal ContactImplicit(Contact c, PetscBool film)
{
  return film ? 1 : c->law->implicit;
}

static inline void ContactNoteGap(const Pair *p, PetscReal gap, PetscReal all[])
{
  all[p->i] = PetscMin(all[p->i], gap);
  if (p->j >= 0) all[p->j] = PetscMin(all[p->j], gap);
}

/* Does body k turn about a pivot here? In a flow its rows know the pivot (bodies/mass.c, couple/inertia.c). */
static inline PetscBool ContactPivots(Contact c, PetscInt k)
{
  return (PetscBool)(c->alone && BodiesGetGroup(c->state, k)->motion.has_pivot);
}

static inline PetscReal ContactSquareOfArm(Contact c, PetscInt k)
{
  const PetscReal *arm = BodiesGetGroup(c->state, k)->arm;

  return PetscSqr(c->s->scale[k]) * dot3(arm, arm);
}

/* Change of angular velocity under an angular impulse, about the pivot of a body that turns about one here. */
static inline void ContactSpin(Contact c, PetscInt k, const PetscReal torque[3], PetscReal dw[3])
{
  if (c->dim == 3) apply_tensor(c->inverse_inertia[k], torque, dw);
  else {
    dw[0] = dw[1] = 0;
    dw[2]         = ContactKind(c, k)->inverse_moment * torque[2];
    if (ContactPivots(c, k))
      dw[2] /= 1 + ContactKind(c, k)->inverse_moment * ContactKind(c, k)->mass * ContactSquareOfArm(c, k);
  }
}

/* What a force at the centre of a body that turns about a pivot adds to its w. */
void ContactSwirl(Contact, PetscInt k, const PetscReal force[3], PetscReal dw[3]);
/* A contact that knows bodies and domain, but no options, no walls and no scales; for the search and for touches.
   Give it range, horizon and points. */
PetscErrorCode ContactCreateBare(Bodies, const PetscReal lower[3], const PetscReal upper[3], Contact *);
/* Make the list of all pairs that can come within the horizon, from x and reach; kept while it is still good. Bodies
   that are spread over the ranks go to their owners before (BodiesMigrate). Collective. */
PetscErrorCode ContactFindPairs(Contact);
/* The list of pairs: one more; into its order, by i (counting), then by j (few each, by insertion); saved or loaded */
PetscErrorCode ContactAddPair(Contact, PetscInt i, PetscInt j);
PetscErrorCode ContactSortPairs(Contact);
PetscErrorCode ContactVisitPairs(Contact, State);
/* Gap between two discs (spheres), j >= 0, or of a disc to a side of the box; the unit normal points at i. */
void ContactDiscGap(Contact, PetscInt i, PetscReal radius_i, PetscInt j, PetscReal radius_j, PetscReal normal[3],
                    PetscReal *gap);
/* All touching points of a pair in c->touch, sum of weights one, and its smallest gap (PETSC_MAX_REAL: none). */
PetscErrorCode ContactFindTouch(Contact, PetscInt i, PetscInt j, PetscInt *n, PetscReal *gap);
/* How two surfaces curve where they are nearest */
typedef struct {
  PetscReal principal[2]; /* of the gap (the sum of both), at least a share of that of the larger bounding ball */
  PetscReal of[2];        /* mean curvature of i and of j (0: a wall) */
} Curvature;
/* From a touch near it to the place where the gap is narrowest: surface points lie too far apart for a film that is
   thinner than the range. One step of Newton's method from where ri is nearest to the surface of i; gap, ri and rj
   change. */
PetscErrorCode ContactFindNarrowest(Contact, PetscInt i, PetscInt j, Touch *, Curvature *);
/* Surface points of all groups, at most `max` each; once more: others. Share: every kind has those of its group. */
PetscErrorCode ContactCreatePoints(Contact, PetscInt max);
void           ContactCopyPoints(Contact);
/* In a flow: law.c says why. */
void ContactStopPulling(Contact);
/* Surface point p of a body, from its centre, space axes. */
static inline void ContactTurnPoint(PetscInt dim, const PetscReal R[9], PetscReal scale, const PetscReal p[],
                                    PetscReal r[3])
{
  for (PetscInt a = 0; a < 3; a++)
    r[a] = scale * (R[3 * a] * p[0] + R[3 * a + 1] * p[1] + (dim == 3 ? R[3 * a + 2] * p[2] : 0));
}
/* Surface points [first, first + n) of body k, n <= CONTACT_BATCH, from its centre in space axes: r [n] */
void ContactPlacePoints(Contact, PetscInt k, PetscInt first, PetscInt n, PetscReal r[][3]);

/* wall.c. A wall j < 0 is a side of the box, or a piece of the border */
static inline PetscBool ContactIsPiece(PetscInt j)
{
  return (PetscBool)(j < -CONTACT_SIDES);
}
static inline PetscInt ContactPiece(PetscInt j)
{
  return -1 - j - CONTACT_SIDES;
}
/* Pairs of body k with all walls nearer to its centre than reach; is wall j? */
PetscErrorCode ContactFindWalls(Contact, PetscInt k, PetscReal reach);
PetscErrorCode ContactIsNearWall(Contact, PetscInt i, PetscInt j, PetscReal reach, PetscBool *);
/* Towards body i, where the wall is nearest to its centre */
PetscErrorCode ContactGetWallNormal(Contact, PetscInt i, PetscInt j, PetscReal normal[3]);
/* Where body i touches wall j, without weights: t [n] */
PetscErrorCode ContactTouchWall(Contact, PetscInt i, PetscInt j, PetscInt *n, Touch t[]);
/* Gap of the place r from the centre of body i, the normal there and its gradient, the curvature of the wall */
PetscErrorCode ContactPlaceOnWall(Contact, PetscInt i, PetscInt j, const PetscReal r[3], PetscReal *gap,
                                  PetscReal normal[3], PetscReal K[9]);
/* Of wall j at x, along it */
PetscErrorCode ContactGetWallVelocity(Contact, PetscInt j, const PetscReal x[3], const PetscReal normal[3],
                                      PetscReal v[3]);
/* Their names, and the end of a line */
PetscErrorCode ContactViewWalls(Contact, PetscViewer);
/* Error: a body whose centre is outside the border */
PetscErrorCode ContactCheckInside(Contact);
/* Options of cohesion, after those of the laws; its reach into the horizon, once there are kinds. Collective. */
PetscErrorCode ContactCreateCohesion(Contact);
PetscErrorCode ContactCheckCohesion(Contact);
/* Options of all laws; the unused laws' ones count as unknown. */
PetscErrorCode ContactReadLaws(Contact);
/* What acts in pair number p where its bodies are now: n dashpots in c->dashpot, and where it rubs, without the normal
   force. h = 0: without damping and friction. */
PetscErrorCode ContactPairDashpots(Contact, PetscInt p, PetscReal h, PetscInt *n, Rub *, PetscReal *gap);
/* Tangential spring with sliding, which moves on by h; added to *sum */
PetscErrorCode ContactAddFriction(Contact, const Rub *, PetscReal h, Impulse *sum);
/* The speed of a pair that scales its stiffness: the larger present one; where contact is solved with the flow that at
   which the centres approach each other, since a spring that stiffens as its bodies part would make energy */
PetscErrorCode ContactPairSpeed(Contact, const Pair *, PetscReal *);
/* Stiffness and scale of speed of a pair */
PetscErrorCode ContactFillMeeting(Contact, const Pair *, Meeting *);
/* Can the pair come within the horizon, with the ways in c->list.reach? The list holds also those that its skin brought
   in. */
PetscErrorCode ContactCanMeet(Contact, const Pair *, PetscBool *);
/* Velocity of i relative to its partner where they touch, by c->u and c->w */
PetscErrorCode ContactRelativeVelocity(Contact, const Pair *, const PetscReal ri[3], const PetscReal rj[3],
                                       const PetscReal normal[3], PetscReal v[3]);
/* One touch in place of many, by their weights; a dashpot at a touch, without force and damping */
void ContactMeanTouch(PetscInt n, const Touch t[], Touch *mean);
void ContactPlaceDashpot(Contact, const Pair *, const Touch *, Dashpot *);
/* Closing speed of a pair at a dashpot, by c->u and c->w. */
PetscReal ContactApproach(Contact, const Pair *, const Dashpot *);
/* Force of a dashpot that acts alone for the time h */
PetscReal ContactDashpotForce(Contact, const Dashpot *, PetscReal approach, PetscReal h);
void      ContactAddForce(const Dashpot *, PetscReal value, Impulse *sum);
/* Forces, and where pairs are round (not discs alone) torques, of all pairs over a sub-step h from where the bodies are
   now, in c->at_once, of each pair too if of_pair is there; without a flow gaps are noted. Collective. */
PetscErrorCode ContactForcesAtOnce(Contact, PetscReal h, PetscBool turns);
PetscErrorCode ContactForgetAtOnce(Contact);
/* The body that carries what a pair of the list remembers, the smaller one, so that none has many (of equal ones the
   first), and the name of the other: 1 + its number, or the wall */
PetscInt ContactGetCarrier(Contact, const Pair *, PetscReal *other);
/* Slips of the list go into slots, in place of those there; back to the list, which may be another one, where the slots
   stay; no slots; slots saved or loaded. Collective. */
PetscErrorCode ContactStoreSlips(Contact, Slips *);
PetscErrorCode ContactLoadSlips(Contact, const Slips *);
PetscErrorCode ContactForgetSlips(Contact, Slips *);
PetscErrorCode ContactVisitSlips(Contact, State, Slips *);
/* Energy stored in pair p. */
PetscErrorCode ContactPairEnergy(Contact, PetscInt p, PetscReal *energy);

/* momentum.c. Effective mass of body k; speed of the fastest body; u_ref and stiffness of the kinds and
   speeds of the bodies for a step dt (collective), a: frozen accelerations or NULL; effective inertia of body k,
   inverted (3D). */
PetscReal      ContactMass(Contact, PetscInt k);
PetscBool      ContactTurns(Contact);                   /* may a force turn a body? The same on all ranks */
PetscErrorCode ContactFastest(Contact, PetscReal *top); /* collective */
PetscErrorCode ContactSetScales(Contact, PetscReal dt, PetscReal (*a)[3]);
void           ContactScaleKinds(Contact);
PetscErrorCode ContactSetInertia(Contact, PetscInt k);
PetscErrorCode ContactSetInertias(Contact); /* of all that this rank knows; in the plane there are none */
/* Adds an impulse times `scale` to forces and torques of a pair. */
void ContactScatter(const Pair *, const Impulse *, PetscReal scale, PetscReal (*force)[3], PetscReal (*torque)[3]);
/* Acceleration of body k under a force, with what is held taken away: inverse mass times force */
void ContactMobility(Contact, PetscInt k, const PetscReal force[3], PetscReal out[3]);
/* Sub-steps of a step dt when forces change within `time`. Error: -contact_substeps too few. */
PetscErrorCode ContactChooseSubsteps(Contact, PetscReal dt, PetscReal time, PetscInt *n);
/* x, q, u, w of the contact become copies of these. */
PetscErrorCode ContactUseCopies(Contact, PetscReal (*x)[3], PetscReal (*q)[4], PetscReal (*u)[3], PetscReal (*w)[3]);
/* kinds.c. Kinds of the bodies that this rank knows. After other bodies became local: their kinds, scales, inertia. */
PetscErrorCode ContactCreateKinds(Contact);
PetscErrorCode ContactUpdateLocalBodies(Contact);
/* impulse.c. Its means saved or loaded. */
PetscErrorCode ContactVisitMeans(Contact, State);
/* Once, when bodies meet: what steps dt do not resolve of contacts whose force changes within `time`. Collective. */
PetscErrorCode ContactRemarkUnresolved(Contact, PetscReal time, PetscReal dt);
/* Forces of the step become those that the scheme of the flow makes their impulse of; the step is over. */
PetscErrorCode ContactMeasureForces(Contact);
PetscErrorCode ContactAcceptForces(Contact);
/* A pair to which contact gave `impulse` in sub-steps over dt, by_law of it by its law (the rest are films and
   friction, which no spring holds: a partner that cannot yield would be spun by it), and of which c->u and c->w are the
   end: a spring holds its bodies to the speed at which they part. stored: energy of its law at the beginning; the
   impulse is cut where it parts with more than that and e times the speed that it came with give. Bodies that end them
   elsewhere than the scheme brings them. */
PetscErrorCode ContactAddSpring(Contact, const Pair *, PetscReal stored, const Impulse *by_law, Impulse *impulse,
                                PetscReal dt);
PetscErrorCode ContactFindShifts(Contact, PetscReal dt, PetscInt n, const PetscInt active[]);
/* Inverse of the mass that body k opposes to a force along n at lever r */
PetscReal ContactInverseMass(Contact, PetscInt k, const PetscReal r[3], const PetscReal n[3]);
/* No contact forces, no gaps. */
void ContactClear(BodyArrays *);

/* Stop where a body on a prescribed way lies in a wall or in another one that cannot give way; start: what does so now
   may go on. Not collective, of own bodies. */
PetscErrorCode ContactCheckDriven(Contact, PetscBool start);
/* Refuse bodies that overlap their own periodic image, and those that turn and reach beyond half a period; start: the
   message says at the start, else the time. Not collective, of own bodies. */
PetscErrorCode ContactCheckImages(Contact, PetscBool start);
