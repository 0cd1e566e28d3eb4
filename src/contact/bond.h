/* Inside of the bonds; for the files bond*.c only. bonds.c: options, which pairs are bonded, what breaks. bondstore.c:
   records that go with the bodies. bondlaw.c: stiffness and strength. bondforce.c: how a bond is strained, its springs
   in a flow. bondalone.c: without one. */
#pragma once
#include "contact/bonds.h"
#include "impl.h"

#define BOND_MODES 6 /* along, across (2), twist, bending (2); in the plane along, across, bending */

/* A bond as its carrier has it (ContactGetCarrier): all reals, to go with the body from rank to rank and into files */
typedef struct {
  PetscReal partner;   /* 1 + number of the other body, or the wall, -1 - number; 0: the slot is free */
  PetscReal formed;    /* when */
  PetscReal end[2][3]; /* from the centres of carrier and partner, in the axes of the bodies; of a wall: in space */
  PetscReal turn[4];   /* orientation of the partner as the carrier sees it, when the bond formed */
  PetscReal axis[3];   /* unit vector from carrier to partner, in the axes of the carrier */
  PetscReal radius, length;
  PetscReal load[4];            /* see BondEvent */
  PetscReal before[4], mean[4]; /* load of the step before; by which it breaks: BondStore */
  PetscReal stored;
} BondRecord;
#define BOND_REALS ((PetscInt)(sizeof(BondRecord) / sizeof(PetscReal)))

/* Directions of the modes, along unit vectors from the carrier to the partner, or about them (turns): see BondDirection
 */
typedef struct {
  PetscReal lever[2][3]; /* from the centres to the middle between the ends */
  PetscReal axis[3][3];  /* along and across the bond; in the plane the third is normal to it */
} BondFrame;

/* How it is strained: stiffness along, across, of twist and of bending (BondKind) */
typedef struct {
  BondFrame frame;
  PetscReal strain[BOND_MODES], stiffness[4];
} BondStrain;

/* One that this rank lists, because it owns one of the bodies: local numbers of carrier and partner (< 0: a wall), n
   modes. There are many: what a step can find again is not kept. */
typedef struct {
  PetscInt    i, j, n;
  BondRecord *record;
  BondFrame   frame;
  PetscReal   value[BOND_MODES], rate[BOND_MODES];          /* of the pull: value + rate x speed of parting */
  PetscReal   elastic_value[BOND_MODES], slope[BOND_MODES]; /* what of them is elastic */
  PetscReal   stiff[BOND_MODES];                            /* 0 .. 1: the step does not see it */
  PetscReal   begin;      /* energy at the beginning of the step of what it sees, without a flow */
  PetscReal   elastic[4]; /* by BondKind: squares of the elastic pulls of the step, of what it does not see */
} Bond;

static inline const PetscReal *BondDirection(const BondFrame *f, PetscInt mode)
{
  return f->axis[mode % 3];
}

/* 0 along, 1 across, 2 twist, 3 bending */
static inline PetscInt BondKind(PetscInt n, PetscInt mode)
{
  if (n == 3) return mode < 2 ? mode : 3;
  return mode == 0 ? 0 : mode < 3 ? 1 : mode == 3 ? 2 : 3;
}

typedef struct _p_BondLaw BondLaw;

/* Strengths; PETSC_MAX_REAL: none */
typedef struct {
  PetscReal tension, shear, friction, moment, energy, lifetime;
} BondStrength;

typedef struct {
  PetscReal young, ratio, radius;                     /* law parallel */
  PetscReal stiffness, tangential, bending, twisting; /* law spring */
  PetscReal damping;                                  /* in the critical one */
} BondParameters;

/* Which pairs are bonded */
typedef struct {
  PetscBool  touching, walls, later; /* at the start; to walls; on contact in the run */
  PetscReal  gap, speed;             /* < 0: by the size of bodies; that they must not exceed */
  PetscBool *group;                  /* [ngroups] */
  PetscInt   npairs, (*pair)[2];     /* from a file, ascending; NULL: no file */
} BondSelection;

