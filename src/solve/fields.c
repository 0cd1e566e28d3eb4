/* FlowSolver: vectors of the system and their parts. On every rank the reduced velocity (own nodes x dim, then the
   rigid slots of own bodies), then the pressure of own cells. */
#include "compat.h"
#include "impl.h"

PetscErrorCode FlowSolverPack(FlowSolver fs, const PetscReal u[], const PetscReal p[], const PetscReal U[], Vec xv)
{
  PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(xv, &x));
  PetscCall(VecPlaceArray(fs->vec.t_u, x));
  PetscCall(ConstraintRestrict(fs->constraint, u, U, fs->vec.t_u));
  PetscCall(VecResetArray(fs->vec.t_u));
  PetscCall(PetscArraycpy(x + fs->nur, p, fs->np));
  PetscCall(VecRestoreArray(xv, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverUnpack(FlowSolver fs, Vec xv, PetscReal u[], PetscReal p[], PetscReal U[])
{
  const PetscReal *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(xv, &x));
  PetscCall(PetscArraycpy(p, x + fs->nur, fs->np));
  PetscCall(VecPlaceArray(fs->vec.t_u, x));
  PetscCall(ConstraintExpand(fs->constraint, fs->vec.t_u, u));
  PetscCall(VecResetArray(fs->vec.t_u));
  PetscCall(ConstraintGatherRigid(fs->constraint, x + fs->nodal, U));
  PetscCall(VecRestoreArrayRead(xv, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static size_t slot_bytes(FlowSolver fs)
{
  return (size_t)(ConstraintGetView(fs->constraint)->count * fs->nr) * sizeof(PetscReal);
}

PetscErrorCode FlowSolverBringSlots(FlowSolver fs, const PetscReal a[], PetscReal slots[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  if (q) PetscCallDevice(q, (*q->run->download)(q, slot_bytes(fs), a + fs->nodal, slots));
  else PetscCall(PetscMemcpy(slots, a + fs->nodal, slot_bytes(fs)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSendSlots(FlowSolver fs, const PetscReal slots[], PetscReal a[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  if (q) PetscCallDevice(q, (*q->run->upload)(q, slot_bytes(fs), slots, a + fs->nodal));
  else PetscCall(PetscMemcpy(a + fs->nodal, slots, slot_bytes(fs)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetSlots(FlowSolver fs, Vec v, PetscReal slots[])
{
  const PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetRead(FlowGetQueue(fs->flow), v, &a));
  PetscCall(FlowSolverBringSlots(fs, a, slots));
  PetscCall(VecRestoreArrayReadAndMemType(v, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetSlots(FlowSolver fs, Vec v, const PetscReal slots[])
{
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGet(FlowGetQueue(fs->flow), v, &a));
  PetscCall(FlowSolverSendSlots(fs, slots, a));
  PetscCall(VecRestoreArrayAndMemType(v, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverMakeConsistent(FlowSolver fs, Vec r)
{
  MatNullSpace constant;
  PetscReal   *a;

  PetscFunctionBeginUser;
  PetscCall(MatGetNullSpace(fs->op.K, &constant));
  if (fs->nbodies) {
    PetscCall(VecGetArrayAndMemType(r, &a, NULL));
    PetscCall(PressureMakeConsistent(fs->pressure, a + fs->nur));
    PetscCall(VecRestoreArrayAndMemType(r, &a));
  } else if (constant) PetscCall(MatNullSpaceRemove(constant, r));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverPlaceFields(FlowSolver fs, const PetscReal from[], const PetscReal to[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCall(DeviceVecPlace(q, fs->vec.from[0], from));
  PetscCall(DeviceVecPlace(q, fs->vec.from[1], from + fs->nur));
  PetscCall(DeviceVecPlace(q, fs->vec.to[0], to));
  PetscCall(DeviceVecPlace(q, fs->vec.to[1], to + fs->nur));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverResetFields(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(DeviceVecReset(q, fs->vec.from[i]));
    PetscCall(DeviceVecReset(q, fs->vec.to[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
