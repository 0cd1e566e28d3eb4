/* Inside of Drops; for its files only. drops.c: groups and state. inherit.c: who descends from whom. curve.c: the
   interface; meet.c: as it ends on something solid; surfaces.c: as the room align sees it. */
#pragma once
#include "phase/drops.h"

/* A list of edges on their way to a curve */
typedef struct {
  PetscInt   n, capacity;
  PhaseEdge *edge;
} Edges;

/* whole [dim + 1]: a ball about the middle of the box of n balls [n][stride], places and radii: that of the corners of
   the box */
static inline void PhaseBoundBalls(PetscInt dim, PetscInt n, PetscInt stride, const PetscReal ball[], PetscReal whole[])
{
  PetscReal square = 0;

  for (PetscInt a = 0; a < dim; a++) {
    PetscReal low = PETSC_MAX_REAL, high = -PETSC_MAX_REAL;

    for (PetscInt e = 0; e < n; e++) {
      low  = PetscMin(low, ball[stride * e + a] - ball[stride * e + dim]);
      high = PetscMax(high, ball[stride * e + a] + ball[stride * e + dim]);
    }
    whole[a] = n ? 0.5 * (low + high) : 0;
    square += n ? PetscSqr(high - low) : 0;
  }
  whole[dim] = 0.5 * PetscSqrtReal(square);
}

/* pairs.c: StateVisit of the neighbours */
PetscErrorCode DropsVisitPairs(DropsState *, State);

struct _p_Drops {
  MPI_Comm   comm;
  DropGroup *group;
  DropsState s;
  PetscReal  lower[3], upper[3]; /* in space, the domain */
};
