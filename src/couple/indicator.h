/* Mark: which nodes lie in which body, and which cells they belong to. Layer 2.

   A step begins with MarkClear; then nodes are claimed, all at once by the sign of the distance (MarkInside) or one by one (MarkClaim); MarkFinish lists the cells around them.
   A node that two bodies claim stays with the first. Bodies near a periodic boundary are seen from all sides. The cost follows what the bodies touch. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct _p_Mark *Mark;

/* Reads -couple_search cells|brute: nodes inside a body are looked for near it, or, for comparison, among all. */
PetscErrorCode MarkCreate(Mesh, Bodies, Mark *);
PetscErrorCode MarkDestroy(Mark *);

/* Do the marks stand for bodies at X [n][3] with orientation q [n][4], none gone since, and for this key (anything else that they depend on)? From then on they are taken to:
   a caller who gets `false` draws. Without bodies: true. Not collective, but the same on every rank. */
PetscErrorCode MarkIsCurrent(Mark, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal key, PetscBool *current);
/* The next MarkIsCurrent() says no. */
PetscErrorCode MarkForget(Mark);
PetscErrorCode MarkClear(Mark);
/* Claim every local node (own or ghost) inside a body that is no hole of the mesh, bodies drawn at X, q. Not collective. */
PetscErrorCode MarkInside(Mark, PetscReal (*X)[3], PetscReal (*q)[4]);
/* The same for body k alone. */
PetscErrorCode MarkInsideBody(Mark, PetscInt k, const PetscReal X[3], const PetscReal q[4]);
PetscErrorCode MarkClaim(Mark, PetscInt node, PetscInt body);
/* List the cells of this node as well, without claiming it. */
PetscErrorCode MarkTouch(Mark, PetscInt node);
PetscErrorCode MarkFinish(Mark);
/* Error when a body that is in the domain and no hole of the mesh has claimed no node on any rank: thinner than the nodes' spacing, or outside of the mesh. Collective. */
PetscErrorCode MarkCheckSeen(Mark);

/* node_body [nnode_all] body of a node or -1; the n claimed nodes; own cells with a claimed or touched node. Borrowed; any may be NULL. */
PetscErrorCode MarkGetNodes(Mark, const PetscInt *node_body[], PetscInt *n, const PetscInt *node[]);
PetscErrorCode MarkGetCells(Mark, PetscInt *n, const PetscInt *cell[]);

/* Periodic images of a body: place number image (0 .. 3^dim - 1) of centre X; does a body of this radius drawn there reach the domain? */
PetscBool MarkImage(const MeshLocal *, const PetscReal X[3], PetscReal radius, PetscInt image, PetscReal Xi[3]);
