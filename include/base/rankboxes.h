/* RankBoxes: where the ranks of a communicator are: boxes of every one of them, and which ranks are near a position.

   All ranks hear the boxes of all, some 50 bytes each. A position is looked up in a search grid (base/neargrid.h), so
   that a question costs what its answer is long, however many ranks there are. */
#pragma once
#include <petscsys.h>

typedef struct _p_RankBoxes *RankBoxes;

/* Own boxes [n], lowest and highest corner, in a domain lower .. upper that is periodic along axes with a period > 0.
   Collective. */
PetscErrorCode RankBoxesCreate(MPI_Comm, PetscInt dim, const PetscReal lower[3], const PetscReal upper[3],
                               const PetscReal period[3], PetscInt n, PetscReal (*box)[2][3], RankBoxes *);
PetscErrorCode RankBoxesDestroy(RankBoxes *);
/* Ranks with a box, or a periodic image of one, nearer to x than reach, ascending, each once: rank [*n], borrowed until
   the next question. Not collective. */
PetscErrorCode RankBoxesNear(RankBoxes, const PetscReal x[3], PetscReal reach, PetscInt *n, const PetscMPIInt *rank[]);
/* Which of the positions x [n] go to whom: those nearer than reach [n] to a rank, to [*m], ascending, are x
   [which [*m]]. Both are the caller's to free. Not collective. */
PetscErrorCode RankBoxesSend(RankBoxes, PetscInt n, const PetscReal (*x)[3], const PetscReal reach[], PetscInt *m,
                             PetscMPIInt **to, PetscInt **which);
/* The first rank with a box that holds x, or else with the nearest one. Not collective. */
PetscMPIInt RankBoxesOwner(RankBoxes, const PetscReal x[3]);
