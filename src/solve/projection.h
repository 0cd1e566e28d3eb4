#pragma once
#include "solve/constraint.h"

struct _p_Constraint {
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nbodies, nr, first, count; /* bodies; rigid slots each; own range */
  PetscInt        *fixed, *node_body, *follow, *unknown;
  PetscReal       *value, *known, (*X)[3], *U;
  PetscBool        have_bodies;
  PetscInt         nbody_nodes, body_node_room, *body_node; /* local nodes with node_body >= 0 */
  /* rows of P at inert slots */
  PetscInt   ninert, *slot, *body, *local_body;
  PetscReal *coef;
  /* the same for slots that follow a body */
  PetscInt   nfollow, follow_room, *follow_slot, *follow_body;
  PetscReal *follow_coef;
  PetscInt   nmore, more_room, *more;
  PetscBool  followers_changed;
  /* bodies that own nodes of this rank belong to or follow, and more; the way to their slots */
  PetscInt     nlocal, *local_index; /* [nbodies] body -> local or -1 */
  PetscInt    *local_list;
  PetscReal   *local_rigid;
  PetscSF      rigid_sf;
  MPI_Datatype rigid_type; /* the nr slots of one body */
};
