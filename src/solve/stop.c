/* FlowSolver: how far the outer iteration goes (see system.h). */
#include "compat.h"
#include "impl.h"
#include "krylov/lean.h"
#include "base/interrupt.h"

/* Density ratio, roughly, up to which rows of bodies count as they are. The right-hand side of a body much heavier is
   its own momentum, of which the fluid beside it is less than any tolerance: such rows count as those of a body of this
   ratio (1e9 without: no iteration at all, and a fluid that does not move out of the way). */
#define HEAVIEST       10
#define COUPLED_FAST   3e-3  /* of the right-hand side, solver fast where contact ties bodies: see bound_residual */
#define COUPLED_ROWS   0.1   /* of the right-hand side that is left in the rows of bodies, from which on it counts */
#define FIRST_RESIDUAL 1e-3  /* of the right-hand side, in the first steps where one iteration may do later */
#define MIN_TOLERANCE  1e-13 /* of a correction; less is round-off */
#define MAX_TOLERANCE  0.99  /* PETSc wants less than 1 */

/* By what the rows of body k count, from the fluid's share in the inertia of a row: of a translation, or of the only
   rotation (in space those are coupled, and D M_r^{-1} says nothing) */
static PetscReal row_weight(FlowSolver fs, PetscInt k)
{
  const PetscInt nr = fs->nr, rows = fs->loc->dim == 2 ? nr : fs->loc->dim;
  PetscReal      fraction = 0;

  for (PetscInt i = 0; i < rows; i++) {
    const PetscInt at = (k * nr + i) * nr + i;

    if (ConstraintIsUnknown(ConstraintGetView(fs->constraint), k, i))
      fraction = PetscMax(fraction, 1 - fs->body.D[at] / fs->step.scale * fs->body.mass_inverse[at]);
  }
  return fraction > 0 ? PetscMin(1, HEAVIEST * fraction) : 1;
}

/* Norm of v with the rows of heavy bodies reduced; of a copy on all ranks, since PETSc, which remembers norms, would
   else take it together on some of them only */
