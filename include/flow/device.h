/* The flow on a device: with -device, vectors of solvers lie in its memory, and products are made there by the kernels
   of device/device.h. Arrays below lie there, except where "host" is said. Nothing here is collective. */
#pragma once
#include "device/device.h"
#include "flow/flow.h"

/* NULL: everything lies in the memory of the processor */
const DeviceQueue *FlowGetQueue(Flow);
/* y [nnode][dim] = S x. masked: components that boundary conditions fix count as zero in x, and are zero in y. */
PetscErrorCode FlowMultiplyOnDevice(Flow, PetscBool masked, const PetscReal x[], PetscReal y[]);

/* y [ncell][4] = factor B u; y [nnode][dim] = factor B^T p, zero where boundary conditions fix components */
PetscErrorCode FlowDivergenceOnDevice(Flow, PetscReal factor, const PetscReal u[], PetscReal y[]);
PetscErrorCode FlowGradientOnDevice(Flow, PetscReal factor, const PetscReal p[], PetscReal y[]);

/* PetscCall of a kernel of the queue */
#define PetscCallDevice(queue, ...) \
  do { \
    const int error_ = (__VA_ARGS__); \
\
    PetscCheck(!error_, PETSC_COMM_SELF, PETSC_ERR_GPU, "%s: %s", #__VA_ARGS__, (*(queue)->run->explain)(error_)); \
  } while (0)

/* *p = memory for n of the pointer's numbers, filled from host unless that is NULL; DeviceFree frees and forgets it */
#define DeviceTake(queue, n, host, p) DeviceTakeBytes(queue, (size_t)(n) * sizeof(**(p)), host, (void **)(p))
PetscErrorCode DeviceTakeBytes(const DeviceQueue *, size_t bytes, const void *host, void **p);
PetscErrorCode DeviceTakeInts(const DeviceQueue *, PetscInt n, const PetscInt host[], const int **p);
#define DeviceFree(queue, p) DeviceFreeBytes(queue, (void **)(p))
PetscErrorCode DeviceFreeBytes(const DeviceQueue *, void **p);
