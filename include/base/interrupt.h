/* Interrupt: a request to end that long solves hear, not only what stands between steps. A signal may reach one rank
   alone, and what all ranks do must depend on what all know: those that iterate ask, a reduction of one number each
   time, and give up together. Where steps are short nobody asks (Arm). */
#pragma once
#include <petscsys.h>

/* The request, from a signal handler, 0: none any more (forgets that it was heard, too) */
void InterruptRaise(int number);
/* Do solves ask from now on? The same on all ranks. */
void      InterruptArm(PetscBool ask);
PetscBool InterruptIsArmed(void);
/* Has any rank a request? Does not communicate unless armed, nor once it was heard. Collective. */
PetscErrorCode InterruptAsk(PetscBool *end);
/* Has InterruptAsk heard one? Then solves have ended before they were done. Not collective, the same on all ranks. */
PetscBool InterruptHeard(void);