static PetscErrorCode take_norm(FlowSolver fs, Vec v, PetscReal *norm)
{
  const ConstraintView *c    = ConstraintGetView(fs->constraint);
  PetscReal            *rows = fs->body.rigid_work;

  PetscFunctionBeginUser;
  if (!fs->nbodies) {
    PetscCall(VecNorm(v, NORM_2, norm));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecCopy(v, fs->vec.y));
  PetscCall(FlowSolverGetSlots(fs, fs->vec.y, rows));
  for (PetscInt k = 0; k < c->nown; k++)
    for (PetscInt i = 0; i < fs->nr && ConstraintHasUnknown(c, c->own[k]); i++)
      rows[k * fs->nr + i] *= row_weight(fs, c->own[k]);
  PetscCall(FlowSolverSetSlots(fs, fs->vec.y, rows));
  PetscCall(VecNorm(fs->vec.y, NORM_2, norm));
  PetscCall(VecZeroEntries(fs->vec.y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Bound of the residual by the right-hand side. Solver fast has none (1), except where contact ties bodies whose rows
   have a large residual at the start, because it has begun or changed: a tenth of that is a force that nobody exerts
   (40 discs that begin within the range: books of energy 12 % open after ten steps, .1 % with it). */
static PetscErrorCode bound_residual(FlowSolver fs, PetscReal rhs, PetscReal *bound)
{
  const PetscInt n    = fs->nur - fs->nodal;
  PetscReal     *rows = fs->body.rigid_work, square = 0;

  PetscFunctionBeginUser;
  *bound = fs->stop.rtol_max;
  if (fs->set.kind != SOLVER_FAST || *bound < 1 || !ContactCouplingAny(fs->body.contact_coupling))
    PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(FlowSolverGetSlots(fs, fs->vec.r, rows));
  for (PetscInt i = 0; i < n; i++) square += PetscSqr(rows[i]);
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &square, 1, MPIU_REAL, MPIU_SUM, fs->comm));
  if (square > PetscSqr(COUPLED_ROWS * rhs)) *bound = COUPLED_FAST;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetTolerance(FlowSolver fs, PetscBool *converged)
{
  PetscReal start, rhs, tol, whole, bound;

  PetscFunctionBeginUser;
  *converged = PETSC_FALSE;
  if (fs->set.single_projection) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(take_norm(fs, fs->vec.r, &start));
  PetscCall(take_norm(fs, fs->vec.b, &rhs));
  if (start > rhs) { /* such as when all comes to rest within a step */
    PetscCall(VecZeroEntries(fs->vec.x));
    PetscCall(VecCopy(fs->vec.b, fs->vec.r));
    start = rhs;
  }
  PetscCall(bound_residual(fs, rhs, &bound));
  tol = PetscMax(fs->stop.rtol * rhs, PetscMin(fs->stop.rtol_start * start, bound * rhs));
  if (fs->stop.once_max > 0 && fs->stop.before == 0)
    tol = PetscMax(fs->stop.rtol * rhs, PetscMin(tol, FIRST_RESIDUAL * rhs));
  fs->stop.tol       = tol;
  fs->stop.rhs       = rhs;
  fs->stop.tol_floor = PetscMax(fs->stop.rtol * rhs, PetscMin(FLOW_BALANCED_RESIDUAL * start, FLOW_BALANCED_MAX * rhs));
  fs->stop.after_one = rhs > 0 ? start / rhs : 0;
  *converged         = (PetscBool)(start == 0 || (start <= tol && !fs->stop.min_it));
  PetscCall(VecNorm(fs->vec.r, NORM_2, &whole));
  if (!*converged && start < PETSC_MAX_REAL)
    PetscCall(KSPSetTolerances(fs->ksp, PetscMin(PetscMax(tol / whole, MIN_TOLERANCE), MAX_TOLERANCE), PETSC_DEFAULT,
                               PETSC_DEFAULT, PETSC_DEFAULT));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- what users read: velocities of bodies and of the flow ---- */

#define MIN_ITERATIONS   2    /* one change says nothing about the next */
#define MAX_RATE         0.9  /* of convergence that an estimate takes for true */
#define MAX_RESIDUAL     2e-4 /* of the right-hand side: rigid nodes come and go, which changes show late */
#define CARRIED_RESIDUAL 1e-2 /* where it is carried to the next step: with a penalty most of it is slip in cut cells */
#define MAX_START        3e-2
#define ONCE_RATE        0.1 /* of convergence at least, where a first change is all that is known */
#define MAX_GROWTH       3   /* of the residual after one iteration since the step before */
/* By what an estimate counts: bodies lighter than the fluid follow later than the residual says; so does what goes
   several cells in a step, and so do tied ones */
#define PRUDENCE_LIGHT     10
#define PRUDENCE_LARGE_CFL 4
#define PRUDENCE_COUPLED   2
/* Where contact ties bodies (runs/studies/contact, "How far a pile is solved"). The change of a step may be all of the
   speed there, of which a share is too much. And chains of bodies follow late, by large changes at a small residual:
   what is left of it may count by as much as the largest change so far did by the residual before, and some. */
#define COUPLED_PRUDENCE 3
#define COUPLED_PATIENCE 60 /* iterations, with which gmres starts anew: what was not found then takes hundreds */

PetscBool FlowSolverHasLightBody(FlowSolver fs)
{
  const ConstraintView *c = ConstraintGetView(fs->constraint);
  PetscInt              i = 0;

  while (i < c->nown && !(ConstraintHasUnknown(c, c->own[i]) && fs->body.D[c->own[i] * fs->nr * fs->nr] < 0)) i++;
  return (PetscBool)(i < c->nown);
}

/* Of entries [begin, end), y of the iterate and of the one before it: sums of squares over nodes, largest of bodies */
static void measure_block(FlowSolver fs, PetscInt begin, PetscInt end, const PetscReal x[], const PetscReal y[],
                          const PetscReal before[], PetscReal sum[3], PetscReal max[3])
{
  for (PetscInt i = begin; i < PetscMin(end, fs->nodal); i++) {
    sum[0] += PetscSqr(y[i - begin] - before[i - begin]);
    sum[1] += PetscSqr(y[i - begin]);
    sum[2] += PetscSqr(x[i] + y[i - begin]);
  }
  for (PetscInt i = PetscMax(begin, fs->nodal); i < end; i++) {
    max[0] = PetscMax(max[0], PetscAbsReal(y[i - begin] - before[i - begin]));
    max[1] = PetscMax(max[1], PetscAbsReal(y[i - begin]));
    max[2] = PetscMax(max[2], PetscAbsReal(x[i] + y[i - begin]));
  }
}

/* The two iterates of a solver that does not tell how it makes them */
static PetscErrorCode measure_vectors(FlowSolver fs, PetscReal sum[3], PetscReal max[3])
{
  const PetscReal *x, *y, *before;
  Vec              t = fs->stop.iterate[0];

  PetscFunctionBeginUser;
  PetscCall(KSPBuildSolution(fs->ksp, fs->stop.iterate[1], NULL));
  if (FlowSolverIsOnDevice(fs)) PetscCall(FlowSolverMeasureOnDevice(fs, sum, max));
  else {
    PetscCall(VecGetArrayRead(fs->vec.x, &x));
    PetscCall(VecGetArrayRead(fs->stop.iterate[1], &y));
    PetscCall(VecGetArrayRead(fs->stop.iterate[0], &before));
    measure_block(fs, 0, fs->nur, x, y, before, sum, max);
    PetscCall(VecRestoreArrayRead(fs->stop.iterate[0], &before));
    PetscCall(VecRestoreArrayRead(fs->stop.iterate[1], &y));
    PetscCall(VecRestoreArrayRead(fs->vec.x, &x));
  }
  fs->stop.iterate[0] = fs->stop.iterate[1];
  fs->stop.iterate[1] = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

#define BLOCK 512 /* entries that stay in the cache */

/* Lengths of the last change of the solution, of the solution itself, which is the correction so far, and of the
   velocity that it leads to: largest velocity of a body, 2-norm of the nodal velocities; is there a light body?
   Collective. */
static PetscErrorCode measure(FlowSolver fs, PetscReal change[2], PetscReal whole[2], PetscReal speed[2],
                              PetscBool *light)
{
  const PetscReal *x;
  PetscReal        y[BLOCK], before[BLOCK], max[4] = {0, 0, 0, FlowSolverHasLightBody(fs)}, sum[3] = {0, 0, 0};
  PetscBool        lean;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)fs->ksp, LEAN_FGMRES, &lean));
  if (lean) {
    PetscCall(VecGetArrayRead(fs->vec.x, &x));
    for (PetscInt begin = 0; begin < fs->nur; begin += BLOCK) {
      const PetscInt end = PetscMin(begin + BLOCK, fs->nur);

      PetscCall(LeanGetIterates(fs->ksp, begin, end, y, before));
      measure_block(fs, begin, end, x, y, before, sum, max);
    }
    PetscCall(VecRestoreArrayRead(fs->vec.x, &x));
  } else PetscCall(measure_vectors(fs, sum, max));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, max, 4, MPIU_REAL, MPIU_MAX, fs->comm));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, fs->comm));
  change[0] = max[0];
  whole[0]  = max[1];
  speed[0]  = max[2];
  *light    = (PetscBool)(max[3] > 0);
  change[1] = PetscSqrtReal(sum[0]);
  whole[1]  = PetscSqrtReal(sum[1]);
  speed[1]  = PetscSqrtReal(sum[2]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Are there ties, and are velocities to be right with them? */
static PetscBool is_coupled(FlowSolver fs)
{
  return (PetscBool)((fs->stop.velocity_tol > 0 || fs->stop.check_contact) &&
                     ContactCouplingAny(fs->body.contact_coupling));
}

/* Around bodies that move: does a single iteration do, by its residual? Not while residuals grow from step to step, nor
   in the first steps, nor with ties or bodies lighter than the fluid (runs/studies/flow-solver, "One iteration"). */
static PetscBool once_suffices(FlowSolver fs, PetscReal norm)
{
  return (PetscBool)(fs->stop.is_time_step && !fs->integrals.n && fs->carry.on &&
                     !ContactCouplingAny(fs->body.contact_coupling) && norm <= fs->stop.once_max * fs->stop.rhs &&
                     norm <= MAX_GROWTH * fs->stop.before * fs->stop.rhs);
}

/* Is the error of both velocities at most the fraction velocity_tol of the largest? And, if what a step leaves is not
   carried to the next and adds up, at most the fraction MAX_START of the start value's? What an iterate lacks is
   the sum of the changes to come, which shrink as the residual or the last changes do, whichever is slower (the
   first change makes up for the cells that a penalty cuts, and says nothing); what the start value lacked is the
   correction so far. With ties by the prudent estimate. */
static PetscErrorCode velocities_suffice(FlowSolver fs, PetscInt it, PetscReal norm, PetscBool *converged)
{
  const PetscBool coupled = is_coupled(fs), adds_up = (PetscBool)(!fs->carry.on && fs->stop.velocity_tol > 0);
  const PetscReal fraction = fs->stop.velocity_tol > 0 ? fs->stop.velocity_tol : FLOW_BALANCED_ERROR;
  PetscReal       change[2], whole[2], speed[2], prudence;
  PetscBool       light = PETSC_FALSE, once;

  PetscFunctionBeginUser;
  PetscCall(measure(fs, change, whole, speed, &light));
  fs->stop.light = light;
  once           = (PetscBool)(it == 1 && !light && once_suffices(fs, norm));
  prudence       = light ? PRUDENCE_LIGHT : fs->choice.large_cfl ? PRUDENCE_LARGE_CFL : coupled ? PRUDENCE_COUPLED : 1;
  *converged     = (PetscBool)((it >= MIN_ITERATIONS || once) &&
                           norm <= (fs->carry.on ? CARRIED_RESIDUAL : MAX_RESIDUAL) * fs->stop.rhs);
  for (PetscInt i = 0; i < 2; i++) {
    const PetscBool counts = (PetscBool)(!once || !i);
    const PetscReal last = fs->stop.last_change[i], slowed = change[i] < MAX_RATE * last ? change[i] / last : MAX_RATE;
    const PetscReal shrunk = once ? ONCE_RATE : it > MIN_ITERATIONS || coupled || !fs->carry.on ? slowed : 0;
    const PetscReal rate   = PetscMin(PetscMax(norm / fs->stop.last_norm, shrunk), MAX_RATE);
    PetscReal       error  = change[i] * rate / (1 - rate);

    fs->stop.steepest[i] = PetscMax(fs->stop.steepest[i], change[i] / fs->stop.last_norm);
    if (coupled) error = PetscMax(error, COUPLED_PRUDENCE * fs->stop.steepest[i] * norm);
    *converged              = (PetscBool)(*converged && (!counts || (prudence * error <= fraction * speed[i] &&
                                                        (!adds_up || error <= MAX_START * whole[i]))));
    fs->stop.last_change[i] = change[i];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A zero iterate before the first, where measure needs vectors */
static PetscErrorCode start_iterates(FlowSolver fs)
{
  PetscBool lean;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)fs->ksp, LEAN_FGMRES, &lean));
  if (lean) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < 2 && !fs->stop.iterate[i]; i++) PetscCall(VecDuplicate(fs->vec.y, &fs->stop.iterate[i]));
  PetscCall(VecZeroEntries(fs->stop.iterate[0]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* PETSc's own test, but not before the least number of iterations, or what solver balanced is content with; or enough
   for those who read velocities. Where contact ties bodies these are to suffice in any case: the right-hand side is
   mostly the forces of contact then, of which any share is too much. */
static PetscErrorCode test_convergence(KSP ksp, PetscInt it, PetscReal norm, KSPConvergedReason *reason, void *ctx)
{
  const FlowSolver fs        = (FlowSolver)ctx;
  const PetscBool  coupled   = is_coupled(fs);
  const PetscBool  open      = (PetscBool)(coupled && it < COUPLED_PATIENCE && norm > fs->stop.rtol * fs->stop.rhs);
  PetscBool        converged = PETSC_FALSE, ends, light;

  PetscFunctionBeginUser;
  PetscCall(KSPConvergedDefault(ksp, it, norm, reason, fs->stop.test));
  if (*reason == KSP_CONVERGED_ITERATING) {
    PetscCall(InterruptAsk(&ends));
    if (ends) *reason = KSP_DIVERGED_BREAKDOWN;
    if (ends) PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (*reason == KSP_CONVERGED_RTOL && it < fs->stop.min_it && norm > fs->stop.tol_floor)
    *reason = KSP_CONVERGED_ITERATING;
  if (it == 1 && fs->stop.is_time_step) fs->stop.after_one = norm / fs->stop.rhs;
  if (it == 1 && fs->stop.velocity_tol == 0 && once_suffices(fs, norm)) {
    light = FlowSolverHasLightBody(fs); /* velocities are not looked at, and these would be a tenth of a per cent off */
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &light, 1, COMPAT_MPI_BOOL, MPI_LOR, fs->comm));
    if (!light && *reason >= 0) *reason = KSP_CONVERGED_RTOL;
  }
  if ((fs->stop.velocity_tol == 0 && !coupled) || !fs->stop.is_time_step || fs->integrals.n)
    PetscFunctionReturn(PETSC_SUCCESS);
  if (it == 0) {
    PetscCall(start_iterates(fs));
    fs->stop.last_change[0] = fs->stop.last_change[1] = PETSC_MAX_REAL;
    fs->stop.steepest[0] = fs->stop.steepest[1] = 0;
  } else if (it > fs->stop.checked && (*reason == KSP_CONVERGED_ITERATING || (*reason == KSP_CONVERGED_RTOL && open))) {
    PetscCall(velocities_suffice(fs, it, norm, &converged));
    if (fs->stop.velocity_tol == 0) converged = (PetscBool)(converged && *reason == KSP_CONVERGED_RTOL);
    *reason = converged ? KSP_CONVERGED_RTOL : KSP_CONVERGED_ITERATING;
  }
  fs->stop.last_norm = norm;
  fs->stop.checked   = it;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_test(void *ctx)
{
  FlowSolver fs = (FlowSolver)COMPAT_DESTROYED(ctx);

  PetscFunctionBeginUser;
  PetscCall(KSPConvergedDefaultDestroy(COMPAT_TO_DESTROY(fs->stop.test)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverSetTest(FlowSolver fs)
{
  PetscFunctionBeginUser;
  PetscCall(KSPConvergedDefaultCreate(&fs->stop.test));
  PetscCall(KSPSetConvergenceTest(fs->ksp, test_convergence, fs, destroy_test));
  PetscFunctionReturn(PETSC_SUCCESS);
}
