/* OnDevice: the flow's cells, its velocity operator and its fields in the memory of a device (device/device.h). Inside
   of flow. Made where -device asks for it; in space, without a matrix. ondevice.c: operator; devicemoments.c: terms of
   participants; devicefields.c: fields of a step, on one rank; devicemeasure.c: what a solution amounts to;
   devicememory.c. */
#pragma once
#include "device/device.h"
#include "flow/flow.h"

typedef struct _p_OnDevice *OnDevice;

/* Read -device; *device stays NULL where everything lies in the memory of the processor. Collective. Errors: what a
   device does not carry. */
PetscErrorCode OnDeviceCreate(Flow, OnDevice *device);
PetscErrorCode OnDeviceDestroy(OnDevice *);
/* All of it anew, for other cells. Errors: as OnDeviceCreate. */
PetscErrorCode OnDeviceRemesh(Flow);
/* The operator of the step's coefficients. Local. */
PetscErrorCode OnDeviceUpdate(Flow);
/* y = S x, d = its diagonal, for arrays of the host. Collective. */
PetscErrorCode OnDeviceMultiply(Flow, const PetscReal x[], PetscReal y[]);
PetscErrorCode OnDeviceGetDiagonal(Flow, PetscReal d[]);

/* ---- fields (devicefields.c); all local ---- */

/* Fields of the host, w too, that are newer on the device are brought; those of the device are old then (changed) or
   stay */
PetscErrorCode OnDeviceBring(Flow, PetscBool changed);
/* Decide whether fields stay there in the step that begins: not with a third velocity in time, nor where a mean
   velocity is held */
PetscErrorCode OnDeviceBeginStep(Flow);
/* w of the host is newer than that of the device from now on */
PetscErrorCode OnDeviceForgetConvection(Flow);
/* w of the host at n nodes, where it is on the device */
PetscErrorCode OnDeviceFetchConvection(Flow, PetscInt n, const PetscInt node[]);
/* What FlowExtrapolateConvection, FlowExtrapolate, FlowRhs, FlowAcceptStep do, where fields stay there */
PetscErrorCode OnDeviceConvect(Flow);
PetscErrorCode OnDeviceExtrapolate(Flow);
/* Without what the host adds then, r [nnode][dim] */
PetscErrorCode OnDeviceRhs(Flow);
PetscErrorCode OnDeviceAddRhs(Flow, const PetscReal r[]);
/* Where fields do not stay there (bodies), on one rank: does it make the right-hand side and the amounts of a step from
   fields of the host all the same? Then r [nnode][dim] <- that of OnDeviceRhs; the solution u goes over, for
   OnDeviceMeasure. */
PetscBool      OnDeviceHelps(Flow);
PetscErrorCode OnDeviceTakeRhs(Flow, PetscReal r[]);
PetscErrorCode OnDeviceSendSolution(Flow, const PetscReal u[]);
PetscErrorCode OnDeviceAccept(Flow);
/* With -info: bytes of the step that ends */
PetscErrorCode OnDeviceReport(Flow);
/* The solution of the step to arrays of the host */
PetscErrorCode OnDeviceTakeLast(Flow, PetscReal u[], PetscReal p[]);

/* ---- what the solution amounts to (devicemeasure.c); all local ---- */

/* What a step amounts to, of own cells and nodes: sums, then largest; the host's own too (evaluate.c) */
typedef struct {
  PetscReal square, divergence, flux[3]; /* int |u|^2, sum of squared means of div u, int w.grad u */
  PetscReal change[3], driven[3], velocity[3], volume, traction[3];
  PetscReal cfl, speed, speed_size; /* speed: its square */
} FlowAmounts;
#define AMOUNTS_SUMMED 18

/* All but the traction */
PetscErrorCode OnDeviceMeasure(Flow, FlowAmounts *);
PetscErrorCode OnDeviceGradientNorm(Flow, PetscReal *square);

/* Fields of the host are up to date afterwards. Local. */
#define FlowBringFields(f) ((f)->device ? OnDeviceBring(f, PETSC_FALSE) : PETSC_SUCCESS)
