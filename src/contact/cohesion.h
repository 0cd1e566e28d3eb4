/* Cohesion: bodies attract each other where they touch (-contact_cohesion). For the files cohesion*.c and those that
   ask them only. cohesion.c: the laws; cohesionpair.c: what they make of a pair.

   Of a pair: R = 1/sqrt(k1 k2) by the principal curvatures of the gap (spheres: Ri Rj/(Ri + Rj); in the plane the
   radius of the gap), s the separation of the surfaces, gap less the range of the law of contact, where the bodies
   touch (of a pair that began within the range: less the gap at the start). */
#pragma once
#include "impl.h"

typedef struct _p_CohesionLaw CohesionLaw;

struct _p_Cohesion {
  const CohesionLaw *law;
  PetscInt           dim;
  PetscReal          hamaker, cutoff, range; /* range: of separations in which surfaces attract each other */
  PetscReal          adhesion, modulus;      /* work of adhesion; E/(2 (1 - nu^2)) */
  PetscReal          tension, angle, volume, rupture;
};

/* Forces are positive apart, of a pair that holds on */
struct _p_CohesionLaw {
  const char *name;
  PetscBool   elastic; /* the repulsion is its own, in place of that of the law of contact */
  PetscBool   latches; /* begins where surfaces touch, and lasts up to its reach */
  PetscErrorCode (*options)(Cohesion);
  PetscReal (*force)(const struct _p_Cohesion *, PetscReal R, PetscReal s);
  PetscReal (*energy)(const struct _p_Cohesion *, PetscReal R, PetscReal s); /* stored; 0 at the reach */
  PetscReal (*reach)(const struct _p_Cohesion *, PetscReal R);               /* separation at which the pair parts */
  PetscReal (*pull)(const struct _p_Cohesion *, PetscReal R);                /* largest */
  PetscReal (*slope)(const struct _p_Cohesion *, PetscReal R); /* by which the pull falls with separation, at most */
};

/* cohesion.c. Force over a way from separation s0 past s to s1: its work over the way where it jumps there, else that
   at s. *holds: did the pair hold on before, does it after? */
PetscReal CohesionMeanForce(const struct _p_Cohesion *, PetscReal R, PetscReal s, PetscReal s0, PetscReal s1,
                            PetscBool *holds);
PetscReal CohesionEnergy(const struct _p_Cohesion *, PetscReal R, PetscReal s, PetscBool holds);
/* Laws that are elastic: stiffness at separation s, and the largest in a collision of a pair of inverse mass `inverse`
   at this speed */
PetscReal CohesionStiffness(const struct _p_Cohesion *, PetscReal R, PetscReal s);
PetscReal CohesionLargestStiffness(const struct _p_Cohesion *, PetscReal R, PetscReal inverse, PetscReal speed);

/* cohesionpair.c. Dashpots of pair number p, in c->dashpot from *n on. dashpot: where it acts, without force; R and the
   separation there; h: sub-step, 0: no way and no damping. *pressing, *stiffness: of an elastic law, else they stay. */
PetscErrorCode CohesionAddDashpots(Contact, PetscInt p, const Dashpot *dashpot, PetscReal R, PetscReal s, PetscReal h,
                                   PetscInt *n, PetscReal *pressing, PetscReal *stiffness);
/* The same where the gap is narrowest, from the touches of the pair in c->touch [touches]; within: see PairList.slip
   */
PetscErrorCode CohesionAddAtTouches(Contact, PetscInt p, PetscInt touches, PetscReal within, PetscReal h, PetscInt *n,
                                    PetscReal *pressing, PetscReal *stiffness);
/* R of balls which enclose the bodies, and of discs; j NULL: a wall */
PetscReal CohesionRadius(const Kind *i, const Kind *j);
PetscReal CohesionDiscRadius(const Kind *i, const Kind *j);
/* Does the pair hold on? Whatever the law for those that do not latch. */
PetscBool      CohesionHolds(Contact, PetscInt p);
PetscErrorCode CohesionPairEnergy(Contact, PetscInt p, PetscInt n, const Touch t[], PetscReal within,
                                  PetscReal *energy);
/* Bound of the energy that a pair has at most given when it holds on */
PetscReal CohesionDepth(Contact, const Pair *);
/* How fast the force of two bodies changes, as a stiffness of the law of contact */
PetscReal CohesionSlope(Contact, const Kind *i, const Kind *j);
/* In a flow, with forces solved with it (spring.c): pull of pair number p over a step, and where it acts; *pull 0:
   none. */
PetscErrorCode CohesionPull(Contact, PetscInt p, Dashpot *dashpot, PetscReal *s, PetscReal *pull);
