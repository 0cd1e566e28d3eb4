/* Pressure on devices of several ranks: what the cycle over cells has to do with the others. Blocks at ghosts are
   brought by PetscSF, which finds out in which memory they lie; sums over bodies are those of devicecut.c; the level of
   the vertices is the processor's, to which the cells' residual goes and from which their correction comes. */
#include "compat.h"
#include "flow/device.h"
#include "blockgs.h"
#include "pressureimpl.h"

static PetscErrorCode correct_cells(Pressure p, const PetscReal r[], PetscReal x[])
{
  struct _p_PressureDevice *d     = p->device;
  const DeviceQueue        *q     = d->queue;
  const size_t              n     = (size_t)p->loc->ncell * 4;
  PetscReal                *fixed = d->here, *ghost = d->here + n;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->download)(q, n * sizeof(*r), r, p->cycle.residual));
  PetscCall(PetscArrayzero(d->here, p->loc->ncell_all * 4));
  PetscCall(CoarseCorrect(p->coarse, p->cycle.residual, fixed, ghost));
  PetscCallDevice(q, (*q->run->upload)(q, n * sizeof(*r), fixed, d->correction));
  PetscCallDevice(q, (*q->run->combine)(q, n, 2, (const double *[]){x, d->correction}, (double[]){1, 1}, NULL, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static int fetch(void *ctx, double x[])
{
  const Pressure p = ctx;

  return (int)BlockGSFetchGhosts(p->nodes.matrix, x, x + p->loc->ncell * 4);
}

/* Without ties, which the cycle without a device leaves out too */
static int sum(void *ctx, double U[])
{
  return (int)PressureSumBodiesOnDevice((Pressure)ctx, NULL, U);
}

static int correct(void *ctx, const double r[], double x[])
{
  return (int)correct_cells((Pressure)ctx, r, x);
}

PetscErrorCode PressureMeetRanks(Pressure p)
{
  struct _p_PressureDevice *d = p->device;
  PetscMPIInt               size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(p->comm, &size));
  if (size == 1 || d->cycle.ranks.ctx) PetscFunctionReturn(PETSC_SUCCESS);
  d->cycle.ranks = (DeviceRanks){p, fetch, sum, correct};
  PetscCall(PetscMalloc1(p->loc->ncell_all * 4, &d->here));
  PetscCall(DeviceTake(d->queue, p->loc->ncell * 4, NULL, &d->correction));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureLeaveRanks(Pressure p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(p->device->here));
  PetscCall(DeviceFree(p->device->queue, &p->device->correction));
  PetscFunctionReturn(PETSC_SUCCESS);
}
