/* OnDevice: terms that participants add in cells (FlowAddCellTerms), of own cells, as the kernels of parts want them:
   they are made there from their moments, a third of what the matrices are. */
#include "compat.h"
#include "devicecells.h"
#include "ondeviceimpl.h"

#define G       DEVICE_GROUP
#define MOMENTS 216

/* What goes over, on the host */
typedef struct {
  int       *node, *without, *hang;
  PetscReal *moment;
} Entries;

static void fill_entry(const MeshLocal *l, const PetscInt number[], const CellTerms *terms, PetscInt t, PetscInt place,
                       const Entries *to)
{
  const PetscInt  c = terms->cell[t];
  const MeshHang *h = MeshCellHang(l, c);

  for (PetscInt j = 0; j < 27; j++) to->node[place * 27 + j] = (int)l->cell_node[c * 27 + j];
  to->without[place] = (int)terms->without[t];
  to->hang[place]    = h ? (int)number[h->code] : -1;
  for (PetscInt m = 0; m < MOMENTS; m++)
    to->moment[(place / G * MOMENTS + m) * G + place % G] = terms->moment[t * MOMENTS + m];
}

/* Entries of all terms of own cells; the rest of the last group is empty */
static PetscInt fill_entries(const struct _p_Flow *f, const PetscInt number[], const Entries *to)
{
  PetscInt n = 0;

  for (PetscInt o = 0; o < f->owners.nterms; o++)
    for (PetscInt t = 0; t < f->owners.terms[o].n; t++)
      if (f->owners.terms[o].cell[t] < f->loc->ncell) fill_entry(f->loc, number, &f->owners.terms[o], t, n++, to);
  for (PetscInt e = n; e % G; e++) {
    for (PetscInt j = 0; j < 27; j++) to->node[e * 27 + j] = -1;
    to->without[e] = 0;
    to->hang[e]    = -1;
    for (PetscInt m = 0; m < MOMENTS; m++) to->moment[(e / G * MOMENTS + m) * G + e % G] = 0;
  }
  return n;
}

PetscErrorCode DeviceMomentsUpdate(Flow f, OnDevice o)
{
  const DeviceQueue *q        = &o->queue;
  DeviceMoments     *p        = &o->moments.on;
  size_t            *capacity = o->moments.capacity, n;
  PetscInt           most     = 0;
  Entries            entries;

  PetscFunctionBeginUser;
  p->ngroup = 0;
  for (PetscInt i = 0; i < f->owners.nterms; i++) most += f->owners.terms[i].n;
  if (!most) PetscFunctionReturn(PETSC_SUCCESS);
  most = (most + G - 1) / G * G;
  PetscCall(PetscMalloc4(most * 27, &entries.node, most, &entries.without, most, &entries.hang, most * MOMENTS,
                         &entries.moment));
  p->ngroup = (int)((fill_entries(f, o->hang, &entries) + G - 1) / G);
  n         = (size_t)p->ngroup * G;
  PetscCall(DeviceRenew(q, n * 27, entries.node, &p->node, &capacity[0]));
  PetscCall(DeviceRenew(q, n, entries.without, &p->without, &capacity[1]));
  if (f->loc->hang) PetscCall(DeviceRenew(q, n, entries.hang, &p->hang, &capacity[2]));
  PetscCall(DeviceRenew(q, n * MOMENTS, entries.moment, &p->moment, &capacity[3]));
  p->hangs = o->cells.hangs;
  PetscCall(PetscFree4(entries.node, entries.without, entries.hang, entries.moment));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceMomentsDestroy(OnDevice o)
{
  DeviceMoments *p = &o->moments.on;

  PetscFunctionBeginUser;
  PetscCall(DeviceFree(&o->queue, &p->node));
  PetscCall(DeviceFree(&o->queue, &p->without));
  PetscCall(DeviceFree(&o->queue, &p->hang));
  PetscCall(DeviceFree(&o->queue, &p->moment));
  o->moments = (MomentsOnDevice){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}
