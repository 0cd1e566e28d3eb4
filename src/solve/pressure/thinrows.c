/* ThinRows: see thinrows.h. */
#include "compat.h"
#include "thinrows.h"
#include "base/array.h"

typedef struct {
  PetscInt   n, capacity, *col; /* columns of a group */
  PetscReal *w;                 /* [n][nr] */
} Group;

/* Rows one after the other */
typedef struct {
  PetscInt   n, capacity, *start, *col; /* entries; start [rows + 1] */
  PetscReal *value;
} Entries;

static PetscErrorCode read_group(Mat W, PetscInt first, PetscInt nr, Group *g)
{
  PetscFunctionBeginUser;
  for (PetscInt s = 0; s < nr; s++) {
    PetscInt           n;
    const PetscInt    *col;
    const PetscScalar *value;

    PetscCall(MatGetRow(W, first + s, &n, &col, &value));
    if (s == 0) {
      g->n = n;
      PetscCall(ArrayReserve(n, &g->capacity, &g->col, sizeof(*g->col), &g->w, nr * sizeof(*g->w), NULL));
      PetscCall(PetscArraycpy(g->col, col, n));
    }
    PetscCheck(n == g->n, PETSC_COMM_SELF, PETSC_ERR_ARG_INCOMP,
               "Rows %" PetscInt_FMT " and %" PetscInt_FMT " have other columns", first, first + s);
    for (PetscInt i = 0; i < n; i++) g->w[i * nr + s] = value[i];
    PetscCall(MatRestoreRow(W, first + s, &n, &col, &value));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscReal norm(PetscInt nr, const PetscReal w[])
{
  PetscReal square = 0;

  for (PetscInt s = 0; s < nr; s++) square += PetscSqr(w[s]);
  return PetscSqrtReal(square);
}

/* Drop the small columns */
static void thin_group(PetscInt nr, PetscReal tol, Group *g)
{
  PetscReal largest = 0, lost[6] = {0}, size[6] = {0};
  PetscInt  kept = 0;

  for (PetscInt i = 0; i < g->n; i++) largest = PetscMax(largest, norm(nr, g->w + i * nr));
  for (PetscInt i = 0; i < g->n; i++) {
    const PetscReal *w    = g->w + i * nr;
    const PetscBool  stay = (PetscBool)(norm(nr, w) > tol * largest);

    for (PetscInt s = 0; s < nr; s++) {
      if (stay) size[s] += PetscAbsReal(w[s]);
      else lost[s] += w[s];
      g->w[kept * nr + s] = w[s];
    }
    g->col[kept] = g->col[i];
    kept += stay;
  }
  g->n = kept;
  for (PetscInt e = 0; e < kept * nr; e++)
    if (size[e % nr] > 0) g->w[e] += lost[e % nr] / size[e % nr] * PetscAbsReal(g->w[e]);
}

/* V = W with every square times the weight of its column */
static PetscErrorCode weighted(Mat W, Vec weight, Mat *V)
{
  Vec root;

  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(weight, &root));
  PetscCall(VecCopy(weight, root));
  PetscCall(VecSqrtAbs(root));
  PetscCall(MatDuplicate(W, MAT_COPY_VALUES, V));
  PetscCall(MatDiagonalScale(*V, NULL, root));
  PetscCall(VecDestroy(&root));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The largest sum of squares of nr rows */
static PetscErrorCode measure_group(Mat V, PetscInt first, PetscInt nr, PetscReal *largest)
{
  PetscFunctionBeginUser;
  *largest = 0;
  for (PetscInt s = 0; s < nr; s++) {
    PetscInt           n;
    PetscReal          sum = 0;
    const PetscScalar *value;

    PetscCall(MatGetRow(V, first + s, &n, NULL, &value));
    for (PetscInt i = 0; i < n; i++) sum += PetscSqr(value[i]);
    PetscCall(MatRestoreRow(V, first + s, &n, NULL, &value));
    *largest = PetscMax(*largest, sum);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode add_group(const Group *g, PetscInt row, PetscInt nr, Entries *all)
{
  PetscFunctionBeginUser;
  PetscCall(ArrayReserve(all->n + g->n * nr, &all->capacity, &all->col, sizeof(*all->col), &all->value,
                         sizeof(*all->value), NULL));
  for (PetscInt s = 0; s < nr; s++) {
    for (PetscInt i = 0; i < g->n; i++) {
      all->col[all->n]     = g->col[i];
      all->value[all->n++] = g->w[i * nr + s];
    }
    all->start[row + s + 1] = all->n;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ThinRows(Mat W, const ThinRule *rule, Vec weight, Mat *thin)
{
  const PetscInt nr = rule->nr;
  PetscInt       begin, end, ncol, any;
  Group          g   = {0};
  Entries        all = {0};
  Mat            V;

  PetscFunctionBeginUser;
  *thin = NULL;
  PetscCall(weighted(W, weight, &V));
  PetscCall(MatGetOwnershipRange(W, &begin, &end));
  PetscCall(PetscCalloc1(end - begin + 1, &all.start));
  for (PetscInt row = begin; row < end; row += nr) {
    PetscReal size;

    PetscCall(measure_group(V, row, nr, &size));
    PetscCall(read_group(W, row, nr, &g));
    thin_group(nr, rule->tol / PetscSqrtReal(PetscMax(1, size)), &g);
    if (g.n > rule->max || (g.n > rule->few && size * PetscPowReal(g.n, rule->power) <= rule->weak)) g.n = 0;
    PetscCall(add_group(&g, row - begin, nr, &all));
  }
  any = all.n > 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &any, 1, MPIU_INT, MPI_MAX, PetscObjectComm((PetscObject)W)));
  if (any) {
    PetscCall(MatGetLocalSize(W, NULL, &ncol));
    PetscCall(MatCreate(PetscObjectComm((PetscObject)W), thin));
    PetscCall(MatSetSizes(*thin, end - begin, ncol, PETSC_DETERMINE, PETSC_DETERMINE));
    PetscCall(MatSetType(*thin, MATAIJ));
    PetscCall(MatSeqAIJSetPreallocationCSR(*thin, all.start, all.col, all.value));
    PetscCall(MatMPIAIJSetPreallocationCSR(*thin, all.start, all.col, all.value));
  }
  PetscCall(MatDestroy(&V));
  PetscCall(PetscFree(g.col));
  PetscCall(PetscFree(g.w));
  PetscCall(PetscFree(all.start));
  PetscCall(PetscFree(all.col));
  PetscCall(PetscFree(all.value));
  PetscFunctionReturn(PETSC_SUCCESS);
}
