/* Inside of Constraint, for constraint.c, rows.c, slots.c and projection.c alone; everybody else reads its view
   (projection.h), whose arrays these are. */
#pragma once
#include "projection.h"
#include <stddef.h>

/* Arrays of ConstraintRows */
typedef struct {
  PetscInt   capacity, *slot, *body, *local_body;
  PetscReal *coef;
} RowArrays;

/* What the ranks of the rigid slots are found by, and the ways to them */
typedef struct {
  PetscLayout  numbers;    /* an even share of all bodies by their numbers, for what goes by no place */
  PetscInt    *owner_slot; /* [nbodies] as local_slot, where not all are known; NULL: slots.c finds them */
  PetscSF      owner_sf;   /* from these slots to the known bodies */
  PetscSF      sf;         /* to the local bodies */
  MPI_Datatype type;       /* the nr slots of one body */
  PetscInt    *local_index, *local_list, *local_slot;
  PetscReal   *local_rigid, *packed; /* [nlocal][nr]; work of projection.c */
} RigidSlots;

/* Bodies that are to be local although no node here belongs to them, see ConstraintSetRelative, ConstraintSetPairs */
typedef struct {
  PetscInt  nmore, more_capacity, *more;
  PetscInt  npair, pair_capacity, (*pair)[2];
  PetscBool changed; /* these, or what nodes are relative to */
} WantedBodies;

struct _p_Constraint {
  ConstraintView   view; /* the first member, see ConstraintGetView */
  Mesh             mesh;
  PetscBool        have_bodies;
  const PetscReal *value; /* [nnode_all][dim] at walls, borrowed */
  const PetscReal *slip;  /* [nnode_all][dim] at nodes of bodies beside the rigid motion, borrowed; NULL: none */
  PetscReal       *U;     /* [nbodies][nr] rigid velocities as given */
  PetscReal (*X)[3], *length;
  unsigned char *fixed;
  PetscInt      *own, *unknown, *node_body, *relative;
  PetscBool     *united;
  PetscInt       body_node_capacity, *body_node;
  RowArrays      inert, relative_rows;
  RigidSlots     slots;
  WantedBodies   wanted;
};
_Static_assert(offsetof(struct _p_Constraint, view) == 0, "ConstraintGetView reads the first member");

/* rows.c: the inert slots; the slots relative to bodies; the nodes of bodies. Local. */
PetscErrorCode ConstraintCollectInert(Constraint);
PetscErrorCode ConstraintCollectRelative(Constraint);
PetscErrorCode ConstraintListBodyNodes(Constraint);
/* slots.c: list the local bodies and connect them to their slots and to the other ranks that know them. Collective. */
PetscErrorCode ConstraintConnectSlots(Constraint);
