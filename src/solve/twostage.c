/* TwoStage: see twostage.h. */
#include "compat.h"
#include "cellrelax.h"
#include "impl.h"
#include "krylov/lean.h"

/* om = most vn/(vn + BLEND_HALF) for the viscous number vn of the smallest cell; most of it with a penalty, which in
   dense packings leaves little to commute (runs/studies/flow-solver) */
#define BLEND_PENALTY 0.95
#define BLEND_RIGID   0.5
#define BLEND_HALF    1
/* The second solve need not be better, but one that ends short of this spoils the correction in dense packings */
#define SECOND_RTOL   0.1
#define SECOND_MAX_IT 10

struct _p_TwoStage {
  CellRelax cells;
  Vec       v, w;  /* of the velocity; v borrowed */
  Vec       e;     /* only with cells to relax, or NULL */
  Vec       g, q;  /* of the pressure */
  PetscReal blend; /* om */
  PetscInt  ncell; /* relaxed cells on all ranks, 0 where they would not pay */
};

/* w = (A_r - X) v, v = X^{-1} P^T B^T p1 */
static PetscErrorCode project(TwoStage t, FlowSolver fs, Vec p1)
{
  PetscFunctionBeginUser;
  PetscCall(MatMult(fs->op.G, p1, t->w)); /* -X v */
  PetscCall(FlowSolverApplyMassInverse(fs, t->w, t->v));
  PetscCall(VecScale(t->v, -1));
  PetscCall(MatMult(fs->op.Ar, t->v, fs->vec.t_u)); /* a shell's MatMultAdd keeps a vector for itself */
  PetscCall(VecAXPY(t->w, 1, fs->vec.t_u));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* q = S_p^{-1} r, loosely */
static PetscErrorCode solve_again(KSP ksp, Vec r, Vec q)
{
  PetscReal rtol;
  PetscInt  max_it;

  PetscFunctionBeginUser;
  PetscCall(KSPGetTolerances(ksp, &rtol, NULL, NULL, &max_it));
  PetscCall(
    KSPSetTolerances(ksp, PetscMax(rtol, SECOND_RTOL), PETSC_DEFAULT, PETSC_DEFAULT, PetscMin(max_it, SECOND_MAX_IT)));
  PetscCall(KSPSolve(ksp, r, q));
  PetscCall(KSPSetTolerances(ksp, rtol, PETSC_DEFAULT, PETSC_DEFAULT, max_it));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* om of cells where the viscosity is mu times that of the parameters */
static PetscReal get_blend(FlowSolver fs, PetscReal mu)
{
  const PetscReal viscous = mu * fs->step.viscous / PetscSqr(fs->loc->h);

  return (FlowSolverHasPenalty(fs) || fs->solid ? BLEND_PENALTY : BLEND_RIGID) * viscous / (viscous + BLEND_HALF);
}

/* q = (1 - om) q + om (mu theta Mp^{-1} g + p1/weight - p1) with om of each cell: the weight of the mass in S_p is the
   commutator's */
static PetscErrorCode blend_cells(TwoStage t, FlowSolver fs, const PetscReal mu[], Vec p1)
{
  const PetscInt   nk = fs->loc->dim + 1;
  const PetscReal *g, *p;
  PetscReal       *q, *scaled;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(t->g, &g));
  PetscCall(VecGetArrayRead(p1, &p));
  PetscCall(VecGetArray(t->q, &q));
  PetscCall(VecGetArray(fs->vec.t_p, &scaled));
  for (PetscInt i = 0; i < fs->np; i++) {
    const PetscReal om = get_blend(fs, mu[i / nk] / fs->step.mu_reference);

    scaled[i] = om * g[i];
    q[i]      = (1 - om) * q[i] + om * (1 / FlowSolverMassWeight(fs, mu[i / nk]) - 1) * p[i];
  }
  PetscCall(FlowPressureMassSolve(fs->flow, fs->step.viscous, scaled, q));
  PetscCall(VecRestoreArray(fs->vec.t_p, &scaled));
  PetscCall(VecRestoreArray(t->q, &q));
  PetscCall(VecRestoreArrayRead(p1, &p));
  PetscCall(VecRestoreArrayRead(t->g, &g));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* q = (1 - om) S_p^{-1} B X^{-1} w + om mu theta Mp^{-1} g */
static PetscErrorCode correct(TwoStage t, FlowSolver fs, Vec p1)
{
  const PetscReal *mu;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverApplyMassInverse(fs, t->w, fs->vec.t_u));
  PetscCall(MatMult(fs->op.B, fs->vec.t_u, fs->vec.t_p));
  PetscCall(solve_again(fs->sub[1], fs->vec.t_p, t->q));
  PetscCall(FlowGetViscosity(fs->flow, &mu, NULL));
  if (mu) {
    PetscCall(blend_cells(t, fs, mu, p1));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (t->blend == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecScale(t->q, 1 - t->blend));
  PetscCall(FlowSolverAddPressureMass(fs, t->blend * fs->step.viscous, t->g, t->q));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Relax the cells. The residual of y = (u + v, p1 + q) needs no further product with A_r:
   e = x_u - A_r (u + v) + P^T B^T (p1 + q) = (x_u - A_r u) - w + P^T B^T q,
   whose first part the velocity's solver has. */
static PetscErrorCode relax(TwoStage t, FlowSolver fs, Vec u, Vec p)
{
  const DeviceQueue *q = FlowGetQueue(fs->flow);
  const PetscReal   *e, *r;
  PetscReal         *ua, *pa;

  PetscFunctionBeginUser;
  PetscCall(MatMultAdd(fs->op.G, t->q, t->w, t->w));
  PetscCall(VecAYPX(t->w, -1, t->e));
  PetscCall(MatMult(fs->op.B, t->v, fs->vec.t_p));
  PetscCall(VecAXPY(t->g, -1, fs->vec.t_p));
  PetscCall(MatMult(fs->op.C, p, fs->vec.t_p));
  PetscCall(VecAXPY(t->g, -1, fs->vec.t_p));
  PetscCall(DeviceVecGetRead(q, t->w, &e));
  PetscCall(DeviceVecGetRead(q, t->g, &r));
  PetscCall(DeviceVecGet(q, u, &ua));
  PetscCall(DeviceVecGet(q, p, &pa));
  if (q) PetscCall(CellRelaxApplyOnDevice(t->cells, e, r, ua, pa));
  else PetscCall(CellRelaxApply(t->cells, e, r, ua, pa));
  PetscCall(VecRestoreArrayAndMemType(p, &pa));
  PetscCall(VecRestoreArrayAndMemType(u, &ua));
  PetscCall(VecRestoreArrayReadAndMemType(t->g, &r));
  PetscCall(VecRestoreArrayReadAndMemType(t->w, &e));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* e = x_u - A_r u of the velocity solve. PETSc's gcr and lean_gmres have it; PETSc's gmres, asked after the solve,
   would add the correction a second time. */
static PetscErrorCode get_residual(TwoStage t, FlowSolver fs)
{
  PetscBool has_residual;
  Vec       rhs, u, e;

  PetscFunctionBeginUser;
  if (!t->e) PetscCall(VecDuplicate(fs->vec.t_u, &t->e));
  PetscCall(PetscObjectTypeCompareAny((PetscObject)fs->sub[0], &has_residual, KSPGCR, LEAN_GMRES, ""));
  if (has_residual) {
    PetscCall(KSPBuildResidual(fs->sub[0], fs->vec.t_u, t->e, &e));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(KSPGetRhs(fs->sub[0], &rhs));
  PetscCall(KSPGetSolution(fs->sub[0], &u));
  PetscCall(MatMult(fs->op.Ar, u, t->e));
  PetscCall(VecAYPX(t->e, -1, rhs));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageApply(TwoStage t, FlowSolver fs, Vec u, Vec p)
{
  Vec g;

  PetscFunctionBeginUser;
  PetscCall(KSPGetRhs(fs->sub[1], &g));
  PetscCall(VecCopy(g, t->g));
  if (t->ncell) PetscCall(get_residual(t, fs));
  if (!t->w) PetscCall(VecDuplicate(fs->vec.t_u, &t->w));
  t->v = fs->vec.t_u2; /* which neither A_r nor a solve of the pressure uses */
  PetscCall(project(t, fs, p));
  PetscCall(correct(t, fs, p));
  PetscCall(VecAXPY(u, 1, t->v));
  PetscCall(VecAXPY(p, 1, t->q));
  if (t->ncell) PetscCall(relax(t, fs, u, p));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageSetUp(TwoStage t, FlowSolver fs)
{
  PetscFunctionBeginUser;
  t->blend = get_blend(fs, 1);
  t->ncell = 0;
  if (t->cells && fs->choice.relax_cells) {
    PetscCall(CellRelaxUpdate(t->cells, fs->body.near, fs->pressure, FlowSolverHasPenalty(fs) ? fs->body.penalty : NULL,
                              fs->step.scale));
    PetscCall(CellRelaxGetCount(t->cells, &t->ncell));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageCreate(FlowSolver fs, TwoStage *two)
{
  TwoStage t;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&t));
  PetscCall(VecDuplicate(fs->vec.t_p, &t->g));
  PetscCall(VecDuplicate(fs->vec.t_p, &t->q));
  if (fs->nbodies) PetscCall(CellRelaxCreate(fs->flow, fs->constraint, &t->cells));
  *two = t;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode TwoStageDestroy(TwoStage *two)
{
  PetscFunctionBeginUser;
  if (!*two) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecDestroy(&(*two)->w));
  PetscCall(VecDestroy(&(*two)->e));
  PetscCall(VecDestroy(&(*two)->g));
  PetscCall(VecDestroy(&(*two)->q));
  PetscCall(CellRelaxDestroy(&(*two)->cells));
  PetscCall(PetscFree(*two));
  PetscFunctionReturn(PETSC_SUCCESS);
}
