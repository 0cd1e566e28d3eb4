/* FlowSolver on a device: the residual that is carried to the next step (conserve.c), where the fields of a step stay
   there. */
#include "compat.h"
#include "impl.h"

/* Slots that boundary conditions fix, once */
static PetscErrorCode list_fixed(FlowSolver fs)
{
  const PetscInt       dim = fs->loc->dim;
  const unsigned char *fixed;
  PetscInt            *slot, n = 0;

  PetscFunctionBeginUser;
  if (fs->device.fixed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ConditionsGetValues(FlowConditions(fs->flow), &fixed, NULL));
  for (PetscInt i = 0; i < fs->nodal; i++) n += (fixed[i / dim] >> i % dim) & 1;
  PetscCall(PetscMalloc1(n, &slot));
  n = 0;
  for (PetscInt i = 0; i < fs->nodal; i++)
    if ((fixed[i / dim] >> i % dim) & 1) slot[n++] = i;
  fs->device.nfixed = (int)n;
  PetscCall(DeviceTakeInts(FlowGetQueue(fs->flow), n, slot, &fs->device.fixed));
  PetscCall(PetscFree(slot));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* w [nodal] = m times factor of its component, where boundary conditions fix nothing */
static PetscErrorCode take_free_mass(FlowSolver fs, const PetscReal factor[3], PetscReal w[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 0, NULL, NULL, factor, w));
  PetscCall(FlowScaleByMassOnDevice(fs->flow, w, w));
  PetscCallDevice(q, (*q->run->fill_slots)(q, fs->device.nfixed, fs->device.fixed, 0, w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As close_sums of conserve.c */
static PetscErrorCode close_sums(FlowSolver fs, PetscReal load[], const PetscReal rigid[])
{
  const DeviceQueue *q      = FlowGetQueue(fs->flow);
  const PetscReal    one[3] = {1, 1, 1};
  PetscReal          sum[6], mass[6], factor[3], *w;

  PetscFunctionBeginUser;
  PetscCall(list_fixed(fs));
  PetscCall(DeviceVecGetWrite(q, fs->device.free, &w));
  PetscCall(take_free_mass(fs, one, w));
  PetscCall(FlowSumProductsOnDevice(fs->flow, NULL, w, mass));
  PetscCall(FlowSumProductsOnDevice(fs->flow, NULL, load, sum));
  PetscCall(PetscArraycpy(sum + 3, mass, 3));
  PetscCall(FlowSolverSumLoads(fs, rigid, sum));
  for (PetscInt a = 0; a < 3; a++) factor[a] = fs->carry.closes[a] ? -sum[a] / sum[3 + a] : 0;
  PetscCall(take_free_mass(fs, factor, w));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 2, (const double *[]){load, w}, (double[]){1, 1}, NULL,
                                        load));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.free, &w));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetImpulseOnDevice(FlowSolver fs, PetscReal load[], PetscReal rigid[])
{
  const DeviceQueue    *q = FlowGetQueue(fs->flow);
  const FlowParameters *par;
  const PetscReal      *t;
  PetscBool             any;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->zero)(q, (size_t)fs->nodal * sizeof(*load), load));
  PetscCall(FlowSolverTakeImpulse(fs, rigid, &any));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowSolverGetSlots(fs, fs->vec.t_u, fs->device.body.slots));
  PetscCall(FlowSolverSpreadSlots(fs, fs->device.body.slots));
  PetscCall(DeviceVecGetRead(q, fs->vec.t_u, &t));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 1, &t, &par->density, NULL, load));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.t_u, &t));
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, load));
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &fs->device.body.place.on, par->density, fs->device.body.U, load));
  PetscCall(FlowScaleByMassOnDevice(fs->flow, load, load));
  PetscCall(close_sums(fs, load, rigid));
  PetscFunctionReturn(PETSC_SUCCESS);
}
