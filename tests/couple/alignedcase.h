/* A mesh, bodies and their align, as the tests of align in the plane and in space open them. */
#pragma once
#include "core.h"
#include "bodies/write.h"
#include "couple/bodysurfaces.h"

typedef struct {
  Mesh             mesh;
  const MeshLocal *l;
  Bodies           bodies;
  BodyArrays      *state;
  BodySurfaces     surfaces;
  Align            align;
  AlignResult      r;
  PetscBool        wanted[8], aligned[8];
  PetscReal        quality; /* worst so far */
  PetscInt         failed;  /* bodies that were left alone so far */
} Case;

/* The mesh and the bodies are there */
static void open_align(Case *c)
{
  OK(BodiesGetArrays(c->bodies, &c->state));
  OK(BodySurfacesCreate(c->bodies, &c->surfaces));
  OK(BodySurfacesSet(c->surfaces, c->state->x, c->state->q));
  OK(BodySurfacesRefusePlates(c->surfaces, c->mesh));
  OK(AlignCreate(c->mesh, BodySurfacesGet(c->surfaces), &c->align));
  for (int k = 0; k < 8; k++) c->wanted[k] = PETSC_TRUE;
}

static void fit(Case *c)
{
  OK(BodySurfacesSet(c->surfaces, c->state->x, c->state->q));
  OK(AlignFit(c->align, c->wanted, NULL, c->aligned, &c->r));
  OK(MeshMoveNodes(c->mesh, c->r.nnode, c->r.node, c->r.x));
}

static void close_case(Case *c)
{
  OK(AlignDestroy(&c->align));
  OK(BodySurfacesDestroy(&c->surfaces));
  OK(BodiesDestroy(&c->bodies));
  OK(MeshDestroy(&c->mesh));
}

/* Largest distance of a wall node from its wall */
static PetscReal miss(Case *c)
{
  PetscReal top = 0;

  for (PetscInt e = 0; e < c->r.nmarked; e++) {
    const PetscInt i = c->r.marked[e], k = c->r.node_surface[i];
    PetscReal      d, x[3];

    if (!c->r.on_wall[i]) continue;
    for (PetscInt a = 0; a < c->l->dim; a++)
      x[a] = DomainNearest(c->l->period[a], c->l->x[c->l->dim * i + a], c->state->x[k][a]);
    OK(BodiesDistance(c->bodies, k, c->state->x[k], c->state->q[k], 1, x, &d));
    top = PetscMax(top, PetscAbsReal(d));
  }
  return largest(top);
}
