/* FlowSolver: the start value of the pressure, shifted along a direction (see system.h). */
#include "compat.h"
#include "impl.h"

/* q = dp without the pressures of cells that lie in bodies: no equation knows them, and what is added once would be
   added in every step */
static PetscErrorCode take_fluid_pressures(FlowSolver fs, const PetscReal dp[], PetscReal q[])
{
  const PetscInt nk = fs->loc->dim + 1;

  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(q, dp, fs->np));
  for (PetscInt c = 0; c < fs->loc->ncell; c++)
    if (FlowSolverCellIsRigid(fs, c)) PetscCall(PetscArrayzero(q + c * nk, nk));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscReal FlowSolverMobility(FlowSolver fs, PetscInt i)
{
  const ConstraintView *c    = ConstraintGetView(fs->constraint);
  const PetscInt        nr   = fs->nr;
  const PetscInt        body = (i - fs->nodal) / nr, slot = (i - fs->nodal) % nr;

  if (i < fs->nodal) return fs->weight[i];
  if (body >= c->nown) return 0; /* a spare slot */
  return fs->body.mass_inverse[(c->own[body] * nr + slot) * nr + slot] /
         PetscSqr(ConstraintSlotUnit(c, c->own[body], slot));
}

/* Go along dp from the start value's pressure to where its residual r is smallest, at most a whole step and never back:
   longer ones follow the noise of a pressure that hardly changes, and grow from step to step. Where the flow changes
   smoothly it is a whole step (a second one would follow from the first by solving for it); where bodies move, the
   pressure jumps and the step is short. Residuals count as accelerations there, since rows of large cells, far from the
   bodies that these are small for, would rule otherwise. */
PetscErrorCode FlowSolverShiftPressure(FlowSolver fs, const PetscReal dp[])
{
  PetscReal       *x, *r, *fluid_pressure, sum[2] = {0, 0};
  const PetscReal *q, *g, *c = NULL; /* a whole step adds q to the pressure and takes g, c from r */

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayWrite(fs->vec.t_p, &fluid_pressure));
  PetscCall(take_fluid_pressures(fs, dp, fluid_pressure));
  PetscCall(VecRestoreArrayWrite(fs->vec.t_p, &fluid_pressure));
  PetscCall(MatMult(fs->op.G, fs->vec.t_p, fs->vec.t_u));
  if (fs->op.C) {
    PetscCall(MatMult(fs->op.C, fs->vec.t_p, fs->vec.t_p2));
    PetscCall(VecScale(fs->vec.t_p2, fs->step.continuity_scale));
  }
  PetscCall(VecGetArray(fs->vec.x, &x));
  PetscCall(VecGetArray(fs->vec.r, &r));
  PetscCall(VecGetArrayRead(fs->vec.t_u, &g));
  PetscCall(VecGetArrayRead(fs->vec.t_p, &q));
  if (fs->op.C) PetscCall(VecGetArrayRead(fs->vec.t_p2, &c));
  for (PetscInt i = 0; i < fs->nur; i++) {
    const PetscReal w = fs->set.moving ? FlowSolverMobility(fs, i) : 1;

    sum[0] += w * g[i] * r[i];
    sum[1] += w * g[i] * g[i];
  }
  for (PetscInt i = 0; i < fs->np && c; i++) {
    sum[0] += c[i] * r[fs->nur + i];
    sum[1] += c[i] * c[i];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 2, MPIU_REAL, MPIU_SUM, fs->comm));
  if (sum[1] > 0) {
    const PetscReal step = PetscMin(1, PetscMax(0, sum[0] / sum[1]));

    for (PetscInt i = 0; i < fs->nur; i++) r[i] -= step * g[i];
    for (PetscInt i = 0; i < fs->np && c; i++) r[fs->nur + i] -= step * c[i];
    for (PetscInt i = 0; i < fs->np; i++) x[fs->nur + i] += step * q[i];
  }
  if (fs->op.C) PetscCall(VecRestoreArrayRead(fs->vec.t_p2, &c));
  PetscCall(VecRestoreArrayRead(fs->vec.t_p, &q));
  PetscCall(VecRestoreArrayRead(fs->vec.t_u, &g));
  PetscCall(VecRestoreArray(fs->vec.r, &r));
  PetscCall(VecRestoreArray(fs->vec.x, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
