/* Array: arrays that grow together. */
#pragma once
#include <petscsys.h>

/* Makes room for n entries in each of some arrays: their addresses and the sizes of an entry in turn, NULL at the end,
   as in ArrayReserve(n + 1, &capacity, &node, sizeof(*node), &x, 3 * sizeof(*x), NULL). Grows by doubling. Not
   collective. */
PetscErrorCode ArrayReserve(PetscInt n, PetscInt *capacity, ...);
/* The other way: where a quarter of the room and more holds nothing, room for n entries and no more. Arrays that are
   filled again in every step and stay about as long would keep twice what they need. Not collective. */
PetscErrorCode ArrayTrim(PetscInt n, PetscInt *capacity, ...);
/* This rank has `what` ("matrices of cells") of n entries, which are counted by PetscInt. Error, the same on all
   ranks: on one of them there are more than it counts. Before they are made. Collective. */
PetscErrorCode ArrayCheckSize(MPI_Comm, const char what[], PetscReal n);
