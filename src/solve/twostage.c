/* TwoStage: see twostage.h. */
#include "compat.h"
#include "twostage.h"
#include "cellrelax.h"
#include "impl.h"

struct _p_TwoStage {
  CellRelax cells;
  Vec       g, w, e;
  PetscReal blend; /* om */
};

/* q in t_p; v in t_u2. p1 in p */
static PetscErrorCode correct(FlowSolver fs, TwoStage t, Vec p)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->G, p, fs->t_u)); /* -X v */
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, fs->t_u2));
  PetscCall(VecScale(fs->t_u2, -1));
  PetscCall(MatMultAdd(fs->Ar, fs->t_u2, fs->t_u, fs->t_u));
  PetscCall(FlowSolverApplyMassInverse(fs, fs->t_u, t->w));
  PetscCall(MatMult(fs->B, t->w, fs->t_p2));
  PetscCall(KSPSolve(fs->sub[1], fs->t_p2, fs->t_p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* p += om mu theta Mp^{-1} (x_p - B u) */
static PetscErrorCode add_viscous(FlowSolver fs, TwoStage t, Vec g, Vec p)
{
  const PetscReal *r;
  PetscReal       *pa;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(p, &pa));
  PetscCall(VecGetArrayRead(g, &r));
  PetscCall(FlowPressureMassSolve(fs->flow, t->blend * fs->viscous, r, pa));
  PetscCall(VecRestoreArrayRead(g, &r));
  PetscCall(VecRestoreArray(p, &pa));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode relax(FlowSolver fs, TwoStage t, Vec x, Vec y)
{
  const PetscReal *e;
  PetscReal       *a;

  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->nest, y, t->e));
  PetscCall(VecAYPX(t->e, -1, x));
  PetscCall(VecGetArrayRead(t->e, &e));
  PetscCall(VecGetArray(y, &a));
  PetscCall(CellRelaxApply(t->cells, e, e + fs->nur, a, a + fs->nur));
  PetscCall(VecRestoreArray(y, &a));
  PetscCall(VecRestoreArrayRead(t->e, &e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageApply(TwoStage t, FlowSolver fs, Vec x, Vec y)
{
  PetscReal       *a;
  const PetscReal *xa;
  Vec              u, p, xp;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(y, &a));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->nur, PETSC_DETERMINE, a, &u));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->np, PETSC_DETERMINE, a + fs->nur, &p));
  PetscCall(VecCreateMPIWithArray(PETSC_COMM_WORLD, 1, fs->np, PETSC_DETERMINE, xa + fs->nur, &xp));
  if (t->blend > 0) {
    PetscCall(MatMult(fs->B, u, t->g));
    PetscCall(VecAYPX(t->g, -1, xp));
  }
  PetscCall(correct(fs, t, p));
  PetscCall(VecAXPY(p, 1 - t->blend, fs->t_p));
  if (t->blend > 0) PetscCall(add_viscous(fs, t, t->g, p));
  PetscCall(VecAXPY(u, 1, fs->t_u2));
  PetscCall(VecDestroy(&u));
  PetscCall(VecDestroy(&p));
  PetscCall(VecDestroy(&xp));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecRestoreArray(y, &a));
  if (t->cells) PetscCall(relax(fs, t, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageSetUp(TwoStage t, FlowSolver fs)
{
  const PetscReal viscous = fs->viscous / PetscSqr(fs->loc->h);

  PetscFunctionBeginUser;
  if (FlowSolverIsSoft(fs)) t->blend = viscous < 1 ? 0.3 : 0.5;
  else t->blend = viscous < 10 ? 0 : 0.5;
  if (t->cells) PetscCall(CellRelaxUpdate(t->cells, fs->pressure, FlowSolverIsSoft(fs) ? fs->soft : NULL, fs->scale));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageCreate(FlowSolver fs, TwoStage *two)
{
  TwoStage t;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  PetscCall(VecDuplicate(fs->t_p, &t->g));
  PetscCall(VecDuplicate(fs->t_u, &t->w));
  PetscCall(VecDuplicate(fs->x, &t->e));
  if (fs->nbodies) PetscCall(CellRelaxCreate(fs->flow, fs->constraint, &t->cells));
  *two = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageDestroy(TwoStage *two)
{
  PetscFunctionBeginUser;
  if (!*two) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecDestroy(&(*two)->g));
  PetscCall(VecDestroy(&(*two)->w));
  PetscCall(VecDestroy(&(*two)->e));
  PetscCall(CellRelaxDestroy(&(*two)->cells));
  PetscCall(PetscFree(*two));
  PetscFunctionReturn(PETSC_SUCCESS);
}
