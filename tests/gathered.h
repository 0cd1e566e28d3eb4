/* Rows of FlowGatherRows beside those of the assembled matrix. */
#pragma once
#include "core.h"
#include "flow/flow.h"

/* The matrix between local nodes (ghosts too), one sequential matrix by global numbers in ascending order, and each
   node's place in it */
static inline void fetch_matrix(Flow flow, const MeshLocal *l, PetscInt place[], Mat **sub)
{
  PetscInt *number, *node;
  IS        is;
  Mat       S;

  OK(FlowGetMatrix(flow, &S));
  OK(PetscMalloc2(l->nnode_all, &number, l->nnode_all, &node));
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    number[i] = l->node_global[i];
    node[i]   = i;
  }
  OK(PetscSortIntWithArray(l->nnode_all, number, node));
  for (PetscInt i = 0; i < l->nnode_all; i++) place[node[i]] = i;
  OK(ISCreateGeneral(PETSC_COMM_SELF, l->nnode_all, number, PETSC_USE_POINTER, &is));
  OK(MatCreateSubMatrices(S, 1, &is, &is, MAT_INITIAL_MATRIX, sub));
  OK(ISDestroy(&is));
  OK(PetscFree2(number, node));
}

/* Rows around marked nodes [nnode_all] are those of the matrix, at own nodes and ghost nodes of own cells: complete
   where marked, else in columns of marked nodes, and no more than that. Returns how many rows of ghost nodes hold
   something. */
static inline PetscInt compare_rows(Flow flow, const MeshLocal *l, const PetscBool marked[])
{
  PetscInt  *place, nghost = 0;
  PetscBool *held;
  PetscReal *row, size;
  Mat       *sub;
  Rows       rows;

  OK(PetscCalloc3(l->nnode_all, &place, l->nnode_all, &held, l->nnode_all, &row));
  for (PetscInt i = 0; i < l->nnode; i++) held[i] = PETSC_TRUE;
  for (PetscInt e = 0; e < l->ncell * l->nb; e++) held[l->cell_node[e]] = PETSC_TRUE;
  fetch_matrix(flow, l, place, &sub);
  OK(MatNorm(sub[0], NORM_INFINITY, &size));
  OK(FlowGatherRows(flow, marked, &rows));
  assert_int_equal(rows.n, l->nnode_all);
  assert_null(rows.mat);
  for (PetscInt i = 0; i < l->nnode_all; i++) {
    for (PetscInt j = 0; j < l->nnode_all; j++) row[j] = 0;
    for (PetscInt q = rows.start[i]; q < rows.start[i + 1]; q++) {
      assert_true(held[i] && (marked[i] || marked[rows.column[q]]));
      NEAR(row[rows.column[q]], 0, 0); /* once */
      row[rows.column[q]] = rows.value[q];
    }
    nghost += i >= l->nnode && rows.start[i + 1] > rows.start[i];
    for (PetscInt j = 0; j < l->nnode_all && held[i]; j++) {
      PetscReal value;

      if (!marked[i] && !marked[j]) continue;
      OK(MatGetValue(sub[0], place[i], place[j], &value));
      NEAR(row[j], value, 1e-14 * size);
    }
  }
  OK(MatDestroySubMatrices(1, &sub));
  OK(PetscFree3(place, held, row));
  return nghost;
}
