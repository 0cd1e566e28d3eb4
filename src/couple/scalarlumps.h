/* ScalarLumps of bodies: groups with the condition lumped, whose bodies have one value each (small Biot numbers: they
   conduct so well that nothing differs inside), an unknown of the scalar's system (scalar/scalar.h). */
#pragma once
#include "scalarmaterial.h"

typedef struct _p_BodyLumps *BodyLumps;

/* n scalars, material [ngroups][n], borrowed. NULL: no group is lumped. Local. */
PetscErrorCode BodyLumpsCreate(Couple, PetscInt n, const ScalarMaterial *material, BodyLumps *);
PetscErrorCode BodyLumpsDestroy(Couple, BodyLumps *);
/* Tells scalar i its bodies: of_node [nnode_all] whose node it is, borrowed; as_fluid: cells inside are the fluid's,
   what they hold too much is taken off. Local; NULL: nothing. */
PetscErrorCode BodyLumpsSet(BodyLumps, Couple, Scalars, PetscInt i, const ScalarParameters *, const PetscInt of_node[],
                            PetscBool as_fluid);
/* The step is taken. Local; NULL: nothing. */
PetscErrorCode BodyLumpsAccept(BodyLumps, Couple);
/* A state without them leaves the values that bodies begin with. Collective; NULL: nothing. */
PetscErrorCode BodyLumpsVisit(BodyLumps, Couple, State);
/* Value of body k, which this rank knows, in scalar i; its group is lumped */
PetscReal BodyLumpsGetValue(BodyLumps, PetscInt i, PetscInt k);
