/* Constraint, for the files of this room: what it says of the present step, as a view to be read, and applications of P
   and P^T. constraint.c alone changes it, with rows.c, which finds the rows of P, and slots.c, which finds the ranks of
   the rigid slots; projection.c applies P, at a cost proportional to the number of constrained nodes, and gives P as a
   matrix for solvers that need one. Its struct is in constraintimpl.h, for these four alone. */
#pragma once
#include "sharedreduction.h"
#include "solve/constraint.h"

/* Rows of P, in ascending order of slots: number of the nodal slot, its body and its row of the rigid map
   U + w x (x - X) with zeros at prescribed degrees of freedom */
typedef struct {
  PetscInt         n;
  const PetscInt  *slot, *body; /* [n] body -1: walls, and bodies without unknowns */
  const PetscInt  *local_body;  /* [n] its index among the nlocal bodies, or -1; of inert slots alone */
  const PetscReal *coef;        /* [n][nr] */
} ConstraintRows;

/* Read-only view, as MeshLocal is of a Mesh. "Known here": bodies whose arrays this rank has (ConstraintSetLocal);
   local: those of them that have nodes or ghosts here, and more, in ascending order. */
typedef struct {
  MPI_Comm         comm; /* of the mesh */
  const MeshLocal *loc;
  PetscInt         nbodies, nall, capacity; /* bodies known here, now; of all ranks; that arrays hold */
  PetscInt         nr, count;               /* rigid slots a body; bodies that this rank has slots for */
  PetscInt         nown;                    /* bodies in these slots, the rest of which are inert */
  const PetscInt  *own;                     /* [nown] */
  /* bodies */
  const PetscInt  *unknown; /* [nbodies] bit mask of rigid velocities */
  const PetscBool *united;  /* [nbodies] */
  const PetscReal (*X)[3];  /* [nbodies] centres */
  const PetscReal *length;  /* [nbodies] see ConstraintSetLengths */
  const PetscReal *U;       /* [nbodies][nr] rigid velocities as given */
  /* nodes */
  const unsigned char *fixed;     /* [nnode_all] bit mask of prescribed components */
  const PetscInt      *node_body; /* [nnode_all] body that a node lies in, or -1 */
  const PetscInt      *relative;  /* [nnode_all] body that a node's velocity is relative to, or -1 */
  PetscInt             nbody_nodes;
  const PetscInt      *body_node; /* local nodes (ghosts too) that lie in a body or are relative to one, ascending */
  ConstraintRows       inert;     /* slots without an unknown */
  ConstraintRows       relative_rows; /* slots relative to a body, whose rows are their own slot plus coef */
  /* bodies that nodes of this rank and its ghosts belong to or are relative to, and more, ascending */
  PetscInt         nlocal;
  const PetscInt  *local_index;      /* [nbodies] body -> local or -1 */
  const PetscInt  *local_list;       /* [nlocal] body */
  const PetscInt  *local_slot;       /* [nlocal] rank of its slots x count + which of its bodies */
  const PetscReal *local_rigid;      /* [nlocal][nr] as ConstraintFetchRigid left them */
  SharedReduction  shared_reduction; /* of the nlocal bodies, up to nr numbers each */
} ConstraintView;

/* It stays where it is; what it holds changes with the Constraint. */
static inline const ConstraintView *ConstraintGetView(Constraint c)
{
  return (const ConstraintView *)c; /* its first member */
}

/* Is rigid velocity s of body k solved for? */
static inline PetscBool ConstraintIsUnknown(const ConstraintView *c, PetscInt k, PetscInt s)
{
  return (PetscBool)((c->unknown[k] >> s) & 1);
}

/* Is any of it? */
static inline PetscBool ConstraintHasUnknown(const ConstraintView *c, PetscInt k)
{
  return (PetscBool)(c->unknown[k] != 0);
}

/* The body that local node i lies in or is relative to, or -1 */
static inline PetscInt ConstraintGetMover(const ConstraintView *c, PetscInt i)
{
  return c->node_body[i] >= 0 ? c->node_body[i] : c->relative[i];
}

/* Is nothing prescribed at local node i, by a boundary or by a body that it lies in or is relative to? */
static inline PetscBool ConstraintIsFree(const ConstraintView *c, PetscInt i)
{
  return (PetscBool)(!c->fixed[i] && ConstraintGetMover(c, i) < 0);
}

