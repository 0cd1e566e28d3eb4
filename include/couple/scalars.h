/* CoupleScalars: what the flow carries (scalar/scalar.h), as a participant of the step: buoyancy before the flow is
   solved for, with values extrapolated; then each scalar with the new velocity. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"

/* A scalar in the step solved */
typedef struct {
  const ScalarParameters *par;
  ScalarBalance           balance;
  PetscReal               error; /* |rest| over size */
  PetscReal    covered;          /* heat a time that appears as bodies cover and free cells, less what is given back */
  PetscReal   *boundary;         /* [nboundary] heat a time that it lets in */
  PetscBool   *open;             /* [nboundary] has it a value or a flux? */
  PetscInt     ngroups;
  PetscReal   *group;      /* [ngroups] heat a time that its bodies let into the fluid */
  const char **group_name; /* [ngroups] NULL: is it solved for inside, or a hole of the mesh? */
  PetscReal   *nusselt;    /* [nboundary] of its mean flux, 0: no value or flux is given there; NULL: none */
} CoupleScalar;

/* Fewest cells that the layer of a scalar has around a body of a group (scalar/layer.h), the Peclet number of that
   body, by its diameter and the fastest fluid near it, and the largest U dt/(D/U) of one: its way of a step over the
   length that conduction reaches ahead of it */
typedef struct {
  PetscReal cells, peclet, way;
} ScalarLayer;

/* Borrowed: places stay, values change in every step; *n 0: there are none. Not collective. */
PetscErrorCode CoupleGetScalars(Couple, PetscInt *n, const CoupleScalar *scalar[]);
/* ScalarsSetReader of the scalars, if there are any. Collective. */
PetscErrorCode CoupleStartScalars(Couple, ScalarsReader);
/* Value of scalar i at all nodes T [nnode_all] as last accepted, without its mean gradient. Not collective. */
PetscErrorCode CoupleGetScalarField(Couple, PetscInt i, PetscReal T[]);
/* Of scalar i around the bodies of all groups, as they and the fluid move now: layer [ngroups], cells PETSC_MAX_REAL
   where a group is none but the fluid's material. Collective. */
PetscErrorCode CoupleMeasureScalarLayers(Couple, PetscInt i, ScalarLayer layer[]);
