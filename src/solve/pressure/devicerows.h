/* Devicerows: rows of S_p, its smoother and the transfer to the vertices as the kernels of device/device.h want them,
   in a queue's memory. In space, one rank. Nothing here is collective. */
#pragma once
#include "blockgs.h"
#include "device/device.h"
#include "transfer.h"

/* Of a BlockGS with blocks of 4 x 4, as its rows are; in single precision where it has no other. Errors: other blocks,
   no memory. Once more where some rows have changed since: which stand where does not, and stays; what they hold goes
   over. The rows are zero at first; `room` [5] is how much there is for them; grows: a third more than they are, for
   rows that are made there (makerows.c). */
PetscErrorCode DeviceRowsRenew(const DeviceQueue *, Mat shell, PetscBool grows, DeviceRows *, size_t room[]);
PetscErrorCode DeviceRowsDestroy(const DeviceQueue *, DeviceRows *);
/* Of the ncell own cells */
PetscErrorCode DeviceTransferCreate(const DeviceQueue *, Transfer, PetscInt ncell, DeviceTransfer *);
PetscErrorCode DeviceTransferDestroy(const DeviceQueue *, DeviceTransfer *);
