/* Inside of Drops; for its files only. drops.c: groups and state. inherit.c: who descends from whom. curve.c: the
   interface; meet.c: as it ends on something solid; surfaces.c: as the room align sees it. */
#pragma once
#include "phase/drops.h"

/* A list of edges on their way to a curve */
typedef struct {
  PetscInt   n, capacity;
  PhaseEdge *edge;
} Edges;

/* pairs.c: StateVisit of the neighbours */
PetscErrorCode DropsVisitPairs(DropsState *, State);

struct _p_Drops {
  MPI_Comm   comm;
  DropGroup *group;
  DropsState s;
  PetscReal  lower[3], upper[3]; /* in space, the domain */
};
