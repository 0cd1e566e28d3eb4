/* Stiff: how little a step sees of springs and dampers that are faster than it (joints of bodies, bonds). */
#pragma once
#include <petscmath.h>

#define STIFF_RESOLVED 0.5 /* frequency times step up to which a step sees a spring as it is */
#define STIFF_UNSEEN   2.  /* and from which on not at all */

/* 0 .. 1, of a frequency (or rate) times the step */
static inline PetscReal StiffFraction(PetscReal phase)
{
  return PetscClipInterval((phase - STIFF_RESOLVED) / (STIFF_UNSEEN - STIFF_RESOLVED), 0, 1);
}
