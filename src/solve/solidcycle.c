/* SolidBlock, the preconditioners of both inner solvers and the operator of the pressure: see solidblock.h. */
#include "compat.h"
#include "solidblockimpl.h"

/* q += S_TT^{-1} r of the pressures around the block */
static PetscErrorCode solve_cells(SolidBlock b, Vec r, Vec q)
{
  PetscFunctionBeginUser;
  PetscCall(VecZeroEntries(b->f));
  PetscCall(VecScatterBegin(b->to_cells, r, b->f, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(VecScatterEnd(b->to_cells, r, b->f, INSERT_VALUES, SCATTER_FORWARD));
  PetscCall(KSPSolve(b->cells, b->f, b->g));
  PetscCall(VecScatterBegin(b->to_cells, b->g, q, ADD_VALUES, SCATTER_REVERSE));
  PetscCall(VecScatterEnd(b->to_cells, b->g, q, ADD_VALUES, SCATTER_REVERSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* y = S_p x = B X^{-1} B^T x + C x */
static PetscErrorCode mult_pressure(Mat mat, Vec x, Vec y)
{
  FlowSolver fs;
  SolidBlock b;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(mat, &fs));
  b = fs->solid;
  PetscCall(MatMult(fs->op.G, x, b->u[0]));
  PetscCall(FlowSolverApplyMassInverse(fs, b->u[0], b->u[1]));
  PetscCall(MatMult(fs->op.B, b->u[1], y));
  PetscCall(VecScale(y, -1));
  if (!fs->op.C) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(MatMult(fs->op.C, x, b->p[1]));
  PetscCall(VecAXPY(y, 1, b->p[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r = x - A y */
static PetscErrorCode take_residual(Mat A, Vec x, Vec y, Vec r)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(A, y, r));
  PetscCall(VecAYPX(r, -1, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode apply_pressure(PC pc, Vec r, Vec q)
{
  FlowSolver fs;
  SolidBlock b;
  Vec        rest;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  b    = fs->solid;
  rest = b->p[2];
  if (!b->cells) {
    PetscCall(PCApply(b->inner[1], r, q));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecZeroEntries(q));
  PetscCall(solve_cells(b, r, q));
  PetscCall(take_residual(b->S_p, r, q, rest));
  PetscCall(PCApply(b->inner[1], rest, b->p[0]));
  PetscCall(VecAXPY(q, 1, b->p[0]));
  PetscCall(take_residual(b->S_p, r, q, rest));
  PetscCall(solve_cells(b, rest, q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode apply_velocity(PC pc, Vec x, Vec y)
{
  FlowSolver fs;
  SolidBlock b;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &fs));
  b = fs->solid;
  PetscCall(VecZeroEntries(y));
  PetscCall(SolidBlockSolve(b, x, y));
  PetscCall(take_residual(fs->op.Ar, x, y, b->u[0]));
  PetscCall(PCApply(b->inner[0], b->u[0], b->u[1]));
  PetscCall(VecAXPY(y, 1, b->u[1]));
  PetscCall(take_residual(fs->op.Ar, x, y, b->u[0]));
  PetscCall(VecZeroEntries(b->u[1]));
  PetscCall(SolidBlockSolve(b, b->u[0], b->u[1]));
  PetscCall(VecAXPY(y, 1, b->u[1]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create(FlowSolver fs)
{
  SolidBlock b = fs->solid;

  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < 3; i++) PetscCall(VecDuplicate(fs->vec.t_p, &b->p[i]));
  for (PetscInt i = 0; i < 2; i++) {
    PetscCall(VecDuplicate(fs->vec.t_u, &b->u[i]));
    PetscCall(PCCreate(fs->comm, &b->pc[i]));
    PetscCall(PCSetType(b->pc[i], PCSHELL));
    PetscCall(PCShellSetContext(b->pc[i], fs));
    PetscCall(PCShellSetName(b->pc[i], i ? "cells around solids, all cells" : "nodes of solids, all nodes"));
    PetscCall(PCShellSetApply(b->pc[i], i ? apply_pressure : apply_velocity));
  }
  PetscCall(MatCreateShell(fs->comm, fs->np, fs->np, PETSC_DETERMINE, PETSC_DETERMINE, fs, &b->S_p));
  PetscCall(MatShellSetOperation(b->S_p, MATOP_MULT, (void (*)(void))mult_pressure));
  PetscCall(MatSetOption(b->S_p, MAT_SYMMETRIC, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode SolidBlockSetUpPC(FlowSolver fs)
{
  SolidBlock b = fs->solid;

  PetscFunctionBeginUser;
  if (!b) PetscFunctionReturn(PETSC_SUCCESS);
  if (!b->S_p) PetscCall(create(fs));
  for (PetscInt i = 0; i < 2; i++) {
    MatNullSpace constant;
    Mat          A, M;

    PetscCall(KSPGetPC(fs->sub[i], &b->inner[i]));
    PetscCall(PetscObjectReference((PetscObject)b->inner[i]));
    PetscCall(KSPGetOperators(fs->sub[i], &A, &M));
    PetscCall(PCSetUp(b->inner[i]));
    if (i) {
      PetscCall(MatGetNullSpace(A, &constant));
      PetscCall(MatSetNullSpace(b->S_p, constant));
    }
    PetscCall(KSPSetPC(fs->sub[i], b->pc[i]));
    PetscCall(KSPSetOperators(fs->sub[i], i ? b->S_p : A, i ? b->S_p : A));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
