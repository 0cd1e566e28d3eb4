/* The inside of Accuracy, for accuracy.c and accuracytime.c. */
#pragma once
#include "sim.h"

/* Order of the error in space, on the low side: by how bodies are drawn. Collective. */
PetscErrorCode AccuracyFindOrder(const SimComponents *, PetscReal *order);
/* Is a body thinner than so many cells? Collective. */
PetscErrorCode AccuracyIsThin(const SimComponents *, PetscReal limit, PetscBool *thin);
/* Into the summary and the terminal; bound: it is no more than that; parts [2] of space and time, NULL: none.
   Collective. */
PetscErrorCode AccuracyReport(const SimComponents *, const char what[], PetscReal error, PetscBool bound,
                              const PetscReal by_source[2]);
/* A remark where the preset that was asked for promises less. Collective. */
PetscErrorCode AccuracyCompare(const char what[], PetscReal error, const PetscReal by_source[2], PetscReal order);
/* Error on the mesh of a steady solution by what elements of the next order find beside it, -1: not known; *bound: at
   most; corners: bodies have some. Collective. */
PetscErrorCode AccuracyByOrder(const SimComponents *, PetscBool corners, PetscReal *error, PetscBool *bound);
