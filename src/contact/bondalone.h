/* Inside of bonds without a flow: the system of bodies that bonds hold together (bondalone.c makes it, bondsolve.c
   solves it where bodies are many). */
#pragma once
#include "bond.h"

/* A mode of a bond: bodies by number (-1: none) and by index, its rows L^T r by slots (rigid.h), h rate, and h (value +
   rate r.U*) */
typedef struct {
  PetscInt  body[2], index[2], order[2];
  PetscReal row[2][6], rate, load, free;
} AloneSpring;

/* L of a body: by its axes, and a lower triangle for turns (in the plane one number) */
typedef struct {
  PetscReal move[3], turn[9];
} BodyRoot;

void BondGetRoot(Contact, PetscInt k, BodyRoot *);
/* Slots y -> u, w [6] */
void BondApplyRoot(PetscInt dim, const BodyRoot *, const PetscReal y[], PetscReal v[6]);
/* f, t [6] -> slots */
void BondApplyRootTransposed(PetscInt dim, const BodyRoot *, const PetscReal f[6], PetscReal y[]);
/* Velocities of body k after all other forces, those in c->at_once: u, w [6] */
void BondFreeVelocity(Contact, PetscInt k, PetscReal h, PetscReal v[6]);
/* Those of a bond, one a mode; index: local numbers (< 0: a wall). v, root [bodies]: free velocities and L of those
   that have bonds. */
PetscErrorCode BondMakeAloneSprings(Contact, const Bond *, PetscReal h, PetscReal (*v)[6], const BodyRoot root[],
                                    AloneSpring spring[]);
/* Iterations instead of a factorisation: forces of the bonds that this rank lists; *good: solved, else nothing is done.
   The same bits on any number of ranks. Collective. */
PetscErrorCode BondSolveSpread(Contact, PetscReal h, PetscBool *good);
