/* Owners: what participants of a flow's step add to its equations, each under its own name (flow.h: FlowAddCellTerms,
   FlowAddOperator, FlowAddForce, FlowAddVolume). The same owner again replaces what it had; n = 0 or NULL removes it.
   Lists are short: loops over them are per owner, never per cell. */
#pragma once
#include "flow/device.h"
#include "flow/flow.h"

#define FLOW_OWNERS 16

typedef struct {
  const void      *owner;
  PetscInt         n;
  const PetscInt  *cell;    /* [n] */
  const PetscReal *matrix;  /* [n][nb][nb] */
  FlowMoments      moments; /* as FlowDescribeCellTerms had them */
  const PetscReal *lumped;  /* FlowCountCellTerms(), or NULL */
} CellTerms;

typedef struct {
  const void  *owner;
  FlowOperator is;
  Mat          formed;  /* P^T E P; NULL: nobody has asked for it, or products are done sooner without */
  Vec          work[2]; /* P x, E P x; NULL: no product yet */
} OwnedOperator;

typedef struct {
  const void      *owner;
  const PetscReal *f; /* [nnode_all][dim] */
} OwnedForce;

typedef struct {
  const void *owner;
  FlowVolume  is;
} OwnedVolume;

typedef struct {
  PetscInt      nterms, noperators, nforces, nvolumes;
  CellTerms     terms[FLOW_OWNERS];
  OwnedOperator operators[FLOW_OWNERS];
  OwnedForce    forces[FLOW_OWNERS];
  OwnedVolume   volumes[FLOW_OWNERS];
  PetscReal    *lumped; /* [nnode_all] sum of the operators' and the terms', NULL: nobody asked */
  /* owners of what belonged to a mesh that is no more, and who have not spoken since */
  PetscInt    nlost;
  const void *lost[4 * FLOW_OWNERS];
} Owners;

/* Where `owner` stands among the n entries of `size` bytes in a list, each of which begins with its owner: with add its
   entry or a new one at the end (error: there are `max` already), else -1, and what follows it closes up. Local. */
PetscErrorCode OwnersAssign(PetscInt max, void *list, size_t size, PetscInt *n, const void *owner, PetscBool add,
                            PetscInt *at);
/* r [nnode_all][dim] += the part of own cells and nodes of what owners push with, to be summed over ranks. Local. */
void OwnersAddForces(const struct _p_Flow *, PetscReal r[]);
/* imposed [own cells]: int div u that owners ask for where the pressure is p (FlowAddVolume); NULL: there are none. To
   be freed. Error: an owner with C, and p is NULL. Local. */
PetscErrorCode OwnersSumVolumes(const struct _p_Flow *, const PetscReal p[], PetscReal *imposed[]);
/* What owners had belongs to a mesh that is no more: they are remembered as lost. Not collective. */
void OwnersLose(const Owners *before, Owners *now);
/* Error: an owner is lost, or (properties) FlowSetProperties has not been called again. The same on all ranks. */
PetscErrorCode OwnersCheck(const struct _p_Flow *);
PetscErrorCode OwnersClear(Owners *);
