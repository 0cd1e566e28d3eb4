/* Indicator: which nodes lie in which body, and which cells they belong to.

   A step begins with IndicatorClear; then nodes are claimed, all at once by the sign of the distance
   (IndicatorInside) or one by one (IndicatorAssign); IndicatorFinish lists the cells around them. A node that two
   bodies claim stays with the first. Bodies near a periodic boundary are seen from all sides. The cost follows what
   the bodies touch. */
#pragma once
#include "bodies/bodies.h"
#include "mesh/mesh.h"

typedef struct _p_Indicator *Indicator;

PetscErrorCode IndicatorCreate(Mesh, Bodies, Indicator *);
PetscErrorCode IndicatorDestroy(Indicator *);

/* Were the bodies last asked about at X [n][3] with orientation q [n][4], none gone since, and with this key (anything
   else that marks depend on)? Without bodies: true. Collective. */
PetscErrorCode IndicatorIsCurrent(Indicator, PetscReal (*X)[3], PetscReal (*q)[4], PetscReal key, PetscBool *current);
/* The next IndicatorIsCurrent() says no. */
PetscErrorCode IndicatorInvalidate(Indicator);
PetscErrorCode IndicatorClear(Indicator);
/* Claim every local node inside a body that is no hole of the mesh, bodies drawn at X, q. Not collective. */
PetscErrorCode IndicatorInside(Indicator, PetscReal (*X)[3], PetscReal (*q)[4]);
/* The same for body k alone. */
PetscErrorCode IndicatorInsideBody(Indicator, PetscInt k, const PetscReal X[3], const PetscReal q[4]);
PetscErrorCode IndicatorAssign(Indicator, PetscInt node, PetscInt body);
/* List the cells of this node as well, without claiming it. */
PetscErrorCode IndicatorAddCells(Indicator, PetscInt node);
PetscErrorCode IndicatorFinish(Indicator);
/* Error when a body that is in the domain and no hole of the mesh has claimed no node on any rank: thinner than the
   nodes' spacing, or outside of the mesh. Collective. */
PetscErrorCode IndicatorCheckSeen(Indicator);

/* node_body [nnode_all] body of a node or -1; the n claimed nodes; own cells with a claimed or touched node.
   Borrowed; any may be NULL. */
PetscErrorCode IndicatorGetNodes(Indicator, const PetscInt *node_body[], PetscInt *n, const PetscInt *node[]);
PetscErrorCode IndicatorGetCells(Indicator, PetscInt *n, const PetscInt *cell[]);
