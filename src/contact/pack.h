/* Inside of packing: pack.c moves and grows the bodies, packgap.c knows the gaps between them. */
#pragma once
#include "impl.h"

#define PACK_COLOURS 8 /* of blocks of cells, at most */

typedef struct {
  Contact    c;
  PetscReal  size, slack, mean;                         /* of all packed bodies; mean radius */
  PetscBool  round;                                     /* bodies count as their bounding circles */
  PetscBool  fine;                                      /* gaps are sought between the surface points */
  PetscReal *inverse_mass, *inverse_moment, *travelled; /* [n] travelled: path of a body */
  PetscReal (*of_owner)[4];                             /* [n] of ghosts, from owners: position, travelled */
  PetscReal *bound, *mark;             /* [capacity] of pairs: a gap it had, what its bodies had moved then */
  PetscInt   capacity, sweeps, lists;  /* lists: that the contact had made when this one was put in order */
  PetscInt   ncells[3];                /* of the domain */
  PetscInt   colour[PACK_COLOURS + 1]; /* first pair of each */
  PetscReal  worst;                    /* that gaps lacked in the last sweep */
  PetscReal (*lower)[3], (*upper)[3];  /* [ngroups] where a body must stay; infinite along periodic axes */
} Pack;

static inline const Packing *PackingOf(const Pack *p, PetscInt k)
{
  return &BodiesGetGroup(p->c->state, k)->pack;
}

/* Gap that a pair, or body i and a face of its box, must have */
static inline PetscReal PackMargin(const Pack *p, PetscInt i, PetscInt j)
{
  const Packing *a = PackingOf(p, i), *b = j >= 0 ? PackingOf(p, j) : a;

  return PetscMax(a->wanted ? a->margin : 0, b->wanted ? b->margin : 0);
}

/* The deepest point of a pair, or of body k and a face of its box; gap PETSC_MAX_REAL: not near */
PetscErrorCode PackLookAtPair(Pack *, PetscInt i, PetscInt j, Touch *);
PetscErrorCode PackLookAtFace(Pack *, PetscInt k, PetscInt face, Touch *);
