/* Finish: what only a run with a flow has to tell at its end: its share of cells and bodies, separation, cells by
   level, with -output_bandwidth what the machine can do. Sizes of the whole mesh and system. Collective. */
#pragma once
#include "sim.h"

PetscErrorCode FinishFlow(const SimParts *, PetscInt *cells, PetscInt *unknowns);
