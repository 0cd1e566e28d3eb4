/* How a run ends that goes wrong: one message, whichever ranks met the error, and a status that is not 0. */
#pragma once
#include <petscsys.h>

/* At the start, after MPI_Init: how ranks meet that leave, apart from what others may wait in. Collective. */
void FailurePrepare(void);

/* PETSc's error handler (PetscPushErrorHandler; it may be there before PetscInitialize): keeps the message of the
   error this rank stops with. Mistakes of the user and a machine that is too small get that message alone, everything
   else PETSc's trace too. */
PetscErrorCode FailureNote(MPI_Comm comm, int line, const char *function, const char *file, PetscErrorCode code,
                           PetscErrorType type, const char *message, void *ctx);

/* Tell what was noted and where to go on from, once for all ranks that come within some seconds, and leave MPI; a rank
   that does not come waits elsewhere for this one and is ended. Returns the exit status. Asks for no memory. */
int FailureExit(void);

/* From now on (after PetscInitialize) a crash outside of shape plugins ends with one message, too, unless PETSc is
   asked for a debugger or for no signal handler. */
PetscErrorCode FailureCatchCrashes(void);

/* Is there memory for what libraries take at once? OpenBLAS turns in circles for ever when it finds none for its
   buffer: it gets it here. Raises an error on this rank alone. Not collective. */
PetscErrorCode FailureReserve(void);

/* As FailureExit, for what is no error of PETSc's, by any rank alone. Does not return. */
void FailureAbort(const char message[]);
