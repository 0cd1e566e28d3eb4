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
  PetscReal value, flux, transfer, conductivity, capacity, source, decay, initial;
  PetscReal expansion, reference; /* its weight: scalarweight.h */
  PetscReal dissolves;            /* its size: scalargrowth.h */
  PetscBool starts;               /* with a value of its own */
  Expr      flux_of;              /* of place, time and scalars, NULL: the number */
} ScalarMaterial;

/* *m zero before. Collective. */
PetscErrorCode ScalarMaterialRead(Couple, const BodyGroup *, const ScalarParameters *, ScalarMaterial *m);
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
/* Conductivity of a sample of a cell of this size at the distance d from the surface, of which chi lies inside. A
   function without a kink is too stiff where a body conducts better than the fluid: as if it were larger. There both
   conduct in series over a zone around the surface, wider as they differ more, which sets the dipole right
   (runs/studies/scalars); what conducts worse than the fluid is taken as it lies. */
PetscReal ScalarMaterialConductivity(PetscReal inside, PetscReal fluid, PetscReal chi, PetscReal d, PetscReal size);
/* Does the group move in time, or its surface? */
PetscBool ScalarGroupMoves(const BodyGroup *);
