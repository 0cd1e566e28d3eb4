/* Marks: the set of mesh/mark.h, for the formula of leaves.h. */
#pragma once
#include "mesh/mark.h"
#include "leaves.h"

/* The set is known from now on as far as `reach` of a rank's regions, in the lattice of these leaves. Collective. */
PetscErrorCode MarksLook(MeshMarks, const Leaves *, Regions, PetscReal reach);
/* Is the cell of this level and key in it? */
PetscBool MarksHave(const struct _p_MeshMarks *, PetscInt level, uint64_t key);
