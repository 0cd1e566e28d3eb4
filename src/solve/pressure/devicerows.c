/* Devicerows: see devicerows.h */
#include "compat.h"
#include "devicerows.h"
#include "flow/device.h"

/* Inverses that are equal once, among rows that stand at the same place: kind [n], from [*nkind] a row that has it */
static PetscErrorCode list_kinds(const struct _p_RowsView *v, PetscInt kind[], PetscInt from[], PetscInt *nkind)
{
  PetscInt *first;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(v->nblock + 1, &first));
  for (PetscInt b = 0; b <= v->nblock; b++) first[b] = -1;
  *nkind = 0;
  for (PetscInt i = 0; i < v->n; i++) {
    const PetscInt k    = first[v->at[i]];
    PetscBool      same = PETSC_FALSE;

    if (k >= 0) PetscCall(PetscMemcmp(v->inverse + i * 16, v->inverse + from[k] * 16, 16 * sizeof(float), &same));
    if (!same) from[*nkind] = i;
    kind[i]         = same ? k : (*nkind)++;
    first[v->at[i]] = kind[i];
  }
  PetscCall(PetscFree(first));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Values in both precisions, the double one also where the rows have single precision only, in room for some more */
static PetscErrorCode take_values(const DeviceQueue *queue, const struct _p_RowsView *v, PetscInt spare, DeviceRows *r,
                                  size_t room[2])
{
  const size_t n = (size_t)v->nblock * 16, all = n + (size_t)spare * 16;
  PetscReal   *value;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &value));
  for (size_t e = 0; e < n; e++) value[e] = v->exact ? v->exact[e] : (PetscReal)v->single[e];
  PetscCall(DeviceRenew(queue, all, NULL, &r->value, &room[0]));
  PetscCall(DeviceRenew(queue, all, NULL, &r->single, &room[1]));
  PetscCallDevice(queue, (*queue->run->upload)(queue, n * sizeof(*value), value, r->value));
  PetscCallDevice(queue, (*queue->run->upload)(queue, n * sizeof(float), v->single, r->single));
  PetscCall(PetscFree(value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where rows stand, the kinds of their inverses, and these */
static PetscErrorCode take_kinds(const DeviceQueue *queue, const struct _p_RowsView *v, DeviceRows *r, size_t room[])
{
  PetscInt *kind, *from, nkind;
  float    *inverse;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(v->n, &kind, v->n, &from));
  PetscCall(list_kinds(v, kind, from, &nkind));
  PetscCall(PetscMalloc1(nkind * 16, &inverse));
  for (PetscInt k = 0; k < nkind; k++) PetscCall(PetscArraycpy(inverse + k * 16, v->inverse + from[k] * 16, 16));
  PetscCall(DeviceRenewInts(queue, v->n, v->at, (const int **)&r->at, &room[0]));
  PetscCall(DeviceRenewInts(queue, v->n, kind, (const int **)&r->kind, &room[1]));
  PetscCall(DeviceRenew(queue, nkind * 16, inverse, &r->inverse, &room[2]));
  PetscCall(PetscFree(inverse));
  PetscCall(PetscFree2(kind, from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceRowsRenew(const DeviceQueue *queue, Mat shell, PetscBool grows, DeviceRows *r, size_t room[])
{
  struct _p_RowsView v;

  PetscFunctionBeginUser;
  PetscCall(BlockGSGetRows(shell, &v));
  PetscCheck(v.nk == 4, PETSC_COMM_SELF, PETSC_ERR_SUP, "Rows of the pressure on a device are for meshes in space");
  if (!r->start) {
    PetscCall(PetscArrayzero(room, 5));
    *r = (DeviceRows){.n = (int)v.n, .nentry = (int)v.start[v.n]};
    PetscCall(DeviceTakeInts(queue, v.n + 1, v.start, &r->start));
    PetscCall(DeviceTakeInts(queue, v.start[v.n], v.column, &r->column));
  }
  r->nblock = (int)v.nblock;
  PetscCall(take_values(queue, &v, grows ? v.nblock / 3 : 0, r, room));
  PetscCall(take_kinds(queue, &v, r, &room[2]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceRowsDestroy(const DeviceQueue *queue, DeviceRows *r)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFree(queue, &r->start));
  PetscCall(DeviceFree(queue, &r->column));
  PetscCall(DeviceFree(queue, &r->at));
  PetscCall(DeviceFree(queue, &r->kind));
  PetscCall(DeviceFree(queue, &r->value));
  PetscCall(DeviceFree(queue, &r->single));
  PetscCall(DeviceFree(queue, &r->inverse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceTransferCreate(const DeviceQueue *queue, Transfer t, PetscInt ncell, DeviceTransfer *d)
{
  const PetscReal *low = NULL, *high = NULL, *fit;
  const PetscInt  *corner, *global, *node;
  PetscInt        *vertex, *form, own, all;

  PetscFunctionBeginUser;
  PetscCall(TransferGetVertices(t, &own, &all, &global, &node));
  PetscCall(PetscMalloc2(ncell * 8, &vertex, ncell, &form));
  for (PetscInt c = 0; c < ncell; c++) {
    TransferGetCell(t, c, &corner, &fit);
    for (PetscInt s = 0; s < 8; s++) vertex[s * ncell + c] = corner[s];
    if (!low || fit < low) low = fit;
    if (!high || fit > high) high = fit;
  }
  for (PetscInt c = 0; c < ncell; c++) {
    TransferGetCell(t, c, &corner, &fit);
    form[c] = (fit - low) / 32;
  }
  *d = (DeviceTransfer){.ncell = (int)ncell, .nvertex = (int)all};
  PetscCall(DeviceTakeInts(queue, ncell * 8, vertex, &d->vertex));
  PetscCall(DeviceTakeInts(queue, ncell, form, &d->form));
  PetscCall(DeviceTake(queue, high - low + 32, low, &d->fit));
  PetscCall(PetscFree2(vertex, form));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceTransferDestroy(const DeviceQueue *queue, DeviceTransfer *d)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFree(queue, &d->vertex));
  PetscCall(DeviceFree(queue, &d->form));
  PetscCall(DeviceFree(queue, &d->fit));
  PetscFunctionReturn(PETSC_SUCCESS);
}
