/* VCycle: one V cycle over the levels that hypre's BoomerAMG has built, with its smoothers (l1-Gauss-Seidel: forward
   from zero on the way down, backward on that up, both on the lowest level: Baker, Falgout, Kolev & Yang 2011), fewer
   waits and less memory than its own: the residual comes with the sweep down, entries are in single precision, and
   levels of few rows are replicated on all ranks, who sum what goes down to them once and need nothing on the way up.

   The matrix of the finest level may be exchanged without new levels below. Where it has grown against that of the
   levels, these take it as D A D with D = sqrt(before / now) < 1, so that they do not overshoot. Symmetric, and
   positive definite if the matrix is. No unit makes an entry too large for single precision. On one rank the digits of
   hypre, but for single precision. */
#pragma once
#include <petscksp.h>

typedef struct _p_VCycle *VCycle;

/* Would hypre do with these options (of a PCHYPRE, which has them already) what a VCycle does? Not collective. */
PetscErrorCode VCycleFits(PC, PetscBool *fits);

/* Take the levels of a PCHYPRE that is set up and fits; it can only be destroyed afterwards. A: its matrix, of which
   nothing is kept. Collective. */
PetscErrorCode VCycleCreate(PC, Mat A, VCycle *);
/* The finest matrix is A now, laid out alike; scale: D, or NULL for 1 (borrowed until the next). Collective. */
PetscErrorCode VCycleSetMatrix(VCycle, Mat A, Vec scale);
/* x = cycle b. Collective. */
PetscErrorCode VCycleApply(VCycle, Vec b, Vec x);
/* Levels, and how many of them all ranks hold. Not collective. */
PetscErrorCode VCycleGetLevels(VCycle, PetscInt *n, PetscInt *replicated);
PetscErrorCode VCycleDestroy(VCycle *);
