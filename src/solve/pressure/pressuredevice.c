/* Pressure: the cycle over cells and vertices on a device (device/device.h): Chebyshev polynomials in place of block
   Gauss-Seidel, which cells side by side cannot do, lattices of twice the width or aggregation below the vertices. On
   one rank; on several the vertices are the processor's (deviceranks.c). In space. */
#include "compat.h"
#include "devicelevels.h"
#include "devicerows.h"
#include "pressureimpl.h"

#define KEEP   0.03 /* share of the cells whose rows may change before the levels of the vertices are made anew */
#define DEGREE 3
#define POWER  15
#define LARGER 1.1

PetscBool PressureIsOnDevice(Pressure p)
{
  return (PetscBool)(FlowGetQueue(p->flow) && p->nodes.block_gs);
}

static PetscErrorCode clear_vertices(struct _p_PressureDevice *d)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceTransferDestroy(d->queue, &d->cycle.transfer));
  PetscCall(DeviceLevelsDestroy(d->queue, d->cycle.nlevel, &d->cycle.level));
  PetscCall(DeviceSparseDestroy(d->queue, &d->lowest));
  d->cycle.nlevel = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureDestroyDevice(Pressure p)
{
  struct _p_PressureDevice *d = p->device;

  PetscFunctionBeginUser;
  if (!d) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DeviceRowsDestroy(d->queue, &d->cycle.rows));
  PetscCall(clear_vertices(d));
  PetscCall(DeviceFree(d->queue, &d->cycle.x));
  PetscCall(DeviceFree(d->queue, &d->cycle.r));
  PetscCall(DeviceFree(d->queue, &d->cycle.d));
  PetscCall(DeviceFree(d->queue, &d->cycle.y));
  PetscCall(DeviceFree(d->queue, &d->all));
  PetscCall(DeviceFree(d->queue, &d->noise));
  PetscCall(PressureFreeBodiesOnDevice(p));
  PetscCall(PressureEndRowsOnDevice(p));
  PetscCall(PressureLeaveRanks(p));
  PetscCall(PetscFree(p->device));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where powers begin: the same every time, so it goes over once */
static PetscErrorCode take_noise(struct _p_PressureDevice *d, size_t n)
{
  PetscReal *noise;

  PetscFunctionBeginUser;
  if (d->noise) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(n, &noise));
  DeviceLevelsFillNoise((PetscInt)n, noise);
  PetscCall(DeviceTake(d->queue, n, noise, &d->noise));
  PetscCall(PetscFree(noise));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A bound of the eigenvalues of D^-1 S_p, by powers; x, r, d of the cycle are lost */
static PetscErrorCode find_largest(Pressure p)
{
  struct _p_PressureDevice *d = p->device;
  const DeviceQueue        *q = d->queue;
  const size_t              n = (size_t)d->cycle.rows.n * 4, bytes = n * sizeof(double);
  double                   *x = d->cycle.x, *y = d->cycle.d, *zero, *sums, before = 0, square;

  PetscFunctionBeginUser;
  PetscCall(take_noise(d, n));
  PetscCallDevice(q, (*q->run->combine)(q, n, 1, (const double *[]){d->noise}, (double[]){1}, NULL, x));
  PetscCall(DeviceTake(q, n, NULL, &zero));
  PetscCall(DeviceTake(q, DEVICE_PARTIAL + 2, NULL, &sums));
  PetscCallDevice(q, (*q->run->zero)(q, bytes, zero));
  d->cycle.largest = 1;
  for (PetscInt k = 0; k < POWER; k++) { /* y = -D^-1 S x over what is the eigenvalue so far */
    const PetscReal scale = 1 / d->cycle.largest;
    DeviceChebyshev step  = {.c2 = scale, .x = x, .d = y, .x_new = d->cycle.r};

    PetscCallDevice(q, DevicePressureShift(q, &d->cycle, zero, x, &step.b));
    if (d->cycle.ranks.ctx) PetscCallDevice(q, (*d->cycle.ranks.fetch)(d->cycle.ranks.ctx, x));
    PetscCallDevice(q, (*q->run->smooth_rows)(q, &d->cycle.rows, &step));
    PetscCallDevice(q, (*q->run->dot)(q, n, y, y, NULL, NULL, sums, sums + DEVICE_PARTIAL));
    PetscCallDevice(q, (*q->run->download)(q, sizeof(square), sums + DEVICE_PARTIAL, &square));
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &square, 1, MPIU_REAL, MPIU_SUM, p->comm));
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

