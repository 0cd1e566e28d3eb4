/* OnDevice: terms that participants add in cells (FlowAddCellTerms), of own cells, as the kernels of parts want them:
   they are made there from their moments, a third of what the matrices are. */
#include "compat.h"
#include "devicecells.h"
#include "ondeviceimpl.h"

#define G       DEVICE_GROUP
#define MOMENTS 216

/* What goes over, on the host. given [group]: some of its moments do; the others are drawn there. */
typedef struct {
  int        *node, *without, *hang, *place;
  PetscReal  *moment;
  PetscBool  *given;
  PetscInt    nmade, nsample;
  DeviceBall *ball;
} Entries;

static void fill_entry(const struct _p_Flow *f, const CellTerms *terms, PetscInt t, PetscInt place, Entries *to)
{
  const PetscInt c = terms->cell[t];

  for (PetscInt j = 0; j < 27; j++) to->node[place * 27 + j] = (int)f->loc->cell_node[c * 27 + j];
  to->without[place] = (int)terms->moments.without[t];
  to->hang[place]    = OnDeviceFindHang(f, c);
}

/* The moments of a part, or NULL: what they are drawn from */
static void fill_moments(const DeviceBall *ball, const PetscReal moment[], PetscInt place, Entries *to)
{
  if (ball) {
    to->place[to->nmade]  = (int)place;
    to->ball[to->nmade++] = *ball;
    return;
  }
  to->given[place / G] = PETSC_TRUE;
  for (PetscInt m = 0; m < MOMENTS; m++) to->moment[(place / G * MOMENTS + m) * G + place % G] = moment[m];
}

/* Of all terms of an owner in own cells, from place n on */
static PetscInt fill_owner(const struct _p_Flow *f, const CellTerms *terms, PetscInt n, Entries *to)
{
  const FlowMoments *given = &terms->moments;
  const PetscReal   *next  = given->moment;

  if (given->ball) to->nsample = given->nsample;
  for (PetscInt t = 0; t < terms->n; t++) {
    const DeviceBall *ball   = given->ball && given->ball[t].edge[0] > 0 ? given->ball + t : NULL;
    const PetscReal  *moment = next;

    if (!ball) next += MOMENTS;
    if (terms->cell[t] >= f->loc->ncell) continue;
    fill_entry(f, terms, t, n, to);
    fill_moments(ball, moment, n++, to);
  }
  return n;
}

/* Entries of all terms of own cells; the rest of the last group is empty */
static PetscInt fill_entries(const struct _p_Flow *f, Entries *to)
{
  static const PetscReal none[MOMENTS] = {0};
  PetscInt               n             = 0;

  for (PetscInt o = 0; o < f->owners.nterms; o++) n = fill_owner(f, &f->owners.terms[o], n, to);
  for (PetscInt e = n; e % G; e++) {
    for (PetscInt j = 0; j < 27; j++) to->node[e * 27 + j] = -1;
    to->without[e] = 0;
    to->hang[e]    = -1;
    fill_moments(NULL, none, e, to);
  }
  return n;
}

/* Moments that are given go over, by groups; others are drawn */
static PetscErrorCode take_moments(const DeviceQueue *q, const Entries *from, PetscInt ngroup, MomentsOnDevice *o)
{
  DeviceMoments *p = &o->on;
  const size_t   n = MOMENTS * G;
  double        *moment;

  PetscFunctionBeginUser;
  PetscCall(DeviceRenew(q, (size_t)ngroup * n, NULL, &p->moment, &o->capacity[3]));
  moment = (double *)p->moment;
  for (PetscInt g = 0, end; g < ngroup; g = end) {
    for (end = g + 1; end < ngroup && from->given[end] == from->given[g];) end++;
    if (!from->given[g]) continue;
    PetscCallDevice(q, (*q->run->upload)(q, (size_t)(end - g) * n * sizeof(double), from->moment + (size_t)g * n,
                                         moment + (size_t)g * n));
  }
  PetscCall(DeviceRenew(q, from->nmade, from->place, &o->place, &o->capacity[4]));
  PetscCall(DeviceRenew(q, from->nmade, from->ball, &o->ball, &o->capacity[5]));
  PetscCallDevice(q, (*q->run->body.make_moments)(q, (int)from->nmade, (int)from->nsample, o->place, o->ball, moment));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceMomentsUpdate(Flow f, OnDevice o)
{
  const DeviceQueue *q        = &o->queue;
  DeviceMoments     *p        = &o->moments.on;
  size_t            *capacity = o->moments.capacity, n;
  PetscInt           most     = 0;
  Entries            entries  = {0};

  PetscFunctionBeginUser;
  p->ngroup = 0;
  for (PetscInt i = 0; i < f->owners.nterms; i++) most += f->owners.terms[i].n;
  if (!most) PetscFunctionReturn(PETSC_SUCCESS);
  most = (most + G - 1) / G * G;
  PetscCall(PetscMalloc6(most * 27, &entries.node, most, &entries.without, most, &entries.hang, most * MOMENTS,
                         &entries.moment, most, &entries.place, most, &entries.ball));
  PetscCall(PetscCalloc1(most / G, &entries.given));
  p->ngroup = (int)((fill_entries(f, &entries) + G - 1) / G);
  n         = (size_t)p->ngroup * G;
  PetscCall(DeviceRenew(q, n * 27, entries.node, &p->node, &capacity[0]));
  PetscCall(DeviceRenew(q, n, entries.without, &p->without, &capacity[1]));
  if (f->loc->hang) PetscCall(DeviceRenew(q, n, entries.hang, &p->hang, &capacity[2]));
  PetscCall(take_moments(q, &entries, p->ngroup, &o->moments));
  p->hangs = o->cells.hangs;
  PetscCall(PetscFree6(entries.node, entries.without, entries.hang, entries.moment, entries.place, entries.ball));
  PetscCall(PetscFree(entries.given));
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
  PetscCall(DeviceFree(&o->queue, &o->moments.place));
  PetscCall(DeviceFree(&o->queue, &o->moments.ball));
  o->moments = (MomentsOnDevice){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}
