/* OnDevice: cells with nodes of their own numbering that have the coefficients and the terms of the step's cells, for
   products with parts of the operator (FlowNearRenew). */
#include "compat.h"
#include "ondeviceimpl.h"

#define G DEVICE_GROUP

/* Cells and terms as they go over, on the host */
typedef struct {
  int *node, *from, *hang, *without;
} Entries;

static PetscErrorCode open_entries(size_t n, Entries *p)
{
  PetscFunctionBeginUser;
  PetscCall(PetscMalloc4(n * 27, &p->node, n, &p->from, n, &p->hang, n, &p->without));
  for (size_t e = 0; e < n * 27; e++) p->node[e] = -1;
  for (size_t e = 0; e < n; e++) p->from[e] = p->without[e] = 0;
  for (size_t e = 0; e < n; e++) p->hang[e] = -1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static void set_entry(const Entries *p, PetscInt at, const PetscInt node[], int from, int hang, int without)
{
  for (PetscInt j = 0; j < 27; j++) p->node[at * 27 + j] = (int)node[j];
  p->from[at]    = from;
  p->hang[at]    = hang;
  p->without[at] = without;
}

static PetscInt groups(PetscInt n)
{
  return (n + G - 1) / G;
}

/* Boxes first; a place of 0 groups of the kind may have none */
static PetscErrorCode send_cells(Flow f, PetscInt n, const PetscInt cell[], const PetscInt node[], FlowNear *near)
{
  const OnDevice     o        = f->device;
  const DeviceQueue *q        = &o->queue;
  const int         *place    = o->place_here;
  const PetscInt     first    = o->cells.nbox * G;
  PetscInt           count[2] = {0, 0}, at[2];
  DeviceCells       *c        = &near->cells;
  Entries            p;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < n; i++) count[place[cell[i]] >= first]++;
  *c    = (DeviceCells){.nnode    = near->n,
                        .nbox     = (int)groups(count[0]),
                        .ngroup   = (int)(groups(count[0]) + groups(count[1])),
                        .node     = c->node,
                        .hang     = c->hang,
                        .hangs    = o->cells.hangs,
                        .from     = c->from,
                        .of_boxes = o->cells.nbox};
  at[0] = 0;
  at[1] = c->nbox * G;
  PetscCall(open_entries((size_t)c->ngroup * G, &p));
  for (PetscInt e = c->nbox * G; e < c->ngroup * G; e++) p.from[e] = (int)first; /* empty ones too are of the kind */
  for (PetscInt i = 0; i < n; i++)
    set_entry(&p, at[place[cell[i]] >= first]++, node + i * 27, place[cell[i]], OnDeviceFindHang(f, cell[i]), 0);
  PetscCall(DeviceRenew(q, c->ngroup * G * 27, p.node, &c->node, &near->capacity[0]));
  PetscCall(DeviceRenew(q, c->ngroup * G, p.from, &c->from, &near->capacity[1]));
  if (f->loc->hang) PetscCall(DeviceRenew(q, c->ngroup * G, p.hang, &c->hang, &near->capacity[2]));
  PetscCall(PetscFree4(p.node, p.from, p.hang, p.without));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Terms by cells, numbered as DeviceMomentsUpdate has them: first [cell], -1: none, next and without [n] */
typedef struct {
  PetscInt n, *first, *next;
  int     *without;
} TermList;

static PetscErrorCode list_terms(Flow f, TermList *t)
{
  PetscInt n = 0;

  PetscFunctionBeginUser;
  for (PetscInt o = 0; o < f->owners.nterms; o++) n += f->owners.terms[o].n;
  t->n = 0;
  PetscCall(PetscMalloc3(f->loc->ncell, &t->first, n, &t->next, n, &t->without));
  for (PetscInt c = 0; c < f->loc->ncell; c++) t->first[c] = -1;
  for (PetscInt o = 0; o < f->owners.nterms; o++)
    for (PetscInt e = 0; e < f->owners.terms[o].n; e++) {
      const PetscInt c = f->owners.terms[o].cell[e];

      if (c >= f->loc->ncell) continue;
      t->without[t->n] = (int)f->owners.terms[o].moments.without[e];
      t->next[t->n]    = t->first[c];
      t->first[c]      = t->n++;
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode send_terms(Flow f, PetscInt n, const PetscInt cell[], const PetscInt node[], FlowNear *near)
{
  const OnDevice     o     = f->device;
  const DeviceQueue *q     = &o->queue;
  DeviceMoments     *m     = &near->moments;
  PetscInt           count = 0;
  TermList           list;
  Entries            p;

  PetscFunctionBeginUser;
  m->ngroup = 0;
  if (!o->moments.on.ngroup) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(list_terms(f, &list));
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt t = list.first[cell[i]]; t >= 0; t = list.next[t]) count++;
  m->ngroup = (int)groups(count);
  m->moment = o->moments.on.moment;
  m->hangs  = o->cells.hangs;
  PetscCall(open_entries((size_t)m->ngroup * G, &p));
  count = 0;
  for (PetscInt i = 0; i < n; i++)
    for (PetscInt t = list.first[cell[i]]; t >= 0; t = list.next[t])
      set_entry(&p, count++, node + i * 27, (int)t, OnDeviceFindHang(f, cell[i]), list.without[t]);
  PetscCall(DeviceRenew(q, m->ngroup * G * 27, p.node, &m->node, &near->capacity[3]));
  PetscCall(DeviceRenew(q, m->ngroup * G, p.from, &m->from, &near->capacity[4]));
  PetscCall(DeviceRenew(q, m->ngroup * G, p.without, &m->without, &near->capacity[5]));
  if (f->loc->hang) PetscCall(DeviceRenew(q, m->ngroup * G, p.hang, &m->hang, &near->capacity[6]));
  PetscCall(PetscFree4(p.node, p.from, p.hang, p.without));
  PetscCall(PetscFree3(list.first, list.next, list.without));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowNearRenew(Flow f, PetscInt nnode, PetscInt n, const PetscInt cell[], const PetscInt node[],
                             FlowNear *near)
{
  PetscFunctionBeginUser;
  near->n = (int)nnode;
  PetscCall(OnDeviceFindGroups(f->device));
  PetscCall(send_cells(f, n, cell, node, near));
  PetscCall(send_terms(f, n, cell, node, near));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowNearMultiply(Flow f, const FlowNear *near, const PetscReal x[], PetscReal y[])
{
  const OnDevice     o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->multiply)(q, &near->cells, &o->form, o->coefficient, 0, x, y));
  if (near->moments.ngroup) PetscCallDevice(q, (*q->run->body.multiply_moments)(q, &near->moments, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowNearDestroy(Flow f, FlowNear *near)
{
  const DeviceQueue *q = FlowGetQueue(f);

  PetscFunctionBeginUser;
  PetscCall(DeviceFree(q, &near->cells.node));
  PetscCall(DeviceFree(q, &near->cells.from));
  PetscCall(DeviceFree(q, &near->cells.hang));
  PetscCall(DeviceFree(q, &near->moments.node));
  PetscCall(DeviceFree(q, &near->moments.from));
  PetscCall(DeviceFree(q, &near->moments.without));
  PetscCall(DeviceFree(q, &near->moments.hang));
  *near = (FlowNear){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}
