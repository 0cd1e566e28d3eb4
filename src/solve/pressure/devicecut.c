/* Pressure on a device: what bodies have in it (pressurecut.c): their part W W^T of S_p, cells inside of them, cells
   between two surfaces. Lists go over once a step. */
#include "compat.h"
#include "flow/device.h"
#include "blockgs.h"
#include "pressureimpl.h"

/* ---- lists of a step ---- */

static PetscErrorCode list_cells(Pressure p, struct _p_PressureDevice *d)
{
  const DeviceQueue *q = d->queue;
  const PetscInt     n = p->interior.n * 4;
  int               *slot;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &slot));
  for (PetscInt i = 0; i < n; i++) slot[i] = (int)(p->interior.cell[i / 4] * 4 + i % 4);
  d->ninterior = (int)n;
  d->nshared   = (int)p->gap.n;
  PetscCall(DeviceRenew(q, n, slot, &d->interior, &d->capacity[5]));
  PetscCall(DeviceRenewInts(q, p->gap.n, p->gap.cell, &d->shared, &d->capacity[6]));
  PetscCall(DeviceRenew(q, p->gap.n * 4, NULL, &d->gap, &d->capacity[7]));
  PetscCall(PetscFree(slot));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureListBodiesOnDevice(Pressure p)
{
  struct _p_PressureDevice *d = p->device;
  const PetscInt            n = p->loc->ncell * 4, nlocal = ConstraintGetView(p->constraint)->nlocal;
  PetscReal                *constant;

  PetscFunctionBeginUser;
  if (!p->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  if (!d->sums) {
    PetscCall(PetscMalloc1(n, &constant));
    for (PetscInt i = 0; i < n; i++) constant[i] = i % 4 == 0;
    PetscCall(DeviceTake(d->queue, n, constant, &d->constant));
    PetscCall(DeviceTake(d->queue, n, NULL, &d->cycle.shifted));
    PetscCall(DeviceTake(d->queue, DEVICE_PARTIAL + 2, NULL, &d->sums));
    PetscCall(PetscFree(constant));
  }
  PetscCall(
    DevicePairsRenew(d->queue, p->cut.n, nlocal, 24, p->cut.local, p->cut.cell, p->cut.w, &d->cycle.body, d->capacity));
  PetscCall(DeviceRenew(d->queue, nlocal * 6, NULL, &d->cycle.U, &d->capacity[4]));
  PetscCall(list_cells(p, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureFreeBodiesOnDevice(Pressure p)
{
  struct _p_PressureDevice *d = p->device;
  const DeviceQueue        *q = d->queue;

  PetscFunctionBeginUser;
  PetscCall(DevicePairsDestroy(q, &d->cycle.body));
  PetscCall(DeviceFree(q, &d->cycle.U));
  PetscCall(DeviceFree(q, &d->cycle.shifted));
  PetscCall(DeviceFree(q, &d->interior));
  PetscCall(DeviceFree(q, &d->shared));
  PetscCall(DeviceFree(q, &d->gap));
  PetscCall(DeviceFree(q, &d->constant));
  PetscCall(DeviceFree(q, &d->sums));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the operator ---- */

PetscErrorCode PressureSumBodiesOnDevice(Pressure p, ContactCoupling ties, PetscReal U[])
{
  const ConstraintView *P     = ConstraintGetView(p->constraint);
  const DeviceQueue    *q     = p->device->queue;
  const size_t          bytes = (size_t)(P->nlocal * p->nr) * sizeof(PetscReal);

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->download)(q, bytes, U, p->cut.work));
  if (ties) PetscCall(ContactCouplingSolveBegin(ties, p->cut.work));
  PetscCall(SharedReductionSumBegin(P->shared_reduction, p->nr, p->cut.work));
  PetscCall(SharedReductionSumEnd(P->shared_reduction, p->nr, p->cut.work));
  if (ties) PetscCall(ContactCouplingSolveEnd(ties, p->cut.work));
  PetscCallDevice(q, (*q->run->upload)(q, bytes, p->cut.work, U));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* U of the cycle = Q (W^T x summed over ranks): numbers of bodies come to the host where ties or ranks have a part */
static PetscErrorCode sum_bodies(Pressure p, const PetscReal x[])
{
  struct _p_PressureDevice *d    = p->device;
  const DeviceQueue        *q    = d->queue;
  const PetscBool           tied = (PetscBool)(p->contact_coupling && ContactCouplingAny(p->contact_coupling));

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->body.sum_blocks)(q, &d->cycle.body, x, d->cycle.U));
  if (tied || d->cycle.ranks.ctx) PetscCall(PressureSumBodiesOnDevice(p, p->contact_coupling, d->cycle.U));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureMultOnDevice(Pressure p, Vec x, Vec y)
{
  struct _p_PressureDevice *d = p->device;
  const DeviceQueue        *q = d->queue;
  const PetscReal          *xa;
  PetscReal                *ya;

  PetscFunctionBeginUser;
  PetscCall(BlockGSMultiplySparse(p->nodes.matrix, x, y));
  PetscCall(DeviceVecGetRead(q, x, &xa));
  PetscCall(DeviceVecGet(q, y, &ya));
  PetscCall(sum_bodies(p, xa));
  PetscCallDevice(q, (*q->run->body.add_blocks)(q, &d->cycle.body, 1, d->cycle.U, ya));
  PetscCall(VecRestoreArrayAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- cells that bodies hold ---- */

static PetscErrorCode clear_interior(struct _p_PressureDevice *d, PetscReal r[])
{
  const DeviceQueue *q = d->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->fill_slots)(q, d->ninterior, d->interior, 0, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureMakeConsistentOnDevice(Pressure p, PetscReal r[])
{
  struct _p_PressureDevice *d = p->device;
  const DeviceQueue        *q = d->queue;
  const size_t              n = (size_t)p->loc->ncell * 4;
  PetscReal                 sum[2];

  PetscFunctionBeginUser;
  PetscCall(clear_interior(d, r));
  if (!p->floating || p->gap.any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallDevice(q, (*q->run->dot)(q, n, r, d->constant, NULL, NULL, d->sums, d->sums + DEVICE_PARTIAL));
  PetscCallDevice(q, (*q->run->download)(q, sizeof(*sum), d->sums + DEVICE_PARTIAL, sum));
  sum[1] = (PetscReal)(p->loc->ncell - p->interior.n);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, p->comm));
  if (sum[1] <= 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallDevice(q, (*q->run->combine)(q, n, 2, (const double *[]){r, d->constant}, (double[]){1, -sum[0] / sum[1]},
                                        NULL, r));
  PetscCall(clear_interior(d, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureSharedOnDevice(Pressure p, PetscReal fraction, const PetscReal x[], PetscReal y[])
{
  struct _p_PressureDevice *d     = p->device;
  const DeviceQueue        *q     = d->queue;
  const size_t              bytes = (size_t)p->gap.n * 4 * sizeof(PetscReal);
  PetscReal                *here;

  PetscFunctionBeginUser;
  if (!p->gap.n) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(p->gap.n * 8, &here));
  PetscCallDevice(q, (*q->run->pick)(q, d->nshared, 4, d->shared, x, d->gap));
  PetscCallDevice(q, (*q->run->download)(q, bytes, d->gap, here));
  for (PetscInt i = 0; i < p->gap.n; i++) {
    PetscReal *out = here + (p->gap.n + i) * 4;

    for (PetscInt k = 0; k < 4; k++) {
      out[k] = 0;
      for (PetscInt m = 0; m < 4; m++) out[k] += p->gap.block[(i * 4 + k) * 4 + m] * here[i * 4 + m];
      if (i < p->gap.ncompressible) out[k] *= fraction;
    }
  }
  PetscCallDevice(q, (*q->run->upload)(q, bytes, here + p->gap.n * 4, d->gap));
  PetscCallDevice(q, (*q->run->add)(q, d->nshared, 4, d->shared, d->gap, y));
  PetscCall(PetscFree(here));
  PetscFunctionReturn(PETSC_SUCCESS);
}
