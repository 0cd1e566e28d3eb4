/* OnDevice: see ondevice.h. Cells go over once, in groups of one kind (DeviceCells); coefficients are made there from
   the convecting velocity in every step. */
#include "compat.h"
#include "devicecells.h"
#include "ondeviceimpl.h"
#include "base/opt.h"

static const char *const DEVICES[] = {"none", "emulate", "cuda", NULL};
#define NONE 0
#define CUDA 2

/* ---- ghosts: PetscSF finds out in which memory arrays lie ---- */

static PetscBool has_ghosts(const struct _p_Flow *f)
{
  return (PetscBool)(f->loc->nnode < f->loc->nnode_all);
}

static PetscErrorCode copy(OnDevice o, size_t n, const double from[], double to[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(&o->queue, (*o->queue.run->combine)(&o->queue, n, 1, &from, (double[]){1}, NULL, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *all = x [nnode][3] with the values at ghosts. Collective. */
static PetscErrorCode fetch_nodes(Flow f, const PetscReal x[], const PetscReal **all)
{
  OnDevice o = f->device;

  PetscFunctionBeginUser;
  *all = x;
  if (has_ghosts(f)) {
    PetscCall(copy(o, DeviceNodal(f), x, o->from));
    *all = o->from;
  }
  PetscCall(MeshFetchNodes(f->mesh, 3, x, has_ghosts(f) ? o->from : (PetscReal *)x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *all = zeros [nnode_all][bs], which end_sum brings together in y [nnode][bs] */
static PetscErrorCode begin_sum(Flow f, PetscInt bs, PetscReal y[], PetscReal **all)
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  *all = has_ghosts(f) ? o->to : y;
  PetscCallDevice(q, (*q->run->zero)(q, (size_t)(f->loc->nnode_all * bs) * sizeof(double), *all));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Collective. */
static PetscErrorCode end_sum(Flow f, PetscInt bs, PetscReal all[], PetscReal y[])
{
  PetscFunctionBeginUser;
  PetscCall(MeshSumNodes(f->mesh, bs, all));
  if (all != y) PetscCall(copy(f->device, (size_t)(f->loc->nnode * bs), all, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

/* Have all terms in cells been described? */
static PetscBool knows_terms(const struct _p_Flow *f)
{
  PetscInt i = 0;

  while (i < f->owners.nterms && f->owners.terms[i].moments.without) i++;
  return (PetscBool)(i == f->owners.nterms);
}

static PetscErrorCode refuse(Flow f, const char device[])
{
  PetscFunctionBeginUser;
  PetscCheck(f->loc->dim == 3, f->comm, PETSC_ERR_SUP,
             "Option -device %s: a device carries scenes in space, and this one is plane: remove it", device);
  PetscCheck(f->matrix.free, f->comm, PETSC_ERR_SUP,
             "Option -device %s: a device carries velocity operators without a matrix: leave -flow_velocity_operator at auto and -flow_rheology at newton, or remove it",
             device);
  PetscCheck(!f->material, f->comm, PETSC_ERR_SUP,
             "Option -device %s: a device carries -flow_rheology newton alone: remove one of them", device);
  PetscCheck(f->loc->nnode_all < DEVICE_MAX_NODES, f->comm, PETSC_ERR_SUP,
             "Option -device %s: a device carries less than %d nodes, not %" PetscInt_FMT ": take fewer cells", device,
             DEVICE_MAX_NODES, f->loc->nnode_all);
  PetscCheck(sizeof(PetscReal) == sizeof(double), f->comm, PETSC_ERR_SUP,
             "Option -device %s: this PETSc has numbers of another precision than double", device);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Components that boundary conditions fix, into the cells */
static PetscErrorCode set_fixed(Flow f, OnDevice o)
{
  const unsigned char *fixed;
  unsigned char       *there;

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(f->boundary, &fixed, NULL));
  PetscCall(DeviceTake(&o->queue, f->loc->nnode_all, fixed, &there));
  PetscCallDevice(&o->queue, (*o->queue.run->set_fixed)(&o->queue, &o->cells, there, (int *)o->cells.node));
  PetscCall(DeviceFree(&o->queue, &there));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode number_hangs(Flow f, OnDevice o)
{
  PetscFunctionBeginUser;
  if (!f->loc->hang) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(MESH_HANG_CODES, &o->hang));
  (void)FlowNumberHangs(f->loc, o->hang);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What goes by the cells */
static PetscErrorCode create_on_mesh(Flow f, OnDevice o)
{
  PetscFunctionBeginUser;
  PetscCall(FlowCreateDeviceCells(f, &o->queue, f->loc->ncell, NULL, &o->cells));
  PetscCall(set_fixed(f, o));
  PetscCall(number_hangs(f, o));
  PetscCall(DeviceTake(&o->queue, f->loc->nnode_all * 3, NULL, &o->w));
  if (has_ghosts(f)) {
    PetscCall(DeviceTake(&o->queue, f->loc->nnode_all * 3, NULL, &o->from));
    PetscCall(DeviceTake(&o->queue, f->loc->nnode_all * 3, NULL, &o->to));
  }
  PetscCall(DeviceFieldsCreate(f, o));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_on_mesh(OnDevice o)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsDestroy(o));
  PetscCall(FlowDestroyDeviceDivergence(&o->queue, &o->divergence));
  PetscCallDevice(&o->queue, DeviceCellsDestroy(&o->queue, &o->cells));
  PetscCall(DeviceMomentsDestroy(o));
  PetscCall(DeviceFetchDestroy(o));
  PetscCall(DeviceFree(&o->queue, &o->place));
  PetscCall(PetscFree(o->place_here));
  PetscCall(PetscFree(o->hang));
  PetscCall(DeviceFree(&o->queue, &o->w));
  PetscCall(DeviceFree(&o->queue, &o->from));
  PetscCall(DeviceFree(&o->queue, &o->to));
  PetscCall(DeviceFree(&o->queue, &o->coefficient));
  o->capacity = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceCreate(Flow f, OnDevice *device)
{
  PetscInt kind = NONE;
  OnDevice o;

  PetscFunctionBeginUser;
  PetscCall(OptChoice("-device", DEVICES, &kind));
  if (kind == NONE) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(refuse(f, DEVICES[kind]));
  PetscCall(PetscNew(&o));
  o->queue.run = DeviceGetKernels(kind == CUDA ? "cuda" : "cpu");
  PetscCheck(o->queue.run, f->comm, PETSC_ERR_SUP,
             "Option -device cuda: this program was built with a PETSc without CUDA: build both with it (tools/petsc-current --cuda), or remove the option");
#if defined(PETSC_HAVE_CUDA)
  if (kind == CUDA) PetscCall(PetscDeviceInitialize(PETSC_DEVICE_CUDA));
#endif
  o->queue.traffic = &o->traffic;
  PetscCall(DeviceTableCreate(o));
  PetscCall(create_on_mesh(f, o));
  *device = o;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceRemesh(Flow f)
{
  PetscFunctionBeginUser;
  PetscCall(destroy_on_mesh(f->device));
  PetscCall(refuse(f, f->device->queue.run->name));
  PetscCall(create_on_mesh(f, f->device));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceDestroy(OnDevice *device)
{
  PetscFunctionBeginUser;
  if (!*device) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DeviceTableDestroy(*device));
  PetscCall(destroy_on_mesh(*device));
  PetscCall(PetscFree(*device));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the velocity operator ---- */

PetscErrorCode DeviceSetCoefficients(OnDevice o, const DeviceCells *cells, const double w[], double **coefficient,
                                     size_t *capacity)
{
  const DeviceQueue *q    = &o->queue;
  const size_t       need = DeviceCoefficients(cells, &o->form);

  PetscFunctionBeginUser;
  if (need > *capacity) {
    PetscCall(DeviceFree(q, coefficient));
    PetscCall(DeviceTake(q, need, NULL, coefficient));
    *capacity = need;
  }
  PetscCallDevice(q, (*q->run->set_coefficients)(q, cells, &o->form, w, NULL, *coefficient));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceUpdate(Flow f)
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;
  const PetscReal   *nu;

  PetscFunctionBeginUser;
  PetscCheck(f->step.dt > 0, f->comm, PETSC_ERR_SUP,
             "Option -device: a device carries steps in time: remove it, or -sim_steady");
  PetscCheck(!f->mesh_velocity, f->comm, PETSC_ERR_SUP,
             "Option -device: a device carries meshes that stand still: remove it, or what moves the mesh");
  PetscCheck(f->owners.noperators + f->owners.nvolumes == 0 && knows_terms(f) && !f->properties.density, f->comm,
             PETSC_ERR_SUP,
             "Option -device: a device carries no terms of other parts in cells (elastic particles, scalars, resistance): remove it, or those");
  if (!o->divergence.kind) PetscCall(FlowCreateDeviceDivergence(f, q, &o->cells, NULL, &o->divergence));
  FlowGetDeviceForm(f, &o->form, &nu);
  if (f->par.convection && !o->field.w_there)
    PetscCallDevice(q, (*q->run->upload)(q, (size_t)f->loc->nnode_all * 3 * sizeof(double), f->w, o->w));
  PetscCall(DeviceSetCoefficients(o, &o->cells, o->w, &o->coefficient, &o->capacity));
  PetscCall(DeviceMomentsUpdate(f, o));
  PetscFunctionReturn(PETSC_SUCCESS);
}

const DeviceQueue *FlowGetQueue(Flow f)
{
  return f->device ? &f->device->queue : NULL;
}

PetscErrorCode FlowMultiplyOnDevice(Flow f, PetscBool masked, const PetscReal x[], PetscReal y[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;
  const PetscReal   *from;
  PetscReal         *to;

  PetscFunctionBeginUser;
  PetscCall(fetch_nodes(f, x, &from));
  PetscCall(begin_sum(f, 3, y, &to));
  PetscCallDevice(q, (*q->run->multiply)(q, &o->cells, &o->form, o->coefficient, masked, from, to));
  if (o->moments.on.ngroup) PetscCallDevice(q, (*q->run->body.multiply_moments)(q, &o->moments.on, from, to));
  PetscCall(end_sum(f, 3, to, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = S x, from and to the host */
PetscErrorCode OnDeviceMultiply(Flow f, const PetscReal x[], PetscReal y[])
{
  const DeviceQueue *q     = &f->device->queue;
  const size_t       bytes = DeviceNodal(f) * sizeof(double);
  double            *from, *to;

  PetscFunctionBeginUser;
  PetscCall(DeviceTake(q, DeviceNodal(f), x, &from));
  PetscCall(DeviceTake(q, DeviceNodal(f), NULL, &to));
  PetscCall(FlowMultiplyOnDevice(f, PETSC_FALSE, from, to));
  PetscCallDevice(q, (*q->run->download)(q, bytes, to, y));
  PetscCall(DeviceFree(q, &from));
  PetscCall(DeviceFree(q, &to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* work [nnode] = diagonal of S */
static PetscErrorCode take_diagonal(Flow f)
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;
  PetscReal         *to;

  PetscFunctionBeginUser;
  PetscCall(begin_sum(f, 1, o->field.work, &to));
  PetscCallDevice(q, (*q->run->add_diagonal)(q, &o->cells, &o->form, o->coefficient, to));
  if (o->moments.on.ngroup) PetscCallDevice(q, (*q->run->body.add_moments_diagonal)(q, &o->moments.on, to));
  PetscCall(end_sum(f, 1, to, o->field.work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceGetDiagonal(Flow f, PetscReal d[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCall(take_diagonal(f));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)f->loc->nnode * sizeof(double), o->field.work, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowInvertDiagonalOnDevice(Flow f, PetscReal min, PetscReal inverse[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCall(take_diagonal(f));
  PetscCallDevice(q, (*q->run->invert_diagonal)(q, (int)f->loc->nnode, min, o->field.lumped, o->field.work, inverse));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- B ---- */

PetscErrorCode FlowDivergenceOnDevice(Flow f, PetscReal factor, const PetscReal u[], PetscReal y[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCall(fetch_nodes(f, u, &u));
  PetscCallDevice(q, (*q->run->divergence)(q, &o->cells, &o->divergence, factor, u, 0, NULL, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGradientOnDevice(Flow f, PetscReal factor, const PetscReal p[], PetscReal y[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;
  PetscReal         *to;

  PetscFunctionBeginUser;
  PetscCall(begin_sum(f, 3, y, &to));
  PetscCallDevice(q, (*q->run->add_gradient)(q, &o->cells, &o->divergence, 1, factor, NULL, p, to));
  PetscCall(end_sum(f, 3, to, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowPressureMassOnDevice(Flow f, PetscReal factor, const PetscReal r[], PetscReal y[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->add_pressure_mass)(q, &o->cells, &o->divergence, factor, r, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceFindGroups(OnDevice o)
{
  const DeviceQueue *q = &o->queue;
  const PetscInt     n = o->cells.ngroup * DEVICE_GROUP;
  int               *cell;

  PetscFunctionBeginUser;
  if (o->place) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(n, &cell));
  PetscCall(PetscMalloc1(o->cells.ncell, &o->place_here));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)n * sizeof(*cell), o->cells.cell, cell));
  for (PetscInt e = 0; e < n; e++)
    if (cell[e] >= 0) o->place_here[cell[e]] = (int)e;
  PetscCall(DeviceTake(q, o->cells.ncell, o->place_here, &o->place));
  PetscCall(PetscFree(cell));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowMakeRowsOnDevice(Flow f, const PetscReal weight[], PetscInt n, const int row[], const int at[],
                                    const DeviceRows *rows)
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCall(OnDeviceFindGroups(o));
  PetscCallDevice(q, (*q->run->body.make_rows)(q, &o->cells, &o->divergence, o->place, weight, (int)n, row, at, rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool FlowHasBoxesAlone(Flow f)
{
  const DeviceCells *c = &f->device->cells;
  PetscInt           e = 0;

  while (e < f->loc->ncell && !FlowIsInactive(f, e)) e++;
  return (PetscBool)(c->nbox == c->ngroup && e == f->loc->ncell);
}

PetscErrorCode FlowAddBoxesOnDevice(Flow f, const DeviceTransfer *t, PetscInt n, const int cell[], const double k[],
                                    const DeviceSparse *A)
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCall(OnDeviceFindGroups(o));
  PetscCallDevice(q, (*q->run->vertices.add_boxes)(q, &o->cells, o->place, t, (int)n, cell, k, A));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the lumped mass ---- */

PetscErrorCode FlowScaleByMassOnDevice(Flow f, const PetscReal x[], PetscReal y[])
{
  const OnDevice     o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->balance.scale_nodes)(q, (int)f->loc->nnode, o->field.lumped, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowInvertMassOnDevice(Flow f, PetscReal y[])
{
  const OnDevice     o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->invert_diagonal)(q, (int)f->loc->nnode, 0, o->field.lumped, o->field.lumped, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}
