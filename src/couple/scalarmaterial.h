/* ScalarMaterial: what a group of bodies is for a scalar, by its options (scalarbodies.h), and what is refused. */
#pragma once
#include "bodies/bodies.h"
#include "scalar/scalar.h"
#include "couple/couple.h"
#include "base/expr.h"
#include "scalarcover.h"

enum {
  SCALAR_BODY_CONJUGATE,
  SCALAR_BODY_VALUE,
  SCALAR_BODY_FLUX,
  SCALAR_BODY_TRANSFER,
  SCALAR_BODY_LUMPED
};

typedef struct {
  PetscInt  condition;
  PetscReal value, flux, transfer, conductivity, capacity, source, decay, initial;
  PetscReal expansion, reference; /* its weight: scalarweight.h */
  PetscReal dissolves;            /* its size: scalargrowth.h */
  PetscBool starts;               /* with a value of its own */
  Expr      flux_of;              /* of place, time and scalars, NULL: the number */
} ScalarMaterial;

/* *m zero before. Collective. */
PetscErrorCode ScalarMaterialRead(Couple, const BodyGroup *, const ScalarParameters *, ScalarMaterial *m);
/* Likewise of a group of that name that is no rigid body: conjugate */
PetscErrorCode ScalarMaterialReadPhase(Couple, const char group[], const ScalarParameters *, ScalarMaterial *m);
PetscErrorCode ScalarMaterialForget(ScalarMaterial *);
/* Of body k with a flux of scalar i by an expression, where the step has it, material [ngroups][n]; no flux: it has
   none. Local. */
void ScalarMaterialSurface(Couple, const ScalarMaterial material[], PetscInt n, PetscInt i, PetscInt k,
                           ScalarSurface *);
/* Is it what the fluid is made of? */
PetscBool ScalarMaterialIsFluid(const ScalarMaterial *, const ScalarParameters *);
/* Does it let a flux through its surface, or exchange? */
static inline PetscBool ScalarMaterialIsSurface(const ScalarMaterial *m)
{
  return (PetscBool)(m->condition == SCALAR_BODY_FLUX || m->condition == SCALAR_BODY_TRANSFER);
}
/* Have its nodes its value? */
static inline PetscBool ScalarMaterialHasValue(const ScalarMaterial *m)
{
  return (PetscBool)(m->condition == SCALAR_BODY_VALUE || m->condition == SCALAR_BODY_LUMPED);
}
/* What a cell of this size that a surface cuts is made of, `at` of cover; scale: of the capacity in excess of the
   fluid's; surface [nbodies]. pool has room for 5 cover->count numbers, which out borrows. Local. */
void ScalarMaterialSamples(const ScalarMaterial *, const ScalarParameters *, const ScalarCover *cover,
                           const CoveredCell *at, PetscReal size, PetscReal scale, const ScalarSurface surface[],
                           PetscReal *pool, ScalarSamples *out);
/* Does the group move in time, or its surface? */
PetscBool ScalarGroupMoves(const BodyGroup *);
