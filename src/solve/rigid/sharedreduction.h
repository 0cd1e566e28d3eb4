/* SharedReduction: sums over the ranks that know a body.

   A body touches the nodes of one rank or of a few. What these have for it is added between them alone: each sends its
   part to each of the others, one message a pair of ranks, and adds the parts in the order of ranks, so that all have
   the same bits. Bodies on more than REDUCTION_MANY ranks, whose number does not grow with the number of bodies, are
   summed over all ranks at once. What a rank sends is proportional to the bodies at its border. */
#pragma once
#include <petscsf.h>

#define REDUCTION_MANY 8 /* as many ranks as parts that meet in a corner in space */

typedef struct _p_SharedReduction *SharedReduction;

/* From a star forest whose n leaves (contiguous) are the entries of this rank and whose roots say which are the same
   one: leaves in one order on all ranks. Sums have up to `max_unit` numbers an entry. The forest is not kept.
   Collective. */
PetscErrorCode SharedReductionCreate(PetscSF, PetscInt n, PetscInt max_unit, SharedReduction *);
PetscErrorCode SharedReductionDestroy(SharedReduction *);
/* value [n][unit], unit <= max_unit: becomes the sum over all entries of the same root; nothing is done on one rank,
   and without a SharedReduction. Collective. */
PetscErrorCode SharedReductionSum(SharedReduction, PetscInt unit, PetscReal value[]);
/* The same in two parts, between which other exchanges may go on, but no other of this SharedReduction; value stays as
   it is until the end. Collective. */
PetscErrorCode SharedReductionSumBegin(SharedReduction, PetscInt unit, const PetscReal value[]);
PetscErrorCode SharedReductionSumEnd(SharedReduction, PetscInt unit, PetscReal value[]);
/* Entries that other ranks have too, and numbers that one number an entry sends to them. Either may be NULL. Local. */
PetscErrorCode SharedReductionGetSizes(SharedReduction, PetscInt *shared, PetscInt *sent);
