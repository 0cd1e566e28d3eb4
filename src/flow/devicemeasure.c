/* OnDevice: what the solution of a step amounts to, made where its fields are; numbers alone go to the host. */
#include "compat.h"
#include "ondeviceimpl.h"

static PetscErrorCode bring(OnDevice o, PetscInt n, PetscReal to[])
{
  PetscFunctionBeginUser;
  PetscCallDevice(&o->queue, (*o->queue.run->download)(&o->queue, (size_t)n * sizeof(double), o->field.out, to));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_dot(OnDevice o, size_t n, const double a[], const double b[], PetscReal *sum)
{
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->dot)(q, n, a, b, NULL, NULL, o->field.partial, o->field.out));
  PetscCall(bring(o, 1, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sums over nodes of weight times sum of factor v */
static PetscErrorCode take_sums(Flow f, const double weight[], PetscInt n, const double *const v[],
                                const double factor[], PetscReal sum[3])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->balance.sum_components)(q, (int)f->loc->nnode, weight, (int)n, v, factor,
                                                       o->field.partial, o->field.out));
  PetscCall(bring(o, 3, sum));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_largest(OnDevice o, size_t n, const double v[], const double weight[], const double shift[3],
                                   PetscReal *largest)
{
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->largest)(q, n, v, weight, shift, o->field.partial, o->field.out));
  PetscCall(bring(o, 1, largest));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- sums over the domain ---- */

