/* FlowSolver on a device (include/flow/device.h): the shells of the velocity operator for vectors that lie there. A
   reduced velocity is that of all nodes, of which boundary conditions and bodies fix some components (inert slots),
   and rigid slots; what bodies have is in devicebodies.c. */
#include "compat.h"
#include "impl.h"
#include "base/log.h"

PetscBool FlowSolverIsOnDevice(FlowSolver fs)
{
  return (PetscBool)(FlowGetQueue(fs->flow) != NULL);
}

PetscErrorCode FlowSolverFillInertOnDevice(FlowSolver fs, PetscReal value, PetscReal a[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->fill_slots)(q, fs->device.ninert, fs->device.inert, value, a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* fs->device.free, lent as *v = P x */
static PetscErrorCode expand(FlowSolver fs, Vec x, PetscReal **v)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCall(VecCopy(x, fs->device.free));
  PetscCall(DeviceVecGet(q, fs->device.free, v));
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, *v));
  PetscCall(FlowSolverExpandOnDevice(fs, *v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = (P^T A P + D) x about bodies */
static PetscErrorCode mult_bodies(FlowSolver fs, Vec x, PetscReal ya[])
{
  PetscReal *v;

  PetscFunctionBeginUser;
  PetscCall(expand(fs, x, &v));
  PetscCall(FlowMultiplyOnDevice(fs->flow, PETSC_TRUE, v, ya));
  PetscCall(FlowSolverReduceOnDevice(fs, v, ya));
  PetscCall(VecRestoreArrayAndMemType(fs->device.free, &v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = A x, identity on inert slots */
static PetscErrorCode mult_velocity(Mat mat, Vec x, Vec y)
{
  FlowSolver         fs;
  const DeviceQueue *q;
  const PetscReal   *xa;
  PetscReal         *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(PetscLogEventBegin(TB_VEL_MULT, 0, 0, 0, 0));
  q = FlowGetQueue(fs->flow);
  PetscCall(DeviceVecGetRead(q, x, &xa));
  PetscCall(DeviceVecGetWrite(q, y, &ya));
  if (fs->nbodies) PetscCall(mult_bodies(fs, x, ya));
  else PetscCall(FlowMultiplyOnDevice(fs->flow, PETSC_TRUE, xa, ya));
  PetscCallDevice(q, (*q->run->copy_slots)(q, fs->device.ninert, fs->device.inert, xa, ya));
  PetscCall(VecRestoreArrayWriteAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscCall(PetscLogEventEnd(TB_VEL_MULT, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x = D^{-1} b between two applications to the bodies: symmetric block Gauss-Seidel, as without a device */
static PetscErrorCode relax_bodies(FlowSolver fs, Vec b, Vec x)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const PetscReal   *ba;
  PetscReal         *r, *xa;

  PetscFunctionBeginUser;
  PetscCall(VecCopy(b, fs->device.free));
  PetscCall(DeviceVecGetRead(q, b, &ba));
  PetscCall(DeviceVecGet(q, fs->device.free, &r));
  PetscCall(FlowSolverBodiesBeforeOnDevice(fs, ba, r));
  PetscCall(VecRestoreArrayAndMemType(fs->device.free, &r));
  PetscCall(VecPointwiseMult(x, fs->device.free, fs->device.jacobi));
  PetscCall(DeviceVecGet(q, x, &xa));
  PetscCall(FlowSolverBodiesAfterOnDevice(fs, xa));
  PetscCallDevice(q, (*q->run->copy_slots)(q, fs->device.ninert, fs->device.inert, ba, xa));
  PetscCall(VecRestoreArrayAndMemType(x, &xa));
  PetscCall(VecRestoreArrayReadAndMemType(b, &ba));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x = D^{-1} b, identity on inert slots */
static PetscErrorCode jacobi(Mat mat, Vec b, PetscReal omega, MatSORType flag, PetscReal shift, PetscInt its,
                             PetscInt lits, Vec x)
{
  FlowSolver fs;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCheck(omega == 1 && shift == 0 && its * lits == 1 && (flag & SOR_ZERO_INITIAL_GUESS),
             PetscObjectComm((PetscObject)mat), PETSC_ERR_SUP,
             "On a device the diagonal of the velocity is applied once, from zero: leave -flow_fieldsplit_velocity_pc_sor_omega and _its at 1");
  PetscCall(PetscLogEventBegin(TB_VEL_SMOOTHER, 0, 0, 0, 0));
  if (fs->nbodies) PetscCall(relax_bodies(fs, b, x));
  else PetscCall(VecPointwiseMult(x, b, fs->device.jacobi));
  PetscCall(PetscLogEventEnd(TB_VEL_SMOOTHER, 0, 0, 0, 0));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = scale B P x */
static PetscErrorCode mult_divergence(Mat mat, Vec x, Vec y)
{
  FlowSolver         fs;
  const DeviceQueue *q;
  PetscReal         *u, *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  q = FlowGetQueue(fs->flow);
  PetscCall(expand(fs, x, &u));
  PetscCall(DeviceVecGetWrite(q, y, &ya));
  PetscCall(FlowDivergenceOnDevice(fs->flow, fs->step.scale, u, ya));
  PetscCall(VecRestoreArrayWriteAndMemType(y, &ya));
  PetscCall(VecRestoreArrayAndMemType(fs->device.free, &u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = -P^T B^T x */
static PetscErrorCode mult_gradient(Mat mat, Vec x, Vec y)
{
  FlowSolver         fs;
  const DeviceQueue *q;
  const PetscReal   *p;
  PetscReal         *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  q = FlowGetQueue(fs->flow);
  PetscCall(DeviceVecGetRead(q, x, &p));
  PetscCall(DeviceVecGetWrite(q, y, &ya));
  PetscCall(FlowGradientOnDevice(fs->flow, -1, p, ya));
  PetscCall(FlowSolverReducePlainOnDevice(fs, ya));
  if (fs->nbodies) PetscCall(FlowSolverFillInertOnDevice(fs, 0, ya));
  PetscCall(VecRestoreArrayWriteAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = C x: few cells between two surfaces, which come to the host */
static PetscErrorCode mult_shared(Mat mat, Vec x, Vec y)
{
  FlowSolver       fs;
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  PetscCall(VecSet(y, 0));
  PetscCall(DeviceVecGetRead(FlowGetQueue(fs->flow), x, &xa));
  PetscCall(DeviceVecGet(FlowGetQueue(fs->flow), y, &ya));
  PetscCall(PressureSharedOnDevice(fs->pressure, FlowSolverGapFraction(fs), xa, ya));
  PetscCall(VecRestoreArrayAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverApplyMassOnDevice(FlowSolver fs, Vec x, Vec y)
{
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(VecPointwiseMult(y, x, fs->device.mass));
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(DeviceVecGetRead(FlowGetQueue(fs->flow), x, &xa));
  PetscCall(DeviceVecGet(FlowGetQueue(fs->flow), y, &ya));
  PetscCall(FlowSolverMassOfBodiesOnDevice(fs, xa, ya));
  PetscCall(VecRestoreArrayAndMemType(y, &ya));
  PetscCall(VecRestoreArrayReadAndMemType(x, &xa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- set-up ---- */

/* What stays for as long as the mesh does */
static PetscErrorCode create_vectors(FlowSolver fs)
{
  PetscReal *a;

  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(fs->vec.t_u, &fs->device.jacobi));
  PetscCall(VecDuplicate(fs->vec.t_u, &fs->device.mass));
  PetscCall(VecDuplicate(fs->vec.t_u, &fs->device.free));
  PetscCall(VecZeroEntries(fs->device.jacobi));
  PetscCall(VecZeroEntries(fs->device.mass));
  PetscCall(DeviceTake(FlowGetQueue(fs->flow), DEVICE_PARTIAL + 2, NULL, &fs->device.sums));
  PetscCall(VecDuplicate(fs->vec.t_p, &fs->device.constant));
  PetscCall(VecGetArrayWrite(fs->device.constant, &a));
  for (PetscInt i = 0; i < fs->np; i++) a[i] = i % (fs->loc->dim + 1) == 0;
  PetscCall(VecRestoreArrayWrite(fs->device.constant, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Slots where something is known, which are others in every step where there are bodies */
static PetscErrorCode list_prescribed(FlowSolver fs)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  const DeviceQueue    *q = FlowGetQueue(fs->flow);
  const PetscInt        n = c->inert.n + c->relative_rows.n;
  SystemOnDevice       *d = &fs->device;
  PetscInt             *slot;

  PetscFunctionBeginUser;
  if ((size_t)n > d->room || !d->value_here) {
    PetscCall(PetscFree(d->value_here));
    d->room = (size_t)(n + n / 4);
    PetscCall(PetscMalloc1(d->room, &d->value_here));
  }
  d->ninert = (int)c->inert.n;
  d->nknown = (int)n;
  PetscCall(PetscMalloc1(n, &slot));
  PetscCall(PetscArraycpy(slot, c->inert.slot, c->inert.n));
  PetscCall(PetscArraycpy(slot + c->inert.n, c->relative_rows.slot, c->relative_rows.n));
  PetscCall(DeviceRenewInts(q, n, slot, &d->inert, &d->capacity[0]));
  PetscCall(PetscFree(slot));
  PetscCall(DeviceRenew(q, n, NULL, &d->value, &d->capacity[1]));
  PetscCallDevice(q, (*q->run->zero)(q, (size_t)n * sizeof(double), d->value));
  PetscCall(PetscArrayzero(d->value_here, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode update_diagonal(FlowSolver fs)
{
  PetscReal *d;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetWrite(FlowGetQueue(fs->flow), fs->device.jacobi, &d));
  PetscCall(FlowInvertDiagonalOnDevice(fs->flow, MIN_DIAGONAL * fs->step.scale, d));
  PetscCall(FlowSolverFillInertOnDevice(fs, 1, d));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.jacobi, &d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverDiagonalsOnDevice(FlowSolver fs, PetscBool *kept)
{
  PetscFunctionBeginUser;
  *kept = (PetscBool)(FlowStaysOnDevice(fs->flow) && fs->device.jacobi && fs->nbodies == 0);
  if (!*kept) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(update_diagonal(fs));
  PetscCall(VecScale(fs->device.mass, fs->device.scale / fs->step.scale));
  fs->device.scale = fs->step.scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Inverse of M_r over the scale at nodes: that of the fluid's mass but where there is a penalty */
static PetscErrorCode update_mass(FlowSolver fs)
{
  PetscReal *d;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetWrite(FlowGetQueue(fs->flow), fs->device.mass, &d));
  PetscCall(FlowInvertMassOnDevice(fs->flow, d));
  PetscCall(FlowSendRows(fs->flow, fs->device.body.ncut, fs->loc->dim, fs->device.body.cut, fs->weight, d));
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, d));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.mass, &d));
  PetscCall(VecScale(fs->device.mass, 1 / fs->step.scale));
  fs->device.scale = fs->step.scale;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetUpOnDevice(FlowSolver fs)
{
  PetscFunctionBeginUser;
  if (!FlowSolverIsOnDevice(fs)) PetscFunctionReturn(PETSC_SUCCESS);
  if (!fs->device.inert || fs->nbodies) PetscCall(list_prescribed(fs));
  if (!fs->device.jacobi) PetscCall(create_vectors(fs));
  PetscCall(FlowSolverListBodiesOnDevice(fs));
  PetscCall(update_diagonal(fs));
  PetscCall(update_mass(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverCreateOnDevice(FlowSolver fs)
{
  PetscFunctionBeginUser;
  if (!FlowSolverIsOnDevice(fs)) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCheck(!fs->set.need_Ar && !fs->set.need_whole, fs->comm, PETSC_ERR_SUP,
             "Option -device: a device carries no assembled matrices: use -flow_solver fast, balanced or accurate, and leave -flow_pc_type and -flow_fieldsplit_velocity_pc_type out");
  PetscCall(DeviceVecCreate(fs->comm, FlowGetQueue(fs->flow), 1, fs->np, PETSC_TRUE, &fs->device.part));
  PetscCall(MatShellSetOperation(fs->op.Ar, MATOP_MULT, (void (*)(void))mult_velocity));
  PetscCall(MatShellSetOperation(fs->op.B, MATOP_MULT, (void (*)(void))mult_divergence));
  PetscCall(MatShellSetOperation(fs->op.G, MATOP_MULT, (void (*)(void))mult_gradient));
  PetscCall(MatShellSetOperation(fs->op.Ar, MATOP_SOR, (void (*)(void))jacobi));
  if (fs->op.C) PetscCall(MatShellSetOperation(fs->op.C, MATOP_MULT, (void (*)(void))mult_shared));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverDestroyOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  if (!q) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecDestroy(&fs->device.jacobi));
  PetscCall(VecDestroy(&fs->device.mass));
  PetscCall(VecDestroy(&fs->device.free));
  PetscCall(VecDestroy(&fs->device.constant));
  PetscCall(VecDestroy(&fs->device.part));
  PetscCall(DeviceFree(q, &fs->device.inert));
  PetscCall(DeviceFree(q, &fs->device.value));
  PetscCall(DeviceFree(q, &fs->device.fixed));
  PetscCall(DeviceFree(q, &fs->device.sums));
  PetscCall(PetscFree(fs->device.value_here));
  PetscCall(FlowSolverFreeBodiesOnDevice(fs));
  PetscCall(FlowSolverFreeCouplingOnDevice(fs));
  PetscFunctionReturn(PETSC_SUCCESS);
}