struct _p_Bonds {
  const BondLaw *law;
  BondParameters par;
  BondStrength   strength;
  BondSelection  select;
  PetscInt       max_bonds; /* slots of a body */
  BondRecord    *slot;      /* [n][max], attached to the bodies */
  PetscReal (*force)[6];    /* [n] force and torque of the bonds on a body in the last step, attached */
  PetscBool  listed;        /* the list below is good */
  PetscBool  many;          /* it has been said what so many cost */
  PetscBool  searching;     /* a list of pairs is wanted whatever the law */
  PetscInt   n, capacity;
  Bond      *bond;
  PetscInt   first; /* of its springs among those of the step */
  PetscInt   nevents, event_capacity;
  BondEvent *event;
  PetscInt   formed, broken; /* of carriers of this rank; on the first rank with what a restart brought */
  PetscReal  released;
};

struct _p_BondLaw {
  const char *name;
  PetscErrorCode (*options)(Bonds);
  /* along, across, twist, bending */
  void (*stiffness)(const struct _p_Bonds *, PetscInt dim, const BondRecord *, PetscReal k[4]);
  /* what tension and shear strength are compared with */
  void (*stress)(PetscInt dim, const BondRecord *, PetscReal *tension, PetscReal *shear);
};

/* bondlaw.c */
PetscErrorCode BondReadLaw(Bonds, PetscBool *wanted);
/* Does it break, by its load, energy and age? */
PetscBool BondBreaks(const struct _p_Bonds *, PetscInt dim, const BondRecord *, PetscReal time, BondCause *);

/* bondforce.c. Strain in the present positions of the contact (c->x, c->q). */
PetscErrorCode BondFindStrain(Contact, const Bond *, BondStrain *);
/* Speed at which the bodies part along a mode, by velocities of the contact; of a wall too */
PetscErrorCode BondSpeed(Contact, const Bond *, PetscInt mode, PetscReal *speed);
/* 1/(mass that the pair opposes to it) */
PetscReal BondInverseMass(Contact, const Bond *, PetscInt mode);
/* Pull of the modes over a step h, elastic as k (e + a v_new + b v_old), with a and b by how stiff it is (bondforce.c)
   */
typedef struct {
  PetscReal h, next, before, end, last; /* a and b of a soft one; of a stiff one */
  PetscReal damped;
  PetscInt  prediction; /* order of the prediction of where bodies end the step; 0: forces act where they begin it */
} BondRule;
PetscErrorCode BondMakeSprings(Contact, const BondRule *, Bond *);
/* Speeds of the wall of a bond along its modes; 0 of a body */
PetscErrorCode BondGetWallSpeeds(Contact, const Bond *, PetscReal wall[]);
/* Force and torques of a mode with this pull */
void BondGetImpulse(const Bond *, PetscInt mode, PetscReal pull, Impulse *);
/* After a step: elastic pulls from the speeds, loads of the record */
void BondTake(Bond *, PetscInt mode, PetscReal speed, PetscReal pull);
/* Forces of the springs of ContactAddBonds */
PetscErrorCode BondTakeForces(Contact, const PetscReal force[]);
/* Energies, at the end of the step */
PetscErrorCode BondStore(Contact, Bond *);

/* bondstore.c. The slots get room for `max`; ghosts those of their owners; list of the bonds here. Collective. */
PetscErrorCode BondReserve(Contact, PetscInt max);
PetscErrorCode BondList(Contact);
/* Record of a pair, NULL: none */
BondRecord    *BondFind(Contact, const Pair *);
PetscErrorCode BondNote(Contact, const BondRecord *, PetscInt carrier, PetscReal time, BondCause);
/* c->list.bonded */
PetscErrorCode BondMarkPairs(Contact);
PetscErrorCode BondVisit(Contact, State);
/* Where no bonds are wanted: an error if the checkpoint has some */
PetscErrorCode BondRefuseLoss(Contact, State);

/* bonds.c. Bonds that break at the end of a step, and those that form. Collective. */
PetscErrorCode BondFinishStep(Contact, PetscReal time, PetscReal dt);
/* Energy stored in the bonds of all ranks. Collective. */
PetscErrorCode BondGetEnergy(Contact, PetscReal *stored);
PetscErrorCode ContactCreateBonds(Contact);
PetscErrorCode ContactStartBonds(Contact);
PetscErrorCode ContactDestroyBonds(Contact);

/* bondalone.c. Before the velocities of a sub-step change; the forces of the bonds into those of c->at_once. */
PetscErrorCode BondBeginAlone(Contact, PetscReal h);
PetscErrorCode BondSolveAlone(Contact, PetscReal h);
