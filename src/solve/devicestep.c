/* FlowSolver where the fields of a step stay on a device (FlowStaysOnDevice): right-hand side, start value and solution
   go from and to arrays there. Of bodies the host has the rows, six numbers each, and lists (devicebodies.c). */
#include "compat.h"
#include "impl.h"

static PetscInt prescribed_slot(const ConstraintView *P, PetscInt j)
{
  return j < P->inert.n ? P->inert.slot[j] : P->relative_rows.slot[j - P->inert.n];
}

/* Velocities that are known, as boundary conditions and bodies of the step have them */
static PetscErrorCode send_prescribed(FlowSolver fs, PetscReal *speed)
{
  const ConstraintView *P       = ConstraintGetView(fs->constraint);
  const DeviceQueue    *q       = FlowGetQueue(fs->flow);
  const PetscInt        dim     = fs->loc->dim;
  PetscBool             changed = PETSC_FALSE;

  PetscFunctionBeginUser;
  *speed = 0;
  for (PetscInt j = 0; j < fs->device.nknown; j++) {
    const PetscInt  slot = prescribed_slot(P, j);
    const PetscReal v    = ConstraintGetPrescribed(fs->constraint, slot / dim, slot % dim);

    changed                  = (PetscBool)(changed || v != fs->device.value_here[j]);
    fs->device.value_here[j] = v;
    *speed                   = PetscMax(*speed, PetscAbsReal(v));
  }
  if (!changed) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCallDevice(q, (*q->run->upload)(q, (size_t)fs->device.nknown * sizeof(double), fs->device.value_here,
                                       fs->device.value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* fs->device.free, lent as *c = what is known */
static PetscErrorCode take_prescribed(FlowSolver fs, PetscReal **c)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetWrite(q, fs->device.free, c));
  PetscCallDevice(q, (*q->run->zero)(q, (size_t)fs->nodal * sizeof(double), *c));
  PetscCallDevice(q, (*q->run->set_slots)(q, fs->device.nknown, fs->device.inert, fs->device.value, *c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* out [nodal] = a + factor b */
static PetscErrorCode add(FlowSolver fs, const PetscReal a[], PetscReal factor, const PetscReal b[], PetscReal out[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)fs->nodal, 2, (const double *[]){a, b}, (double[]){1, factor}, NULL,
                                        out));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode copy(FlowSolver fs, PetscInt n, const PetscReal from[], PetscReal to[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->combine)(q, (size_t)n, 1, &from, (double[]){1}, NULL, to));
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

/* What a penalty makes of known velocities, at the nodes that it holds alone */
static PetscErrorCode add_penalty(FlowSolver fs, PetscReal b[], PetscReal rigid[])
{
  const ConstraintView *P   = ConstraintGetView(fs->constraint);
  const BodiesOnDevice *on  = &fs->device.body;
  const PetscInt        dim = fs->loc->dim;
  PetscReal            *c = fs->vec.local, *y = fs->vec.nodal;
  PetscBool             any = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (!FlowSolverHasPenalty(fs)) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt e = 0; e < on->ncut * dim; e++) {
    const PetscInt i = on->cut[e / dim], a = e % dim;

    c[i * dim + a] = ConstraintIsFree(P, i) ? 0 : ConstraintGetPrescribed(fs->constraint, i, a);
    y[i * dim + a] = 0;
  }
  PetscCall(FlowSolverAddPrescribedPenalty(fs, c, y, rigid));
  for (PetscInt e = 0; e < on->ncut * dim; e++) {
    PetscReal *v = &y[on->cut[e / dim] * dim + e % dim];

    *v  = -*v;
    any = (PetscBool)(any || *v != 0);
  }
  if (any) PetscCall(FlowAddRows(fs->flow, on->ncut, dim, on->cut, y, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Rows of bodies, and what they and a penalty have in those of nodes */
static PetscErrorCode add_bodies(FlowSolver fs, const PetscReal g[], PetscReal b[])
{
  PetscReal *rigid = fs->device.body.slots;

  PetscFunctionBeginUser;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  FlowSolverTakeLoads(fs, g, rigid);
  PetscCall(add_penalty(fs, b, rigid));
  PetscCall(FlowSolverReduceIntoOnDevice(fs, rigid, b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverBuildRhsOnDevice(FlowSolver fs, const PetscReal g[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  PetscReal         *b, *c, flux, speed;
  MatNullSpace       constant;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(send_prescribed(fs, &speed));
  PetscCall(DeviceVecGetWrite(q, fs->vec.b, &b));
  PetscCall(take_prescribed(fs, &c));
  PetscCall(FlowMultiplyOnDevice(fs->flow, PETSC_FALSE, c, b));
  PetscCall(add(fs, s.rhs, -1, b, b));
  PetscCall(add_bodies(fs, g, b));
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, b));
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

/* x += factor (P of rigid slots of the host), and of what is known as well */
static PetscErrorCode add_motion(FlowSolver fs, PetscReal factor, const PetscReal slots[], PetscReal x[])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  BodiesOnDevice    *b = &fs->device.body;
  PetscReal         *c;

  PetscFunctionBeginUser;
  PetscCall(take_prescribed(fs, &c));
  PetscCall(add(fs, x, factor, c, x));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.free, &c));
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverSpreadSlots(fs, slots));
  PetscCallDevice(q, (*q->run->body.add_rigid)(q, &b->place.on, factor, b->U, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverPackOnDevice(FlowSolver fs, const PetscReal U[])
{
  const DeviceQueue *q     = FlowGetQueue(fs->flow);
  PetscReal         *slots = fs->device.body.slots, *x;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(DeviceVecGetWrite(q, fs->vec.x, &x));
  PetscCall(copy(fs, fs->nodal, s.u, x));
  if (fs->nbodies) {
    ConstraintRestrictRigid(fs->constraint, U, slots);
    PetscCall(add_motion(fs, -1, slots, x));
  }
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, x));
  PetscCall(copy(fs, fs->np, s.p, x + fs->nur));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->vec.x, &x));
  if (fs->nbodies) PetscCall(FlowSolverSetSlots(fs, fs->vec.x, slots));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverUnpackOnDevice(FlowSolver fs, PetscReal U[])
{
  const DeviceQueue *q     = FlowGetQueue(fs->flow);
  PetscReal         *slots = fs->device.body.slots;
  const PetscReal   *x;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  if (fs->nbodies) PetscCall(FlowSolverGetSlots(fs, fs->vec.x, slots));
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  PetscCall(DeviceVecGetRead(q, fs->vec.x, &x));
  PetscCall(copy(fs, fs->nodal, x, s.u));
  PetscCall(FlowSolverFillInertOnDevice(fs, 0, s.u));
  PetscCall(add_motion(fs, 1, slots, s.u));
  PetscCall(copy(fs, fs->np, x + fs->nur, s.p));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.x, &x));
  if (fs->nbodies) PetscCall(ConstraintGatherRigid(fs->constraint, slots, U));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* sum = g.r, g.g over velocities, by M_r^{-1} where bodies move, as FlowSolverShiftPressure has them */
static PetscErrorCode sum_weighted(FlowSolver fs, Vec g, Vec r, PetscReal sum[2])
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const PetscInt     n = fs->nur - fs->nodal;
  const PetscReal   *ga, *ra, *m;
  PetscReal         *w, *G = fs->device.body.slots, *R = G + n;

  PetscFunctionBeginUser;
  PetscCall(DeviceVecGetRead(q, g, &ga));
  PetscCall(DeviceVecGetRead(q, r, &ra));
  PetscCall(DeviceVecGetRead(q, fs->device.mass, &m));
  PetscCall(DeviceVecGetWrite(q, fs->device.free, &w));
  if (fs->set.moving) PetscCallDevice(q, (*q->run->scale)(q, (size_t)fs->nodal, m, ga, w));
  else PetscCall(copy(fs, fs->nodal, ga, w));
  PetscCallDevice(q, (*q->run->dot)(q, (size_t)fs->nodal, w, ra, w, ga, fs->device.sums,
                                    fs->device.sums + DEVICE_PARTIAL));
  PetscCallDevice(q, (*q->run->download)(q, 2 * sizeof(*sum), fs->device.sums + DEVICE_PARTIAL, sum));
  PetscCall(VecRestoreArrayWriteAndMemType(fs->device.free, &w));
  PetscCall(VecRestoreArrayReadAndMemType(fs->device.mass, &m));
  PetscCall(VecRestoreArrayReadAndMemType(r, &ra));
  PetscCall(VecRestoreArrayReadAndMemType(g, &ga));
  for (PetscInt k = 0; k < 2 && fs->set.moving; k++) sum[k] *= fs->step.scale;
  if (!fs->nbodies) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverGetSlots(fs, g, G));
  PetscCall(FlowSolverGetSlots(fs, r, R));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal mobility = fs->set.moving ? FlowSolverMobility(fs, fs->nodal + i) : 1;

    sum[0] += mobility * G[i] * R[i];
    sum[1] += mobility * G[i] * G[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As FlowSolverShiftPressure: t_u = G dp, t_p = C dp, by which the residual shrinks */
PetscErrorCode FlowSolverShiftOnDevice(FlowSolver fs)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  PetscReal         *x, *r, sum[2], more[2], step;
  FlowDeviceStep     s;

  PetscFunctionBeginUser;
  PetscCall(FlowGetStepOnDevice(fs->flow, &s));
  if (fs->nbodies) PetscCallDevice(q, (*q->run->fill_slots)(q, fs->device.body.nrigid, fs->device.body.rigid, 0, s.dp));
  PetscCall(DeviceVecPlace(q, fs->device.part, s.dp));
  PetscCall(MatMult(fs->op.G, fs->device.part, fs->vec.t_u));
  PetscCall(DeviceVecGet(q, fs->vec.x, &x));
  PetscCall(DeviceVecGet(q, fs->vec.r, &r));
  PetscCall(FlowSolverPlaceFields(fs, r, x));
  PetscCall(sum_weighted(fs, fs->vec.t_u, fs->vec.from[0], sum));
  if (fs->op.C) {
    PetscCall(MatMult(fs->op.C, fs->device.part, fs->vec.t_p));
    PetscCall(VecScale(fs->vec.t_p, fs->step.continuity_scale));
    PetscCall(VecDot(fs->vec.t_p, fs->vec.from[1], &more[0]));
    PetscCall(VecDot(fs->vec.t_p, fs->vec.t_p, &more[1]));
    for (PetscInt k = 0; k < 2; k++) sum[k] += more[k];
  }
  step = sum[1] > 0 ? PetscMin(1, PetscMax(0, sum[0] / sum[1])) : 0;
  PetscCall(VecAXPY(fs->vec.from[0], -step, fs->vec.t_u));
  if (fs->op.C) PetscCall(VecAXPY(fs->vec.from[1], -step, fs->vec.t_p));
  PetscCall(VecAXPY(fs->vec.to[1], step, fs->device.part));
  PetscCall(FlowSolverResetFields(fs));
  PetscCall(DeviceVecReset(q, fs->device.part));
  PetscCall(VecRestoreArrayAndMemType(fs->vec.r, &r));
  PetscCall(VecRestoreArrayAndMemType(fs->vec.x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