/* work = scale M u with the density of the parameters, times c_t */
static PetscErrorCode apply_mass(Flow f, PetscReal scale, const double u[])
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->zero)(q, DeviceNodal(f) * sizeof(double), o->field.work));
  PetscCallDevice(q, (*q->run->add_mass)(q, &o->cells, &o->form, o->coefficient, scale, 1, &u, (double[]){1}, NULL,
                                         o->field.work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* int |u|^2; the flux int w.grad v of v = theta u + (1 - theta) u^n: rows of the operator summed are what is no
   divergence of anything, mass and convection. The mass of their difference is small beside them, and goes first. */
static PetscErrorCode measure_motion(Flow f, FlowAmounts *out)
{
  OnDevice           o     = f->device;
  const DeviceQueue *q     = &o->queue;
  DeviceFields      *d     = &o->field;
  const PetscReal    theta = f->step.theta, rho = f->par.density;
  const double      *v[] = {d->u_new, d->u}, factor[] = {theta, 1 - theta};

  PetscFunctionBeginUser;
  PetscCall(apply_mass(f, 1 / (rho * f->step.ct), d->u_new));
  PetscCall(take_dot(o, DeviceNodal(f), d->work, d->u_new, &out->square));
  for (PetscInt a = 0; a < 3; a++) out->flux[a] = 0;
  if (!f->par.convection) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt k = 0; k < (theta < 1 ? 2 : 1); k++) {
    PetscReal sum[3];

    PetscCallDevice(q, (*q->run->zero)(q, DeviceNodal(f) * sizeof(double), d->work));
    PetscCallDevice(q, (*q->run->multiply)(q, &o->cells, &o->form, o->coefficient, 0, v[k], d->work));
    PetscCallDevice(q, (*q->run->add_mass)(q, &o->cells, &o->form, o->coefficient, -1, 1, &v[k], (double[]){1}, NULL,
                                           d->work));
    PetscCall(take_sums(f, NULL, 1, (const double *[]){d->work}, (double[]){factor[k] / (rho * theta)}, sum));
    for (PetscInt a = 0; a < 3; a++) out->flux[a] += sum[a];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_nodes(Flow f, FlowAmounts *out)
{
  const DeviceFields *d   = &f->device->field;
  const FlowStep     *s   = &f->step;
  const double       *v[] = {d->u_new, d->u, d->u_old}, factor[] = {s->ct, -s->d0, -s->d1};

  PetscFunctionBeginUser;
  PetscCall(take_sums(f, d->lumped, 3, v, factor, out->change));
  PetscCall(take_sums(f, d->lumped, 1, v, (double[]){1}, out->velocity));
  for (PetscInt a = 0; a < 3; a++) out->driven[a] = 0;
  if (d->source) PetscCall(take_sums(f, d->lumped, 1, (const double *[]){d->source}, (double[]){1}, out->driven));
  for (PetscInt a = 0; a < 3; a++) out->driven[a] += f->par.force[a] * d->volume;
  out->volume = d->volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure_cells(Flow f, FlowAmounts *out)
{
  OnDevice           o        = f->device;
  const DeviceQueue *q        = &o->queue;
  DeviceFields      *d        = &o->field;
  const size_t       n        = (size_t)f->loc->ncell;
  double            *weighted = d->work; /* nodes are more than pressures of the cells */

  PetscFunctionBeginUser;
  PetscCall(FlowDivergenceOnDevice(f, 1, d->u_new, d->cell));
  PetscCallDevice(q, (*q->run->scale)(q, 4 * n, d->inverse_volume, d->cell, weighted));
  PetscCall(take_dot(o, 4 * n, weighted, d->cell, &out->divergence));
  PetscCallDevice(q, (*q->run->speeds)(q, &o->cells, f->step.frame, d->u_new, d->cell));
  PetscCall(take_largest(o, n, d->cell, NULL, NULL, &out->speed));
  PetscCall(take_largest(o, n, d->cell + n, d->inverse, NULL, &out->cfl));
  PetscCall(take_largest(o, n, d->cell + n, d->size, NULL, &out->speed_size));
  out->cfl        = PetscSqrtReal(out->cfl) * f->step.dt;
  out->speed_size = PetscSqrtReal(out->speed_size);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceMeasure(Flow f, FlowAmounts *out)
{
  PetscFunctionBeginUser;
  PetscCall(measure_motion(f, out));
  PetscCall(measure_nodes(f, out));
  PetscCall(measure_cells(f, out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode OnDeviceGradientNorm(Flow f, PetscReal *square)
{
  OnDevice           o = f->device;
  const DeviceQueue *q = &o->queue;
  DeviceFields      *d = &o->field;

  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsSend(f, o));
  PetscCallDevice(q, (*q->run->zero)(q, DevicePressures(f) * sizeof(double), d->cell));
  PetscCallDevice(q, (*q->run->gradients)(q, &o->cells, &o->divergence, d->u, d->cell));
  PetscCall(take_dot(o, DevicePressures(f), d->cell, d->inverse_volume, square));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowGetSpeedOnDevice(Flow f, const PetscReal frame[3], PetscReal *speed)
{
  OnDevice o = f->device;

  PetscFunctionBeginUser;
  PetscCall(DeviceFieldsSend(f, o));
  PetscCall(take_largest(o, DeviceNodal(f), o->field.u, NULL, frame, speed));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSumProductsOnDevice(Flow f, const PetscReal a[], const PetscReal b[], PetscReal sum[6])
{
  const DeviceQueue *q    = &f->device->queue;
  double            *work = f->device->field.work;

  PetscFunctionBeginUser;
  if (a) PetscCallDevice(q, (*q->run->scale)(q, DeviceNodal(f), a, b, work));
  PetscCall(take_sums(f, NULL, 1, (const double *[]){a ? work : b}, (double[]){1}, sum));
  PetscCallDevice(q, (*q->run->balance.take_sizes)(q, DeviceNodal(f), a ? work : b, work));
  PetscCall(take_sums(f, NULL, 1, (const double *[]){work}, (double[]){1}, sum + 3));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where cells are; made when it is asked for */
static PetscErrorCode take_centres(Flow f)
{
  const MeshLocal *l = f->loc;
  PetscReal       *centre;

  PetscFunctionBeginUser;
  if (f->device->field.centre) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(l->ncell * 4, &centre));
  for (PetscInt c = 0; c < l->ncell; c++) {
    for (PetscInt a = 0; a < 3; a++) centre[4 * c + a] = l->x[l->cell_node[c * 27 + 13] * 3 + a] - l->lower[a];
    centre[4 * c + 3] = f->cells.size[c];
  }
  PetscCall(DeviceTake(&f->device->queue, l->ncell * 4, centre, &f->device->field.centre));
  PetscCall(PetscFree(centre));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowAddLinearOnDevice(Flow f, const PetscReal factor[], PetscReal q[])
{
  const DeviceQueue *queue = &f->device->queue;

  PetscFunctionBeginUser;
  PetscCall(take_centres(f));
  PetscCallDevice(queue,
                  (*queue->run->balance.add_linear)(queue, (int)f->loc->ncell, f->device->field.centre, factor, q));
  PetscFunctionReturn(PETSC_SUCCESS);
}
