/* Aggregates: bodies that bonds hold together, by union and find over the graph of bonds; positions in them are
   followed along bonds, so that those across periodic faces are whole. */
#pragma once
#include "contact/bonds.h"

/* Of all aggregates, which have two bodies or more. bonded: bodies in them; rg: radius of gyration of the centres, mean
   by bodies; dimension: the slope of a straight line through log N over log R of the aggregates (least squares), as of
   N ~ R^D; 0 where fewer than two sizes are. */
typedef struct {
  PetscInt  aggregates, largest, bonded;
  PetscReal rg, dimension;
} Aggregates;

/* Of the nbonds bonds of n bodies. number [n] (may be NULL): of the lowest body of its aggregate, -1: alone. Not
   collective. */
PetscErrorCode AggregatesFind(PetscInt n, PetscInt nbonds, const BondView bond[], Aggregates *, PetscInt number[]);
