/* FlowSolver where the fields of a step stay on a device (FlowStaysOnDevice): right-hand side, start value and solution
   go from and to arrays there. Without bodies, whose rows are all that the host would have to say. */
#include "compat.h"
#include "impl.h"

PetscBool FlowSolverStaysOnDevice(FlowSolver fs)
{
  return FlowStaysOnDevice(fs->flow);
}

/* Velocities that are known, as boundary conditions of the step have them */
static PetscErrorCode send_values(FlowSolver fs, PetscReal *speed)
{
  const ConstraintView *P       = ConstraintGetView(fs->constraint);
  const DeviceQueue    *q       = FlowGetQueue(fs->flow);
  const PetscInt        dim     = fs->loc->dim;
  PetscBool             changed = PETSC_FALSE;

  PetscFunctionBeginUser;
  *speed = 0;
  for (PetscInt j = 0; j < P->inert.n; j++) {
    const PetscReal v = ConstraintGetPrescribed(fs->constraint, P->inert.slot[j] / dim, P->inert.slot[j] % dim);

    changed                  = (PetscBool)(changed || v != fs->device.value_here[j]);
    fs->device.value_here[j] = v;
    *speed                   = PetscMax(*speed, PetscAbsReal(v));
  }
  if (!changed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallDevice(q,
                  (*q->run->upload)(q, (size_t)P->inert.n * sizeof(double), fs->device.value_here, fs->device.value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* a [nodal] at inert slots = what is known, or zero */
static PetscErrorCode set_inert(FlowSolver fs, PetscBool known, PetscReal a[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const double      *v = known ? fs->device.value : fs->device.nothing;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->set_slots)(q, fs->device.ninert, fs->device.inert, v, a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverRemoveConstantOnDevice(FlowSolver fs, Vec x)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  PetscReal         *a, sum;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGet(q, x, &a));
  PetscCall(DeviceVecPlace(q, fs->device.part, a + fs->nur));
  PetscCall(VecDot(fs->device.part, fs->device.constant, &sum));
  PetscCall(VecAXPY(fs->device.part, -sum / (PetscReal)fs->loc->ncell_global, fs->device.constant));
  PetscCall(DeviceVecReset(q, fs->device.part));
  PetscCall(VecRestoreArrayAndMemType(x, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The flux of known velocities, in the pressure's rows b */
static PetscErrorCode measure_flux(FlowSolver fs, const PetscReal b[], PetscReal *flux)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCall(DeviceVecPlace(q, fs->device.part, b));
  PetscCall(VecDot(fs->device.part, fs->device.constant, flux));
  PetscCall(DeviceVecReset(q, fs->device.part));
  *flux /= fs->step.scale * fs->step.continuity_scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverBuildRhsOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const size_t       n = (size_t)fs->nodal;
  PetscReal         *b, *c, flux, speed;
  MatNullSpace       constant;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(send_values(fs, &speed));
  PetscCall(DeviceVecGetWrite(q, fs->vec.b, &b));
  PetscCall(DeviceVecGetWrite(q, fs->device.free, &c));
  PetscCallDevice(q, (*q->run->zero)(q, n * sizeof(double), c));
  PetscCall(set_inert(fs, PETSC_TRUE, c));
  PetscCall(FlowMultiplyOnDevice(fs->flow, PETSC_FALSE, c, b));
  PetscCallDevice(q, (*q->run->combine)(q, n, 2, (const double *[]){s.rhs, b}, (double[]){1, -1}, NULL, b));
  PetscCall(set_inert(fs, PETSC_FALSE, b));
  PetscCall(FlowDivergenceOnDevice(fs->flow, -fs->step.scale * fs->step.continuity_scale, c, b + fs->nur));
  PetscCall(MatGetNullSpace(fs->op.K, &constant));
  if (constant) {
    PetscCall(measure_flux(fs, b + fs->nur, &flux));
    PetscCall(FlowSolverCheckFlux(fs, flux, speed));
  }
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.free, &c));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->vec.b, &b));
  if (constant) PetscCall(MatNullSpaceRemove(constant, fs->vec.b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverPackOnDevice(FlowSolver fs)
{
  const DeviceQueue *q     = FlowGetQueue(fs->flow);
  const double       one[] = {1};
  PetscReal         *x;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(DeviceVecGetWrite(q, fs->vec.x, &x));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 1, (const double *[]){s.u}, one, NULL, x));
  PetscCall(set_inert(fs, PETSC_FALSE, x));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->np, 1, (const double *[]){s.p}, one, NULL, x + fs->nur));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->vec.x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverUnpackOnDevice(FlowSolver fs)
{
  const DeviceQueue *q     = FlowGetQueue(fs->flow);
  const double       one[] = {1};
  const PetscReal   *x;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(DeviceVecGetRead(q, fs->vec.x, &x));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 1, (const double *[]){x}, one, NULL, s.u));
  PetscCall(set_inert(fs, PETSC_TRUE, s.u));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->np, 1, (const double *[]){x + fs->nur}, one, NULL, s.p));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As FlowSolverShiftPressure, without bodies: t_u = G dp, by which the residual's velocity rows shrink */
PetscErrorCode FlowSolverShiftOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  PetscReal         *x, *r, sum[2], step;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(DeviceVecPlace(q, fs->device.part, s.dp));
  PetscCall(MatMult(fs->op.G, fs->device.part, fs->vec.t_u));
  PetscCall(DeviceVecGet(q, fs->vec.x, &x));
  PetscCall(DeviceVecGet(q, fs->vec.r, &r));
  PetscCall(FlowSolverPlaceFields(fs, r, x));
  PetscCall(VecDot(fs->vec.t_u, fs->vec.from[0], &sum[0]));
  PetscCall(VecDot(fs->vec.t_u, fs->vec.t_u, &sum[1]));
  step = sum[1] > 0 ? PetscMin(1, PetscMax(0, sum[0] / sum[1])) : 0;
  PetscCall(VecAXPY(fs->vec.from[0], -step, fs->vec.t_u));
  PetscCall(VecAXPY(fs->vec.to[1], step, fs->device.part));
  PetscCall(FlowSolverResetFields(fs));
  PetscCall(DeviceVecReset(q, fs->device.part));
  PetscCall(VecRestoreArrayAndMemType(fs->vec.r, &r));
  PetscCall(VecRestoreArrayAndMemType(fs->vec.x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
