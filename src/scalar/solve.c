/* Scalars, the solution of a step: start value extrapolated, then GMRES for the correction. Where a step's mass
   dominates, ILU is enough; where diffusion over a cell does, or without time, algebraic multigrid, which large cell
   Peclet numbers break: then ILU. */
#include "compat.h"
#include "impl.h"
#include "base/opt.h"

#define TOLERANCE 1e-10 /* of the residual, over the right-hand side and the matrix's diagonal times the solution */
#define DIFFUSIVE 30    /* theta k/(c c_t h^2) of the smallest cell, beyond which multigrid pays */

static PetscErrorCode create_solver(Scalars all, Scalar *s, ScalarSolverKind kind)
{
#if defined(PETSC_HAVE_HYPRE)
  static const char *const PC_TYPE[] = {PCBJACOBI, PCHYPRE, PCLU};
#else
  static const char *const PC_TYPE[] = {PCBJACOBI, PCGAMG, PCLU};
#endif
  char prefix[OPT_NAME];
  PC   pc;

  PetscFunctionBeginUser;
  if (s->ksp && s->kind == kind) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPDestroy(&s->ksp));
  s->kind = kind;
  PetscCall(KSPCreate(all->comm, &s->ksp));
  PetscCall(KSPSetOptionsPrefix(s->ksp, OptJoin("scalar_", s->name, "_", prefix)));
  PetscCall(KSPSetType(s->ksp, KSPGMRES));
  PetscCall(KSPGetPC(s->ksp, &pc));
  PetscCall(PCSetType(pc, PC_TYPE[kind]));
  PetscCall(KSPSetPCSide(s->ksp, PC_RIGHT)); /* norms are those of the residual itself */
  PetscCall(KSPSetNormType(s->ksp, KSP_NORM_UNPRECONDITIONED));
  PetscCall(KSPSetFromOptions(s->ksp));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Does diffusion dominate the step? */
static PetscBool is_diffusive(Scalars all, const Scalar *s)
{
  const PetscReal h = all->loc->h;

  if (all->step.ct == 0) return PETSC_TRUE;
  return (PetscBool)(all->step.theta * s->par.conductivity > DIFFUSIVE * s->par.capacity * all->step.ct * h * h);
}

PetscErrorCode ScalarCreateSolver(Scalars all, Scalar *s)
{
  PetscFunctionBeginUser;
  if (!s->A) PetscCall(ScalarCreateMatrix(all, s));
  PetscCall(create_solver(all, s, is_diffusive(all, s) ? SCALAR_SOLVER_MULTIGRID : SCALAR_SOLVER_ILU));
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

/* Size of what the equations balance */
static PetscErrorCode find_size(Scalar *s, Vec x, Vec b, Vec work, PetscReal *size)
{
  PetscReal norm;

  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonal(s->A, work));
  PetscCall(VecPointwiseMult(work, work, x));
  PetscCall(VecNorm(work, NORM_2, size));
  PetscCall(VecNorm(b, NORM_2, &norm));
  *size += norm;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Where nothing says how large a steady scalar is, one node keeps its value: the rest of the rows add up to its own. */
static PetscErrorCode fix_one_node(Scalars all, Scalar *s)
{
  const MeshLocal *l   = all->loc;
  PetscInt         any = s->decay > 0;
  PetscMPIInt      rank;

  PetscFunctionBeginUser;
  if (all->step.ct != 0) PetscFunctionReturn(PETSC_SUCCESS);
  for (PetscInt i = 0; i < l->nnode; i++) any += s->owner[i] >= 0;
  for (PetscInt b = 0; b < all->nboundary; b++) any += s->condition[b].transfer > 0;
  for (PetscInt i = 0; i < s->nside; i++) any += s->side[i].h > 0;
  for (PetscInt c = 0; c < l->ncell && s->cells.sample; c++) {
    const ScalarSamples *p = s->cells.sample[c] >= 0 ? s->cells.samples + s->cells.sample[c] : NULL;

    for (PetscInt q = 0; p && p->lump < 0 && q < PetscPowInt(p->n, l->dim); q++) any += p->reaction[q] > 0;
  }
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_MAX, all->comm));
  PetscCallMPI(MPI_Comm_rank(all->comm, &rank));
  for (PetscInt i = 0; i < l->nnode && !any && rank == 0; i++) {
    if (!ScalarCellIsActive(s, l->node_cell[l->node_cell_ptr[i]])) continue;
    s->owner[i] = all->nboundary;
    s->fixed[i] = s->T[i];
    break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A uniform shift of the nodes that are free, by which the sum of their residuals vanishes: what the solver has left
   would else be missing in the balance. */
static PetscErrorCode close_balance(Scalars all, Scalar *s, Vec x, Vec rows, Vec work)
{
  const MeshLocal *l      = all->loc;
  PetscReal        sum[3] = {0, 0, 0}; /* of residuals, of rows, of the sizes of these */
  const PetscReal *v;
  PetscReal       *w;

  PetscFunctionBeginUser;
  PetscCall(MatMult(ScalarGetProduct(s), x, work));
  PetscCall(VecGetArrayRead(work, &v));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (s->owner[i] < 0) sum[0] += s->rhs[i] - v[i];
  PetscCall(VecRestoreArrayRead(work, &v));
  PetscCall(VecGetArray(work, &w));
  for (PetscInt i = 0; i < l->nnode; i++) w[i] = s->owner[i] < 0 && (s->seen[i] || ScalarIsLumped(s, i));
  PetscCall(VecRestoreArray(work, &w));
  PetscCall(MatMult(ScalarGetProduct(s), work, rows));
  PetscCall(VecGetArrayRead(rows, &v));
  for (PetscInt i = 0; i < l->nnode; i++)
    if (s->owner[i] < 0) {
      sum[1] += v[i];
      sum[2] += PetscAbsReal(v[i]);
    }
  PetscCall(VecRestoreArrayRead(rows, &v));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, all->comm));
  if (sum[1] > 1e-10 * sum[2] && all->step.ct > 0) PetscCall(VecAXPY(x, sum[0] / sum[1], work));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* dx from the residual r to this size of what is left. Where a solver fails, the other one, then a direct one. */
