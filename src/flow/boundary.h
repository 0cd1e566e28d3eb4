/* Boundary: what the conditions keep of every boundary; for condition.c, which reads and evaluates them, and
   boundary.c, which says of what type boundaries are and where they lie. */
#pragma once
#include "impl.h"

typedef enum {
  BC_NO_SLIP,
  BC_MOVING_WALL,
  BC_ROTATING_WALL,
  BC_INFLOW,
  BC_OUTFLOW,
  BC_SLIP,
  BC_PRESSURE
} ConditionsType;

typedef struct {
  ConditionsType type;
  PetscBool      parabolic;
  PetscReal      velocity[3], factor[3], ramp;
  Expr           formula;             /* of the velocity or pressure, in place of the numbers; NULL: none */
  PetscReal      pressure;            /* of an opening */
  PetscReal     *x;                   /* with it: positions of the boundary's nodes */
  PetscReal      omega[3], centre[3]; /* of a rotating wall */
  PetscReal      lower[3], upper[3];  /* extent, for the profile and for slip */
  PetscInt       axis;                /* slip: the normal axis */
} Condition;

struct _p_Conditions {
  MPI_Comm         comm; /* the mesh's */
  Mesh             mesh;
  const MeshLocal *loc;
  PetscInt         n;
  unsigned char   *fixed, *wall; /* bit masks of components: prescribed; prescribed by a wall */
  Condition       *condition;
  PetscReal       *value;
  PetscBool        floating, timed; /* timed: has a time been set? */
  PetscReal        time;
  VectorField      field; /* in place of the conditions' values */
  void            *field_ctx;
};

/* Later ones win where boundaries meet */
static const ConditionsType ORDER[] = {BC_SLIP, BC_INFLOW, BC_ROTATING_WALL, BC_MOVING_WALL, BC_NO_SLIP};

/* Is nothing prescribed there but the traction? */
static inline PetscBool BoundaryIsFree(const Condition *bc)
{
  return (PetscBool)(bc->type == BC_OUTFLOW || bc->type == BC_PRESSURE);
}
