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
