/* Inside of ContactCoupling; for its files only. contactcoupling.c: which ties there are, products, blocks of
   bodies. contactcouplingmass.c: the system of masses. contactcouplingadd.c: what ties add to matrices.

   Which rank solves for a body: ties hold bodies together in clusters. A cluster is closed when all its bodies are in
   slots of one rank and no other rank knows them: it is solved for there. Open ones, on all ranks together, are solved
   for by every rank, which gathers their right-hand sides: one point at which ranks wait. Where they are too many for
   that they are iterated, with the closed ones. */
#pragma once
#include "contactcoupling.h"
#include <petscksp.h>

/* A system of tied bodies that this rank solves alone */
typedef struct {
  PetscInt n; /* bodies */
  Mat      mat;
  KSP      ksp;
  Vec      b, x;
} SpringSystem;

struct _p_ContactCoupling {
  Constraint   constraint;
  PetscInt     n, capacity;
  PetscBool    any;
  BodySpring  *spring;             /* [n] of this rank; rows without known degrees of freedom */
  PetscInt     ncoupled, *coupled; /* own tied bodies, of which are in which own slots */
  PetscInt     nblock;             /* largest number of blocks in a row */
  PetscReal   *factor;             /* [ncoupled][nr][nr] L of the own ones */
  PetscReal   *sum;                /* [count][2 + nr^2] of own bodies: number of ties, what they add to the block; how
                                     many other ranks know the body */
  PetscReal   *slots;              /* [count][nr] work */
  PetscBool    iterated;           /* the system of all tied bodies, across ranks; else the two others */
  PetscBool    asked;              /* for, by options */
  PetscInt    *number;             /* [nbodies] of a tied body: iterated: among those of all ranks; else >= 0 among the
                                     closed ones here, <= -2: open, -2 - number; -1: not tied or unknown here */
  PetscInt     first;              /* iterated: number of the first own one */
  Mat          mat;
  KSP          ksp;
  Vec          b, x;
  SpringSystem closed, open;
  MPI_Request  sum_request;
  PetscMPIInt *length, *begin; /* [ranks] of the right-hand side of the open ones */
  PetscInt    *index;          /* [ncoupled] of own tied bodies, numbers as above */
};

/* What the ties of a body come to and numbers of the tied bodies, into t. Collective. */
PetscErrorCode ContactCouplingNumber(ContactCoupling);
/* The systems, as ContactCouplingUpdate; their factors. Collective. */
PetscErrorCode ContactCouplingCreateSystems(ContactCoupling);
PetscErrorCode ContactCouplingForgetSystems(ContactCoupling);
PetscErrorCode ContactCouplingDestroySystems(ContactCoupling);
PetscErrorCode ContactCouplingUpdateSystems(ContactCoupling, const PetscReal mass_inverse[], PetscReal scale);
/* Q of tied own bodies, in place in their slots [count][nr]. Collective. */
PetscErrorCode ContactCouplingSolveSystems(ContactCoupling, PetscReal slots[]);
/* The same, where not iterated, with right-hand sides of the open ones that are sums over ranks of part [nlocal][nr],
   begun before. Collective. */
PetscErrorCode ContactCouplingSumBegin(ContactCoupling, const PetscReal partial[]);
PetscErrorCode ContactCouplingSumEnd(ContactCoupling, PetscReal slots[]);
/* Row of body k in the units of its slots, or, with mass_inverse [nbodies][nr][nr], in those of its factor. Local. */
void ContactCouplingTransformRow(const ConstraintView *, const PetscReal mass_inverse[], PetscInt k,
                                 const PetscReal row[], PetscReal out[]);
/* mat += ties/scale at columns column [nbodies] (-1: not in it), rows as above. Local. */
PetscErrorCode ContactCouplingAdd(ContactCoupling, const PetscInt column[], const PetscReal mass_inverse[],
                                  PetscReal scale, Mat mat);

/* Of the mesh */
static inline MPI_Comm ContactCouplingComm(ContactCoupling t)
{
  return ConstraintGetView(t->constraint)->comm;
}
