/* Marks: the set of mesh/mark.h, for the formula of leaves.h. */
#pragma once
#include "mesh/mark.h"
#include "leaves.h"

/* Is the cell of this level and key in it? */
PetscBool MarksHave(const struct _p_MeshMarks *, PetscInt level, uint64_t key);
