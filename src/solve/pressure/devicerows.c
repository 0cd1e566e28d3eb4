/* Devicerows: see devicerows.h */
#include "compat.h"
#include "devicerows.h"

static PetscErrorCode check(const DeviceQueue *queue, int failed)
{
  PetscFunctionBeginUser;
  PetscCheck(!failed, PETSC_COMM_SELF, PETSC_ERR_LIB, "Pressure on the device: %s", (*queue->run->explain)(failed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode bring(const DeviceQueue *queue, size_t bytes, const void *host, const void **to)
{
  void *p = NULL;

  PetscFunctionBeginUser;
  PetscCall(check(queue, (*queue->run->allocate)(queue, bytes, &p)));
  PetscCall(check(queue, (*queue->run->upload)(queue, bytes, host, p)));
  *to = p;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode bring_ints(const DeviceQueue *queue, PetscInt n, const PetscInt v[], const int **to)
{
  int *host;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &host));
  for (PetscInt i = 0; i < n; i++) host[i] = (int)v[i];
  PetscCall(bring(queue, (size_t)n * sizeof(*host), host, (const void **)to));
  PetscCall(PetscFree(host));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode drop(const DeviceQueue *queue, PetscInt n, const void *const array[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++)
    if (array[i]) PetscCall(check(queue, (*queue->run->release)(queue, (void *)array[i])));
  PetscFunctionReturn(PETSC_SUCCESS);
}

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

/* Values in double precision, also where the rows have single precision only */
static PetscErrorCode bring_values(const DeviceQueue *queue, const struct _p_RowsView *v, const double **to)
{
  PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(v->nblock * 16, &value));
  for (PetscInt e = 0; e < v->nblock * 16; e++) value[e] = v->exact ? v->exact[e] : (PetscReal)v->single[e];
  PetscCall(bring(queue, (size_t)v->nblock * 16 * sizeof(*value), value, (const void **)to));
  PetscCall(PetscFree(value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceRowsCreate(const DeviceQueue *queue, Mat shell, DeviceRows *r)
{
  struct _p_RowsView v;
  PetscInt          *kind, *from, nkind;
  float             *inverse;

  PetscFunctionBeginUser;
  PetscCall(BlockGSGetRows(shell, &v));
  PetscCheck(v.nk == 4, PETSC_COMM_SELF, PETSC_ERR_SUP, "Rows of the pressure on a device are for meshes in space");
  PetscCall(PetscMalloc2(v.n, &kind, v.n, &from));
  PetscCall(list_kinds(&v, kind, from, &nkind));
  PetscCall(PetscMalloc1(nkind * 16, &inverse));
  for (PetscInt k = 0; k < nkind; k++) PetscCall(PetscArraycpy(inverse + k * 16, v.inverse + from[k] * 16, 16));
  *r = (DeviceRows){.n = (int)v.n};
  PetscCall(bring_ints(queue, v.n + 1, v.start, &r->start));
  PetscCall(bring_ints(queue, v.start[v.n], v.column, &r->column));
  PetscCall(bring_ints(queue, v.n, v.at, &r->at));
  PetscCall(bring_ints(queue, v.n, kind, &r->kind));
  PetscCall(bring_values(queue, &v, &r->value));
  PetscCall(bring(queue, (size_t)v.nblock * 16 * sizeof(float), v.single, (const void **)&r->single));
  PetscCall(bring(queue, (size_t)nkind * 16 * sizeof(float), inverse, (const void **)&r->inverse));
  PetscCall(PetscFree(inverse));
  PetscCall(PetscFree2(kind, from));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceRowsDestroy(const DeviceQueue *queue, DeviceRows *r)
{
  const void *array[] = {r->start, r->column, r->at, r->kind, r->value, r->single, r->inverse};

  PetscFunctionBeginUser;
  PetscCall(drop(queue, PETSC_STATIC_ARRAY_LENGTH(array), array));
  *r = (DeviceRows){0};
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
  PetscCall(bring_ints(queue, ncell * 8, vertex, &d->vertex));
  PetscCall(bring_ints(queue, ncell, form, &d->form));
  PetscCall(bring(queue, (size_t)(high - low + 32) * sizeof(double), low, (const void **)&d->fit));
  PetscCall(PetscFree2(vertex, form));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceTransferDestroy(const DeviceQueue *queue, DeviceTransfer *d)
{
  const void *array[] = {d->vertex, d->form, d->fit};

  PetscFunctionBeginUser;
  PetscCall(drop(queue, PETSC_STATIC_ARRAY_LENGTH(array), array));
  *d = (DeviceTransfer){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}
