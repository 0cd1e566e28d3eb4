/* ScalarHeat: what bodies keep of scalars as they move, and the books of it.

   Where a body has another capacity than the fluid, c' = c - c_f more, its cells change as it moves, and their heat
   with them. The equation of a step has c' (c_t T - d(T)) + c' w.grad T with the capacity of its end; the heat itself
   changes by c_t C - d(C), C = int c' T of each time. Exactly both are the same; here they differ by

     D = int c' d(T) - d(C) - int c' w.grad T_theta,

   heat that appears as the body covers and frees cells. It is predicted with T extrapolated and given back in the same
   step as a source: inside a body that is solved for, in the fluid of its cut cells where there is a flux or exchange.
   What the prediction lacks is given back in the next step. The difference is booked (column scalar_covered_<scalar>).
   A body at a value is a reservoir, which gives and takes without. Capacities are scaled, so that a body that moves has
   that of its exact volume; what uniform values would change otherwise is not given back. No books under a mean
   gradient, where heat has no bound. Called for runs in time alone, if a group's books are kept for some scalar. */
#pragma once
#include "couple/couple.h"
#include "scalar/scalar.h"
#include "scalarcover.h"

typedef struct {
  PetscReal have;                   /* contents known, 0 to 2 */
  PetscReal content, content_old;   /* int c' T of the last two steps */
  PetscReal capacity, capacity_old; /* int c' */
  PetscReal owed;                   /* heat that has appeared and was not given back */
} BodyHeat;

typedef struct {
  PetscInt   n;       /* scalars */
  PetscBool *keeps;   /* [ngroups][n] are books kept, */
  PetscBool *pays;    /* [ngroups][n] and is given back what appears? */
  BodyHeat  *last;    /* [nbodies][n] */
  BodyHeat  *next;    /* [nbodies][n] after the step */
  PetscReal *sum;     /* [nbodies][n][4] */
  PetscReal *given;   /* [nbodies][n] source of a body in the step, minus what is given back a time */
  PetscReal *appears; /* [n] of all bodies, in the last prediction or measurement */
  PetscReal *covered; /* [n] heat a time that appears in the step, with what is given back */
} ScalarHeat;

PetscErrorCode ScalarHeatCreate(Couple, PetscInt n, ScalarHeat *);
PetscErrorCode ScalarHeatDestroy(Couple, ScalarHeat *);
/* Is there a body whose books are kept for scalar i? Collective in nothing. */
PetscBool ScalarHeatKeeps(const ScalarHeat *, Couple, PetscInt i);
/* Bodies are where they start: what they have. Collective. */
PetscErrorCode ScalarHeatBegin(ScalarHeat *, Couple, Scalars, const ScalarCover *);
/* After ScalarsPredict of scalar i: `given` of all bodies. Collective. */
PetscErrorCode ScalarHeatPredict(ScalarHeat *, Couple, Scalars, PetscInt i, const ScalarCover *);
/* After the scalars are solved for: the books of the step. Collective. */
PetscErrorCode ScalarHeatMeasure(ScalarHeat *, Couple, Scalars, const ScalarCover *);
/* The step is taken. */
void           ScalarHeatAccept(ScalarHeat *, Couple);
PetscErrorCode ScalarHeatVisit(ScalarHeat *, Couple, State);
