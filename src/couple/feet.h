/* Feet: fields at the feet of the trajectories that end in the nodes of a new mesh, and how fast the nodes move. For
   those who line the mesh up with surfaces that move with the flow (dropfeet.c, elasticscalars.c).

   A node at x comes from y^n = x - chi d(y^n), d the displacement of the flow in the step, chi 1 near the surface and 0
   away from it, and before that from y^(n-1), which the step before knew at y^n. */
#pragma once
#include "align/align.h"
#include "flow/flow.h"
#include "mesh/remap.h"
#include "scalar/scalar.h"

#define FEET_FAR 6 /* cells: chi is 0 from here on */

/* The mesh before it moves */
typedef struct {
  Mesh             mesh;
  const MeshLocal *loc;
  Remap            remap;
  const PetscReal *way; /* [nnode_all][dim] displacement of the flow */
  /* [nnode_all][dim] x - y of the last step, and of this one; velocity of the nodes as the scheme differentiates */
  PetscReal *shift, *velocity;
  /* Distance of x [dim] from the nearest surface, at most FEET_FAR cells: to there it may be anything larger */
  PetscReal (*distance)(const void *ctx, const MeshLocal *, const PetscReal x[]);
  const void *ctx;
  Scalars     scalars; /* whose fields go along; NULL: none */
} FeetMesh;

typedef struct {
  PetscInt   n; /* own nodes that are carried */
  PetscInt  *node;
  PetscInt   width; /* of a value */
  PetscReal *value; /* [n][width] x - y [dim], then the fields at y [nfield][dim], then what is known here alone */
} Feet;

/* Nodes that go along with the surfaces, or are elsewhere than now, to the places of the result; shift and velocity
   become those of this step, and scalars have their values. Collective. */
PetscErrorCode FeetFind(const FeetMesh *, const FlowStep *, const AlignResult *, PetscInt nfield,
                        const PetscReal *const field[], Feet *);
PetscErrorCode FeetDestroy(Feet *);
/* way <- dt times the velocity in the middle of the step, extrapolated where it can be. Local. */
PetscErrorCode FeetPredict(Flow, const FlowStep *, PetscBool first_order, PetscInt n, PetscReal way[]);