/* The level of the vertices and those below it, on one rank: changed there, where cells are boxes, else they go over */
static PetscErrorCode take_vertices(Pressure p, struct _p_PressureDevice *d)
{
  PetscInt   nlevel;
  DeviceGrid grid;
  Transfer   transfer;
  Mat        A;

  PetscFunctionBeginUser;
  if (d->keeps) {
    PetscCall(DeviceLevelsChange(p->flow, p->coarse, &d->cycle.transfer, &d->cycle.level[0].A));
    PetscCall(
      DeviceLevelsUpdate(d->queue, d->cycle.nlevel, d->cycle.level, &d->lowest, p->floating, d->noise, d->sums));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(clear_vertices(d));
  PetscCall(CoarseGetMatrix(p->coarse, &A));
  PetscCall(CoarseGetTransfer(p->coarse, &transfer));
  PetscCall(DeviceTransferCreate(d->queue, transfer, p->loc->ncell, &d->cycle.transfer));
  PetscCall(DeviceGridCreate(p->mesh, transfer, &grid));
  PetscCall(DeviceLevelsCreate(d->queue, A, &grid, p->floating, &nlevel, &d->cycle.level, &d->lowest));
  PetscCall(DeviceGridDestroy(&grid));
  d->cycle.nlevel = (int)nlevel;
  if (p->nbodies && d->lowest.n && d->cycle.level[0].A.n <= 4 * p->loc->ncell && FlowHasBoxesAlone(p->flow))
    PetscCall(CoarseKeepChanges(p->coarse, &d->keeps)); /* so many numbers has d->noise */
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_work(struct _p_PressureDevice *d, PetscInt n)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceTake(d->queue, n, NULL, &d->cycle.x));
  PetscCall(DeviceTake(d->queue, n, NULL, &d->cycle.r));
  PetscCall(DeviceTake(d->queue, n, NULL, &d->cycle.d));
  if (!d->cycle.ranks.ctx) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DeviceTake(d->queue, n, NULL, &d->cycle.y));
  PetscCall(DeviceTake(d->queue, n, NULL, &d->all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSetUpDevice(Pressure p)
{
  struct _p_PressureDevice *d;
  struct _p_RowsView        rows;

  PetscFunctionBeginUser;
  if (!p->device) PetscCall(PetscNew(&p->device));
  d        = p->device;
  d->queue = FlowGetQueue(p->flow);
  PetscCall(PressureMeetRanks(p));
  PetscCall(PressureListBodiesOnDevice(p));
  PetscCall(PressureInvertRowsOnDevice(p));
  if (!d->cycle.x) p->device_stale = PETSC_TRUE;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &p->device_stale, 1, COMPAT_MPI_BOOL, MPI_LOR, p->comm));
  if (!p->device_stale) PetscFunctionReturn(PETSC_SUCCESS);
  if (!PressureMakesRowsOnDevice(p))
    PetscCall(DeviceRowsRenew(d->queue, p->nodes.matrix, (PetscBool)(p->nbodies > 0), &d->cycle.rows, d->room));
  if (!d->cycle.ranks.ctx && (!d->cycle.level || p->device_changed > KEEP * (PetscReal)p->loc->ncell)) {
    PetscCall(take_vertices(p, d));
    p->device_changed = 0;
  }
  d->cycle.degree = DEGREE;
  PetscCall(BlockGSGetRows(p->nodes.matrix, &rows));
  if (!d->cycle.x) PetscCall(take_work(d, (rows.n + rows.nghost) * 4));
  PetscCall(find_largest(p));
  PetscCall(BlockGSSetDevice(p->nodes.matrix, d->queue, &d->cycle.rows, d->all));
  p->device_stale = PETSC_FALSE;
  PetscCall(PressureBeginRowsOnDevice(p));
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
