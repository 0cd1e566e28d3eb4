/* Door of rigid/: what bodies are in the system. projection.h the projection P onto what may move freely,
   sharedreduction.h sums over the ranks that know a body, bodyblocks.h blocks of single bodies, bodycoupling.h what the
   velocity operator has between them and the nodes, contactcoupling.h linear forces between bodies, and the operator of
   penaltyterm.h. */
#pragma once
#include "bodyblocks.h"
#include "bodycoupling.h"
#include "projection.h"
#include "sharedreduction.h"
#include "contactcoupling.h"
#include "solve/penaltyterm.h"

/* The operator of penaltyterm.h without Pen and H: r -= G U at own nodes, rigid -= G^T u. u, r [own nodes][dim]; U,
   rigid [nlocal][nr] by the local numbers of the constraint, of which the entries of U for unknown or for known degrees
   of freedom count, and the unknown rows of rigid are served. Local. */
PetscErrorCode PenaltyTermMultAdd(const PenaltyTerm *, Constraint, PetscBool of_unknown, const PetscReal U[],
                                  const PetscReal u[], PetscReal r[], PetscReal rigid[]);