/* Rigid velocity s of body k, in the units of the scene, for 1 in its slot; the row of the slot is that times the force
   or torque. */
static inline PetscReal ConstraintSlotUnit(const ConstraintView *c, PetscInt k, PetscInt s)
{
  return s < c->loc->dim ? 1 : 1 / c->length[k];
}

/* c of component a of local node i: what is prescribed there, or the known part of a rigid motion */
PetscReal ConstraintGetPrescribed(Constraint, PetscInt i, PetscInt a);

/* Local size of u_r and number of those that are nodal (own nodes x dim). Either may be NULL. */
PetscErrorCode ConstraintGetSizes(Constraint, PetscInt *nodal, PetscInt *total);
PetscErrorCode ConstraintCreateVec(Constraint, Vec *ur);
/* Global columns of the first rigid slots in u_r of the bodies that this rank knows, column [nbodies]. Collective. */
PetscErrorCode ConstraintGetRigidColumns(Constraint, PetscInt column[]);

/* The two halves of an application of P^T A P, on the own part of nodal arrays. rigid: the slots of this rank, count x
   nr. Expand: inert and relative slots of v are overwritten by P u_r (zero at walls). Reduce: rigid += P^T r of the
   bodies' nodes, then the inert slots of r are zeroed. Collective. */
PetscErrorCode ConstraintExpandInPlace(Constraint, const PetscReal rigid[], PetscReal v[]);
PetscErrorCode ConstraintReduceInPlace(Constraint, PetscReal r[], PetscReal rigid[]);
/* Rigid velocities between the slots of their owner and, in the units of the scene, the bodies this rank knows. Fetch:
   local_rigid = rigid, as Expand does on its way. Deliver: rigid += sum of local [nlocal][nr] (forces, torques) over
   ranks. Collective. */
PetscErrorCode ConstraintFetchRigid(Constraint, const PetscReal rigid[]);
PetscErrorCode ConstraintDeliverRigid(Constraint, const PetscReal local[], PetscReal rigid[]);
/* rigid, as it is in the slots, at the local bodies: local [nlocal][nr], which stays until the next exchange.
   Collective. */
PetscErrorCode ConstraintFetchSlots(Constraint, const PetscReal rigid[], const PetscReal *local[]);
/* Rows of n numbers a body, value [nbodies][n] and own [nown][n] in the order of the slots. Sum: own becomes the sum of
   the rows of the ranks that know a body. Copy: own rows go to value, here and on the ranks that know a body.
   Collective. */
PetscErrorCode ConstraintSumRows(Constraint, PetscInt n, const PetscReal value[], PetscReal own[]);
PetscErrorCode ConstraintCopyRows(Constraint, PetscInt n, const PetscReal own[], PetscReal value[]);
/* own [count] = sum of local [nlocal] over the ranks that have the body as a local one. Collective. */
PetscErrorCode ConstraintSumCounts(Constraint, const PetscInt local[], PetscInt own[]);

/* u = P ur + c on own nodes and ghosts, u [nnode_all][dim]. Collective. */
PetscErrorCode ConstraintExpand(Constraint, Vec ur, PetscReal u[]);
/* ur = free nodal values of u (relative to the body at nodes that follow one) and, in the rigid slots, the unknown
   entries of U [nbodies][nr]; inert slots zero. Local. */
PetscErrorCode ConstraintRestrict(Constraint, const PetscReal u[], const PetscReal U[], Vec ur);
/* Its rigid slots alone, rigid [count][nr]. Local. */
void ConstraintRestrictRigid(Constraint, const PetscReal U[], PetscReal rigid[]);
/* Rigid velocities of the slots of ur, rigid [count][nr], on every rank that knows a body: unknown entries of U
   [nbodies][nr] are set, known ones kept. Collective. */
PetscErrorCode ConstraintGatherRigid(Constraint, const PetscReal rigid[], PetscReal U[]);

/* P as an assembled matrix, rows: own nodes x dim, columns: u_r. Inert columns are empty. Collective; caller destroys.
   */
PetscErrorCode ConstraintCreateMat(Constraint, Mat *P);
