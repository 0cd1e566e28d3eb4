/* ElasticGap: contact of elastic solids. Closer than a cell to a boundary of the mesh, another solid (periodic images
   too) or a rigid body, an outline is pushed away by the pressure mu (1 - gap/cell), mu its shear modulus: the flow in
   such a gap is not resolved, and a film of it drains too slowly. Implicit: in the matrix of the solids, a spring on
   the way from the predicted positions, of two solids on both, so that each takes what the other gives; a rigid body
   takes the force at the predicted positions. Frictionless. */
#pragma once
#include "elastic.h"

/* Solids at their predicted positions, after ElasticMap, against all that: every node of an outline, with the size of
   the cell it lies in. Nodes within two cells of those that are held are left out: a solid may be fixed to what it
   touches there. Collective. Error: a gap that has closed. */
PetscErrorCode ElasticFindContacts(Elastic *, Couple);
/* entries [unknowns of all solids, over ranks] += how many a row of the matrix needs for these at most. Collective. */
PetscErrorCode ElasticCountContacts(const Elastic *, Vec entries);
/* To the matrix and the force of the solids. Not collective. */
PetscErrorCode ElasticAddContacts(const Elastic *, PetscReal bdt);
/* rows [bodies][nr] += what contact gives rigid bodies in this step, all ranks together. Collective. */
PetscErrorCode ElasticPushBodies(const Elastic *, Couple, PetscReal rows[]);
/* Of the step solved: power of contact on elastic solids, what this rank found. Not collective. */
PetscReal ElasticContactPower(const Elastic *);
