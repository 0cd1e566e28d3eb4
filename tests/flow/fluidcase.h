/* Mesh and flow from options, for tests of the flow alone. */
#pragma once
#include "core.h"
#include "flow/flow.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  const MeshLocal *l;
  PetscInt         dim;
} Case;

static inline void open_case(Case *c, const char options[])
{
  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  c->dim = c->l->dim;
}

static inline void close_case(Case *c)
{
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}

/* y = S x of own nodes, of every component */
static inline void multiply(const Case *c, PetscReal x[], PetscReal y[])
{
  const PetscInt n = c->l->nnode * c->dim;
  Mat            S, A;
  Vec            in, out;

  if (FlowIsMatrixFree(c->flow)) {
    OK(FlowMultiply(c->flow, PETSC_FALSE, x, y));
    return;
  }
  OK(FlowGetMatrix(c->flow, &S));
  OK(MatCreateMAIJ(S, c->dim, &A));
  OK(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, n, PETSC_DETERMINE, x, &in));
  OK(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, n, PETSC_DETERMINE, y, &out));
  OK(MatMult(A, in, out));
  OK(VecDestroy(&in));
  OK(VecDestroy(&out));
  OK(MatDestroy(&A));
}
