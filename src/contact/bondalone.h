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

/* Those of a bond, one a mode; index: local numbers (< 0: a wall). Reads the forces in c->at_once. */
PetscErrorCode BondMakeAloneSprings(Contact, const Bond *, PetscReal h, AloneSpring spring[]);
/* Iterations instead of a factorisation: speed at which the modes of the bonds that this rank lists part in the end, in
   their order; *good: solved. The same bits on any number of ranks. Collective. */
PetscErrorCode BondSolveSpread(Contact, PetscReal h, PetscReal speed[], PetscBool *good);