static PetscErrorCode solve_for_correction(Scalars all, Scalar *s, PetscReal size, Vec r, Vec dx,
                                           KSPConvergedReason *reason)
{
  const ScalarSolverKind others[] = {s->kind == SCALAR_SOLVER_ILU ? SCALAR_SOLVER_MULTIGRID : SCALAR_SOLVER_ILU,
                                     SCALAR_SOLVER_DIRECT};
  PetscMPIInt ranks;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_size(all->comm, &ranks));
  for (PetscInt attempt = 0; attempt < 3; attempt++) {
#if !defined(PETSC_HAVE_MUMPS)
    if (attempt == 2 && ranks > 1) break;
#endif
    if (attempt) PetscCall(create_solver(all, s, others[attempt - 1]));
    if (attempt) PetscCall(KSPSetOperators(s->ksp, ScalarGetProduct(s), s->lumps ? s->lump_rows : s->A));
    PetscCall(KSPSetTolerances(s->ksp, 1e-15, PetscMax(size, PETSC_MIN_REAL), 1e100, 500));
    PetscCall(KSPSetInitialGuessNonzero(s->ksp, PETSC_FALSE));
    PetscCall(KSPSolve(s->ksp, r, dx));
    PetscCall(KSPGetConvergedReason(s->ksp, reason));
    if (*reason > 0) break;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarsSolve(Scalars all, PetscInt i, const PetscReal w[], KSPConvergedReason *reason)
{
  const MeshLocal *l = all->loc;
  Scalar          *s = all->scalar + i;
  Vec              x, b, r, dx;
  PetscReal        size;

  PetscFunctionBeginUser;
  PetscCall(ScalarsSetConditions(all, s));
  PetscCall(fix_one_node(all, s));
  PetscCall(ScalarsPredict(all, i, w));
  for (PetscInt k = 0; k < l->nnode_all; k++)
    if (s->owner[k] >= 0) s->x[k] = s->fixed[k];
  PetscCall(ScalarLumpsBegin(all, s));
  PetscCall(ScalarAssemble(all, s));
  PetscCall(ScalarLumpsAssemble(all, s));
  PetscCall(VecCreateMPIWithArray(all->comm, 1, l->nnode, PETSC_DETERMINE, s->x, &x));
  PetscCall(VecCreateMPIWithArray(all->comm, 1, l->nnode, PETSC_DETERMINE, s->rhs, &b));
  PetscCall(VecDuplicate(b, &r));
  PetscCall(VecDuplicate(b, &dx));
  PetscCall(find_size(s, x, b, r, &size));
  PetscCall(MatMult(ScalarGetProduct(s), x, r));
  PetscCall(VecAYPX(r, -1, b));
  PetscCall(solve_for_correction(all, s, TOLERANCE * size, r, dx, reason));
  PetscCall(VecAXPY(x, 1, dx));
  PetscCall(close_balance(all, s, x, dx, r));
  PetscCall(ScalarLumpsTake(all, s));
  PetscCall(VecDestroy(&dx));
  PetscCall(VecDestroy(&r));
  PetscCall(VecDestroy(&b));
  PetscCall(VecDestroy(&x));
  PetscCall(MeshSyncNodes(all->mesh, 1, s->x));
  if (s->extended) PetscCall(ScalarExtendSolution(all, s));
  PetscFunctionReturn(PETSC_SUCCESS);
}
