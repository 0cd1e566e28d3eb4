/* Pressure: the cycle over cells and vertices on a device (device/device.h): Chebyshev polynomials in place of block
   Gauss-Seidel, which cells side by side cannot do, lattices of twice the width or aggregation below the vertices. On
   one rank, in space. */
#include "compat.h"
#include "devicelevels.h"
#include "devicerows.h"
#include "pressureimpl.h"

#define DEGREE 3
#define POWER  15
#define LARGER 1.1

PetscBool PressureIsOnDevice(Pressure p)
{
  return (PetscBool)(FlowGetQueue(p->flow) && p->nodes.block_gs);
}

static PetscErrorCode clear(struct _p_PressureDevice *d)
{
  PetscFunctionBeginUser;
  if (!d->cycle.x) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DeviceRowsDestroy(d->queue, &d->cycle.rows));
  PetscCall(DeviceTransferDestroy(d->queue, &d->cycle.transfer));
  PetscCall(DeviceLevelsDestroy(d->queue, d->cycle.nlevel, &d->cycle.level));
  PetscCall(DeviceFree(d->queue, &d->cycle.x));
  PetscCall(DeviceFree(d->queue, &d->cycle.r));
  PetscCall(DeviceFree(d->queue, &d->cycle.d));
  d->cycle.x = NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureDestroyDevice(Pressure p)
{
  PetscFunctionBeginUser;
  if (!p->device) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(clear(p->device));
  PetscCall(PressureFreeBodiesOnDevice(p));
  PetscCall(PetscFree(p->device));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A bound of the eigenvalues of D^-1 S_p, by powers; x, r, d of the cycle are lost */
static PetscErrorCode find_largest(struct _p_PressureDevice *d)
{
  const DeviceQueue *q = d->queue;
  const size_t       n = (size_t)d->cycle.rows.n * 4, bytes = n * sizeof(double);
  double            *x = d->cycle.x, *y = d->cycle.d, *zero, *sums, before = 0, square;
  PetscReal         *noise;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &noise));
  DeviceLevelsFillNoise((PetscInt)n, noise);
  PetscCallDevice(q, (*q->run->upload)(q, bytes, noise, x));
  PetscCall(PetscFree(noise));
  PetscCall(DeviceTake(q, n, NULL, &zero));
  PetscCall(DeviceTake(q, DEVICE_PARTIAL + 2, NULL, &sums));
  PetscCallDevice(q, (*q->run->zero)(q, bytes, zero));
  d->cycle.largest = 1;
  for (PetscInt k = 0; k < POWER; k++) { /* y = -D^-1 S x over what is the eigenvalue so far */
    const PetscReal scale = 1 / d->cycle.largest;
    DeviceChebyshev step  = {.c2 = scale, .x = x, .d = y, .x_new = d->cycle.r};

    PetscCallDevice(q, DevicePressureShift(q, &d->cycle, zero, x, &step.b));
    PetscCallDevice(q, (*q->run->smooth_rows)(q, &d->cycle.rows, &step));
    PetscCallDevice(q, (*q->run->dot)(q, n, y, y, NULL, NULL, sums, sums + DEVICE_PARTIAL));
    PetscCallDevice(q, (*q->run->download)(q, sizeof(square), sums + DEVICE_PARTIAL, &square));
    if (k > 0) d->cycle.largest = PetscSqrtReal(square / before) / scale;
    before = square;
    x      = y;
    y      = x == d->cycle.d ? d->cycle.x : d->cycle.d;
  }
  d->cycle.largest *= LARGER;
  PetscCall(DeviceFree(q, &zero));
  PetscCall(DeviceFree(q, &sums));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetUpDevice(Pressure p)
{
  struct _p_PressureDevice *d;
  const DeviceQueue        *q = FlowGetQueue(p->flow);
  const PetscInt            n = p->loc->ncell * p->nk;
  PetscInt                  nlevel;
  DeviceGrid                grid;
  Transfer                  transfer;
  Mat                       A;

  PetscFunctionBeginUser;
  if (!p->device) PetscCall(PetscNew(&p->device));
  d        = p->device;
  d->queue = q;
  PetscCall(PressureListBodiesOnDevice(p));
  if (d->cycle.x && !p->device_stale) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(clear(d));
  PetscCall(CoarseGetMatrix(p->coarse, &A));
  PetscCall(CoarseGetTransfer(p->coarse, &transfer));
  PetscCall(DeviceRowsCreate(q, p->nodes.matrix, &d->cycle.rows));
  PetscCall(DeviceTransferCreate(q, transfer, p->loc->ncell, &d->cycle.transfer));
  PetscCall(DeviceGridCreate(p->mesh, transfer, &grid));
  PetscCall(DeviceLevelsCreate(q, A, &grid, p->floating, &nlevel, &d->cycle.level));
  PetscCall(DeviceGridDestroy(&grid));
  d->cycle.nlevel = (int)nlevel;
  d->cycle.degree = DEGREE;
  PetscCall(DeviceTake(q, n, NULL, &d->cycle.x));
  PetscCall(DeviceTake(q, n, NULL, &d->cycle.r));
  PetscCall(DeviceTake(q, n, NULL, &d->cycle.d));
  PetscCall(find_largest(d));
  PetscCall(BlockGSSetDevice(p->nodes.matrix, q, &d->cycle.rows));
  p->device_stale = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureApplyOnDevice(Pressure p, Vec b, Vec z)
{
  const DeviceQueue *q = p->device->queue;
  const PetscReal   *ba;
  PetscReal         *za;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetRead(q, b, &ba));
  PetscCall(DeviceVecGetWrite(q, z, &za));
  PetscCallDevice(q, DevicePressureApply(q, &p->device->cycle, ba, za));
  PetscCall(VecRestoreArrayWriteAndMemType(z, &za));
  PetscCall(VecRestoreArrayReadAndMemType(b, &ba));
  PetscFunctionReturn(PETSC_SUCCESS);
}
