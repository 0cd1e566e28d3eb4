/* BondFields: bonds between bodies as lines for ParaView, at the same steps as the fields. Called by run.

   bonds_<step>.h5: time [1]; end [2 n][3], of every bond the centre of its body and that of its partner (or its end on
   a wall), in one piece across a period; line [n][2]; of each bond body, partner (-1 - number: a wall), tension
   (negative: pressure), shear, twist, bending, energy, formed (when), aggregate (number of the lowest body that bonds
   join to it) [n]. Ascending in body, then partner, whatever the number of ranks. bonds.xdmf shows
   them over time, but for snapshots that have none. */
#pragma once
#include "base/state.h"
#include "contact/bonds.h"

typedef struct _p_BondFields *BondFields;

/* Collective on the communicator of the run, like all others. */
PetscErrorCode BondFieldsCreate(MPI_Comm, BondFields *);
/* Frees it and sets it to NULL. Collective. */
PetscErrorCode BondFieldsDestroy(BondFields *);
/* Write one snapshot into dir, an existing directory, of the n bonds of all ranks, the same and in the same order on
   all of them; aggregate [n]; frame: where the origin of the bodies' positions lies in space. A step written twice
   takes the position of its first version. Error: the disk. */
PetscErrorCode BondFieldsWrite(BondFields, const char dir[], PetscInt step, PetscReal time, PetscInt n,
                               const BondView bond[], const PetscInt aggregate[], const PetscReal frame[3]);
/* As OutlinesRewind and OutlinesVisitState */
PetscErrorCode BondFieldsRewind(BondFields, const char dir[]);
PetscErrorCode BondFieldsVisitState(void *bondfields, State state);
