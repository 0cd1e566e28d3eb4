/* FlowSolver: how many directions the Krylov methods keep before they start anew. They take memory for all of them as
   soon as they need more than two, 16 bytes an unknown for each of the outer ones, and most steps need few. */
#include "compat.h"
#include "impl.h"

#define FEW       6 /* directions of the velocity, see MANY_DIRECTIONS */
#define MANY      30
#define FEW_OUTER 6 /* until a step takes more */
#define MOST      60
#define TIGHT     1e-9 /* tolerance below which the outer iteration begins with most */

/* The user's own number stands */
static PetscErrorCode keep_outer(FlowSolver fs, PetscInt n)
{
  PetscBool given;

  PetscFunctionBeginUser;
  PetscCall(PetscOptionsHasName(NULL, NULL, "-flow_ksp_gmres_restart", &given));
  if (given || n == fs->directions) PetscFunctionReturn(PETSC_SUCCESS);
  fs->directions = n;
  PetscCall(KSPGMRESSetRestart(fs->ksp, n));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A tight tolerance needs many; of the outer iteration a steady flow and chains of bodies that touch do, too */
PetscErrorCode FlowSolverChooseDirections(FlowSolver fs, PetscReal dt, PetscBool many)
{
  PetscBool given;
  PetscReal rtol;

  PetscFunctionBeginUser;
  PetscCall(keep_outer(fs, dt == 0 || fs->rtol < TIGHT || TiesAny(fs->ties) ? MOST : PetscMax(fs->directions, FEW_OUTER)));
  PetscCall(PetscOptionsHasName(NULL, NULL, VELOCITY "ksp_gmres_restart", &given));
  if (given || fs->need_whole) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(KSPGetTolerances(fs->sub[0], &rtol, NULL, NULL, NULL));
  PetscCall(KSPGMRESSetRestart(fs->sub[0], many || rtol < LOOSE_VELOCITY ? MANY : FEW));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode FlowSolverIterate(FlowSolver fs, Vec b, Vec x)
{
  const PetscInt     kept = fs->directions;
  KSPConvergedReason reason;
  PetscInt           n;

  PetscFunctionBeginUser;
  PetscCall(FlowSolverIterateOnce(fs, b, x));
  PetscCall(KSPGetIterationNumber(fs->ksp, &n));
  PetscCall(KSPGetConvergedReason(fs->ksp, &reason));
  if (kept == 0 || n <= kept) PetscFunctionReturn(PETSC_SUCCESS);
  /* so that the next step need not start anew; what failed is done again */
  PetscCall(keep_outer(fs, reason < 0 ? MOST : PetscMin(MOST, n + FEW_OUTER)));
  if (reason == KSP_DIVERGED_ITS && fs->directions > kept) PetscCall(FlowSolverIterateOnce(fs, b, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}
