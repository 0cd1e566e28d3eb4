/* ScalarWeight: what bodies weigh as they expand with a scalar (-particle_<group>_<scalar>_expansion): as if their
   density were rho (1 - expansion (T - reference)), T the mean of the body, extrapolated to the step; their mass and
   size stay (as Boussinesq has it for the fluid). The weight acts at the centroid, also where T differs inside. */
#pragma once
#include "scalarmaterial.h"
#include "base/state.h"

typedef struct {
  PetscInt              n; /* scalars; 0: no group expands */
  const ScalarMaterial *material;
  PetscReal            *last; /* [nbodies][n][3]: how many means are known, at T^n, T^{n-1} */
} ScalarWeight;

/* n scalars, material [ngroups][n], borrowed. Local. */
PetscErrorCode ScalarWeightCreate(Couple, PetscInt n, const ScalarMaterial *material, ScalarWeight *);
PetscErrorCode ScalarWeightDestroy(Couple, ScalarWeight *);
/* Sets the weight of bodies for a step that begins, which extrapolates by so much. Local. */
PetscErrorCode ScalarWeightBegin(ScalarWeight *, Couple, PetscReal extrapolation);
/* Before the step is taken: means of its solution. Collective. */
PetscErrorCode ScalarWeightAccept(ScalarWeight *, Couple, Scalars);
PetscErrorCode ScalarWeightVisit(ScalarWeight *, Couple, State);
