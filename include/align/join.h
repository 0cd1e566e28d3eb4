/* AlignJoin: the surfaces of several owners as the one table that a mesh is lined up with, those of the first owner
   first. Numbers go on from owner to owner. Where one owner's surfaces are spread over ranks those are that all ranks
   know count on the first. Not for owners whose surfaces end on sides, are approached from a side or keep cells closed
   (ends_on, approach, closed). */
#pragma once
#include "align/surfaces.h"

typedef struct _p_AlignJoin *AlignJoin;

/* The tables are borrowed. Not collective. */
PetscErrorCode AlignJoinCreate(MPI_Comm, PetscInt n, const AlignSurfaces *const table[], AlignJoin *);
PetscErrorCode AlignJoinDestroy(AlignJoin *);
/* What the owners have now, before every fit. Not collective. */
PetscErrorCode AlignJoinUpdate(AlignJoin);
/* The first of the surfaces of each owner [n + 1], since the last update; borrowed. */
const PetscInt *AlignJoinGetFirst(AlignJoin);
/* The owner of surface *k, which becomes the number that he has for it */
PetscInt AlignJoinFindOwner(AlignJoin, PetscInt *k);
/* Of one owner that is his own table; borrowed. */
const AlignSurfaces *AlignJoinGet(AlignJoin);
