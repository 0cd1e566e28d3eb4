/* OnDevice: rows of nodal and cell arrays between the host and the device (flow/device.h): what is near bodies, where
   the host works with a field that stays there. */
#include "compat.h"
#include "ondeviceimpl.h"

/* Room for n rows; the rows' numbers go over */
static PetscErrorCode open_rows(OnDevice o, PetscInt n, PetscInt size, const PetscInt row[])
{
  RowsOnDevice *r    = &o->rows;
  const size_t  room = r->capacity[1];

  PetscFunctionBeginUser;
  PetscCall(DeviceRenewInts(&o->queue, n, row, &r->row, &r->capacity[0]));
  PetscCall(DeviceRenew(&o->queue, n * size, NULL, &r->value, &r->capacity[1]));
  if (r->capacity[1] == room && r->here) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree(r->here));
  PetscCall(PetscMalloc1(r->capacity[1], &r->here));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowFetchRows(Flow f, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal there[],
                             PetscReal here[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  if (n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(open_rows(o, n, size, row));
  PetscCallDevice(q, (*q->run->pick)(q, (int)n, (int)size, o->rows.row, there, o->rows.value));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)(n * size) * sizeof(double), o->rows.value, o->rows.here));
  for (PetscInt i = 0; i < n; i++) PetscCall(PetscArraycpy(here + row[i] * size, o->rows.here + i * size, size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Their values go over, to where put or add of the kernels has them */
static PetscErrorCode send_rows(OnDevice o, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal here[],
                                int (*place)(const DeviceQueue *, int, int, const int[], const double[], double[]),
                                PetscReal there[])
{
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  if (n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(open_rows(o, n, size, row));
  for (PetscInt i = 0; i < n; i++) PetscCall(PetscArraycpy(o->rows.here + i * size, here + row[i] * size, size));
  PetscCallDevice(q, (*q->run->upload)(q, (size_t)(n * size) * sizeof(double), o->rows.here, o->rows.value));
  PetscCallDevice(q, (*place)(q, (int)n, (int)size, o->rows.row, o->rows.value, there));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSendRows(Flow f, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal here[],
                            PetscReal there[])
{
  PetscFunctionBeginUser;
  PetscCall(send_rows(f->device, n, size, row, here, f->device->queue.run->put, there));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddRows(Flow f, PetscInt n, PetscInt size, const PetscInt row[], const PetscReal here[],
                           PetscReal there[])
{
  PetscFunctionBeginUser;
  PetscCall(send_rows(f->device, n, size, row, here, f->device->queue.run->add, there));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceFetchConvection(Flow f, PetscInt n, const PetscInt node[])
{
  PetscFunctionBeginUser;
  PetscCall(FlowFetchRows(f, n, 3, node, f->device->w, f->w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceFetchDestroy(OnDevice o)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFree(&o->queue, &o->rows.row));
  PetscCall(DeviceFree(&o->queue, &o->rows.value));
  PetscCall(PetscFree(o->rows.here));
  o->rows = (RowsOnDevice){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}
