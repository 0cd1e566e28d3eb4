/* OnDevice: the fields of a step, which stay in the memory of the device from step to step; the host has them when
   somebody asks (FlowGetFields, FlowTakeSolution). */
#include "compat.h"
#include "ondeviceimpl.h"

#define BYTES(n) ((n) * sizeof(double))

static PetscErrorCode send(OnDevice o, size_t n, const PetscReal from[], double to[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(&o->queue, (*o->queue.run->upload)(&o->queue, BYTES(n), from, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode bring(OnDevice o, size_t n, const double from[], PetscReal to[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(&o->queue, (*o->queue.run->download)(&o->queue, BYTES(n), from, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode combine(OnDevice o, size_t n, PetscInt nv, const double *const v[], const double factor[],
                              const double constant[3], double out[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(&o->queue, (*o->queue.run->combine)(&o->queue, n, (int)nv, v, factor, constant, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

/* Sizes of cells, in the forms that sums want */
static PetscErrorCode take_sizes(Flow f, OnDevice o)
{
  const PetscInt n = f->loc->ncell;
  PetscReal     *size, *inverse, *volume;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc3(n, &size, n, &inverse, n * 4, &volume));
  for (PetscInt c = 0; c < n; c++) {
    size[c]       = PetscSqr(f->cells.size[c]);
    inverse[c]    = 1 / size[c];
    volume[4 * c] = 1 / PetscPowRealInt(f->cells.size[c], 3);
  }
  PetscCall(DeviceTake(&o->queue, n, size, &o->field.size));
  PetscCall(DeviceTake(&o->queue, n, inverse, &o->field.inverse));
  PetscCall(DeviceTake(&o->queue, n * 4, volume, &o->field.inverse_volume));
  PetscCall(PetscFree3(size, inverse, volume));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceFieldsCreate(Flow f, OnDevice o)
{
  DeviceFields          *d         = &o->field;
  double **const         nodal[]   = {&d->u, &d->u_old, &d->u_new, &d->rhs, &d->work},
                 **const by_cell[] = {&d->p, &d->p_old, &d->p_new, &d->dp, &d->cell};
  PetscMPIInt            size;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(f->comm, &size));
  d->allowed = (PetscBool)(f->par.rate_axes == 0 && size == 1 && !o->left);
  d->here = d->w_here = PETSC_TRUE;
  d->nodal            = DeviceNodal(f);
  d->pressures        = DevicePressures(f);
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(nodal); i++)
    PetscCall(DeviceTake(&o->queue, DeviceNodal(f), NULL, nodal[i]));
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(by_cell); i++)
    PetscCall(DeviceTake(&o->queue, DevicePressures(f), NULL, by_cell[i]));
  PetscCall(DeviceTake(&o->queue, DEVICE_PARTIAL, NULL, &d->partial));
  PetscCall(DeviceTake(&o->queue, 4, NULL, &d->out));
  PetscCall(DeviceTake(&o->queue, f->loc->nnode, f->cells.lumped, &d->lumped));
  d->volume = 0;
  for (PetscInt i = 0; i < f->loc->nnode; i++) d->volume += f->cells.lumped[i];
  PetscCall(take_sizes(f, o));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceFieldsDestroy(OnDevice o)
{
  DeviceFields  *d     = &o->field;
  double **const all[] = {&d->u,   &d->u_old,  &d->p,      &d->p_old,   &d->u_new,          &d->p_new,
                          &d->dp,  &d->rhs,    &d->source, &d->work,    &d->cell,           &d->partial,
                          &d->out, &d->lumped, &d->size,   &d->inverse, &d->inverse_volume, &d->centre};

  PetscFunctionBeginUser;
  for (size_t i = 0; i < PETSC_STATIC_ARRAY_LENGTH(all); i++) PetscCall(DeviceFree(&o->queue, all[i]));
  *d = (DeviceFields){0};
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- there and back ---- */

PetscErrorCode DeviceFieldsSend(Flow f, OnDevice o)
{
  DeviceFields *d = &o->field;

  PetscFunctionBeginUser;
  if (d->there) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(send(o, DeviceNodal(f), f->u, d->u));
  PetscCall(send(o, DeviceNodal(f), f->u_old, d->u_old));
  PetscCall(send(o, DevicePressures(f), f->p, d->p));
  PetscCall(send(o, DevicePressures(f), f->p_old, d->p_old));
  d->there = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceBring(Flow f, PetscBool changed)
{
  OnDevice      o = f->device;
  DeviceFields *d = &o->field;

  PetscFunctionBeginUser;
  if (!d->here) {
    PetscCall(bring(o, d->nodal, d->u, f->u));
    PetscCall(bring(o, d->nodal, d->u_old, f->u_old));
    PetscCall(bring(o, d->pressures, d->p, f->p));
    PetscCall(bring(o, d->pressures, d->p_old, f->p_old));
    d->here = PETSC_TRUE;
  }
  if (!d->w_here) PetscCall(bring(o, d->nodal, o->w, f->w));
  d->w_here = PETSC_TRUE;
  if (changed) d->there = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceTakeLast(Flow f, PetscReal u[], PetscReal p[])
{
  DeviceFields *d = &f->device->field;

  PetscFunctionBeginUser;
  PetscCall(bring(f->device, DeviceNodal(f), d->u_new, u));
  PetscCall(bring(f->device, DevicePressures(f), d->p_new, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceForgetConvection(Flow f)
{
  PetscFunctionBeginUser;
  f->device->field.w_here  = PETSC_TRUE;
  f->device->field.w_there = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- a step ---- */

PetscErrorCode OnDeviceBeginStep(Flow f)
{
  DeviceFields *d = &f->device->field;

  PetscFunctionBeginUser;
  d->stays = (PetscBool)(d->allowed && !f->u_older && f->step.dt > 0);
  if (!d->stays) PetscCall(OnDeviceBring(f, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceConvect(Flow f)
{
  OnDevice      o = f->device;
  DeviceFields *d = &o->field;
  const double  e = f->time.extrapolation, frame[3] = {-f->step.frame[0], -f->step.frame[1], -f->step.frame[2]};

  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsSend(f, o));
  PetscCall(combine(o, DeviceNodal(f), 2, (const double *[]){d->u, d->u_old}, (double[]){1 + e, -e}, frame, o->w));
  d->w_here  = PETSC_FALSE;
  d->w_there = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceExtrapolate(Flow f)
{
  OnDevice      o = f->device;
  DeviceFields *d = &o->field;
  const double  r = f->time.nsteps > 1 ? f->step.dt / f->time.dt_old : 0, last = f->time.nsteps > 1;

  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsSend(f, o));
  PetscCall(combine(o, DeviceNodal(f), 2, (const double *[]){d->u, d->u_old}, (double[]){1 + r, -r}, NULL, d->u_new));
  PetscCall(combine(o, DevicePressures(f), 1, (const double *[]){d->p}, (double[]){1}, NULL, d->p_new));
  PetscCall(
    combine(o, DevicePressures(f), 2, (const double *[]){d->p, d->p_old}, (double[]){last, -last}, NULL, d->dp));
  d->u_new_here = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The body force that varies, where there is one */
static PetscErrorCode send_source(Flow f, OnDevice o)
{
  PetscFunctionBeginUser;
  if (!f->force.source) PetscCall(DeviceFree(&o->queue, &o->field.source));
  if (!f->force.source) PetscFunctionReturn(PETSC_SUCCESS);
  if (!o->field.source) PetscCall(DeviceTake(&o->queue, DeviceNodal(f), NULL, &o->field.source));
  PetscCall(send(o, DeviceNodal(f), f->force.source, o->field.source));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceAddPast(Flow f, const DeviceTerms *t, const double u[], const double u_old[],
                             const double source[], double work[], double rhs[])
{
  const DeviceQueue *q   = &f->device->queue;
  const FlowStep    *s   = &f->step;
  const PetscReal    rho = f->par.density, before = (1 - s->theta) / s->theta;
  const double      *v[] = {u, u_old, source}, factor[] = {s->d0, s->d1, 1 / rho},
               force[3] = {f->par.force[0] / rho, f->par.force[1] / rho, f->par.force[2] / rho};

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->zero)(q, BYTES(t->n), rhs));
  PetscCallDevice(q, (*q->run->add_mass)(q, t->cells, t->form, t->coefficient, 1 / s->ct, source ? 3 : 2, v, factor,
                                         force, rhs));
  if (s->theta == 1) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallDevice(q, (*q->run->add_mass)(q, t->cells, t->form, t->coefficient, before, 1, v, (double[]){1}, NULL, rhs));
  PetscCallDevice(q, (*q->run->zero)(q, BYTES(t->n), work));
  PetscCallDevice(q, (*q->run->multiply)(q, t->cells, t->form, t->coefficient, 0, u, work));
  PetscCallDevice(q, (*q->run->combine)(q, t->n, 2, (const double *[]){rhs, work}, (double[]){1, -before}, NULL, rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceRhs(Flow f)
{
  OnDevice      o = f->device;
  DeviceFields *d = &o->field;

  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsSend(f, o));
  PetscCall(send_source(f, o));
  PetscCall(DeviceAddPast(f, &(DeviceTerms){&o->cells, &o->form, o->coefficient, DeviceNodal(f)}, d->u, d->u_old,
                          d->source, d->work, d->rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceAddRhs(Flow f, const PetscReal r[])
{
  OnDevice      o = f->device;
  DeviceFields *d = &o->field;

  PetscFunctionBeginUser;
  PetscCall(send(o, DeviceNodal(f), r, d->work));
  PetscCall(combine(o, DeviceNodal(f), 2, (const double *[]){d->rhs, d->work}, (double[]){1, 1}, NULL, d->rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscBool OnDeviceHelps(Flow f)
{
  PetscMPIInt size = 1;

  if (!f->device || f->device->field.stays || f->step.dt <= 0) return PETSC_FALSE;
  return (PetscBool)(MPI_Comm_size(f->comm, &size) == MPI_SUCCESS && size == 1);
}

PetscErrorCode OnDeviceTakeRhs(Flow f, PetscReal r[])
{
  PetscFunctionBeginUser;
  PetscCall(OnDeviceRhs(f));
  PetscCall(bring(f->device, DeviceNodal(f), f->device->field.rhs, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceSendSolution(Flow f, const PetscReal u[])
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsSend(f, f->device));
  PetscCall(send(f->device, DeviceNodal(f), u, f->device->field.u_new));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceAccept(Flow f)
{
  OnDevice      o = f->device;
  DeviceFields *d = &o->field;
  double       *u = d->u_old, *p = d->p_old;

  PetscFunctionBeginUser;
  d->u_old = d->u;
  d->u     = d->u_new;
  d->u_new = u;
  d->p_old = d->p;
  d->p     = d->p_new;
  d->p_new = p;
  d->here  = PETSC_FALSE;
  d->there = PETSC_TRUE;
  PetscCall(OnDeviceReport(f));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceReport(Flow f)
{
  OnDevice o = f->device;

  PetscFunctionBeginUser;
  PetscCall(PetscInfo(NULL, "device: %.0f bytes there, %.0f back in this step; at most %.0f held beside vectors\n",
                      o->traffic.up - o->before.up, o->traffic.down - o->before.down, o->traffic.most));
  o->before = o->traffic;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- for others ---- */

PetscBool FlowStaysOnDevice(Flow f)
{
  return (PetscBool)(f->device && f->device->field.stays);
}

PetscErrorCode FlowLeaveDevice(Flow f)
{
  PetscFunctionBeginUser;
  f->device->left          = PETSC_TRUE;
  f->device->field.allowed = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowTakeSolution(Flow f, PetscReal u[], PetscReal p[])
{
  PetscFunctionBeginUser;
  if (!FlowStaysOnDevice(f) || f->device->field.u_new_here) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(OnDeviceTakeLast(f, u, p));
  f->device->field.u_new_here = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetStepOnDevice(Flow f, FlowDeviceStep *s)
{
  DeviceFields *d = &f->device->field;

  PetscFunctionBeginUser;
  *s            = (FlowDeviceStep){.rhs = d->rhs, .before = d->u, .u = d->u_new, .p = d->p_new, .dp = d->dp};
  d->u_new_here = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddRhsOnDevice(Flow f, PetscReal factor, const PetscReal v[])
{
  double *rhs = f->device->field.rhs;

  PetscFunctionBeginUser;
  PetscCall(combine(f->device, DeviceNodal(f), 2, (const double *[]){rhs, v}, (double[]){1, factor}, NULL, rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}
