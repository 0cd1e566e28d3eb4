/* FlowSolver: mean velocities held by uniform forces, one more unknown and one more row of the system each (see
   system.h).

     [ K   -s ] [x]   [ b ]     s = P^T (lumped mass of the axis) + rigid weights: what a unit force does to the rows,
     [ s^T  0 ] [f] = [ t ]     and, transposed, the integral of the velocity along the axis over the domain

   By blocks: K y = b, K z = s, x = y + f z with f = (t - s^T y)/(s^T z). Whatever the tolerances of the two solves, the
   row of t holds up to rounding; what the residual of z leaves in the other rows is f |s - K z|. Since f is what the
   force changes by in the step, the z of the steps before mostly serves: it is solved for again, from where it is, if
   it would leave more than the tolerance of the step. */
#include "compat.h"
#include "impl.h"

#define ROUNDS 6 /* of solves for z in a step, each to at least a tenth of its residual */

PetscErrorCode FlowSolverSetFlowRate(FlowSolver fs, FlowRateConstraint *constraint)
{
  PetscFunctionBeginUser;
  fs->rate.constraint = constraint;
  for (PetscInt i = 0; constraint && i < constraint->n && !fs->rate.z[i]; i++) {
    PetscCall(VecDuplicate(fs->vec.x, &fs->rate.s[i]));
    PetscCall(VecDuplicate(fs->vec.x, &fs->rate.z[i]));
    PetscCall(VecDuplicate(fs->vec.x, &fs->rate.r[i]));
    PetscCall(VecZeroEntries(fs->rate.z[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverDestroyFlowRate(FlowSolver fs)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 3; i++) {
    PetscCall(VecDestroy(&fs->rate.s[i]));
    PetscCall(VecDestroy(&fs->rate.z[i]));
    PetscCall(VecDestroy(&fs->rate.r[i]));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Zero where the velocity is no unknown */
static void clear_prescribed(FlowSolver fs, PetscReal x[])
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);

  for (PetscInt j = 0; j < c->inert.n; j++) x[c->inert.slot[j]] = 0;
  for (PetscInt i = 0; i < c->count * fs->nr; i++)
    if (i >= c->nown * fs->nr || !ConstraintIsUnknown(c, c->own[i / fs->nr], i % fs->nr)) x[fs->nodal + i] = 0;
}

/* s of row i, the old z without what has become known, and r = s - K z */
static PetscErrorCode begin_row(FlowSolver fs, PetscInt i)
{
  const FlowRateConstraint *h   = fs->rate.constraint;
  const ConstraintView     *c   = ConstraintGetView(fs->constraint);
  const PetscInt            dim = fs->loc->dim;
  const PetscReal          *m;
  PetscReal                *s, *z;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(fs->flow, &m));
  PetscCall(VecZeroEntries(fs->rate.s[i]));
  PetscCall(VecGetArray(fs->rate.s[i], &s));
  for (PetscInt j = 0; j < fs->loc->nnode; j++) s[j * dim + h->axis[i]] = m[j];
  for (PetscInt j = 0; j < c->nown * fs->nr; j++) {
    const PetscInt k = c->own[j / fs->nr], m = j % fs->nr;

    s[fs->nodal + j] = ConstraintSlotUnit(c, k, m) * h->rigid[i][k * fs->nr + m];
  }
  PetscCall(ConstraintReduceInPlace(fs->constraint, s, s + fs->nodal));
  clear_prescribed(fs, s);
  PetscCall(VecRestoreArray(fs->rate.s[i], &s));
  PetscCall(VecGetArray(fs->rate.z[i], &z));
  clear_prescribed(fs, z);
  PetscCall(VecRestoreArray(fs->rate.z[i], &z));
  PetscCall(MatMult(fs->op.K, fs->rate.z[i], fs->rate.r[i]));
  PetscCall(VecAYPX(fs->rate.r[i], -1, fs->rate.s[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the rows lack with the velocities u, U: t less the integral */
static PetscErrorCode find_deficit(FlowSolver fs, const PetscReal u[], const PetscReal U[], PetscReal deficit[3])
{
  const ConstraintView     *c   = ConstraintGetView(fs->constraint);
  const FlowRateConstraint *h   = fs->rate.constraint;
  const PetscInt            dim = fs->loc->dim;
  const PetscReal          *m;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(fs->flow, &m));
  for (PetscInt i = 0; i < h->n; i++) {
    deficit[i] = 0;
    for (PetscInt j = 0; j < fs->loc->nnode; j++) deficit[i] -= m[j] * u[j * dim + h->axis[i]];
    for (PetscInt j = 0; j < c->nown * fs->nr; j++) {
      const PetscInt e = c->own[j / fs->nr] * fs->nr + j % fs->nr;

      deficit[i] -= h->rigid[i][e] * U[e];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, deficit, (PetscMPIInt)h->n, MPIU_REAL, MPIU_SUM, fs->comm));
  for (PetscInt i = 0; i < h->n; i++) deficit[i] += h->target[i];
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* force with (s_i^T z_j) force = deficit, by elimination; *ok: the forces move the fluid, every pivot is positive */
static PetscErrorCode find_force(FlowSolver fs, const PetscReal deficit[], PetscReal force[3], PetscBool *ok)
{
  const PetscInt n = fs->rate.constraint->n;
  PetscReal      A[3][3];

  PetscFunctionBeginUser;
  *ok = PETSC_TRUE;
  for (PetscInt i = 0; i < n; i++) {
    force[i] = deficit[i];
    for (PetscInt j = 0; j < n; j++) PetscCall(VecDot(fs->rate.s[i], fs->rate.z[j], &A[i][j]));
  }
  for (PetscInt i = 0; i < n; i++) {
    if (!(A[i][i] > 0)) *ok = PETSC_FALSE;
    for (PetscInt k = i + 1; k < n && *ok; k++) {
      const PetscReal factor = A[k][i] / A[i][i];

      for (PetscInt j = i; j < n; j++) A[k][j] -= factor * A[i][j];
      force[k] -= factor * force[i];
    }
  }
  for (PetscInt i = n - 1; i >= 0 && *ok; i--) {
    for (PetscInt j = i + 1; j < n; j++) force[i] -= A[i][j] * force[j];
    force[i] /= A[i][i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* z += K^{-1} r, to rtol of r */
static PetscErrorCode improve_row(FlowSolver fs, PetscInt i, PetscReal rtol, PetscInt *its, KSPConvergedReason *reason)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverMakeConsistent(fs, fs->rate.r[i]));
  if (!fs->set.single_projection)
    PetscCall(KSPSetTolerances(fs->ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(FlowSolverIterate(fs, fs->rate.r[i], fs->vec.y));
  PetscCall(KSPGetIterationNumber(fs->ksp, &n));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  *its += n;
  PetscCall(VecAXPY(fs->rate.z[i], 1, fs->vec.y));
  PetscCall(MatMult(fs->op.K, fs->rate.z[i], fs->rate.r[i]));
  PetscCall(VecAYPX(fs->rate.r[i], -1, fs->rate.s[i]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solve for every z that leaves more than its part of the tolerance; *converged: none did */
static PetscErrorCode improve_rows(FlowSolver fs, const PetscReal force[], PetscBool known, PetscInt *its,
                                   KSPConvergedReason *reason, PetscBool *converged)
{
  const PetscInt n = fs->rate.constraint->n;

  PetscFunctionBeginUser;
  *converged = PETSC_TRUE;
  for (PetscInt i = 0; i < n && *reason >= 0; i++) {
    PetscReal size, allowed;

    PetscCall(VecNorm(fs->rate.r[i], NORM_2, &size));
    allowed = known && force[i] != 0 ? fs->stop.tol / (n * PetscAbsReal(force[i])) : known ? PETSC_MAX_REAL : 0;
    if (size <= allowed) continue;
    *converged = PETSC_FALSE;
    PetscCall(improve_row(fs, i, known ? PetscMax(1e-12, PetscMin(0.1, 0.5 * allowed / size)) : 1e-3, its, reason));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverAddFlowRateForces(FlowSolver fs, PetscReal u[], PetscReal p[], PetscReal U[], PetscInt *its,
                                           KSPConvergedReason *reason)
{
  FlowRateConstraint *h = fs->rate.constraint;
  PetscReal           deficit[3];
  PetscReal           left;
  PetscBool           ok, converged = PETSC_FALSE;

  PetscFunctionBeginUser;
  if (fs->stop.min_it) { /* the iterations may have left much less than they needed */
    PetscCall(KSPGetResidualNorm(fs->ksp, &left));
    fs->stop.tol = PetscMin(fs->stop.tol, left);
  }
  for (PetscInt i = 0; i < h->n; i++) PetscCall(begin_row(fs, i));
  PetscCall(find_deficit(fs, u, U, deficit));
  for (PetscInt round = 0; round < (fs->set.single_projection ? 1 : ROUNDS) && !converged && *reason >= 0; round++) {
    PetscCall(find_force(fs, deficit, h->force, &ok));
    PetscCall(improve_rows(fs, h->force, ok, its, reason, &converged));
  }
  PetscCall(find_force(fs, deficit, h->force, &ok));
  PetscCheck(ok, fs->comm, PETSC_ERR_NOT_CONVERGED,
             "A uniform force does not move the fluid along the axes of -flow_rate, as far as the solver sees: lower -flow_ksp_rtol, or use -flow_solver direct");
  for (PetscInt i = 0; i < h->n; i++) PetscCall(VecAXPY(fs->vec.x, h->force[i], fs->rate.z[i]));
  PetscCall(FlowSolverUnpack(fs, fs->vec.x, u, p, U));
  PetscFunctionReturn(PETSC_SUCCESS);
}
