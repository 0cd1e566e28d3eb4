/* Around: how far places are from the bodies of a scene, for meshes that are refined around them (MeshSurface).

   Asked for a distance within some reach, it looks at those bodies alone whose box, so much larger, holds the place: a
   search grid (base/grid.h) for every power of two of the reach, made when it is first asked for. Which cells there are
   can be asked on any rank, so that all hear where the bodies are while a mesh is made. */
#pragma once
#include "base/grid.h"
#include "bodies/bodies.h"
#include "mesh/mesh.h"

#define AROUND_GRIDS 64

typedef struct {
  Bodies     bodies;
  BodyState *s;
  PetscInt   dim;
  PetscReal  lower[3], upper[3], period[3];
  PetscBool  inside; /* insides count as surface */
  PetscReal  margin; /* distances are less by this */
  /* all bodies by their numbers, while a mesh is made (AroundCollect): [n] */
  PetscInt n, *group;
  PetscReal (*X)[3], (*q)[4], (*u)[3], *scale; /* u: wakes lie against these velocities */
  PetscBool *gone;
  PetscInt   ngrid, power[AROUND_GRIDS]; /* of two, of the reach */
  Grid       grid[AROUND_GRIDS];
  PetscInt  *body[AROUND_GRIDS]; /* of an item: one or an image of one */
} Around;

/* Where the known bodies are: X, q, u [n of the state]; all ranks then know these of all bodies (some 110 bytes each),
   and nothing else, until AroundDrop. Collective. */
PetscErrorCode AroundCollect(Around *, const PetscReal (*X)[3], const PetscReal (*q)[4], const PetscReal (*u)[3]);
PetscErrorCode AroundDrop(Around *);
/* MeshSurface.distance with an Around as context: smallest distance of x to any body that is not gone, from inside 0 or
   positive; grids stay until AroundForget, which is due when bodies have moved. Not collective. */
PetscErrorCode AroundDistance(void *around, const PetscReal x[3], PetscReal reach, PetscReal *d);
PetscErrorCode AroundForget(Around *);
/* MeshSurface.carriers with an Around as context. Error: a wake of bodies that stand still. */
PetscErrorCode AroundCarriers(void *around, const char group[], PetscBool motion, MeshCarriers *);
