/* ScalarGrowth: bodies that dissolve or grow by what goes through their surface: their volume V changes by

     dV/dt = -a Q,   Q: amount of the scalar a time that the surface lets into the fluid,

   a of -particle_<group>_<scalar>_dissolves, summed over the scalars. What holds an amount C by volume and has
   the value c at its surface dissolves with a = 1/(C - c); what melts, of latent heat L by volume, with a = -1/L.
   Shapes stay similar. The fluid that takes the place moves as the body did and has the value of the surface; the
   body's momentum goes with its mass. Left out: the Stefan flow, the fluid's velocity through the surface where its
   density is another than the body's.

   V follows the scheme of the scalars, c_t V - d(V) = -a Q. Bodies are drawn with the size that Q extrapolated gives,
   before the step is solved for. A body that is about to be smaller than a cell is removed. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"
#include "scalarmaterial.h"

/* Of a body */
typedef struct {
  PetscReal have;               /* rates known, 0 to 2 */
  PetscReal volume, volume_old; /* V at T^n, T^{n-1}; 0: not begun */
  PetscReal rate, rate_old;     /* of the last two steps */
  PetscReal size, size_old;     /* relative to the shape, as drawn in the last two steps */
} BodyGrowth;

typedef struct {
  PetscInt              n;        /* scalars; 0: no group grows */
  const ScalarMaterial *material; /* [ngroups][n] */
  BodyGrowth           *last;     /* [nbodies] */
  PetscReal            *rate;     /* [nbodies] of the step */
  PetscBool             told;     /* that a body is gone */
} ScalarGrowth;

/* n scalars, material [ngroups][n], borrowed. Local. */
PetscErrorCode ScalarGrowthCreate(Couple, PetscInt n, const ScalarMaterial *material, ScalarGrowth *);
PetscErrorCode ScalarGrowthDestroy(Couple, ScalarGrowth *);
/* A step begins: bodies get their sizes at its end. Collective. */
PetscErrorCode ScalarGrowthBegin(ScalarGrowth *, Couple);
/* Largest step in which no surface goes more than half a cell. Collective. */
PetscErrorCode ScalarGrowthLimit(const ScalarGrowth *, Couple, PetscReal *dt);
/* Radial velocity of points of body k over their distance from the point about which it shrinks or grows */
PetscReal ScalarGrowthGetRate(const ScalarGrowth *, Couple, PetscInt k);
/* Heat a time of scalar i that bodies at a value free as their size changes: it stays in the fluid. Collective. */
PetscErrorCode ScalarGrowthFreed(const ScalarGrowth *, Couple, Scalars, PetscInt i, PetscReal *freed);
/* Scalar i is solved for, scalars from 0 on: flux [nbodies] into the fluid. Local. */
void ScalarGrowthMeasure(ScalarGrowth *, Couple, PetscInt i, const PetscReal flux[]);
/* The step is taken; bodies that are gone are removed. Collective. */
PetscErrorCode ScalarGrowthAccept(ScalarGrowth *, Couple);
PetscErrorCode ScalarGrowthVisit(ScalarGrowth *, Couple, State);
