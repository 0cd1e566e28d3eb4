/* Bonds: bodies that hold on to each other and to walls, until they break (-contact_bond_law). A part of the contact:
   all functions take a Contact.

   A bond joins two bodies where they touch. Its ends and its axis are carried by both bodies, so that any rotation of
   the pair as a whole leaves it without load; what it feels is how the ends part along the axis and across it, and how
   the two bodies turn against each other about the axis (twist) and across it (bending). Each is a spring with a
   dashpot. Forces act at the middle between the ends, moments on both bodies: momentum and angular momentum are kept.

   Laws (-contact_bond_law):
     spring: stiffnesses along and across, and of bending and twist; strengths are forces, and a moment
     parallel (Potyondy & Cundall 2004, Int. J. Rock Mech. Min. Sci. 41, 1329): a beam of circular cross-section
       (in the plane: a strip of unit depth) of radius -contact_bond_radius in that of the smaller body and of the
       length between the centres: k_n = E A/L, k_s = k_n/ratio, bending E I/L, twist E J/(L ratio). Strengths are
       stresses at the rim: tension F/A + |M| R/I, shear |V|/A + |T| R/J.
   They break by tension, by shear (Mohr-Coulomb with -contact_bond_friction), by a moment (law spring), by stored
   energy, or with time.

   In a flow the springs are in the system of flow and bodies (ContactAddBonds), without one in a system of the bodies
   (bondalone.c): stable whatever the stiffness. A bond that a step resolves (its period is longer than some ten steps)
   keeps its energy; one that is stiffer is held by the end of the step, as a rigid joint.

   Bonded pairs do not feel the law of contact and its films: the bond carries pressure too, and takes part in no gap.
   */
#pragma once
#include "contact/contact.h"

/* Are there to be any in this scene? Not collective, the same on all ranks. */
PetscBool ContactHasBonds(Contact);
/* In a flow, after ContactFindSprings or ContactStep of a step dt: springs of the bonds are added to the n that it
   gave.
   theta: the rows of
   bodies hold after theta dt; order: of the way of the bodies (BodiesPredict), 2: by the mean speed. Collective.
   */
PetscErrorCode ContactAddBonds(Contact, PetscReal dt, PetscReal theta, PetscInt order, PetscInt *n,
                               const ContactSpring *spring[]);
/* Of all ranks, in the present state: number of bonds, energy stored in them, number of those formed and broken since
   the beginning, energy that was stored in those that broke. Collective. */
typedef struct {
  PetscInt  n, formed, broken;
  PetscReal stored, released;
} BondTotals;
PetscErrorCode ContactGetBondTotals(Contact, BondTotals *);

/* Why a bond formed or broke */
typedef enum {
  BOND_START,
  BOND_CONTACT,
  BOND_TENSION,
  BOND_SHEAR,
  BOND_MOMENT,
  BOND_ENERGY,
  BOND_TIME,
  BOND_LEFT /* a body has left the domain */
} BondCause;
extern const char *const BOND_CAUSES[];
/* Loads: tension (negative: pressure), shear force, twisting and bending moment. i, j: permanent numbers, j < 0: wall
   -1 - j (ContactGetWallName). x: the middle of the bond. */
typedef struct {
  PetscReal time, load[4], x[3];
  PetscInt  i, j;
  BondCause cause;
} BondEvent;
/* What has happened since the last call, of all ranks, by time, then i, then j, on every rank. *event [*n] is the
   caller's to free. Collective. */
PetscErrorCode ContactTakeBondEvents(Contact, PetscInt *n, BondEvent *event[]);
/* The bonds of own bodies, ascending in i; likewise. x: centre of body i; offset: from there to the centre of j, or to
   the end on the wall; load: as of an event, in the last step; stored: energy */
typedef struct {
  PetscReal x[3], offset[3], load[4], stored, formed;
  PetscInt  i, j;
} BondView;
PetscErrorCode ContactGetBonds(Contact, PetscInt *n, BondView *bond[]);
