/* Interrupt: see interrupt.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "base/interrupt.h"
#include <signal.h>

static volatile sig_atomic_t request;
static PetscBool             armed, heard;

void InterruptRaise(int number)
{
  request = number;
  if (!number) heard = PETSC_FALSE;
}

void InterruptArm(PetscBool ask)
{
  armed = ask;
}

PetscBool InterruptIsArmed(void)
{
  return armed;
}

PetscErrorCode InterruptAsk(PetscBool *end)
{
  int any = request != 0;

  PetscFunctionBeginUser;
  if (armed && !heard) {
    PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &any, 1, MPI_INT, MPI_MAX, RunComm()));
    heard = (PetscBool)(any != 0);
  }
  *end = heard;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool InterruptHeard(void)
{
  return heard;
}
