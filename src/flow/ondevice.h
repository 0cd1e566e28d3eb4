/* OnDevice: the flow's cells and its velocity operator in the memory of a device (device/device.h), for products there.
   Inside of flow. Made where -device asks for it; on one rank, in space, without a matrix. */
#pragma once
#include "device/device.h"
#include "flow/flow.h"

typedef struct _p_OnDevice *OnDevice;

/* Read -device; *device stays NULL where everything lies in the memory of the processor. Collective. Errors: what a
   device does not carry. */
PetscErrorCode OnDeviceCreate(Flow, OnDevice *device);
PetscErrorCode OnDeviceDestroy(OnDevice *);
/* The operator of the step's coefficients. Local. */
PetscErrorCode OnDeviceUpdate(Flow);
