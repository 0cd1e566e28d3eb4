/* FlowDeviceList (flow/device.h): what the host wants in every step of fields that stay on a device. The listed cells
   are there a second time, apart from each other, so that kernels that add up give the residual of each. */
#include "compat.h"
#include "devicecells.h"
#include "ondeviceimpl.h"

struct _p_FlowDeviceList {
  PetscInt         nnode, ncell, npoint;
  const PetscInt  *node, *cell, *point;       /* borrowed */
  const int       *node_there, *cell_there;   /* [nnode], [ncell] */
  const int       *apart_there, *point_there; /* [ncell][27] nodes, [npoint] places */
  DeviceCells      cells;
  DeviceDivergence divergence;
  double          *coefficient;
  size_t           capacity;
  double          *u, *u_old, *w, *r, *source; /* [ncell][27][3]; source NULL: none so far */
  double          *p;                          /* [ncell][4] */
  double          *out;
  PetscReal       *here; /* [largest list] */
};

PetscErrorCode FlowListCreate(Flow f, PetscInt nnode, const PetscInt node[], PetscInt ncell, const PetscInt cell[],
                              PetscInt npoint, const PetscInt point[], FlowDeviceList *list)
{
  const DeviceQueue *q = FlowGetQueue(f);
  const PetscInt     n = ncell * 27;
  PetscInt          *apart, most;
  FlowDeviceList     s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->nnode  = nnode;
  s->ncell  = ncell;
  s->npoint = npoint;
  s->node   = node;
  s->cell   = cell;
  s->point  = point;
  PetscCall(DeviceTakeInts(q, nnode, node, &s->node_there));
  PetscCall(DeviceTakeInts(q, ncell, cell, &s->cell_there));
  PetscCall(DeviceTakeInts(q, npoint, point, &s->point_there));
  PetscCall(PetscMalloc1(n, &apart));
  for (PetscInt i = 0; i < n; i++) apart[i] = f->loc->cell_node[cell[i / 27] * 27 + i % 27];
  PetscCall(DeviceTakeInts(q, n, apart, &s->apart_there));
  PetscCall(PetscFree(apart));
  PetscCall(FlowCreateDeviceCells(f, q, ncell, cell, &s->cells));
  PetscCall(FlowCreateDeviceDivergence(f, q, &s->cells, cell, &s->divergence));
  {
    double **const nodal[] = {&s->u, &s->u_old, &s->w, &s->r};

    for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(nodal); i++) PetscCall(DeviceTake(q, n * 3, NULL, nodal[i]));
  }
  most = PetscMax(PetscMax(nnode, npoint) * 3, ncell * 4);
  PetscCall(DeviceTake(q, ncell * 4, NULL, &s->p));
  PetscCall(DeviceTake(q, most, NULL, &s->out));
  PetscCall(PetscMalloc1(most, &s->here));
  *list = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowListDestroy(Flow f, FlowDeviceList *list)
{
  const DeviceQueue *q = FlowGetQueue(f);
  FlowDeviceList     s = *list;

  PetscFunctionBeginUser;
  if (!s) PetscFunctionReturn(PETSC_SUCCESS);
  {
    void *all[] = {(void *)s->node_there,
                   (void *)s->cell_there,
                   (void *)s->apart_there,
                   (void *)s->point_there,
                   s->coefficient,
                   s->u,
                   s->u_old,
                   s->w,
                   s->source,
                   s->r,
                   s->p,
                   s->out};

    for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(all); i++) PetscCall(DeviceFree(q, &all[i]));
  }
  PetscCallDevice(q, DeviceCellsDestroy(q, &s->cells));
  PetscCall(FlowDestroyDeviceDivergence(q, &s->divergence));
  PetscCall(PetscFree(s->here));
  PetscCall(PetscFree(*list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* to [..][size] at rows of the host = the same rows of `from`, which lies on the device; rows NULL: as listed there */
static PetscErrorCode take_rows(const DeviceQueue *q, FlowDeviceList s, PetscInt n, PetscInt size, const int there[],
                                const PetscInt rows[], const double from[], PetscReal to[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->pick)(q, (int)n, (int)size, there, from, s->out));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)(n * size) * sizeof(double), s->out, rows ? s->here : to));
  for (PetscInt i = 0; i < n && rows; i++) PetscCall(PetscArraycpy(to + rows[i] * size, s->here + i * size, size));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A nodal array of the flow in the listed cells */
