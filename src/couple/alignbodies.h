/* AlignBodies: rigid bodies as owner of surfaces that the mesh is lined up with (aligned.h), for the boundary method
   aligned. Their inside is no part of the fluid. */
#pragma once
#include "aligned.h"
#include "bodies/bodies.h"

typedef struct _p_AlignBodies *AlignBodies;

/* With a driver of its own, which others may add their surfaces to. Error: in space, a body thinner than a cell.
   Collective. */
PetscErrorCode AlignBodiesCreate(Flow, Bodies, MeshUpdate, AlignBodies *);
PetscErrorCode AlignBodiesDestroy(AlignBodies *);
AlignDriver    AlignBodiesGetDriver(AlignBodies);

/* AlignDriverUpdate with the bodies drawn at X, q. aligned [nbodies], borrowed. Collective. */
PetscErrorCode AlignBodiesUpdate(AlignBodies, PetscReal (*X)[3], PetscReal (*q)[4], const PetscBool *aligned[]);

/* Vertices are to lie on these points x [n][2], borrowed, of surfaces of bodies (BodySurfacesSetPoints). */
PetscErrorCode AlignBodiesSetPoints(AlignBodies, PetscInt n, const PetscReal x[]);
/* Others with fields on nodes that move: called in every update but the first, before nodes move, with the new fit, and
   how bodies have moved since the last one: displacement [nbodies][3], rotation [nbodies][9] from axes now to axes
   then, times the size then over that now; before: were they aligned then? Collective. Borrowed. */
typedef struct _n_AlignMotion {
  const AlignResult *result;
  const PetscReal (*displacement)[3], (*rotation)[9];
  const PetscBool *before;
  Remap            remap;
} AlignMotion;
typedef PetscErrorCode (*AlignCarry)(void *ctx, const AlignMotion *);
PetscErrorCode AlignBodiesSetCarry(AlignBodies, AlignCarry, void *ctx);

/* When the cells of a mesh are made anew (AlignDriverBeforeRemesh). Collective. */
typedef struct _n_AlignBodiesKept AlignBodiesKept;
PetscErrorCode                    AlignBodiesBeforeRemesh(AlignBodies, AlignBodiesKept **);
PetscErrorCode                    AlignBodiesAfterRemesh(AlignBodies, AlignBodiesKept **, Mesh *old);

/* Part of the state of the coupling; loading is an AlignDriverRestore. Collective. */
PetscErrorCode AlignBodiesVisitState(AlignBodies, State);
