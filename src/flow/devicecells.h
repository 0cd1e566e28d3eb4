/* Devicecells: the fluid's own cells and the form of its velocity operator as the kernels of device.h want them. In
   space only. Nothing here is collective. */
#pragma once
#include "device/device.h"
#include "impl.h"

/* All own cells of the mesh as it is, less than DEVICE_MAX_NODES nodes, in the queue's memory; nodal arrays
   [nnode_all][3], cell arrays [ncell]. With a list of n cells these alone, each with nodes of its own: nodal arrays
   [n][27][3], cell arrays [n]. The caller destroys them (DeviceCellsDestroy). Error: no memory. */
PetscErrorCode FlowCreateDeviceCells(Flow, const DeviceQueue *, PetscInt n, const PetscInt list[], DeviceCells *);
/* Ways in which something hangs in own cells, each once: number [MESH_HANG_CODES] by code, -1: it does not occur.
   Returns how many; in this order they are in DeviceCells. */
PetscInt FlowNumberHangs(const MeshLocal *, PetscInt number[]);
/* That of S in the step; nu: viscosities at the points [ncell][27], or NULL, on the host */
void FlowGetDeviceForm(Flow, DeviceForm *, const PetscReal *nu[]);
/* Matrices of B of the cells on a device, there, and of the same list, or NULL; the caller destroys them. Errors: no
   memory. */
PetscErrorCode FlowCreateDeviceDivergence(Flow, const DeviceQueue *, const DeviceCells *, const PetscInt list[],
                                          DeviceDivergence *);
PetscErrorCode FlowDestroyDeviceDivergence(const DeviceQueue *, DeviceDivergence *);
