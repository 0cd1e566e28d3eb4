/* Conserve: the momentum that a solve left over goes to a linear pressure.

   Iterations end with a residual r of the momentum rows, and its sum over the rows that are solved for is what the
   balance of momentum lacks. A pressure a.x that is added takes a times the gradient's rows from r; their sums along an
   axis are the volume that these rows stand for, so that one vector a makes all sums vanish: exact conservation at the
   price of two products, where iterations would buy it with the norm of r as a whole (runs/studies/flow-solver). Not
   along axes where the rows of a linear pressure cancel, such as periodic ones. */
#include "compat.h"
#include "impl.h"

#define LEAST_SHARE 0.5  /* of the rows' sizes that their sum must be */
#define SOLVED      1e-3 /* residual, relative: what leaves more has failed, and run/judge.h is to see it */

/* e = the motion with velocity 1 along every axis in u_r: what r is multiplied by for its sums */
static PetscErrorCode take_translation(FlowSolver fs, Vec e)
{
  const PetscInt dim = fs->loc->dim, n = fs->loc->nnode_all * dim;
  PetscReal     *U;
  Vec            none = fs->t_u2;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(fs->constraint->nbodies * fs->nr, &U));
  PetscCall(PetscArrayzero(fs->local, n));
  PetscCall(ConstraintRestrict(fs->constraint, fs->local, U, none));
  for (PetscInt i = 0; i < n; i++) fs->local[i] = 1;
  for (PetscInt i = 0; i < fs->constraint->nbodies * fs->nr; i++) U[i] = i % fs->nr < dim;
  PetscCall(ConstraintRestrict(fs->constraint, fs->local, U, e));
  PetscCall(VecAXPY(e, -1, none)); /* nodes that follow a body: less what they are told */
  PetscCall(PetscFree(U));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* q += factor.x in the cells whose pressure an equation knows */
static PetscErrorCode add_linear(FlowSolver fs, const PetscReal factor[], PetscReal q[])
{
  const MeshLocal *l  = fs->loc;
  const PetscInt   nk = l->dim + 1;
  const PetscReal *h;

  PetscFunctionBeginUser;
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
  for (PetscInt i = 0; i < fs->nur; i++) {
    const PetscInt axis = i < fs->nodal ? i % dim : (i - fs->nodal) % fs->nr;

    if (axis >= dim) continue;
    sum[axis] += e[i] * v[i];
    sum[3 + axis] += PetscAbsReal(e[i] * v[i]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 6, MPIU_REAL, MPIU_SUM, PETSC_COMM_WORLD));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sums of the rows of a pressure x + y + z, as sum_rows */
static PetscErrorCode sum_gradient(FlowSolver fs, const PetscReal e[], PetscReal sum[6])
{
  const PetscReal one[3] = {1, 1, 1}, *g;
  PetscReal      *q;

  PetscFunctionBeginUser;
  PetscCall(VecZeroEntries(fs->t_p));
  PetscCall(VecGetArray(fs->t_p, &q));
  PetscCall(add_linear(fs, one, q));
  PetscCall(VecRestoreArray(fs->t_p, &q));
  PetscCall(MatMult(fs->G, fs->t_p, fs->t_u2));
  PetscCall(VecGetArrayRead(fs->t_u2, &g));
  PetscCall(sum_rows(fs, g, e, sum));
  PetscCall(VecRestoreArrayRead(fs->t_u2, &g));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverConserve(FlowSolver fs, Vec xv)
{
  PetscReal        left[6], volume[6], factor[3] = {0, 0, 0}, size[2], *x;
  const PetscReal *r, *e;

  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->K, xv, fs->r));
  PetscCall(VecAYPX(fs->r, -1, fs->b));
  PetscCall(VecNorm(fs->r, NORM_2, &size[0]));
  PetscCall(VecNorm(fs->b, NORM_2, &size[1]));
  if (!(size[0] <= SOLVED * size[1])) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(take_translation(fs, fs->t_u));
  PetscCall(VecGetArrayRead(fs->t_u, &e));
  PetscCall(VecGetArrayRead(fs->r, &r));
  PetscCall(sum_rows(fs, r, e, left));
  PetscCall(VecRestoreArrayRead(fs->r, &r));
  PetscCall(sum_gradient(fs, e, volume));
  PetscCall(VecRestoreArrayRead(fs->t_u, &e));
  for (PetscInt d = 0; d < fs->loc->dim; d++)
    if (PetscAbsReal(volume[d]) > LEAST_SHARE * volume[3 + d]) factor[d] = left[d] / volume[d];
  PetscCall(VecGetArray(xv, &x));
  PetscCall(add_linear(fs, factor, x + fs->nur));
  PetscCall(VecRestoreArray(xv, &x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
