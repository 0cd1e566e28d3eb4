/* Inside of Bodies; for its files only. bodies.c: the state. advance.c: its motion. group.c: options of the groups,
   where their bodies start. */
#pragma once
#include "bodies/write.h"
#include "motion.h"

#define BODIES_MAX_GROUPS 256 /* of a scene */

struct _p_Bodies {
  union { /* the same fields */
    BodyArrays          state;
    struct _n_BodyState view;
  };
  PetscReal   lower[3], upper[3]; /* domain */
  PetscReal   period[3];          /* of a box that travels */
  PetscBool   held;               /* BodiesHold */
  Placement **start;              /* [ngroups][count] what prescribed motion starts from; NULL for groups that have
                                     none */
};

/* Read -particle_groups and the options of all groups, load their shapes, place their bodies in the domain lower ..
   upper. Needs s->dim; sets s->n, s->ngroups and s->group, of which all but `hole`; the rest of the state is not
   touched. body [ngroups][count]: first state of every body, of its centre of mass or its pivot; the caller frees the
   rows and the array. Collective. Errors: those of BodiesCreate but for bodies outside the domain. */
PetscErrorCode BodyGroupsRead(BodyArrays *s, const PetscReal lower[3], const PetscReal upper[3], Placement ***body);

static inline PetscErrorCode check_body(Bodies b, PetscInt k)
{
  PetscFunctionBeginUser;
  PetscCheck(k >= 0 && k < b->state.n, PETSC_COMM_SELF, PETSC_ERR_ARG_OUTOFRANGE, "Body %" PetscInt_FMT " does not exist: there are %" PetscInt_FMT,
             k, b->state.n);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Put what is not free to its prescribed value at `time`: place, orientation and velocities of body k. */
PetscErrorCode BodiesApplyKnown(Bodies, PetscInt k, PetscReal time);
