/* Fitted: bodies that are holes of the mesh.

   A boundary of the mesh that is named like a particle group (boundary `cylinder` of -mesh_kind fitted, group
   `cylinder`), or lies where the surface of a group's one body is, within a twentieth of its radius and with the
   fluid outside, is the surface of that body. The flow then ends at the surface: the velocity there is that of the
   boundary condition (-flow_bc_<boundary>_type, no_slip by default), nothing is marked inside, and the body does not
   move (`free: none`). Forces are read from the cells that touch the boundary.
   Residual form: F = -sum over the nodes of the boundary of R^T (momentum residual), conservative and of the order
   of the element (Giles, Larson, Levenstam, Suli 1997). The gradient form of the viscous term misses the torque -2
   mu w |body| of a rotating boundary, which is added here (design section 2). Volume form: -int sigma . grad(alpha),
   alpha the finite element function that is 1 on the boundary; it leaves out the inertia of the fluid weighted by
   alpha. */
#pragma once
#include "bodies/bodies.h"
#include "flow/flow.h"

typedef struct _p_Fitted *Fitted;

/* Finds the groups that are boundaries and notes it in BodyGroup.body_fitted. Collective. Errors: such a group has
   several bodies or one that is free to move; the boundary is not the surface of the body's shape (nodes further from
   it than a tenth of its radius) that has its name. */
PetscErrorCode FittedCreate(Flow, Bodies, Fitted *);
PetscErrorCode FittedDestroy(Fitted *);
/* [nnode_all] permanent number of the body on whose surface a node lies, or -1. Borrowed. */
PetscErrorCode FittedGetNodeBody(Fitted, const PetscInt *node_body[]);
/* Force and torque about the centre of mass in residual and in volume form of all bodies that are holes, from the
   solution u [nnode_all][dim], p [own cells][dim + 1] of the step and what others give the nodes (FlowGetGiven; NULL:
   nothing): arrays [n][3] of the known bodies, entries of others untouched, either pair may be NULL. Collective. */
PetscErrorCode FittedForce(Fitted, const PetscReal u[], const PetscReal p[], const PetscReal given[],
                           PetscReal (*force)[3], PetscReal (*torque)[3], PetscReal (*volume_force)[3],
                           PetscReal (*volume_torque)[3]);
