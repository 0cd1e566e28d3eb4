/* Mesh, flow and bodies from options, for tests of what stands between flow and bodies. */
#pragma once
#include "bodies/write.h"
#include "core.h"
#include "flow/flow.h"

typedef struct {
  Mesh             mesh;
  Flow             flow;
  Bodies           bodies;
  BodyArrays      *s;
  const MeshLocal *l;
} Case;

static inline void open_case(Case *c, const char options[])
{
  give(options);
  OK(MeshCreate(PETSC_COMM_WORLD, &c->mesh));
  OK(MeshGetLocal(c->mesh, &c->l));
  OK(FlowCreate(c->mesh, &c->flow));
  OK(BodiesCreate(c->l->dim, c->l->lower, c->l->upper, &c->bodies));
  OK(BodiesGetArrays(c->bodies, &c->s));
}

static inline void close_case(Case *c)
{
  OK(BodiesDestroy(&c->bodies));
  OK(FlowDestroy(&c->flow));
  OK(MeshDestroy(&c->mesh));
}
