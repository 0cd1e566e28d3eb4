/* Lagged: see lagged.h. */
#include "compat.h"
#include "lagged.h"

#define CHANGED 1.1 /* a diagonal entry by this factor, up or down */
/* Applications from one change to the next above which a set-up pays: sweeps and residual cost about a tenth of the
   set-up of BoomerAMG, and some iterations are added */
#define WORTH 10

typedef struct {
  Mat       A;
  PC        M;
  PetscReal keep;
  PetscInt  applications;  /* since the last update */
  PetscBool corrected;     /* A is no longer the matrix of M */
  Vec       before, scale; /* diagonal of the matrix of M; D */
  Vec       r, z;          /* scratch */
} Lagged;

static PetscErrorCode apply(PC pc, Vec b, Vec x)
{
  Lagged *s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  s->applications++;
  if (!s->corrected) {
    PetscCall(PCApply(s->M, b, x));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(MatSOR(s->A, b, 1, (MatSORType)(SOR_LOCAL_FORWARD_SWEEP | SOR_ZERO_INITIAL_GUESS), 0, 1, 1, x));
  PetscCall(MatResidual(s->A, b, x, s->r));
  PetscCall(VecPointwiseMult(s->r, s->r, s->scale));
  PetscCall(PCApply(s->M, s->r, s->z));
  PetscCall(VecPointwiseMult(s->z, s->z, s->scale));
  PetscCall(VecAXPY(x, 1, s->z));
  PetscCall(MatSOR(s->A, b, 1, SOR_LOCAL_BACKWARD_SWEEP, 0, 1, 1, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(PC pc, PetscViewer viewer)
{
  Lagged *s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(PetscViewerASCIIPrintf(viewer, "built anew when more than %g of the rows have changed:\n", (double)s->keep));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(PCView(s->M, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(PC pc)
{
  Lagged *s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(MatDestroy(&s->A));
  PetscCall(PCDestroy(&s->M));
  PetscCall(VecDestroy(&s->before));
  PetscCall(VecDestroy(&s->scale));
  PetscCall(VecDestroy(&s->r));
  PetscCall(VecDestroy(&s->z));
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* D of the present matrix, and the share of its rows that differ from the matrix of M */
static PetscErrorCode compare(Lagged *s, PetscReal *share)
{
  PetscReal       *d;
  const PetscReal *before;
  PetscInt         n, count[2] = {0, 0};

  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonal(s->A, s->scale));
  PetscCall(VecGetLocalSize(s->scale, &n));
  PetscCall(VecGetArray(s->scale, &d));
  PetscCall(VecGetArrayRead(s->before, &before));
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal ratio = before[i] / d[i];

    if (!(ratio < CHANGED && ratio > 1 / CHANGED)) count[0]++;
    d[i] = PetscSqrtReal(PetscMin(1, ratio));
  }
  PetscCall(VecRestoreArrayRead(s->before, &before));
  PetscCall(VecRestoreArray(s->scale, &d));
  count[1] = n;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, count, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)s->A)));
  *share = (PetscReal)count[0] / PetscMax(1, count[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* M on a matrix of its own: some types, such as GAMG, read theirs in every application, and new values would not fit
   what they estimated of the old ones */
static PetscErrorCode build(Lagged *s)
{
  Mat A;

  PetscFunctionBeginUser;
  if (!s->before) {
    PetscCall(MatCreateVecs(s->A, &s->before, &s->scale));
    PetscCall(MatCreateVecs(s->A, &s->r, &s->z));
  }
  PetscCall(MatGetDiagonal(s->A, s->before));
  PetscCall(PCSetReusePreconditioner(s->M, PETSC_FALSE));
  PetscCall(MatDuplicate(s->A, MAT_COPY_VALUES, &A));
  PetscCall(PCSetOperators(s->M, A, A));
  PetscCall(MatDestroy(&A));
  PetscCall(PCSetUp(s->M));
  PetscCall(PCSetReusePreconditioner(s->M, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LaggedCreate(PC pc, PetscReal keep)
{
  Lagged     *s;
  const char *prefix;
  char        own[256];

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->keep = keep;
  PetscCall(PCCreate(PetscObjectComm((PetscObject)pc), &s->M));
  PetscCall(PCGetOptionsPrefix(pc, &prefix));
  PetscCall(PCSetOptionsPrefix(s->M, prefix));
  PetscCall(PCSetFromOptions(s->M));
  PetscCall(PetscSNPrintf(own, sizeof(own), "%slagged_", prefix ? prefix : ""));
  PetscCall(PCSetOptionsPrefix(pc, own)); /* the type in the options is that of M */
  PetscCall(PCSetType(pc, PCSHELL));
  PetscCall(PCShellSetName(pc, "lagged"));
  PetscCall(PCShellSetContext(pc, s));
  PetscCall(PCShellSetApply(pc, apply));
  PetscCall(PCShellSetView(pc, view));
  PetscCall(PCShellSetDestroy(pc, destroy));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode LaggedUpdate(PC pc, Mat A)
{
  Lagged   *s;
  PetscReal share = 1;
  PetscBool anew;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(PetscObjectReference((PetscObject)A));
  PetscCall(MatDestroy(&s->A));
  s->A            = A;
  anew            = (PetscBool)(!s->before || s->keep <= 0 || s->applications > WORTH);
  s->applications = 0;
  if (!anew) {
    PetscCall(compare(s, &share));
    anew = (PetscBool)(share > s->keep);
  }
  if (anew) PetscCall(build(s));
  s->corrected = (PetscBool)!anew;
  PetscFunctionReturn(PETSC_SUCCESS);
}
