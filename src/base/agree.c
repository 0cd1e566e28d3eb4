/* Agree: see agree.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "base/agree.h"
#include <stdio.h>

static PetscBool trying;
static int       inside;
static void (*give_up)(const char message[]);

/* Of PETSc, called where an error is raised and by everyone who passes it on */
static PetscErrorCode receive_error(MPI_Comm comm, int line, const char *function, const char *file,
                                    PetscErrorCode code, PetscErrorType type, const char *message, void *ctx)
{
  char        text[2048];
  PetscMPIInt size = 1, world = 1;

  (void)line;
  (void)function;
  (void)file;
  (void)ctx;
  if (type != PETSC_ERROR_INITIAL || inside) return code;
  MPI_Comm_size(comm, &size);
  MPI_Comm_size(RunComm(), &world);
  if (size == world) return code;
  (void)snprintf(text, sizeof(text),
                 "One rank found alone, in what was only a trial: %s. Run without -monitor_accuracy, or on one rank",
                 message && message[0] ? message : "no reason is given");
  (*give_up)(text);
  return code;
}

PetscErrorCode AgreeBegin(void (*abort)(const char message[]))
{
  PetscFunctionBeginUser;
  trying  = PETSC_TRUE;
  inside  = 0;
  give_up = abort;
  PetscCall(PetscPushErrorHandler(receive_error, NULL));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AgreeEnd(void)
{
  PetscFunctionBeginUser;
  PetscCall(PetscPopErrorHandler());
  trying = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

void AgreeEnter(void)
{
  inside++;
}

PetscErrorCode AgreeReturn(PetscErrorCode mine)
{
  int any = (int)mine;

  inside--;
  if (!trying) return mine;
  if (MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, RunComm())) return PETSC_ERR_LIB;
  return mine ? mine : (PetscErrorCode)any;
}
