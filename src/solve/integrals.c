/* FlowSolver: integrals of the velocity that are held by forces with the same weights, one more unknown and one more
   row of the system each (see system.h).

     [ K   -s ] [x]   [ b ]     s: the weights, reduced to what is unknown: P^T (lumped mass of an axis, or what was
     [ s^T  g ] [f] = [ t ]     given) + rigid weights, what a unit force does to the rows; g: how it gives way

   By blocks: K y = b, K z = s, x = y + f z with f = (t - s^T y)/(s^T z + g). Whatever the tolerances of both solves
   the row of t holds up to rounding; what the residual of z leaves in the other rows is f |s - K z|. Since f is what
   the force changes by in the step, the z of the steps before mostly serves: it is solved for again, from where it is,
   if it would leave more than the tolerance of the step. */
#include "compat.h"
#include "impl.h"

#define ROUNDS 6 /* of solves for z in a step, each to at least a tenth of its residual */

PetscErrorCode FlowSolverAddIntegrals(FlowSolver fs, PetscInt n, FlowIntegral list[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscRealloc((size_t)(fs->integrals.n + n) * sizeof(*fs->integrals.row), &fs->integrals.row));
  for (PetscInt i = 0; i < n; i++) {
    IntegralRow *row = fs->integrals.row + fs->integrals.n++;

    *row = (IntegralRow){.is = list + i};
    PetscCall(VecDuplicate(fs->vec.x, &row->s));
    PetscCall(VecDuplicate(fs->vec.x, &row->z));
    PetscCall(VecDuplicate(fs->vec.x, &row->r));
    PetscCall(VecZeroEntries(row->z));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverDestroyIntegrals(FlowSolver fs)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < fs->integrals.n; i++) {
    PetscCall(VecDestroy(&fs->integrals.row[i].s));
    PetscCall(VecDestroy(&fs->integrals.row[i].z));
    PetscCall(VecDestroy(&fs->integrals.row[i].r));
  }
  PetscCall(PetscFree(fs->integrals.row));
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

/* s of a row, the old z without what has become known, and r = s - K z */
static PetscErrorCode begin_row(FlowSolver fs, IntegralRow *row)
{
  const FlowIntegral   *is  = row->is;
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim;
  const PetscReal      *m;
  PetscReal            *s, *z;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(fs->flow, &m));
  PetscCall(VecZeroEntries(row->s));
  PetscCall(VecGetArray(row->s, &s));
  if (is->nodal) PetscCall(PetscArraycpy(s, is->nodal, fs->loc->nnode * dim));
  for (PetscInt j = 0; j < fs->loc->nnode && !is->nodal; j++) s[j * dim + is->axis] = m[j];
  for (PetscInt j = 0; j < c->nown * fs->nr && is->rigid; j++) {
    const PetscInt k = c->own[j / fs->nr], m = j % fs->nr;

    s[fs->nodal + j] = ConstraintSlotUnit(c, k, m) * is->rigid[k * fs->nr + m];
  }
  PetscCall(ConstraintReduceInPlace(fs->constraint, s, s + fs->nodal));
  clear_prescribed(fs, s);
  PetscCall(VecRestoreArray(row->s, &s));
  PetscCall(VecGetArray(row->z, &z));
  clear_prescribed(fs, z);
  PetscCall(VecRestoreArray(row->z, &z));
  PetscCall(MatMult(fs->op.K, row->z, row->r));
  PetscCall(VecAYPX(row->r, -1, row->s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* What the rows lack with the velocities u, U: t less the integral */
static PetscErrorCode find_deficit(FlowSolver fs, const PetscReal u[], const PetscReal U[], PetscReal deficit[])
{
  const ConstraintView *c   = ConstraintGetView(fs->constraint);
  const PetscInt        dim = fs->loc->dim, n = fs->integrals.n;
  const PetscReal      *m;

  PetscFunctionBeginUser;
  PetscCall(FlowGetLumpedMass(fs->flow, &m));
  for (PetscInt i = 0; i < n; i++) {
    const FlowIntegral *is = fs->integrals.row[i].is;

    deficit[i] = 0;
    for (PetscInt j = 0; j < fs->loc->nnode * dim && is->nodal; j++) deficit[i] -= is->nodal[j] * u[j];
    for (PetscInt j = 0; j < fs->loc->nnode && !is->nodal; j++) deficit[i] -= m[j] * u[j * dim + is->axis];
    for (PetscInt j = 0; j < c->nown * fs->nr && is->rigid; j++) {
      const PetscInt e = c->own[j / fs->nr] * fs->nr + j % fs->nr;

      deficit[i] -= is->rigid[e] * U[e];
    }
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, deficit, (PetscMPIInt)n, MPIU_REAL, MPIU_SUM, fs->comm));
  for (PetscInt i = 0; i < n; i++) deficit[i] += fs->integrals.row[i].is->target;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Forces with (s_i^T z_j + g_i) force = deficit, by elimination; returns the row whose force moves nothing, as far as
   the solver sees: not every pivot is positive; -1: there is none */
static PetscErrorCode find_forces(FlowSolver fs, const PetscReal deficit[], PetscInt *stuck)
{
  const PetscInt n = fs->integrals.n;
  PetscReal     *A, *force;

  PetscFunctionBeginUser;
  *stuck = -1;
  PetscCall(PetscMalloc2(n * n, &A, n, &force));
  for (PetscInt i = 0; i < n; i++) {
    force[i] = deficit[i];
    for (PetscInt j = 0; j < n; j++) PetscCall(VecDot(fs->integrals.row[i].s, fs->integrals.row[j].z, &A[i * n + j]));
    A[i * (n + 1)] += fs->integrals.row[i].is->give;
  }
  for (PetscInt i = 0; i < n && *stuck < 0; i++) {
    if (!(A[i * (n + 1)] > 0)) *stuck = i;
    for (PetscInt k = i + 1; k < n && *stuck < 0; k++) {
      const PetscReal factor = A[k * n + i] / A[i * (n + 1)];

      for (PetscInt j = i; j < n; j++) A[k * n + j] -= factor * A[i * n + j];
      force[k] -= factor * force[i];
    }
  }
  for (PetscInt i = n - 1; i >= 0 && *stuck < 0; i--) {
    for (PetscInt j = i + 1; j < n; j++) force[i] -= A[i * n + j] * force[j];
    force[i] /= A[i * (n + 1)];
  }
  for (PetscInt i = 0; i < n; i++) fs->integrals.row[i].is->force = force[i];
  PetscCall(PetscFree2(A, force));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* z += K^{-1} r, to rtol of r */
static PetscErrorCode improve_row(FlowSolver fs, IntegralRow *row, PetscReal rtol, PetscInt *its,
                                  KSPConvergedReason *reason)
{
  PetscInt n;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverMakeConsistent(fs, row->r));
  if (!fs->set.single_projection)
    PetscCall(KSPSetTolerances(fs->ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(FlowSolverIterate(fs, row->r, fs->vec.y));
  PetscCall(KSPGetIterationNumber(fs->ksp, &n));
  PetscCall(KSPGetConvergedReason(fs->ksp, reason));
  *its += n;
  PetscCall(VecAXPY(row->z, 1, fs->vec.y));
  PetscCall(MatMult(fs->op.K, row->z, row->r));
  PetscCall(VecAYPX(row->r, -1, row->s));
  row->solved = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Solve for every z that leaves more than its part of the tolerance; known: forces are; *converged: none did */
static PetscErrorCode improve_rows(FlowSolver fs, PetscBool known, PetscInt *its, KSPConvergedReason *reason,
                                   PetscBool *converged)
{
  const PetscInt n = fs->integrals.n;

  PetscFunctionBeginUser;
  *converged = PETSC_TRUE;
  for (PetscInt i = 0; i < n; i++) known = (PetscBool)(known && fs->integrals.row[i].solved);
  for (PetscInt i = 0; i < n && *reason >= 0; i++) {
    IntegralRow    *row   = fs->integrals.row + i;
    const PetscReal force = PetscAbsReal(row->is->force);
    PetscReal       size, allowed;

    PetscCall(VecNorm(row->r, NORM_2, &size));
    allowed = known && force != 0 ? fs->stop.tol / (n * force) : known ? PETSC_MAX_REAL : 0;
    if (size <= allowed) continue;
    *converged = PETSC_FALSE;
    PetscCall(improve_row(fs, row, known ? PetscMax(1e-12, PetscMin(0.1, 0.5 * allowed / size)) : 1e-3, its, reason));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverHoldIntegrals(FlowSolver fs, PetscReal u[], PetscReal p[], PetscReal U[], PetscInt *its,
                                       KSPConvergedReason *reason)
{
  IntegralRow *row = fs->integrals.row;
  PetscReal   *deficit, left;
  PetscInt     stuck;
  PetscBool    converged = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(fs->integrals.n, &deficit));
  if (fs->stop.min_it) { /* the iterations may have left much less than they needed */
    PetscCall(KSPGetResidualNorm(fs->ksp, &left));
    fs->stop.tol = PetscMin(fs->stop.tol, left);
  }
  for (PetscInt i = 0; i < fs->integrals.n; i++) PetscCall(begin_row(fs, row + i));
  PetscCall(find_deficit(fs, u, U, deficit));
  for (PetscInt round = 0; round < (fs->set.single_projection ? 1 : ROUNDS) && !converged && *reason >= 0; round++) {
    PetscCall(find_forces(fs, deficit, &stuck));
    PetscCall(improve_rows(fs, (PetscBool)(stuck < 0), its, reason, &converged));
  }
  PetscCall(find_forces(fs, deficit, &stuck));
  PetscCheck(stuck < 0, fs->comm, PETSC_ERR_NOT_CONVERGED, "%s", row[stuck].is->stuck);
  for (PetscInt i = 0; i < fs->integrals.n; i++) PetscCall(VecAXPY(fs->vec.x, row[i].is->force, row[i].z));
  PetscCall(FlowSolverUnpack(fs, fs->vec.x, u, p, U));
  PetscCall(PetscFree(deficit));
  PetscFunctionReturn(PETSC_SUCCESS);
}
