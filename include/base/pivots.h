/* Pivots: which ones of a factorisation are zero. PETSc takes all below 2.2e-14 for zero, or adds that to them: where
   the units make the entries of a matrix small none is left. */
#pragma once
#include <petscksp.h>

/* Of a solver with PCLU, PCILU or one of them in blocks (those are set up by this, operators must be there); nothing of
   others: any pivot that is not 0 serves. Collective. */
PetscErrorCode PivotsOfAnySize(KSP);
