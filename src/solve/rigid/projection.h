/* Inside of Constraint, for the files of this room: constraint.c alone changes it and finds the rows of P; projection.c
   applies P and P^T, at a cost proportional to the number of constrained nodes, and gives P as a matrix for solvers
   that need one.

   A free slot is its own image, so only the inert slots (walls, body nodes) and the following ones are stored, in
   ascending order: for each its number, its body and its row of the rigid map U + w x (x - X) with zeros at known
   degrees of freedom, coef [slots][nr]. */
#pragma once
#include "solve/constraint.h"
#include "sharing.h"

struct _p_Constraint {
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         nbodies, nall, room; /* bodies known here, now; of all ranks; known ones that arrays hold */
  PetscInt         nr, count;           /* rigid slots a body; bodies that this rank has slots for */
  PetscInt         nown, *own;          /* [nown] bodies in these slots, the rest of which are inert */
  unsigned char   *fixed;               /* [nnode_all] bit mask of prescribed components */
  PetscInt        *node_body, *follow;  /* [nnode_all] body a node lies in, follows, or -1 */
  PetscBool       *united;              /* [nbodies] */
  PetscInt        *unknown;             /* [nbodies] bit mask of rigid velocities */
  const PetscReal *value;               /* [nnode_all][dim] at walls, borrowed */
  PetscReal (*X)[3], *U;                /* [nbodies] centres; rigid velocities as given, [nbodies][nr] */
  PetscReal *length;                    /* [nbodies] see ConstraintSetLengths */
  PetscBool  have_bodies;
  PetscInt   nbody_nodes, body_node_room, *body_node; /* local nodes (ghosts too) that lie in a body or follow one,
                                                        ascending */
  /* inert slots; body -1: walls, and bodies without unknowns */
  PetscInt   ninert, *slot, *body, *local_body;
  PetscReal *coef;
  /* slots that follow a body, whose rows are their own slot plus coef */
  PetscInt   nfollow, follow_room, *follow_slot, *follow_body;
  PetscReal *follow_coef;
  PetscInt   nmore, more_room, *more;
  PetscBool  followers_changed;
  PetscInt   npartners, partner_room, (*partner)[2]; /* see ConstraintSetPartners */
  /* bodies that nodes of this rank and its ghosts belong to or follow, and more, ascending; the way to their slots, and
     to the other ranks that know them */
  PetscInt     nlocal, *local_index;    /* [nbodies] body -> local or -1 */
  PetscInt    *local_list, *local_slot; /* [nlocal] body; rank of its slots x count + which of its bodies */
  PetscReal   *local_rigid;             /* [nlocal][nr] as ConstraintFetchRigid left them */
  PetscReal   *packed;                  /* [nlocal][nr] work of ConstraintDeliverRigid */
  PetscSF      rigid_sf;
  PetscLayout  numbers;    /* an even share of all bodies by their numbers, for what goes by no place */
  PetscInt    *slot_of;    /* [nbodies] as local_slot, where not all are known; NULL: place_slots finds them */
  PetscSF      known_sf;   /* from these slots to the known bodies */
  Sharing      sharing;    /* of the nlocal bodies, up to nr numbers each */
  MPI_Datatype rigid_type; /* the nr slots of one body */
};

/* The body that local node i lies in or follows, or -1 */
static inline PetscInt ConstraintGetMover(const struct _p_Constraint *c, PetscInt i)
{
  return c->node_body[i] >= 0 ? c->node_body[i] : c->follow[i];
}

/* Is nothing prescribed at local node i, by a boundary or by a body that it lies in or follows? */
static inline PetscBool ConstraintIsFree(const struct _p_Constraint *c, PetscInt i)
{
  return (PetscBool)(!c->fixed[i] && ConstraintGetMover(c, i) < 0);
}

/* Rigid velocity s of body k, in the units of the scene, for 1 in its slot; the row of the slot is that times the force
   or torque. */
static inline PetscReal ConstraintSlotUnit(const struct _p_Constraint *c, PetscInt k, PetscInt s)
{
  return s < c->loc->dim ? 1 : 1 / c->length[k];
}

/* c of component a of local node i: what is prescribed there, or the known part of a rigid motion */
PetscReal ConstraintKnown(Constraint, PetscInt i, PetscInt a);

/* Local size of u_r and number of those that are nodal (own nodes x dim). Either may be NULL. */
PetscErrorCode ConstraintGetSizes(Constraint, PetscInt *nodal, PetscInt *total);
PetscErrorCode ConstraintCreateVec(Constraint, Vec *ur);
/* Global columns of the first rigid slots in u_r of the bodies that this rank knows, column [nbodies]. Collective. */
PetscErrorCode ConstraintGetRigidColumns(Constraint, PetscInt column[]);

/* The two halves of an application of P^T A P, on the own part of nodal arrays. rigid: the slots of this rank, count x
   nr. Expand: inert and following slots of v are overwritten by P u_r (zero at walls); saved [inert + following slots]
   takes the old values, which PutBack restores. Reduce: rigid += P^T r of the bodies' nodes, then the inert slots of r
   are zeroed. Collective. */
PetscErrorCode ConstraintExpandInPlace(Constraint, const PetscReal rigid[], PetscReal v[], PetscReal saved[]);
PetscErrorCode ConstraintPutBack(Constraint, const PetscReal saved[], PetscReal v[]);
PetscErrorCode ConstraintReduceInPlace(Constraint, PetscReal r[], PetscReal rigid[]);
/* Rigid velocities between the slots of their owner and, in the units of the scene, the bodies this rank knows. Fetch:
   local_rigid = rigid, as Expand does on its way. Deliver: rigid += sum of local [nlocal][nr] (forces, torques) over
   ranks. Collective. */
PetscErrorCode ConstraintFetchRigid(Constraint, const PetscReal rigid[]);
PetscErrorCode ConstraintDeliverRigid(Constraint, const PetscReal local[], PetscReal rigid[]);
/* Rows of n numbers a body, value [nbodies][n] and own [nown][n] in the order of the slots. Sum: own becomes the sum of
   the rows of the ranks that know a body. Copy: own rows go to value, here and on the ranks that know a body.
   Collective. */
PetscErrorCode ConstraintSumRows(Constraint, PetscInt n, const PetscReal value[], PetscReal own[]);
PetscErrorCode ConstraintCopyRows(Constraint, PetscInt n, const PetscReal own[], PetscReal value[]);

/* u = P ur + c on own nodes and ghosts, u [nnode_all][dim]. Collective. */
PetscErrorCode ConstraintExpand(Constraint, Vec ur, PetscReal u[]);
/* ur = free nodal values of u (relative to the body at nodes that follow one) and, in the rigid slots, the unknown
   entries of U [nbodies][nr]; inert slots zero. Local. */
PetscErrorCode ConstraintRestrict(Constraint, const PetscReal u[], const PetscReal U[], Vec ur);
/* Rigid velocities of ur on every rank that knows a body: unknown entries of U [nbodies][nr] are set, known ones kept.
   Collective. */
PetscErrorCode ConstraintGatherRigid(Constraint, Vec ur, PetscReal U[]);

/* P as an assembled matrix, rows: own nodes x dim, columns: u_r. Inert columns are empty. Collective; caller destroys.
   */
PetscErrorCode ConstraintCreateMat(Constraint, Mat *P);
