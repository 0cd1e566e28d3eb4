/* OnDevice: memory of a queue (flow/device.h). */
#include "compat.h"
#include "flow/device.h"

PetscErrorCode DeviceTakeBytes(const DeviceQueue *queue, size_t bytes, const void *host, void **p)
{
  PetscFunctionBeginUser;
  PetscCallDevice(queue, (*queue->run->allocate)(queue, bytes, p));
  if (host) PetscCallDevice(queue, (*queue->run->upload)(queue, bytes, host, *p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceRenewBytes(const DeviceQueue *queue, size_t n, size_t size, const void *host, void **p,
                                size_t *capacity)
{
  PetscFunctionBeginUser;
  if (n > *capacity || !*p) {
    PetscCall(DeviceFreeBytes(queue, p));
    *capacity = n + n / 4;
    PetscCallDevice(queue, (*queue->run->allocate)(queue, *capacity * size, p));
  }
  if (host) PetscCallDevice(queue, (*queue->run->upload)(queue, n * size, host, *p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The kernels' integers, to be freed */
static PetscErrorCode narrow(PetscInt n, const PetscInt host[], int **v)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, v));
  for (PetscInt i = 0; i < n; i++) (*v)[i] = (int)host[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceTakeInts(const DeviceQueue *queue, PetscInt n, const PetscInt host[], const int **p)
{
  int *v;

  PetscFunctionBeginUser;
  PetscCall(narrow(n, host, &v));
  PetscCall(DeviceTake(queue, n, v, p));
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceRenewInts(const DeviceQueue *queue, PetscInt n, const PetscInt host[], const int **p,
                               size_t *capacity)
{
  int *v;

  PetscFunctionBeginUser;
  PetscCall(narrow(n, host, &v));
  PetscCall(DeviceRenew(queue, n, v, p, capacity));
  PetscCall(PetscFree(v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceFreeBytes(const DeviceQueue *queue, void **p)
{
  PetscFunctionBeginUser;
  if (*p) PetscCallDevice(queue, (*queue->run->release)(queue, *p));
  *p = NULL;
  PetscFunctionReturn(PETSC_SUCCESS);
}
