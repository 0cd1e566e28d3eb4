/* Conditions: conditions of the flow on the named boundaries of the mesh.

   Options for boundary <b>: -flow_bc_<b>_type no_slip|moving_wall|rotating_wall|inflow|outflow|slip (default no_slip),
   and for inflow and moving_wall _velocity u,v[,w] (largest one of a profile), _profile uniform|parabolic (over the
   extent of the boundary); for rotating_wall _omega (2D: one number) and _centre x,y[,z] (default: origin): u = omega x
   (x - centre); for all three _factor a,b,T (velocity times a + b sin(2 pi t/T)), _ramp T (rises smoothly from zero
   over T). outflow is the do-nothing condition mu du/dn - p n = 0 of the gradient form; slip fixes the normal component
   on planes along an axis. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_Conditions *Conditions;

/* A vector field: v [dim] at point x [dim] and a time (0 in steady problems). Not collective. */
typedef PetscErrorCode (*VectorField)(void *ctx, PetscReal time, const PetscReal x[], PetscReal v[]);

/* Prescribed components everywhere follow a field in place of the conditions' own values, from the next step on; for
   verification. NULL: back. */
PetscErrorCode ConditionsSetField(Conditions, VectorField, void *ctx);
/* Prescribed components: fixed [nnode_all] bit mask, value [nnode_all][dim] (may be NULL). Borrowed. */
PetscErrorCode ConditionsGetValues(Conditions, const PetscInt *fixed[], const PetscReal *value[]);
/* The prescribed components that belong to walls (no_slip, moving_wall, slip) and not to an inflow: [nnode_all] bit
   mask. Borrowed. */
PetscErrorCode ConditionsGetWalls(Conditions, const PetscInt *wall[]);
/* Is the pressure determined up to a constant only (no outflow)? */
PetscErrorCode ConditionsPressureIsFloating(Conditions, PetscBool *floating);
/* Bit mask of solid faces of the box (no_slip or moving_wall): bit 2 axis for lower, 2 axis + 1 for upper. Boundaries
   of other names do not count. */
PetscErrorCode ConditionsGetSolidFaces(Conditions, PetscInt *faces);
/* Is boundary b a wall (no_slip, moving_wall, rotating_wall, slip), or open (inflow, outflow)? */
PetscErrorCode ConditionsGetKind(Conditions, PetscInt b, PetscBool *wall, PetscBool *open);
/* The boundary whose condition prescribes a component, or -1: owner [nnode_all][dim]. Where boundaries meet it is the
   one whose value holds. */
PetscErrorCode ConditionsGetOwners(Conditions, PetscInt owner[]);
