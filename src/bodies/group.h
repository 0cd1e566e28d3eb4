/* Inside of Bodies; for its files only. bodies.c: state and motion. bodygroup.c: options of the groups, where their bodies start.

   The options are those of bodies.h, with motion.h and place.h for the parts that have modules of their own. */
#pragma once
#include "bodies/bodies.h"

#define BODIES_MAX_GROUPS 256 /* of a scene */

/* Read -particle_groups and the options of all groups, load their shapes, place their bodies in the domain lower .. upper. Needs s->dim; sets s->n, s->ngroups and s->group, of which
   all but `hole`; the rest of the state is not touched. body [ngroups][count]: first state of every body, of its centre of mass or its pivot; the caller frees the rows and the array.
   Collective. Errors: those of BodiesCreate but for bodies outside the domain. */
PetscErrorCode BodyGroupsRead(BodyState *s, const PetscReal lower[3], const PetscReal upper[3], Placement ***body);
