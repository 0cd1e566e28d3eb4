/* Conditions: conditions of the flow on the named boundaries of the mesh.

   The velocity of an inflow or a wall is the largest one of its profile, parabolic over the extent of the boundary, or
   an expression of x, y, z and t (of the end of the step), which profile, factor and ramp multiply as well; a
   rotating wall has omega x (x - centre). outflow is the do-nothing condition mu du/dn - p n = 0 of the gradient form;
   slip fixes the normal component on planes along an axis. pressure is outflow with a pressure P outside, a number or
   an expression of x, y, z and t that factor and ramp multiply: mu du/dn - p n = -P n; it drives the flow in or out. */
#pragma once
#include "mesh/mesh.h"

typedef struct _p_Conditions *Conditions;

/* A vector field: v [dim] at point x [dim] and a time (0 in steady problems). Not collective. */
typedef PetscErrorCode (*VectorField)(void *ctx, PetscReal time, const PetscReal x[], PetscReal v[]);

/* Prescribed components everywhere follow a field in place of the conditions' own values, from the next step on; for
   verification. NULL: back. */
PetscErrorCode ConditionsSetField(Conditions, VectorField, void *ctx);
/* Nodes have moved within boundaries: values at the new positions, at the time that was set last. Collective. */
PetscErrorCode ConditionsRenew(Conditions);
/* Prescribed components: fixed [nnode_all] bit mask, value [nnode_all][dim] (may be NULL). Borrowed. */
PetscErrorCode ConditionsGetValues(Conditions, const unsigned char *fixed[], const PetscReal *value[]);
/* Prescribed components of walls (no_slip, moving_wall, slip), not of an inflow: [nnode_all] bit mask. Borrowed. */
PetscErrorCode ConditionsGetWalls(Conditions, const unsigned char *wall[]);
/* The largest speed that a boundary prescribes, at the largest of its factor and after its ramp; of an expression, at
   the present time. Collective. */
PetscErrorCode ConditionsGetSpeed(Conditions, PetscReal *speed);
/* Is the pressure determined up to a constant only (neither outflow nor pressure)? */
PetscErrorCode ConditionsPressureIsFloating(Conditions, PetscBool *floating);
/* Along which axes can a uniform force change the mean velocity? Along periodic ones, and between outflows or
   pressures across the axis at different positions; elsewhere what is prescribed says what flows. Bit mask of axes.
   Collective. */
PetscErrorCode ConditionsGetOpenAxes(Conditions, PetscInt *axes);
/* Along which axes can the mesh travel as a whole, without taking a wall with it that is not parallel to the
   displacement? Bit mask of axes. Collective. */
PetscErrorCode ConditionsGetSlidingAxes(Conditions, PetscInt *axes);
/* Does the fluid stick to boundary b (no_slip, moving_wall, rotating_wall), and may that move? */
PetscErrorCode ConditionsSticks(Conditions, PetscInt b, PetscBool *sticks, PetscBool *moves);
/* Velocity v [3] that boundary b has at its position x at the time of the step, 0 where nothing is prescribed. Not
   collective. */
PetscErrorCode ConditionsGetVelocity(Conditions, PetscInt b, const PetscReal x[3], PetscReal v[3]);
/* Bit mask of solid sides of the box (no_slip or moving_wall): bit 2 axis for lower, 2 axis + 1 for upper. Boundaries
   of other names do not count, nor those that lie elsewhere. */
PetscErrorCode ConditionsGetSolidFaces(Conditions, PetscInt *faces);
/* Is boundary b a wall (no_slip, moving_wall, rotating_wall, slip), or open (inflow, outflow, pressure)? */
PetscErrorCode ConditionsGetKind(Conditions, PetscInt b, PetscBool *wall, PetscBool *open);
/* Is boundary b of type outflow or pressure? */
PetscErrorCode ConditionsIsOutflow(Conditions, PetscInt b, PetscBool *outflow);
/* Is any boundary open? Local. */
PetscBool ConditionsHaveOpening(Conditions);
/* Is boundary b of type pressure? */
PetscBool ConditionsHasPressure(Conditions, PetscInt b);
/* The boundary whose condition prescribes a component, or -1: owner [nnode_all][dim]. Where boundaries meet it is the
   one whose value holds. */
PetscErrorCode ConditionsGetOwners(Conditions, PetscInt owner[]);
