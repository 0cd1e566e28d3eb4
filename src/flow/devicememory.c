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
    *capacity = *capacity ? n + n / 4 : n; /* what never grows has what it needs */
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

PetscErrorCode DevicePairsRenew(const DeviceQueue *queue, PetscInt n, PetscInt nbody, PetscInt width,
                                const PetscInt body[], const PetscInt at[], const PetscReal value[], DevicePairs *p,
                                size_t capacity[4])
{
  PetscInt  *start, *to_body, *to_at;
  PetscReal *to_value;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(nbody + 2, &start));
  PetscCall(PetscMalloc3(n, &to_at, n, &to_body, value ? n * width : 0, &to_value));
  for (PetscInt i = 0; i < n; i++) start[body[i] + 2]++;
  for (PetscInt k = 0; k < nbody; k++) start[k + 1] += start[k];
  for (PetscInt i = 0; i < n; i++) { /* start[k + 1]: where the next of body k goes */
    const PetscInt to = start[body[i] + 1]++;

    to_at[to]   = at[i];
    to_body[to] = body[i];
    for (PetscInt m = 0; m < width && value; m++) to_value[m * n + to] = value[i * width + m];
  }
  p->n     = (int)n;
  p->nbody = (int)nbody;
  PetscCall(DeviceRenewInts(queue, nbody + 1, start, &p->start, &capacity[0]));
  PetscCall(DeviceRenewInts(queue, n, to_at, &p->at, &capacity[1]));
  PetscCall(DeviceRenewInts(queue, n, to_body, &p->body, &capacity[2]));
  PetscCall(DeviceRenew(queue, n * width, value ? to_value : NULL, &p->value, &capacity[3]));
  PetscCall(PetscFree(start));
  PetscCall(PetscFree3(to_at, to_body, to_value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DevicePairsDestroy(const DeviceQueue *queue, DevicePairs *p)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFree(queue, &p->start));
  PetscCall(DeviceFree(queue, &p->at));
  PetscCall(DeviceFree(queue, &p->body));
  PetscCall(DeviceFree(queue, &p->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
