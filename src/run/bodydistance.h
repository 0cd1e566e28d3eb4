/* BodyDistance: how far places are from the particles of a scene, rigid bodies, elastic ones and the interface of
   drops, for meshes that are refined around them (MeshSurface).

   Asked for a distance within some reach, it looks at those bodies alone that a search grid finds so near
   (base/neargrid.h). While a mesh is made a rank knows the bodies near the cells that it asks about: their owners send
   where they are. All ranks know all elastic ones, and the interface. */
#pragma once
#include "align/surfaces.h"
#include "base/neargrid.h"
#include "bodies/bodies.h"
#include "dropdistance.h"
#include "mesh/mesh.h"

typedef struct {
  MPI_Comm   comm;
  Bodies     bodies;
  BodyState *s;
  PetscInt   dim;
  PetscReal  lower[3], upper[3], period[3];
  PetscBool  inside; /* insides count as surface */
  PetscReal  margin; /* distances are less by this */
  /* where the mesh is to have the known bodies, and their velocities, against which wakes lie: [n of the state]; NULL:
     those of the state */
  PetscReal (*X)[3], (*q)[4], (*u)[3];
  const AlignSurfaces *solids; /* elastic ones, where the mesh is to have them; NULL: there are none */
  DropDistance         drops;  /* NULL: there are none */
  /* bodies that may be asked about (BodyDistanceGather), by their numbers: [n] */
  PetscInt n, *group;
  PetscReal (*near_X)[3], (*near_q)[4], (*near_u)[3], *scale;
  PetscBool *removed, *own;
  NearGrid   grid;
} BodyDistance;

/* MeshSurface.look with a BodyDistance as context: a rank knows the bodies that are nearer than reach to its regions
   (some 120 bytes each), until the next look or BodyDistanceFree. Collective. */
PetscErrorCode BodyDistanceGather(void *ctx, RankBoxes, PetscReal reach);
PetscErrorCode BodyDistanceFree(BodyDistance *);
/* Bodies that may be asked about. */
static inline PetscInt BodyDistanceCount(const BodyDistance *s)
{
  return s->n + (s->solids ? s->solids->n : 0);
}
/* Does the scene have any, known or not? */
static inline PetscBool BodyDistanceHasAny(const BodyDistance *s)
{
  return (PetscBool)(s->s->nall || s->solids || s->drops);
}
/* MeshSurface.distance with a BodyDistance as context: smallest distance of x to any body that is not gone, from
   inside 0 or positive, and to the interface of drops on both sides. Not collective. */
PetscErrorCode BodyDistanceAt(void *ctx, const PetscReal x[3], PetscReal reach, PetscReal *d);
/* MeshSurface.carriers with a BodyDistance as context. Error: a wake of bodies that stand still. */
PetscErrorCode BodyDistanceWakeBoxes(void *ctx, const char group[], PetscBool motion, MeshCarriers *);
