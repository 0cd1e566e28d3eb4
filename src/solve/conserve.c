/* Conserve: the momentum that a solve left over goes to a linear pressure.

   Iterations end with a residual r of the momentum rows, and its sum over the rows that are solved for is what the
   balance of momentum lacks. A pressure a.x that is added takes a times the gradient's rows from r; their sums along an
   axis are the volume that these rows stand for, so that one vector a makes all sums vanish: exact conservation at the
   price of two products, where iterations would buy it with the norm of r as a whole (runs/studies/flow-solver). Not
   along axes where the rows of a linear pressure cancel, such as periodic ones.

   The rest of r says by how much velocities are wrong here and there, about e = M_r^{-1} r. Left alone these errors add
   up from step to step; the momentum of e, taken into the right-hand side of the next step, makes up for them. */
#include "compat.h"
#include "impl.h"

#define MIN_FRACTION 0.5 /* of the rows' sizes that their sum must be */
/* Residual, relative: what leaves more has failed, and run/stepcheck.h is to see it (steps leave up to .02, others .9)
   */
#define SOLVED 5e-2

/* e = the motion with velocity 1 along every axis in u_r: what r is multiplied by for its sums */
static PetscErrorCode take_translation(FlowSolver fs, Vec e)
{
  const PetscInt dim = fs->loc->dim, n = fs->loc->nnode_all * dim;
  PetscReal     *U;
  Vec            none = fs->vec.t_u2;

  PetscFunctionBeginUser;
  if (FlowSolverIsOnDevice(fs)) {
    PetscCall(FlowSolverTranslationOnDevice(fs, e));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscCalloc1(ConstraintGetView(fs->constraint)->nbodies * fs->nr, &U));
  PetscCall(PetscArrayzero(fs->vec.local, n));
  PetscCall(ConstraintRestrict(fs->constraint, fs->vec.local, U, none));
  for (PetscInt i = 0; i < n; i++) fs->vec.local[i] = 1;
  for (PetscInt i = 0; i < ConstraintGetView(fs->constraint)->nbodies * fs->nr; i++) U[i] = i % fs->nr < dim;
  PetscCall(ConstraintRestrict(fs->constraint, fs->vec.local, U, e));
  PetscCall(VecAXPY(e, -1, none)); /* nodes that follow a body: less what they are told */
  PetscCall(PetscFree(U));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* q += factor.x in the cells whose pressure an equation knows; q where vectors lie */
static PetscErrorCode add_linear(FlowSolver fs, const PetscReal factor[], PetscReal q[])
{
  const MeshLocal *l  = fs->loc;
  const PetscInt   nk = l->dim + 1;
  const PetscReal *h;

  PetscFunctionBeginUser;
  if (FlowSolverIsOnDevice(fs)) {
    PetscCall(FlowSolverAddLinearOnDevice(fs, factor, q));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(FlowGetCellSize(fs->flow, &h));
  for (PetscInt c = 0; c < l->ncell; c++) {
    const PetscReal *x = l->x + l->cell_node[c * l->nb + l->nb / 2] * l->dim;

    if (FlowSolverCellIsRigid(fs, c)) continue;
    for (PetscInt d = 0; d < l->dim; d++) {
      q[c * nk] += factor[d] * (x[d] - l->lower[d]);
      q[c * nk + 1 + d] += factor[d] * h[c];
    }
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of the rows v of u_r, along each axis: sum[0..2] over e, sum[3..5] of their sizes. Collective. */
static PetscErrorCode sum_rows(FlowSolver fs, const PetscReal v[], const PetscReal e[], PetscReal sum[6])
{
  const PetscInt dim = fs->loc->dim;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(sum, 6));
  for (PetscInt i = 0; i < fs->nur && !FlowSolverIsOnDevice(fs); i++) {
    const PetscInt axis = i < fs->nodal ? i % dim : (i - fs->nodal) % fs->nr;

    if (axis >= dim) continue;
    sum[axis] += e[i] * v[i];
    sum[3 + axis] += PetscAbsReal(e[i] * v[i]);
  }
  if (FlowSolverIsOnDevice(fs)) PetscCall(FlowSolverSumRowsOnDevice(fs, v, e, sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 6, MPIU_REAL, MPIU_SUM, fs->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* t_p = a linear pressure, t_u2 = its rows */
static PetscErrorCode take_linear(FlowSolver fs, const PetscReal factor[])
{
  PetscReal *q;

  PetscFunctionBeginUser;
  PetscCall(VecZeroEntries(fs->vec.t_p));
  PetscCall(VecGetArrayAndMemType(fs->vec.t_p, &q, NULL));
  PetscCall(add_linear(fs, factor, q));
  PetscCall(VecRestoreArrayAndMemType(fs->vec.t_p, &q));
  PetscCall(MatMult(fs->op.G, fs->vec.t_p, fs->vec.t_u2));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverConserve(FlowSolver fs, Vec xv)
{
  const PetscReal one[3] = {1, 1, 1}, *v, *e;
  PetscReal       left[6], volume[6], size[2], *x;

  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->op.K, xv, fs->vec.r));
  PetscCall(VecAYPX(fs->vec.r, -1, fs->vec.b));
  PetscCall(VecNorm(fs->vec.r, NORM_2, &size[0]));
  PetscCall(VecNorm(fs->vec.b, NORM_2, &size[1]));
  fs->carry.solved = (PetscBool)(size[0] <= SOLVED * size[1]);
  PetscCall(PetscArrayzero(fs->carry.closes, 3));
  PetscCall(PetscArrayzero(fs->carry.factor, 3));
  if (!fs->carry.solved) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(take_translation(fs, fs->vec.t_u));
  PetscCall(take_linear(fs, one));
  PetscCall(VecGetArrayReadAndMemType(fs->vec.t_u, &e, NULL));
  PetscCall(VecGetArrayReadAndMemType(fs->vec.r, &v, NULL));
  PetscCall(sum_rows(fs, v, e, left));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.r, &v));
  PetscCall(VecGetArrayReadAndMemType(fs->vec.t_u2, &v, NULL));
  PetscCall(sum_rows(fs, v, e, volume));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.t_u2, &v));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.t_u, &e));
  for (PetscInt d = 0; d < fs->loc->dim; d++) {
    fs->carry.closes[d] = (PetscBool)(PetscAbsReal(volume[d]) > MIN_FRACTION * volume[3 + d]);
    if (fs->carry.closes[d]) fs->carry.factor[d] = left[d] / volume[d];
  }
  PetscCall(VecGetArrayAndMemType(xv, &x, NULL));
  PetscCall(add_linear(fs, fs->carry.factor, x + fs->nur));
  PetscCall(VecRestoreArrayAndMemType(xv, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSumLoads(FlowSolver fs, const PetscReal rigid[], PetscReal sum[6])
{
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim;

  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < c->nown * dim; e++) {
    const PetscInt k = c->own[e / dim];

    if (ConstraintIsUnknown(c, k, e % dim)) sum[e % dim] += rigid[k * fs->nr + e % dim];
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 6, MPIU_REAL, MPIU_SUM, fs->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where nothing is left of the sum of r, nothing may be carried as a whole: what M_r^{-1} gives walls and known bodies,
   through cells that a penalty cuts, is taken from all nodes that are free, which pressure bears. Collective. */
static PetscErrorCode close_sums(FlowSolver fs, const PetscReal m[], PetscReal load[], const PetscReal rigid[])
{
  const PetscInt       dim = fs->loc->dim;
  const unsigned char *fixed;
  PetscReal            sum[6] = {0, 0, 0, 0, 0, 0};

  PetscFunctionBeginUser;
  PetscCall(ConditionsGetValues(FlowConditions(fs->flow), &fixed, NULL));
  for (PetscInt i = 0; i < fs->nodal; i++) {
    sum[i % dim] += load[i];
    if (!((fixed[i / dim] >> i % dim) & 1)) sum[3 + i % dim] += m[i / dim];
  }
  PetscCall(FlowSolverSumLoads(fs, rigid, sum));
  for (PetscInt i = 0; i < fs->nodal; i++)
    if (fs->carry.closes[i % dim] && !((fixed[i / dim] >> i % dim) & 1))
      load[i] -= sum[i % dim] / sum[3 + i % dim] * m[i / dim];
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetCarry(FlowSolver fs, PetscBool carry)
{
  PetscFunctionBeginUser;
  fs->carry.on = carry;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetBefore(FlowSolver fs, PetscReal left)
{
  PetscFunctionBeginUser;
  fs->stop.before = left;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetLeft(FlowSolver fs, PetscReal *left, PetscBool *solved)
{
  PetscFunctionBeginUser;
  *left   = fs->stop.after_one;
  *solved = fs->carry.solved;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverTakeImpulse(FlowSolver fs, PetscReal rigid[], PetscBool *any)
{
  const ConstraintView *c  = ConstraintGetView(fs->constraint);
  const PetscInt        nr = fs->nr;
  const FlowStep       *step;
  const PetscReal      *r;
  PetscReal            *E;

  PetscFunctionBeginUser;
  *any = (PetscBool)(fs->carry.solved && !fs->step.steady);
  PetscCall(PetscArrayzero(rigid, c->nbodies * nr));
  if (!*any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetStep(fs->flow, &step));
  PetscCall(take_linear(fs, fs->carry.factor));
  PetscCall(VecGetArrayReadAndMemType(fs->vec.r, &r, NULL));
  PetscCall(FlowSolverPlaceFields(fs, r, r));
  PetscCall(VecAYPX(fs->vec.t_u2, -1, fs->vec.from[0])); /* without the rows of the pressure that was added */
  PetscCall(FlowSolverResetFields(fs));
  PetscCall(VecRestoreArrayReadAndMemType(fs->vec.r, &r));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->vec.t_u2, fs->vec.t_u));
  PetscCall(PetscMalloc1(c->nbodies * nr, &E));
  PetscCall(FlowSolverGetSlots(fs, fs->vec.t_u, fs->body.rigid_work));
  PetscCall(ConstraintGatherRigid(fs->constraint, fs->body.rigid_work, E));
  for (PetscInt e = 0; e < c->nbodies * nr; e++) {
    const PetscInt k = e / nr;

    for (PetscInt j = 0; j < nr; j++)
      if (ConstraintIsUnknown(c, k, j)) rigid[e] += fs->body.D[e * nr + j] / step->ct * E[k * nr + j];
  }
  PetscCall(PetscFree(E));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverGetResidualImpulse(FlowSolver fs, PetscReal load[], PetscReal rigid[])
{
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim;
  const FlowParameters *par;
  const PetscReal      *m;
  PetscBool             any;

  PetscFunctionBeginUser;
  PetscCall(PetscArrayzero(load, fs->nodal));
  PetscCall(FlowSolverTakeImpulse(fs, rigid, &any));
  if (!any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowGetParameters(fs->flow, &par));
  PetscCall(FlowGetInertialMass(fs->flow, &m));
  PetscCall(ConstraintExpand(fs->constraint, fs->vec.t_u, fs->vec.local));
  for (PetscInt i = 0; i < fs->loc->nnode; i++)
    for (PetscInt a = 0; a < dim; a++)
      load[i * dim + a] = par->density * m[i] *
                          (fs->vec.local[i * dim + a] -
                           (ConstraintIsFree(c, i) ? 0 : ConstraintGetPrescribed(fs->constraint, i, a)));
  PetscCall(close_sums(fs, m, load, rigid));
  PetscFunctionReturn(PETSC_SUCCESS);
}
