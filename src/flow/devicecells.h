/* Devicecells: the fluid's own cells and the form of its velocity operator as the kernels of device.h want them. In
   space only. Nothing here is collective. */
#pragma once
#include "device/device.h"
#include "impl.h"

/* Own cells of the mesh as it is, in the queue's memory; nodal arrays [nnode_all][3], cell arrays [ncell]. The caller
   destroys them (DeviceCellsDestroy). Errors: more nodes on a rank than DEVICE_MAX_NODES, no memory. */
PetscErrorCode FlowCreateDeviceCells(Flow, const DeviceQueue *, DeviceCells *);
/* Ways in which something hangs in own cells, each once: number [MESH_HANG_CODES] by code (-1: it does not occur),
   hangs [*n] to be freed */
PetscErrorCode FlowListDeviceHangs(const MeshLocal *, PetscInt number[], int *n, DeviceHang *hangs[]);
/* That of S in the step; nu: -flow viscosities at the points [ncell][27], or NULL, on the host */
void FlowGetDeviceForm(Flow, DeviceForm *, const PetscReal *nu[]);
/* Matrices of B of the cells on a device, there; the caller destroys them. Errors: no memory. */
PetscErrorCode FlowCreateDeviceDivergence(Flow, const DeviceQueue *, const DeviceCells *, DeviceDivergence *);
PetscErrorCode FlowDestroyDeviceDivergence(const DeviceQueue *, DeviceDivergence *);
