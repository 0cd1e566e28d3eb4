/* ElasticTensions: membranes whose area is held as a whole (-particle_<group>_global_area_modulus k).

   The tension s = k (A/A_0 - 1) is the same everywhere on a membrane, and its force at the nodes s times l = dA/dx.
   What the law has of it is that of the step before, which makes a matrix of cells like any other; what it gains in
   the step would couple all nodes of the membrane with each other. It is an unknown of its own: with the area linear
   about the predicted positions,
     l . P u - ds A_0 c_t/k = c_t (A_0 - A + s A_0/k - l . (a - x*)),
   a row that the solver holds by a force with the weights P^T l (FlowIntegral in solve/system.h). */
#pragma once
#include "couple/couple.h"
#include "solve/system.h"

struct Elastic;

typedef struct {
  PetscInt      n, *solid; /* such membranes */
  FlowIntegral *row;       /* [n] */
  PetscReal    *weight;    /* [n][own nodes][dim] P^T l */
  PetscReal    *l;         /* [nodes of all solids][dim], the same on all ranks */
  PetscReal    *tension;   /* [solids] at the end of the step solved */
} ElasticTensions;

/* Once; and what depends on the mesh. Local. ElasticTensionsConnect: of CoupleParticipant. */
PetscErrorCode ElasticTensionsCreate(struct Elastic *);
PetscErrorCode ElasticTensionsMakeOnMesh(struct Elastic *, Couple);
PetscErrorCode ElasticTensionsConnect(Couple, void *elastic, FlowSolver);
PetscErrorCode ElasticTensionsDiscard(struct Elastic *);
PetscErrorCode ElasticTensionsDestroy(struct Elastic *);
/* The rows of the step, at its predicted positions, with its P. Collective. */
PetscErrorCode ElasticTensionsSet(struct Elastic *, Couple);
/* Of the step solved: into the force on the flow and that of the solids. Local. */
PetscErrorCode ElasticTensionsTake(struct Elastic *, Couple);
/* Of the step solved: the area of solid k, 0: it is not held */
PetscReal ElasticTensionsGetArea(const struct Elastic *, PetscInt k);
