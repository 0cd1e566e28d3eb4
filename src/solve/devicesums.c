/* FlowSolver on a device: sums over vectors that lie there, for the balance of momentum (conserve.c) and the end of an
   iteration (stop.c). Numbers go to the host, and the rows of bodies. */
#include "compat.h"
#include "impl.h"

/* a [nodal] - or + b in fs->device.free; sums of its squares and of those of c */
static PetscErrorCode square(FlowSolver fs, Vec a, PetscReal factor, Vec b, PetscReal sum[2])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const size_t       n = (size_t)fs->nodal;
  const PetscReal   *aa, *ba;
  PetscReal         *w, *out = fs->device.sums + DEVICE_PARTIAL;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetRead(q, a, &aa));
  PetscCall(DeviceVecGetRead(q, b, &ba));
  PetscCall(DeviceVecGetWrite(q, fs->device.free, &w));
  PetscCallDevice(q, (*q->run->combine)(q, n, 2, (const double *[]){aa, ba}, (double[]){1, factor}, NULL, w));
  PetscCallDevice(q, (*q->run->dot)(q, n, w, w, aa, aa, fs->device.sums, out));
  PetscCallDevice(q, (*q->run->download)(q, 2 * sizeof(*sum), out, sum));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.free, &w));
  PetscCall(VecRestoreArrayReadAndMemType(b, &ba));
  PetscCall(VecRestoreArrayReadAndMemType(a, &aa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverMeasureOnDevice(FlowSolver fs, PetscReal sum[3], PetscReal max[3])
{
  const PetscInt n = fs->nur - fs->nodal;
  PetscReal      whole[2], *slots;

  PetscFunctionBeginUser;
  PetscCall(square(fs, fs->stop.iterate[1], -1, fs->stop.iterate[0], sum));
  PetscCall(square(fs, fs->stop.iterate[1], 1, fs->vec.x, whole));
  sum[2] = whole[0];
  if (n == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscMalloc1(3 * n, &slots));
  PetscCall(FlowSolverGetSlots(fs, fs->stop.iterate[1], slots));
  PetscCall(FlowSolverGetSlots(fs, fs->stop.iterate[0], slots + n));
  PetscCall(FlowSolverGetSlots(fs, fs->vec.x, slots + 2 * n));
  for (PetscInt i = 0; i < n; i++) {
    max[0] = PetscMax(max[0], PetscAbsReal(slots[i] - slots[n + i]));
    max[1] = PetscMax(max[1], PetscAbsReal(slots[i]));
    max[2] = PetscMax(max[2], PetscAbsReal(slots[2 * n + i] + slots[i]));
  }
  PetscCall(PetscFree(slots));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the balance of momentum ---- */

PetscErrorCode FlowSolverTranslationOnDevice(FlowSolver fs, Vec e)
{
  const DeviceQueue *q      = FlowGetQueue(fs->flow);
  const double       one[3] = {1, 1, 1};
  PetscReal         *U, *slots = fs->device.body.slots, *a;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(ConstraintGetView(fs->constraint)->nbodies * fs->nr, &U));
  for (PetscInt i = 0; i < ConstraintGetView(fs->constraint)->nbodies * fs->nr; i++) U[i] = i % fs->nr < fs->loc->dim;
  ConstraintRestrictRigid(fs->constraint, U, slots);
  PetscCall(PetscFree(U));
  PetscCall(FlowSolverSpreadSlots(fs, slots));
  PetscCall(DeviceVecGetWrite(q, e, &a));
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 0, NULL, NULL, one, a));
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &fs->device.body.place.on, -1, fs->device.body.U, a));
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, a));
  PetscCall(VecRestoreArrayWriteAndMemType(e, &a));
  PetscCall(FlowSolverSetSlots(fs, e, slots));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverAddLinearOnDevice(FlowSolver fs, const PetscReal factor[], PetscReal x[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  PetscReal         *linear;

  PetscFunctionBeginUser;
  PetscCall(VecZeroEntries(fs->vec.t_p2));
  PetscCall(DeviceVecGet(q, fs->vec.t_p2, &linear));
  PetscCall(FlowAddLinearOnDevice(fs->flow, factor, linear));
  PetscCallDevice(q, (*q->run->fill_slots)(q, fs->device.body.nrigid, fs->device.body.rigid, 0, linear));
  PetscCallDevice(q,
                  (*q->run->combine)(q, (size_t)fs->np, 2, (const double *[]){x, linear}, (double[]){1, 1}, NULL, x));
  PetscCall(VecRestoreArrayAndMemType(fs->vec.t_p2, &linear));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSumRowsOnDevice(FlowSolver fs, const PetscReal v[], const PetscReal e[], PetscReal sum[6])
{
  const PetscInt n = fs->nur - fs->nodal;
  PetscReal     *V = fs->device.body.slots, *E = V + n;

  PetscFunctionBeginUser;
  PetscCall(FlowSumProductsOnDevice(fs->flow, e, v, sum));
  PetscCall(FlowSolverBringSlots(fs, v, V));
  PetscCall(FlowSolverBringSlots(fs, e, E));
  for (PetscInt i = 0; i < n; i++)
    if (i % fs->nr < fs->loc->dim) {
      sum[i % fs->nr] += E[i] * V[i];
      sum[3 + i % fs->nr] += PetscAbsReal(E[i] * V[i]);
    }
  PetscFunctionReturn(PETSC_SUCCESS);
}
