/* DropFields: the interface of drops as curves for ParaView, at the same steps as the fields: drops_<step>.h5 and
   drops_<step>.xdmf, quadratic edges as they are at the end of the step, those of a closed curve one after the other,
   the inside on their left; in one piece across a period. In what cells lie inside the fields say (FieldsSetPhase).
   Rank 0 writes, since all ranks have all. Called by run. */
#pragma once
#include "phase/drops.h"

/* Into the existing folder dir; does nothing without drops (NULL). Collective. Error: a file that cannot be
   written. */
PetscErrorCode DropFieldsWrite(MPI_Comm, Drops, const char dir[], PetscInt step, PetscReal time);
/* phase [n] of cells: 0 the fluid around, g + 1 the g-th of the groups of drops. Local. */
void DropFieldsPhase(const DropsState *, PetscInt n, PetscInt phase[]);
