/* ScalarMaterial: what a group of bodies is for a scalar, by its options (scalarbodies.h), and what is refused. */
#pragma once
#include "bodies/bodies.h"
#include "scalar/scalar.h"
#include "couple/couple.h"
#include "base/expr.h"

enum {
  SCALAR_BODY_CONJUGATE,
  SCALAR_BODY_VALUE,
  SCALAR_BODY_FLUX,
  SCALAR_BODY_TRANSFER,
  SCALAR_BODY_LUMPED
};

typedef struct {
  PetscInt  condition;
  PetscReal value, flux, transfer, conductivity, capacity, source, initial;
  PetscReal expansion, reference; /* its weight: scalarweight.h */
  PetscBool starts;               /* with a value of its own */
  Expr      flux_of;              /* of place, time and scalars, NULL: the number */
} ScalarMaterial;

/* *m zero before. Collective. */
PetscErrorCode ScalarMaterialRead(Couple, const BodyGroup *, const ScalarParameters *, ScalarMaterial *m);
PetscErrorCode ScalarMaterialForget(ScalarMaterial *);
/* Of body k with a flux by an expression, where the step has it; no flux: it has none. Local. */
void ScalarMaterialSurface(Couple, const ScalarMaterial *, PetscInt k, ScalarSurface *);
/* Is it what the fluid is made of? */
PetscBool ScalarMaterialIsFluid(const ScalarMaterial *, const ScalarParameters *);
/* Does it let a flux through its surface, or exchange? */
static inline PetscBool ScalarMaterialIsSurface(const ScalarMaterial *m)
{
  return (PetscBool)(m->condition == SCALAR_BODY_FLUX || m->condition == SCALAR_BODY_TRANSFER);
}
/* Does the group move in time? */
PetscBool ScalarGroupMoves(const BodyGroup *);
