/* OnDevice: the table of -device_table, of kernels by what they move (device/device.h): how much of the memory's speed
   each of them uses. Of the first rank. */
#include "compat.h"
#include "ondeviceimpl.h"
#include "base/opt.h"

PetscErrorCode DeviceTableCreate(OnDevice o)
{
  PetscBool wanted = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(OptBool("-device_table", &wanted));
  if (wanted) PetscCall(PetscNew(&o->counts));
  o->traffic.counts = o->counts;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void sort_by_bytes(DeviceCounts *c)
{
  for (int i = 1; i < c->n; i++)
    for (int k = i; k > 0 && c->count[k].bytes > c->count[k - 1].bytes; k--) {
      const DeviceCount swap = c->count[k];

      c->count[k]     = c->count[k - 1];
      c->count[k - 1] = swap;
    }
}

PetscErrorCode DeviceTableDestroy(OnDevice o)
{
  DeviceCounts *c = o->counts;

  PetscFunctionBeginUser;
  if (!c) PetscFunctionReturn(PETSC_SUCCESS);
  o->traffic.counts = NULL;
  sort_by_bytes(c);
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "| kernel | calls | MB | s | GB/s |\n| --- | --- | --- | --- | --- |\n"));
  for (int k = 0; k < c->n; k++) {
    const DeviceCount *row = c->count + k;

    PetscCall(PetscPrintf(PETSC_COMM_WORLD, "| %.*s | %.0f | %.3f | %.6f | %.0f |\n",
                          (int)(strrchr(row->name, '_') - row->name), row->name, row->calls, row->bytes / 1e6,
                          row->seconds, row->seconds > 0 ? row->bytes / row->seconds / 1e9 : 0));
  }
  PetscCall(PetscPrintf(PETSC_COMM_WORLD, "Memory there: %.3f MB at most%s\n", o->traffic.most / 1e6,
                        strcmp(o->queue.run->name, "cpu") ? "" : ", without PETSc's vectors"));
  PetscCall(PetscFree(o->counts));
  PetscFunctionReturn(PETSC_SUCCESS);
}
