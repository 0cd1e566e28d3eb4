/* Extrapolate: error of a value from the same value on coarser meshes (Richardson 1911; Roache 1994; the least order
   where meshes do not agree, as Eca & Hoekstra, J. Comput. Phys. 262 (2014), do), where elements of the next order on
   the same mesh do not do (accuracy.h). No mesh, no flow. */
#pragma once
#include <petscsys.h>

/* Orders that an error may have, and that of one which is seen on the coarsest mesh but not between the others */
typedef struct {
  PetscReal low, high, vanished;
} ErrorOrder;

/* How the meshes come closer to the judged one: by an order; on both sides of it; by no order, as if the finest were no
   better than the others, or one mesh alone. Of the last two an estimate is a bound. */
typedef enum {
  TREND_CONVERGES,
  TREND_TURNS,
  TREND_STALLS
} ErrorTrend;

/* difference[n], n 1 or 2: signed, of coarser meshes to the one that is judged, whose cells are ratio[n] times as
   large (growing, above 1). */
PetscReal ExtrapolateError(PetscInt n, const PetscReal difference[], const PetscReal ratio[], const ErrorOrder *,
                           ErrorTrend *);
