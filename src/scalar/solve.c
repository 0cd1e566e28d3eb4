/* Scalars, the solution of a step: start value extrapolated, then GMRES for the correction, down to a part of what the
   start value leaves (-scalars_rtol; the sum of what is left is shifted away, so that the balance closes all the same).
   Where a step's mass dominates by far, symmetric Gauss-Seidel sweeps are enough; then ILU, kept for several steps;
   where diffusion over a cell does, or without time, algebraic multigrid, which large cell Peclet numbers break: then
   ILU. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"
#include "base/pivots.h"

#define TOLERANCE 1e-10 /* of the residual, over the right-hand side and the matrix's diagonal times the solution */
#define CANCEL    1e-3  /* of their sizes: what sources and fluxes of a steady scalar may miss to cancel */
#define PASSES    6     /* solutions at most, until limits hold, */
#define STEADY    30    /* and of a steady state */
#define SWEEPS    50    /* solutions of all scalars at most, until sources are those of their values */
#define LOOSE     1e-6  /* no residual beyond this either */
#define DIFFUSIVE 30    /* theta k/(c c_t h^2) of the smallest cell, beyond which multigrid pays, */
#define MASSIVE   0.1   /* and below which sweeps are enough */
#define MAX_PAUSE 64    /* steps */

static PetscErrorCode create_solver(Scalars all, Scalar *s, ScalarSolverKind kind)
{
#if defined(PETSC_HAVE_HYPRE)
  static const char *const PC_TYPE[] = {PCSOR, PCBJACOBI, PCHYPRE, PCLU};
#else
  static const char *const PC_TYPE[] = {PCSOR, PCBJACOBI, PCGAMG, PCLU};
#endif
  ScalarSolver *v = &s->solver;
  char          prefix[OPT_NAME];
  PC            pc;

  PetscFunctionBeginUser;
  if (v->ksp && v->kind == kind) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPDestroy(&v->ksp));
  v->kind  = kind;
  v->first = -1;
  v->wait = v->pause = 0;
  PetscCall(KSPCreate(all->comm, &v->ksp));
  PetscCall(KSPSetOptionsPrefix(v->ksp, OptJoin("scalar_", s->name, "_", prefix)));
  PetscCall(KSPSetType(v->ksp, KSPFGMRES));
  PetscCall(KSPGetPC(v->ksp, &pc));
  PetscCall(PCSetType(pc, PC_TYPE[kind]));
  /* from the right norms are those of the residual itself; FGMRES saves a preconditioning */
  PetscCall(KSPSetPCSide(v->ksp, PC_RIGHT));
  PetscCall(KSPSetNormType(v->ksp, KSP_NORM_UNPRECONDITIONED));
  PetscCall(KSPSetInitialGuessNonzero(v->ksp, PETSC_FALSE));
  PetscCall(KSPSetFromOptions(v->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static ScalarSolverKind choose_solver(Scalars all, const Scalar *s)
{
  const PetscReal h = all->loc->h, k = all->step.theta * s->par.conductivity,
                  mass = s->par.capacity * all->step.ct * h * h;

  if (s->solver.has_failed) return s->solver.working;
  return k > DIFFUSIVE * mass ? SCALAR_SOLVER_MULTIGRID : k > MASSIVE * mass ? SCALAR_SOLVER_ILU : SCALAR_SOLVER_SWEEPS;
}

PetscErrorCode ScalarCreateSolver(Scalars all, Scalar *s)
{
  PetscFunctionBeginUser;
  if (!s->A) PetscCall(ScalarCreateMatrix(all, s));
  PetscCall(create_solver(all, s, choose_solver(all, s)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarForgetSolver(Scalar *s)
{
  PetscFunctionBeginUser;
  PetscCall(KSPDestroy(&s->solver.ksp));
  s->solver = (ScalarSolver){.first = -1};
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsPredict(Scalars all, PetscInt i, const PetscReal w[])
{
  Scalar         *s = all->scalar + i;
  const PetscReal r = all->step.theta > 0 ? all->step.extrapolation / all->step.theta : 0;

  PetscFunctionBeginUser;
  s->w = w;
  for (PetscInt k = 0; k < all->loc->nnode_all; k++) s->x[k] = s->T[k] + r * (s->T[k] - s->T_old[k]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Size of what the rows of free nodes balance, and norm of r, what is left of them at x. Rows of nodes that have a
   value are not in it: they are values, of another unit. */
static PetscErrorCode find_size(Scalars all, Scalar *s, Vec x, Vec r, Vec work, PetscReal *size, PetscReal *norm)
{
  const PetscReal *v[2], *d;
  PetscReal        sum[3] = {0, 0, 0}; /* squares: of the diagonal times the solution, right-hand sides, what is left */

  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonal(s->A, work));
  PetscCall(VecGetArrayRead(work, &d));
  PetscCall(VecGetArrayRead(x, v));
  PetscCall(VecGetArrayRead(r, v + 1));
  for (PetscInt i = 0; i < all->loc->nnode; i++) {
    if (!ScalarIsFree(s, i)) continue;
    sum[0] += PetscSqr(d[i] * v[0][i]);
    sum[1] += PetscSqr(s->rhs[i]);
    sum[2] += PetscSqr(v[1][i]);
  }
  PetscCall(VecRestoreArrayRead(r, v + 1));
  PetscCall(VecRestoreArrayRead(x, v));
  PetscCall(VecRestoreArrayRead(work, &d));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, all->comm));
  *norm = PetscSqrtReal(sum[2]);
  *size = PetscSqrtReal(sum[0]) + PetscSqrtReal(sum[1]) + *norm;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A steady scalar of which nothing says how large it is needs sources and fluxes that cancel, unless a flow w takes the
   difference through a boundary. */
static PetscErrorCode check_sources(Scalars all, const Scalar *s, const PetscReal w[])
{
  const MeshLocal *l      = all->loc;
  PetscReal        sum[3] = {0, 0, 0}; /* of sources, of their sizes, of speeds at boundaries */
  ScalarCell       cell;

  PetscFunctionBeginUser;
  if (s->par.periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt c = 0; c < l->ncell; c++) {
    if (!ScalarCellIsActive(s, c)) continue;
    PetscCall(ScalarCellSet(all, s, c, &cell));
    for (PetscInt j = 0; j < l->nb; j++) {
      sum[0] += cell.f[j];
      sum[1] += PetscAbsReal(cell.f[j]);
    }
  }
  for (PetscInt k = 0; s->lumps && k < s->lumps->n; k++) {
    if (!s->lumps->is[k] || !s->lumps->own[k]) continue;
    sum[0] += s->lumps->source[k];
    sum[1] += PetscAbsReal(s->lumps->source[k]);
  }
  for (PetscInt b = 0; b < all->nboundary && w; b++) {
    const PetscInt *node;
    PetscInt        n;

    PetscCall(MeshGetBoundaryNodes(all->mesh, b, &n, &node));
    for (PetscInt i = 0; i < n * l->dim; i++) sum[2] += PetscAbsReal(w[node[i / l->dim] * l->dim + i % l->dim]);
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, all->comm));
  PetscCheck(sum[2] > 0 || PetscAbsReal(sum[0]) <= CANCEL * sum[1], all->comm, PETSC_ERR_USER_INPUT,
             "Scalar '%s' has no steady state: its sources and fluxes add up to %g a time, and nothing takes that up: give a "
             "boundary a value or a transfer coefficient (-scalar_%s_bc_<boundary>_value, _transfer), make them cancel, or "
             "leave out -sim_steady",
             s->name, (double)sum[0], s->name);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where nothing says how large a steady scalar is, one node keeps its value: the rest of the rows add up to its own. */
static PetscErrorCode fix_one_node(Scalars all, Scalar *s, const PetscReal w[])
{
  const MeshLocal *l   = all->loc;
  PetscInt         any = s->decay > 0;
  PetscMPIInt      rank;

  PetscFunctionBeginUser;
  if (all->step.ct != 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < l->nnode; i++) any += s->owner[i] >= 0;
  any += ScalarHasSink(all, s);
  for (PetscInt c = 0; c < l->ncell && s->cells.decay; c++) any += s->cells.decay[c] > 0;
  for (PetscInt c = 0; c < l->ncell && s->cells.sample; c++) {
    const ScalarSamples *p = s->cells.sample[c] >= 0 ? s->cells.samples + s->cells.sample[c] : NULL;

    for (PetscInt q = 0; p && p->lump < 0 && q < PetscPowInt(p->n, l->dim); q++) any += p->reaction[q] > 0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_MAX, all->comm));
  if (!any) PetscCall(check_sources(all, s, w));
  PetscCallMPI(MPI_Comm_rank(all->comm, &rank));
  for (PetscInt i = 0; i < l->nnode && !any && rank == 0; i++) {
    if (!ScalarCellIsActive(s, l->node_cell[l->node_cell_ptr[i]])) continue;
    s->owner[i] = all->nboundary;
    s->fixed[i] = s->T[i];
    break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Sum of the rows of free nodes times a shift of these by 1, and of the sizes of its terms */
static PetscErrorCode sum_shift(Scalar *s, PetscInt n, Vec shift, Vec rows, PetscReal sum[2])
{
  const PetscReal *v;

  PetscFunctionBeginUser;
  sum[0] = sum[1] = 0;
  PetscCall(MatMult(ScalarGetProduct(s), shift, rows));
  PetscCall(VecGetArrayRead(rows, &v));
  for (PetscInt i = 0; i < n; i++)
    if (s->owner[i] < 0) {
      sum[0] += v[i];
      sum[1] += PetscAbsReal(v[i]);
    }
  PetscCall(VecRestoreArrayRead(rows, &v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A uniform shift of the nodes that are free, by which the sum of their residuals vanishes: what the solver has left
   would else be missing in the balance. */
static PetscErrorCode close_balance(Scalars all, Scalar *s, Vec x, Vec rows, Vec work)
{
  const MeshLocal *l      = all->loc;
  PetscReal        sum[3] = {0, 0, 0}; /* of residuals; sum_shift */
  const PetscReal *v;
  PetscReal       *w;

  PetscFunctionBeginUser;
  if (all->step.ct == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatMult(ScalarGetProduct(s), x, work));
  PetscCall(VecGetArrayRead(work, &v));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (ScalarIsFree(s, i)) sum[0] += s->rhs[i] - v[i];
  PetscCall(VecRestoreArrayRead(work, &v));
  PetscCall(VecGetArray(work, &w));
  for (PetscInt i = 0; i < l->nnode; i++) w[i] = ScalarIsFree(s, i);
  PetscCall(VecRestoreArray(work, &w));
  PetscCall(sum_shift(s, l->nnode, work, rows, sum + 1));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, all->comm));
  if (sum[1] > 1e-12 * sum[2]) PetscCall(VecAXPY(x, sum[0] / sum[1], work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A solve of n iterations (fails: none), with the preconditioner of a step before (kept) or a new one, which costs
   about as much as `cost` iterations: it goes when those beyond what it needed at first add up to that. Where this is
   at once, because bodies move, steps pass before one is kept again. */
static void count_iterations(ScalarSolver *v, PetscBool kept, PetscBool fails, PetscInt n, PetscInt cost)
{
  if (!kept) {
    v->first  = fails ? -1 : n;
    v->spent  = 0;
    v->served = 0;
    v->wait   = PetscMax(0, v->wait - 1);
    return;
  }
  v->served++;
  v->spent += fails ? cost : PetscMax(0, n - v->first);
  if (v->spent < cost) return;
  v->pause = v->served < 3 ? PetscMin(MAX_PAUSE, 2 * v->pause + 1) : 0;
  v->wait  = v->pause;
  v->first = -1;
}

static PetscErrorCode solve_once(Scalars all, Scalar *s, PetscReal size, Vec r, Vec dx, KSPConvergedReason *reason)
{
  ScalarSolver  *v    = &s->solver;
  const PetscInt cost = all->loc->dim == 2 ? 4 : 12; /* of a new preconditioner, in iterations */
  PetscBool      keep = (PetscBool)(v->first >= 0 && v->wait == 0 && !s->lumps && v->kind != SCALAR_SOLVER_SWEEPS);
  PetscInt       n;

  PetscFunctionBeginUser;
  for (PetscInt attempt = 0; attempt < 2; attempt++) {
    PetscCall(KSPSetReusePreconditioner(v->ksp, keep));
    PetscCall(KSPSetOperators(v->ksp, ScalarGetProduct(s), s->lumps ? s->lump_rows : s->A));
    if (v->kind == SCALAR_SOLVER_ILU || v->kind == SCALAR_SOLVER_DIRECT) PetscCall(PivotsOfAnySize(v->ksp));
    PetscCall(KSPSetTolerances(v->ksp, 1e-15, PetscMax(size, PETSC_MIN_REAL), 1e100, keep ? v->first + cost : 500));
    PetscCall(KSPSolve(v->ksp, r, dx));
    PetscCall(KSPGetConvergedReason(v->ksp, reason));
    PetscCall(KSPGetIterationNumber(v->ksp, &n));
    if (v->kind != SCALAR_SOLVER_SWEEPS) count_iterations(v, keep, (PetscBool)(*reason <= 0), n, cost);
    if (*reason > 0 || !keep) break;
    keep = PETSC_FALSE;
  }
  if (v->kind != SCALAR_SOLVER_SWEEPS) PetscFunctionReturn(PETSC_SUCCESS);
  v->wait = n > cost + 2 ? v->wait + 1 : 0; /* ILU pays then, if it goes on */
  if (v->wait < 3) PetscFunctionReturn(PETSC_SUCCESS);
  v->has_failed = PETSC_TRUE;
  v->working    = SCALAR_SOLVER_ILU;
  v->wait       = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* dx from the residual r to this size of what is left. Where a solver fails others take over, in the end a direct one,
   for the steps that follow, too. */
static PetscErrorCode solve_for_correction(Scalars all, Scalar *s, PetscReal size, Vec r, Vec dx,
                                           KSPConvergedReason *reason)
{
  const ScalarSolverKind chosen   = s->solver.kind,
                         others[] = {chosen, chosen == SCALAR_SOLVER_ILU ? SCALAR_SOLVER_MULTIGRID : SCALAR_SOLVER_ILU,
                                     SCALAR_SOLVER_DIRECT};
  PetscMPIInt ranks;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(all->comm, &ranks));
  for (PetscInt attempt = 0; attempt < 3; attempt++) {
#if !defined(PETSC_HAVE_MUMPS)
    if (attempt == 2 && ranks > 1) break;
#endif
    PetscCall(create_solver(all, s, others[attempt]));
    PetscCall(solve_once(all, s, size, r, dx, reason));
    if (*reason <= 0) continue;
    if (attempt) {
      s->solver.has_failed = PETSC_TRUE;
      s->solver.working    = s->solver.kind;
    }
    break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With the parts of cells that are of low order */
static PetscErrorCode solve_linear(Scalars all, Scalar *s, KSPConvergedReason *reason)
{
  const MeshLocal *l = all->loc;
  Vec              x, b, r, dx;
  PetscReal        size, norm;

  PetscFunctionBeginUser;
  PetscCall(ScalarLumpsBegin(all, s));
  PetscCall(ScalarAssemble(all, s));
  PetscCall(ScalarLumpsAssemble(all, s));
  PetscCall(VecCreateMPIWithArray(all->comm, 1, l->nnode, PETSC_DETERMINE, s->x, &x));
  PetscCall(VecCreateMPIWithArray(all->comm, 1, l->nnode, PETSC_DETERMINE, s->rhs, &b));
  PetscCall(VecDuplicate(b, &r));
  PetscCall(VecDuplicate(b, &dx));
  PetscCall(MatMult(ScalarGetProduct(s), x, r));
  PetscCall(VecAYPX(r, -1, b));
  PetscCall(find_size(all, s, x, r, dx, &size, &norm));
  if (all->step.ct == 0) norm = 0;
  PetscCall(
    solve_for_correction(all, s, PetscMin(LOOSE * size, PetscMax(TOLERANCE * size, all->rtol * norm)), r, dx, reason));
  PetscCall(VecAXPY(x, 1, dx));
  PetscCall(close_balance(all, s, x, dx, r));
  PetscCall(ScalarLumpsTake(all, s));
  PetscCall(VecDestroy(&dx));
  PetscCall(VecDestroy(&r));
  PetscCall(VecDestroy(&b));
  PetscCall(VecDestroy(&x));
  PetscCall(MeshSyncNodes(all->mesh, 1, s->x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* With what goes in as it is */
static PetscErrorCode solve_within_bounds(Scalars all, Scalar *s, KSPConvergedReason *reason)
{
  const PetscInt passes = all->step.ct > 0 ? PASSES : STEADY;
  PetscBool      more;

  PetscFunctionBeginUser;
  for (PetscInt pass = 0; pass < passes; pass++) {
    PetscCall(solve_linear(all, s, reason));
    if (*reason < 0 || pass == passes - 1) break;
    PetscCall(ScalarLimit(all, s, PETSC_TRUE, &more));
    if (!more) break;
  }
  if (s->extended) PetscCall(ScalarExtendSolution(all, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSolve(Scalars all, PetscInt i, const PetscReal w[], KSPConvergedReason *reason)
{
  Scalar   *s = all->scalar + i;
  PetscBool more;

  PetscFunctionBeginUser;
  s->solved = PETSC_FALSE;
  PetscCall(ScalarsSetValues(all, s));
  PetscCall(ScalarSetInput(all, s));
  PetscCall(fix_one_node(all, s, w));
  PetscCall(ScalarsPredict(all, i, w));
  for (PetscInt k = 0; k < all->loc->nnode_all; k++)
    if (s->owner[k] >= 0) s->x[k] = s->fixed[k];
  PetscCall(ScalarLimit(all, s, PETSC_FALSE, &more));
  PetscCall(solve_within_bounds(all, s, reason));
  s->solved = PETSC_TRUE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSettle(Scalars all, PetscInt *failed, KSPConvergedReason *reason)
{
  PetscBool more = PETSC_TRUE, changed;

  PetscFunctionBeginUser;
  *failed = -1;
  *reason = KSP_CONVERGED_RTOL;
  for (PetscInt sweep = 0; sweep < SWEEPS && more && *failed < 0; sweep++) {
    more = PETSC_FALSE;
    for (PetscInt i = 0; i < all->n && *failed < 0; i++) {
      if (!all->scalar[i].input.reacts) continue;
      PetscCall(ScalarRenewInput(all, all->scalar + i, &changed));
      if (!changed) continue;
      more = PETSC_TRUE;
      PetscCall(solve_within_bounds(all, all->scalar + i, reason));
      if (*reason <= 0) *failed = i;
    }
  }
  PetscCheck(!more || all->step.ct > 0, all->comm, PETSC_ERR_NOT_CONVERGED,
             "Scalars that react have found no steady state in %d solutions: run in time until nothing changes, or start nearer to it "
             "(-scalar_<scalar>_initial)",
             SWEEPS);
  PetscFunctionReturn(PETSC_SUCCESS);
}
