/* Lagged: see lagged.h. */
#include "compat.h"
#include "lagged.h"
#include "vcycle.h"

#define CHANGED 1.1  /* a diagonal entry by this factor, up or down */
#define ALIKE   1e-3 /* and relative change of one whose row is swept */

typedef struct {
  Mat       A; /* during an update */
  PC        M;
  PetscReal keep;
  PetscBool corrected;     /* A is no longer the matrix of M */
  PetscBool cycles;        /* M gives its levels to the cycle */
  VCycle    cycle;         /* in place of M; or NULL */
  Vec       before, scale; /* diagonal of the matrix of M; D */
  PetscInt  n, *row;       /* own rows that differ from the matrix of M, ascending */
  Mat       rows, square;  /* of A: these rows, and of them these columns, of this rank alone */
  Vec       r, z;          /* scratch */
  Vec       b_row, x_row;  /* of these rows */
  Vec       b_own, x_own;  /* the same for `square` */
} Lagged;

/* v_row = v in the rows that differ, or (add) v += v_row there */
static PetscErrorCode move_rows(Lagged *s, PetscBool add, Vec v, Vec v_row)
{
  PetscReal *a, *row_value;

  PetscFunctionBeginUser;
  PetscCall(VecGetArray(v, &a));
  PetscCall(VecGetArray(v_row, &row_value));
  for (PetscInt k = 0; k < s->n; k++) {
    if (add) a[s->row[k]] += row_value[k];
    else row_value[k] = a[s->row[k]];
  }
  PetscCall(VecRestoreArray(v_row, &row_value));
  PetscCall(VecRestoreArray(v, &a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One sweep over the rows that differ, from zero */
static PetscErrorCode sweep(Lagged *s, MatSORType direction)
{
  const PetscReal *b;
  PetscReal       *x;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(s->b_row, &b));
  PetscCall(VecGetArray(s->x_row, &x));
  PetscCall(VecPlaceArray(s->b_own, b));
  PetscCall(VecPlaceArray(s->x_own, x));
  PetscCall(MatSOR(s->square, s->b_own, 1, (MatSORType)(direction | SOR_ZERO_INITIAL_GUESS), 0, 1, 1, s->x_own));
  PetscCall(VecResetArray(s->x_own));
  PetscCall(VecResetArray(s->b_own));
  PetscCall(VecRestoreArray(s->x_row, &x));
  PetscCall(VecRestoreArrayRead(s->b_row, &b));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode apply(PC pc, Vec b, Vec x)
{
  Lagged *s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  if (s->cycle) {
    PetscCall(VCycleApply(s->cycle, b, x));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  if (!s->corrected) {
    PetscCall(PCApply(s->M, b, x));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(VecCopy(b, s->r));
  PetscCall(move_rows(s, PETSC_FALSE, s->r, s->b_row));
  PetscCall(sweep(s, SOR_LOCAL_FORWARD_SWEEP));
  PetscCall(MatMultTranspose(s->rows, s->x_row, s->z)); /* A is symmetric */
  PetscCall(VecAXPY(s->r, -1, s->z));
  PetscCall(VecPointwiseMult(s->r, s->r, s->scale));
  PetscCall(PCApply(s->M, s->r, s->z));
  PetscCall(VecPointwiseMult(x, s->z, s->scale));
  PetscCall(move_rows(s, PETSC_TRUE, x, s->x_row));
  PetscCall(MatMult(s->rows, x, s->x_row));
  PetscCall(VecAXPY(s->b_row, -1, s->x_row));
  PetscCall(sweep(s, SOR_LOCAL_BACKWARD_SWEEP));
  PetscCall(move_rows(s, PETSC_TRUE, x, s->x_row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode view(PC pc, PetscViewer viewer)
{
  Lagged *s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(PetscViewerASCIIPrintf(viewer, "rebuilt when more than %g of the rows have changed:\n", (double)s->keep));
  PetscCall(PetscViewerASCIIPushTab(viewer));
  PetscCall(PCView(s->M, viewer));
  PetscCall(PetscViewerASCIIPopTab(viewer));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode forget_rows(Lagged *s)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(s->row));
  PetscCall(MatDestroy(&s->rows));
  PetscCall(MatDestroy(&s->square));
  PetscCall(VecDestroy(&s->b_row));
  PetscCall(VecDestroy(&s->x_row));
  PetscCall(VecDestroy(&s->b_own));
  PetscCall(VecDestroy(&s->x_own));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy(PC pc)
{
  Lagged *s;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  PetscCall(forget_rows(s));
  PetscCall(PCDestroy(&s->M));
  PetscCall(VCycleDestroy(&s->cycle));
  PetscCall(VecDestroy(&s->before));
  PetscCall(VecDestroy(&s->scale));
  PetscCall(VecDestroy(&s->r));
  PetscCall(VecDestroy(&s->z));
  PetscCall(PetscFree(s));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* D of the present matrix, its rows that differ from the matrix of M, and the share of those that differ much */
static PetscErrorCode compare(Lagged *s, PetscReal *fraction)
{
  PetscReal       *d;
  const PetscReal *before;
  PetscInt         n, count[2] = {0, 0};

  PetscFunctionBeginUser;
  PetscCall(MatGetDiagonal(s->A, s->scale));
  PetscCall(VecGetLocalSize(s->scale, &n));
  PetscCall(VecGetArray(s->scale, &d));
  PetscCall(VecGetArrayRead(s->before, &before));
  PetscCall(PetscMalloc1(n, &s->row));
  s->n = 0;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal ratio = before[i] / d[i];

    if (!(ratio < CHANGED && ratio > 1 / CHANGED)) count[0]++;
    if (!(PetscAbsReal(ratio - 1) < ALIKE)) s->row[s->n++] = i;
    d[i] = PetscSqrtReal(PetscMin(1, ratio));
  }
  PetscCall(VecRestoreArrayRead(s->before, &before));
  PetscCall(VecRestoreArray(s->scale, &d));
  count[1] = n;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, count, 2, MPIU_INT, MPI_SUM, PetscObjectComm((PetscObject)s->A)));
  *fraction = (PetscReal)count[0] / PetscMax(1, count[1]);
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_rows(Lagged *s)
{
  PetscInt begin;
  IS       list, own;
  Mat      block;

  PetscFunctionBeginUser;
  PetscCall(MatGetOwnershipRange(s->A, &begin, NULL));
  PetscCall(ISCreateGeneral(PetscObjectComm((PetscObject)s->A), s->n, s->row, PETSC_COPY_VALUES, &list));
  PetscCall(ISShift(list, begin, list));
  PetscCall(MatCreateSubMatrix(s->A, list, NULL, MAT_INITIAL_MATRIX, &s->rows));
  PetscCall(MatGetDiagonalBlock(s->A, &block));
  PetscCall(ISCreateGeneral(PETSC_COMM_SELF, s->n, s->row, PETSC_COPY_VALUES, &own));
  PetscCall(MatCreateSubMatrix(block, own, own, MAT_INITIAL_MATRIX, &s->square));
  PetscCall(ISDestroy(&own));
  PetscCall(MatCreateVecs(s->rows, NULL, &s->b_row));
  PetscCall(VecDuplicate(s->b_row, &s->x_row));
  PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, s->n, NULL, &s->b_own));
  PetscCall(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, s->n, NULL, &s->x_own));
  PetscCall(ISDestroy(&list));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_M(Lagged *s, MPI_Comm comm, const char prefix[])
{
  PetscFunctionBeginUser;
  PetscCall(PCCreate(comm, &s->M));
  PetscCall(PCSetOptionsPrefix(s->M, prefix));
  PetscCall(PCSetFromOptions(s->M));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* hypre's levels; it goes when they are taken, and comes again for the next */
static PetscErrorCode build_cycle(Lagged *s)
{
  const char *prefix;
  PC          next;

  PetscFunctionBeginUser;
  PetscCall(VCycleDestroy(&s->cycle));
  PetscCall(PCSetOperators(s->M, s->A, s->A));
  PetscCall(PCSetUp(s->M));
  PetscCall(VCycleCreate(s->M, s->A, &s->cycle));
  PetscCall(PCGetOptionsPrefix(s->M, &prefix));
  next = s->M;
  PetscCall(create_M(s, PetscObjectComm((PetscObject)next), prefix));
  PetscCall(PCDestroy(&next));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* M on a matrix of its own: some types, such as GAMG, read theirs in every application, and new values would not fit
   what they estimated of the old ones. */
static PetscErrorCode build(Lagged *s)
{
  Mat A;

  PetscFunctionBeginUser;
  if (!s->before) {
    PetscCall(MatCreateVecs(s->A, &s->before, &s->scale));
    if (!s->cycles) PetscCall(MatCreateVecs(s->A, &s->r, &s->z));
  }
  PetscCall(MatGetDiagonal(s->A, s->before));
  if (s->cycles) {
    PetscCall(build_cycle(s));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
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
  PetscCall(PCGetOptionsPrefix(pc, &prefix));
  PetscCall(create_M(s, PetscObjectComm((PetscObject)pc), prefix));
  PetscCall(VCycleFits(s->M, &s->cycles));
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
  PetscReal fraction = 1;
  PetscBool anew;

  PetscFunctionBeginUser;
  PetscCall(PCShellGetContext(pc, &s));
  s->A = A;
  anew = (PetscBool)(!s->before || s->keep <= 0);
  PetscCall(forget_rows(s));
  if (!anew) {
    PetscCall(compare(s, &fraction));
    anew = (PetscBool)(fraction > s->keep);
  }
  if (anew) PetscCall(build(s));
  else if (s->cycle) PetscCall(VCycleSetMatrix(s->cycle, A, s->scale));
  else PetscCall(take_rows(s));
  s->A         = NULL;
  s->corrected = (PetscBool)!anew;
  PetscFunctionReturn(PETSC_SUCCESS);
}
