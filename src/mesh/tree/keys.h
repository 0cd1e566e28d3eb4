/* Keys: a table from 64-bit keys to numbers, for what is found by its place on a lattice. Open addressing (Knuth, The
   Art of Computer Programming 3, 6.4), at most half full; grows by itself. Not collective. */
#pragma once
#include <petscsys.h>
#include <stdint.h>

typedef struct {
  uint64_t *key;
  PetscInt *value; /* -1: free */
  PetscInt  n, capacity;
} Keys;

PetscErrorCode KeysDestroy(Keys *);
/* The value of a key, or -1. */
PetscInt KeysFind(const Keys *, uint64_t key);
/* Value of the key, which is put in with `value` >= 0 if it is new. */
PetscErrorCode KeysAdd(Keys *, uint64_t key, PetscInt value, PetscInt *found);
