/* Constraint: the projection u = P u_r + c of the nodal velocity onto what may move freely.

   The reduced vector u_r has one slot for every velocity component of every own node, followed by the rigid velocities
   (translation, then rotation: 3 numbers in 2D, 6 in 3D) of the bodies this rank owns. The layout never changes; what changes is the meaning of a slot:
     * node free                      u_i = its slot
     * component prescribed (wall)    slot inert (zero), value in c
     * node inside body k             slots inert, u_i = U_k + w_k x (x_i - X_k); degrees of freedom of the body that are unknown
                                      come from u_r, known ones (fixed, prescribed, explicit coupling) go to c
     * node that follows body k       its slot is the velocity relative to the body, u_i = slot + U_k + w_k x (x_i - X_k). A mere change of unknowns, for nodes
                                      that something else (penaltyterm.h) ties to the body: it keeps the system well conditioned
   P and P^T are applied matrix-free at a cost proportional to the number of constrained nodes; ConstraintCreateMat gives P as a matrix for solvers that need one. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_Constraint *Constraint;

/* nbodies: bodies that may have unknown rigid velocities. Collective. */
PetscErrorCode ConstraintCreate(Mesh, PetscInt nbodies, Constraint *);
PetscErrorCode ConstraintDestroy(Constraint *);

/* Prescribed components: fixed [nnode_all] bit mask of components, value [nnode_all][dim]. Collective. */
PetscErrorCode ConstraintSetBoundary(Constraint, const PetscInt fixed[], const PetscReal value[]);

/* Nodes that follow a body in this step: follow [nnode_all] body or -1 (NULL: none), same on all ranks that hold the node; further bodies [nmore] whose rigid velocities this rank
   needs (ConstraintGetLocalRigid). Takes effect in the next ConstraintSetBodies. Copied. */
PetscErrorCode ConstraintSetFollowers(Constraint, const PetscInt follow[], PetscInt nmore, const PetscInt more[]);
/* Bodies of this step: node_body [nnode_all] index of the body a node lies in or -1; X [nbodies][3] the centres; unknown [nbodies] bit mask of unknown
   rigid velocities in the order of the rigid slots; U [nbodies][nr] the values of the known ones (unknown entries ignored). Walls win over bodies. Collective.
   *changed (may be NULL): has the set of constrained nodes, unknowns or centres changed since the last call (on any rank)? */
PetscErrorCode ConstraintSetBodies(Constraint, const PetscInt node_body[], PetscReal (*X)[3], const PetscInt unknown[], const PetscReal U[],
                                   PetscBool *changed);

/* Rigid slots of a body: 3 in 2D, 6 in 3D. */
PetscErrorCode ConstraintGetRigidSize(Constraint, PetscInt *nr);
/* Local size of u_r and number of those that are nodal (own nodes x dim). */
PetscErrorCode ConstraintGetSizes(Constraint, PetscInt *nodal, PetscInt *total);
PetscErrorCode ConstraintCreateVec(Constraint, Vec *ur);
/* Which body does a local node lie in, which does it follow (-1: none)? [nnode_all] */
PetscErrorCode ConstraintGetNodeBody(Constraint, const PetscInt *node_body[]);
PetscErrorCode ConstraintGetFollow(Constraint, const PetscInt *follow[]);
/* The local nodes (ghosts too) that lie in a body or follow one, ascending. */
PetscErrorCode ConstraintGetBodyNodes(Constraint, PetscInt *n, const PetscInt *node[]);
/* Inert slots among the own nodal ones, ascending. */
PetscErrorCode ConstraintGetInert(Constraint, PetscInt *n, const PetscInt *slot[]);
/* The constrained (body) slots of this rank as rows of P: slot[i] = sum_s coef[i*nr + s] * rigid velocity s of body[i]; walls have body -1. Same order as ConstraintGetInert. */
PetscErrorCode ConstraintGetRows(Constraint, const PetscInt *body[], const PetscReal *coef[]);
/* The following slots of this rank, whose rows are their own slot plus coef[] as above. */
PetscErrorCode ConstraintGetFollowers(Constraint, PetscInt *n, const PetscInt *slot[], const PetscInt *body[], const PetscReal *coef[]);
/* R [dim][nr] of any local node i about the centre of body k: its velocity for unit rigid velocities (unknown or not). */
PetscErrorCode ConstraintRigidMap(Constraint, PetscInt i, PetscInt k, PetscReal R[]);
/* The same about any centre, for plane or periodic distance. */
void           ConstraintRigidAt(const MeshLocal *, PetscInt i, const PetscReal X[3], PetscReal R[]);
PetscErrorCode ConstraintGetUnknown(Constraint, const PetscInt *unknown[]);
/* Rigid velocities as given to ConstraintSetBodies, [nbodies][nr]. */
PetscErrorCode ConstraintGetRigid(Constraint, const PetscReal *U[]);
/* First body whose rigid slots this rank holds, and how many. */
PetscErrorCode ConstraintGetOwnBodies(Constraint, PetscInt *first, PetscInt *count);
/* Global column of the first rigid slot of every body in u_r, column [nbodies]. Collective. */
PetscErrorCode ConstraintGetRigidColumns(Constraint, PetscInt column[]);
/* Known part c, [nnode_all][dim]. */
PetscErrorCode ConstraintGetKnown(Constraint, const PetscReal *c[]);

/* The two halves of an application of P^T A P, on the own part of nodal arrays. rigid: own bodies x nr.
   Expand: inert and following slots of v are overwritten by P u_r (zero at walls); saved [inert + following slots] takes the old values, which PutBack restores.
   Reduce: rigid += P^T r of the bodies' nodes, then the inert slots of r are zeroed. Collective. */
PetscErrorCode ConstraintExpandInPlace(Constraint, const PetscReal rigid[], PetscReal v[], PetscReal saved[]);
PetscErrorCode ConstraintPutBack(Constraint, const PetscReal saved[], PetscReal v[]);
PetscErrorCode ConstraintReduceInPlace(Constraint, PetscReal r[], PetscReal rigid[]);
/* Rigid velocities between their owner and the bodies this rank knows: local [n][nr], index [nbodies] number of a body among the n or -1.
   Fetch: local = rigid, as Expand does on its way. Deliver: rigid += sum of local over ranks. Collective. */
PetscErrorCode ConstraintGetLocalRigid(Constraint, PetscInt *n, const PetscInt *index[], const PetscReal *local[]);
PetscErrorCode ConstraintFetchRigid(Constraint, const PetscReal rigid[]);
PetscErrorCode ConstraintDeliverRigid(Constraint, const PetscReal local[], PetscReal rigid[]);

/* u = P ur + c on own nodes and ghosts, u [nnode_all][dim]. Collective. */
PetscErrorCode ConstraintExpand(Constraint, Vec ur, PetscReal u[]);
/* ur = free nodal values of u (relative to the body at nodes that follow one) and, in the rigid slots, the unknown entries of U [nbodies][nr]; inert slots zero. Local. */
PetscErrorCode ConstraintRestrict(Constraint, const PetscReal u[], const PetscReal U[], Vec ur);
/* Rigid velocities of ur on every rank: unknown entries of U [nbodies][nr] are overwritten, known ones kept. Collective. */
PetscErrorCode ConstraintGatherRigid(Constraint, Vec ur, PetscReal U[]);

/* P as an assembled matrix, rows: own nodes x dim, columns: u_r. Inert columns are empty. Collective; caller destroys. */
PetscErrorCode ConstraintCreateMat(Constraint, Mat *P);
