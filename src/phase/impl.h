/* Inside of Drops; for its files only. drops.c: groups and state. inherit.c: who descends from whom. curve.c: the
   interface; surfaces.c: as the room align sees it. */
#pragma once
#include "phase/drops.h"

/* pairs.c: StateVisit of the neighbours */
PetscErrorCode DropsVisitPairs(DropsState *, State);

struct _p_Drops {
  MPI_Comm   comm;
  DropGroup *group;
  DropsState s;
};
