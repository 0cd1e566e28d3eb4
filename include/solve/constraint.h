/* Constraint: the projection u = P u_r + c of the nodal velocity onto what may move freely.

   The reduced vector u_r has one slot for every velocity component of every own node, followed by the rigid velocities
   (translation, then rotation: 3 numbers in 2D, 6 in 3D) of bodies that have most of their nodes here, and inert slots
   in place of more of them. The layout never changes; what changes is the meaning of a slot:

     node                      its slots                 its velocity
     free                      u_i                       slot
     at a wall (component)     inert (zero)              value in c
     inside body k             inert                     U_k + w_k x (x_i - X_k) (+ slip in c)
     relative to body k        velocity relative to it   slot + U_k + w_k x (x_i - X_k)

   Degrees of freedom of a body that are unknown come from u_r, prescribed ones (fixed, given motion, explicit coupling)
   go to c. Relative velocities are a mere change of unknowns, for nodes that something else (penaltyterm.h) ties to the
   body: it keeps the system well conditioned.
   What the solver does with P stands in the private projection.h. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_Constraint *Constraint;

/* nbodies: bodies that may have unknown rigid velocities. Collective. */
PetscErrorCode ConstraintCreate(Mesh, PetscInt nbodies, Constraint *);
/* The same where a rank knows some of the nbodies alone (bodies/local.h): arrays [nbodies] below are then those of the
   bodies known here, of which there is room for so many, and each has its slots on the rank of its owner, which has
   slots for `count` of them, the same on all ranks. None is known yet. Collective. */
PetscErrorCode ConstraintCreateLocal(Mesh, PetscInt nbodies, PetscInt capacity, PetscInt count, Constraint *);
PetscErrorCode ConstraintGetCapacity(Constraint, PetscInt *capacity, PetscInt *count);
/* The bodies known from now on: rank that owns each [n], and which of its own ones it is. Lengths and what bodies unite
   with are to be set again; the next ConstraintSetBodies says that something has changed. Collective. */
PetscErrorCode ConstraintSetLocal(Constraint, PetscInt n, const PetscMPIInt rank[], const PetscInt which[]);
/* Bodies that a rank has slots for, if nothing else is said */
PetscInt       ConstraintSlots(MPI_Comm, PetscInt nbodies);
PetscErrorCode ConstraintDestroy(Constraint *);

/* A length of every body, [nbodies], such as its radius; 1 before. The slots of rotation in u_r hold w times that
   length, and their rows a torque divided by it: all slots of u_r are then speeds and all rows forces, whatever the
   units of a scene. Copied. Local. */
PetscErrorCode ConstraintSetLengths(Constraint, const PetscReal length[]);

/* Prescribed components: fixed [nnode_all] bit mask of components, copied, value [nnode_all][dim], borrowed until
   the next call. Collective. */
PetscErrorCode ConstraintSetBoundary(Constraint, const unsigned char fixed[], const PetscReal value[]);

/* Nodes whose velocity is relative to a body in this step: relative [nnode_all] body or -1 (NULL: none), same on all
   ranks that hold the node; further bodies [nmore] whose rigid velocities this rank needs. Takes effect in the next
   ConstraintSetBodies. Copied. */
PetscErrorCode ConstraintSetRelative(Constraint, const PetscInt relative[], PetscInt nmore, const PetscInt more[]);
/* Pairs of bodies [n][2] (second < 0: none) whose rigid velocities are wanted on one rank, that of the slots of
   either. Takes effect in the next ConstraintSetBodies. Copied. Local. */
PetscErrorCode ConstraintSetPairs(Constraint, PetscInt n, const PetscInt pair[][2]);
/* Bodies of this step: node_body [nnode_all] index of the body a node lies in or -1; X [nbodies][3] the centres;
   unknown [nbodies] bit mask of unknown rigid velocities in the order of the rigid slots; U [nbodies][nr] the values of
   the known ones (unknown entries ignored). Walls win over bodies. *changed (may be NULL): has the set of constrained
   nodes, unknowns or centres changed since the last call (on any rank)? Collective. */
PetscErrorCode ConstraintSetBodies(Constraint, const PetscInt node_body[], PetscReal (*X)[3], const PetscInt unknown[],
                                   const PetscReal U[], PetscBool *changed);
/* Nodes of the mesh have moved: the next ConstraintSetBodies measures their arms anew, though bodies are where they
   were. Local. */
void ConstraintMoveNodes(Constraint);

/* Velocity beside the rigid motion at nodes that lie in bodies, slip [nnode_all][dim], in c; NULL: none. Borrowed.
   Local. */
PetscErrorCode ConstraintSetSlip(Constraint, const PetscReal slip[]);
/* Bodies that may overlap one another count as one surface: a cell between them is inside, no gap. united [nbodies].
   Copied. */
PetscErrorCode ConstraintSetUnited(Constraint, const PetscBool united[]);
/* Rigid slots of a body: 3 in 2D, 6 in 3D. */
PetscErrorCode ConstraintGetRigidSize(Constraint, PetscInt *nr);
/* Which body does a local node lie in (-1: none)? [nnode_all] */
PetscErrorCode ConstraintGetNodeBody(Constraint, const PetscInt *node_body[]);
/* R [dim][nr] of any local node i about the centre of body k: its velocity for unit rigid velocities (unknown or not).
   */
PetscErrorCode ConstraintRigidMap(Constraint, PetscInt i, PetscInt k, PetscReal R[]);
/* The same about any centre, for plane or periodic distance. */
void ConstraintRigidAt(const MeshLocal *, PetscInt i, const PetscReal X[3], PetscReal R[]);
