/* Pressure on a device, one rank: rows of S_p near bodies are made there, from the weights of nodes that have changed.
   The host has rows once, when those of all cells go over as a pool in which equal rows stand once; a row that changes
   later stands at a place of its own. */
#include "compat.h"
#include "flow/device.h"
#include "blockgs.h"
#include "pressureimpl.h"

PetscBool PressureMakesRowsOnDevice(Pressure p)
{
  return (PetscBool)(p->device && p->device->made.weight);
}

/* The inverse of the block on the diagonal of row c is to be made anew */
static void list_fresh(RowsMade *m, PetscInt c)
{
  if (m->listed[c]) return;
  m->listed[c]          = 1;
  m->fresh[m->nfresh++] = c;
}

/* Rows with a part of a body, whose inverses change with it */
static void list_cut(Pressure p)
{
  for (PetscInt e = 0; e < p->cut.n; e++) list_fresh(&p->device->made, p->cut.cell[e]);
}

/* ---- once ---- */

/* Rows that stand alone have their places; each row has an inverse of its own */
static PetscErrorCode take_rows(Pressure p, RowsMade *m)
{
  const DeviceQueue *q    = p->device->queue;
  DeviceRows        *r    = &p->device->cycle.rows;
  const PetscInt     n    = p->loc->ncell;
  size_t            *room = p->device->room;
  struct _p_RowsView v;
  PetscInt          *users, *each;

  PetscFunctionBeginUser;
  PetscCall(BlockGSGetRows(p->nodes.matrix, &v));
  PetscCall(PetscCalloc1(v.nblock + 1, &users));
  PetscCall(PetscMalloc1(n, &each));
  for (PetscInt c = 0; c < n; c++) users[v.at[c]]++;
  for (PetscInt c = 0; c < n; c++) {
    m->own[c] = users[v.at[c]] == 1 ? v.at[c] : -1;
    each[c]   = c;
  }
  m->used = v.nblock;
  PetscCall(DeviceRenewInts(q, n, each, (const int **)&r->kind, &room[3]));
  PetscCall(DeviceRenew(q, n * 16, v.inverse, &r->inverse, &room[4]));
  PetscCall(PetscFree(users));
  PetscCall(PetscFree(each));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureBeginRowsOnDevice(Pressure p)
{
  const DeviceQueue *q = p->device->queue;
  RowsMade          *m = &p->device->made;
  const PetscInt     n = p->loc->ncell;

  PetscFunctionBeginUser;
  if (!p->nbodies || m->weight || p->device->cycle.ranks.ctx) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscCalloc3(n, &m->own, n, &m->fresh, n, &m->listed));
  PetscCall(take_rows(p, m));
  PetscCall(DeviceTake(q, p->loc->nnode * 3, p->weight, &m->weight));
  PetscCall(DeviceTake(q, n, NULL, &m->where));
  list_cut(p);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureEndRowsOnDevice(Pressure p)
{
  const DeviceQueue *q = p->device->queue;
  RowsMade          *m = &p->device->made;

  PetscFunctionBeginUser;
  PetscCall(DeviceFree(q, &m->weight));
  PetscCall(DeviceFree(q, &m->where));
  PetscCall(DeviceFree(q, &m->row));
  PetscCall(DeviceFree(q, &m->at));
  PetscCall(DeviceFree(q, &m->block));
  PetscCall(PetscFree3(m->own, m->fresh, m->listed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- in every step ---- */

/* Room for `used` blocks of rows, of which the first `kept` hold something */
static PetscErrorCode grow(struct _p_PressureDevice *d, PetscInt kept, PetscInt used)
{
  const DeviceQueue *q    = d->queue;
  DeviceRows        *r    = &d->cycle.rows;
  const size_t       room = (size_t)(used + used / 16) * 16, n = (size_t)kept * 16;
  double            *value;

  PetscFunctionBeginUser;
  if ((size_t)used * 16 <= PetscMin(d->room[0], d->room[1])) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DeviceFree(q, &r->single));
  PetscCall(DeviceTake(q, room, NULL, &value));
  PetscCallDevice(q, (*q->run->combine)(q, n, 1, (const double *const *)&r->value, (double[]){1}, NULL, value));
  PetscCall(DeviceFree(q, &r->value));
  PetscCall(DeviceTake(q, room, NULL, &r->single));
  PetscCallDevice(q, (*q->run->body.narrow)(q, n, value, r->single));
  r->value   = value;
  d->room[0] = d->room[1] = room;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Listed cells and their places go over */
static PetscErrorCode take_own(Pressure p, RowsMade *m)
{
  const PetscInt *start = p->nodes.neighbour_ptr, n = p->list.n, before = m->used;
  PetscInt       *at;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(n, &at));
  for (PetscInt k = 0; k < n; k++) {
    const PetscInt c = p->list.cell[k];

    if (m->own[c] < 0) {
      m->own[c] = m->used;
      m->used += start[c + 1] - start[c];
    }
    at[k] = m->own[c];
    list_fresh(m, c);
  }
  PetscCall(grow(p->device, before, m->used));
  p->device->cycle.rows.nblock = (int)m->used;
  PetscCall(DeviceRenewInts(p->device->queue, n, p->list.cell, &m->row, &m->capacity[0]));
  PetscCall(DeviceRenewInts(p->device->queue, n, at, &m->at, &m->capacity[1]));
  PetscCall(PetscFree(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Blocks of cells between two surfaces, of those that are listed; see add_shared of pressurematrix.c */
static PetscErrorCode add_gaps(Pressure p, RowsMade *m)
{
  const DeviceQueue *q = p->device->queue;
  PetscInt          *cell, n = 0;
  PetscReal         *block;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(p->gap.n, &cell, p->gap.n * 16, &block));
  for (PetscInt i = 0; i < p->gap.n; i++) {
    if (p->list.stamp[p->gap.cell[i]] != p->list.stamp_now) continue;
    PetscCall(PetscArraycpy(block + n * 16, p->gap.block + i * 16, 16));
    cell[n++] = p->gap.cell[i];
  }
  if (n) {
    PetscCall(DeviceRenewInts(q, n, cell, &m->row, &m->capacity[0]));
    PetscCall(DeviceRenew(q, n * 16, block, &m->block, &m->capacity[2]));
    PetscCallDevice(q, (*q->run->body.add_to_diagonal)(q, (int)n, m->row, m->block, &p->device->cycle.rows));
  }
  PetscCall(PetscFree2(cell, block));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureMakeRowsOnDevice(Pressure p, const PetscReal weight[], PetscInt n, const PetscInt node[])
{
  RowsMade *m = &p->device->made;

  PetscFunctionBeginUser;
  PetscCall(FlowSendRows(p->flow, n, 3, node, weight, m->weight));
  PetscCall(take_own(p, m));
  PetscCall(FlowMakeRowsOnDevice(p->flow, m->weight, p->list.n, m->row, m->at, &p->device->cycle.rows));
  PetscCall(add_gaps(p, m));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PressureInvertRowsOnDevice(Pressure p)
{
  const DeviceQueue *q = p->device->queue;
  RowsMade          *m = &p->device->made;

  PetscFunctionBeginUser;
  if (!PressureMakesRowsOnDevice(p)) PetscFunctionReturn(PETSC_SUCCESS);
  list_cut(p);
  PetscCall(DeviceRenewInts(q, m->nfresh, m->fresh, &m->row, &m->capacity[0]));
  PetscCall(DeviceRenew(q, m->nfresh * 16, NULL, &m->block, &m->capacity[2]));
  PetscCallDevice(q, (*q->run->body.invert_rows)(q, (int)m->nfresh, m->row, &p->device->cycle.body, m->where, m->block,
                                                 &p->device->cycle.rows));
  for (PetscInt k = 0; k < m->nfresh; k++) m->listed[m->fresh[k]] = 0;
  m->nfresh = 0;
  list_cut(p); /* when they are cut no more */
  PetscFunctionReturn(PETSC_SUCCESS);
}