static PetscErrorCode pick_nodes(const DeviceQueue *q, FlowDeviceList s, const double from[], double to[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->pick)(q, (int)(s->ncell * 27), 3, s->apart_there, from, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* s->r = S u - (what is known) - B^T p of each cell; arrays that are done with serve again: w as work, u as u of now */
static PetscErrorCode make_residuals(Flow f, FlowDeviceList s)
{
  OnDevice            o     = f->device;
  const DeviceQueue  *q     = &o->queue;
  const DeviceFields *d     = &o->field;
  DeviceTerms         terms = {.cells = &s->cells, .form = &o->form, .n = (size_t)s->ncell * 81};
  double             *work  = s->w;

  PetscFunctionBeginUser;
  PetscCall(pick_nodes(q, s, d->u, s->u));
  PetscCall(pick_nodes(q, s, d->u_old, s->u_old));
  PetscCall(pick_nodes(q, s, o->w, s->w));
  if (d->source && !s->source) PetscCall(DeviceTake(q, terms.n, NULL, &s->source));
  if (d->source) PetscCall(pick_nodes(q, s, d->source, s->source));
  PetscCallDevice(q, (*q->run->pick)(q, (int)s->ncell, 4, s->cell_there, d->p_new, s->p));
  PetscCall(DeviceSetCoefficients(o, &s->cells, s->w, &s->coefficient, &s->capacity));
  terms.coefficient = s->coefficient;
  PetscCall(DeviceAddPast(f, &terms, s->u, s->u_old, d->source ? s->source : NULL, work, s->r));
  PetscCall(pick_nodes(q, s, d->u_new, s->u));
  PetscCallDevice(q, (*q->run->zero)(q, terms.n * sizeof(double), work));
  PetscCallDevice(q, (*q->run->multiply)(q, &s->cells, &o->form, s->coefficient, 0, s->u, work));
  PetscCallDevice(q, (*q->run->add_gradient)(q, &s->cells, &s->divergence, 0, -1, NULL, s->p, work));
  PetscCallDevice(q, (*q->run->combine)(q, terms.n, 2, (const double *[]){work, s->r}, (double[]){1, -1}, NULL, s->r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What acts on openings of type pressure, in the cells that are listed */
static void subtract_traction(Flow f, FlowDeviceList s, PetscReal r[])
{
  PetscReal all[81];

  for (PetscInt i = 0, at = -1; i < s->npoint && f->force.traction; i++) {
    if (s->point[i] / 27 != at) {
      at = s->point[i] / 27;
      for (PetscInt e = 0; e < 81; e++) all[e] = 0;
      TractionAddCell(f->force.traction, s->cell[at], -1, all);
    }
    for (PetscInt a = 0; a < 3; a++) r[i * 3 + a] += all[s->point[i] % 27 * 3 + a];
  }
}

PetscErrorCode FlowListTake(Flow f, FlowDeviceList s, PetscReal u[], PetscReal p[], PetscReal r[])
{
  const DeviceQueue  *q = &f->device->queue;
  const DeviceFields *d = &f->device->field;

  PetscFunctionBeginUser;
  PetscCall(take_rows(q, s, s->nnode, 3, s->node_there, s->node, d->u_new, u));
  PetscCall(take_rows(q, s, s->ncell, 4, s->cell_there, s->cell, d->p_new, p));
  PetscCall(make_residuals(f, s));
  PetscCall(take_rows(q, s, s->npoint, 3, s->point_there, NULL, s->r, r));
  subtract_traction(f, s, r);
  PetscFunctionReturn(PETSC_SUCCESS);
}
