/* Calm: which nodes no body and no moving mesh has touched for some steps, so that differences in time mean something
   there. */
#pragma once
#include "mesh/mesh.h"

#define CALM_STEPS 3 /* after which what was disturbed counts again */

/* age [nnode_all]: steps since a node was disturbed, CALM_STEPS at most. All are calm. Local. */
void CalmBegin(const MeshLocal *, PetscReal age[]);
/* A step was taken, with these bodies at nodes (CoupleGetNodeBody). Local. */
void CalmStep(const MeshLocal *, const PetscInt body[], PetscReal age[]);
/* To another mesh: a velocity [nnode_all][dim] and ages, of one PetscMalloc2, give way to those there. A node between
   disturbed ones counts as one. Collective. */
PetscErrorCode CalmCarry(Mesh old, Mesh now, PetscReal **velocity, PetscReal **age);
