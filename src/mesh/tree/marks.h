/* Marks: the set of mesh/mark.h, for the formula of leaves.h. */
#pragma once
#include "mesh/mark.h"
#include "leaves.h"

#define MARKS_WIDTH 4 /* numbers of a cell on its way to other ranks: its place, its level */

typedef struct {
  PetscInt n, capacity, (*x)[3];
} MarkedCells;

struct _p_MeshMarks {
  PetscInt    n, (*own)[MARKS_WIDTH]; /* refined cells of this rank */
  Keys        refined[LEAVES_MAX_LEVELS + 1];
  MarkedCells cell[LEAVES_MAX_LEVELS + 1]; /* in the order of coming */
};

/* The set is known from now on as far as `reach` of a rank's regions, in the lattice of these leaves. Collective. */
PetscErrorCode MarksLook(MeshMarks, const Leaves *, RankBoxes, PetscReal reach);
/* Is the cell of this level and key in it? */
static inline PetscBool MarksHave(const struct _p_MeshMarks *m, PetscInt level, uint64_t key)
{
  return (PetscBool)(KeysFind(&m->refined[level], key) >= 0);
}
