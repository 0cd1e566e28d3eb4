/* Devicelevels: see devicelevels.h */
#include "compat.h"
#include "devicelevels.h"
#include "flow/device.h"
#include <petscpc.h>
#include <petscksp.h>

#define LOWEST     60  /* unknowns of the lowest level, about: its inverse is a full matrix */
#define HIGHEST    600 /* and of one that lattices end with */
#define MAX_LEVELS 32  /* levels */
#define POWER      12  /* steps for the largest eigenvalue */
#define LARGER     1.1
#define REGULARISE 1e-8

/* Rows of a matrix, all as long as the longest */
static PetscErrorCode take_sparse(const DeviceQueue *queue, Mat A, DeviceSparse *s)
{
  PetscInt         n, width = 0, length;
  const PetscInt  *col;
  const PetscReal *value;
  int             *column;
  PetscReal       *entry;

  PetscFunctionBeginUser;
  PetscCall(MatGetSize(A, &n, NULL));
  for (PetscInt i = 0; i < n; i++) {
    PetscCall(MatGetRow(A, i, &length, NULL, NULL));
    width = PetscMax(width, length);
    PetscCall(MatRestoreRow(A, i, &length, NULL, NULL));
  }
  PetscCall(PetscCalloc1(width * n, &column));
  PetscCall(PetscCalloc1(width * n, &entry));
  for (PetscInt i = 0; i < n; i++) {
    PetscCall(MatGetRow(A, i, &length, &col, &value));
    for (PetscInt e = 0; e < length; e++) {
      column[e * n + i] = (int)col[e];
      entry[e * n + i]  = value[e];
    }
    PetscCall(MatRestoreRow(A, i, &length, &col, &value));
  }
  *s = (DeviceSparse){.n = (int)n, .width = (int)width};
  PetscCall(DeviceTake(queue, width * n, column, &s->column));
  PetscCall(DeviceTake(queue, width * n, entry, &s->value));
  PetscCall(PetscFree(column));
  PetscCall(PetscFree(entry));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By Gauss-Jordan, which needs no pivoting for definite matrices; a is lost */
static void invert(PetscInt n, PetscReal a[], PetscReal inverse[])
{
  for (PetscInt e = 0; e < n * n; e++) inverse[e] = e % (n + 1) == 0;
  for (PetscInt i = 0; i < n; i++) {
    const PetscReal pivot = a[i * n + i];

    for (PetscInt j = 0; j < n; j++) {
      a[i * n + j] /= pivot;
      inverse[i * n + j] /= pivot;
    }
    for (PetscInt r = 0; r < n; r++) {
      const PetscReal m = a[r * n + i];

      for (PetscInt j = 0; j < n && r != i && m != 0; j++) {
        a[r * n + j] -= m * a[i * n + j];
        inverse[r * n + j] -= m * inverse[i * n + j];
      }
    }
  }
}

/* The inverse of a [n][n], which is lost, as a full matrix; of one that is singular with what it cannot see given a
   value */
static PetscErrorCode take_inverse(const DeviceQueue *queue, PetscInt n, PetscReal a[], PetscBool floating,
                                   DeviceSparse *s)
{
  PetscReal *inverse, mean = 0;
  int       *column;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(n * n, &inverse, n * n, &column));
  for (PetscInt e = 0; e < n * n; e++) column[e] = (int)(e / n);
  for (PetscInt i = 0; i < n; i++) mean += a[i * (n + 1)] / (PetscReal)n;
  for (PetscInt e = 0; e < n * n && floating; e++)
    a[e] += mean / (PetscReal)n + (e % (n + 1) == 0 ? REGULARISE * mean : 0);
  invert(n, a, inverse);
  *s = (DeviceSparse){.n = (int)n, .width = (int)n};
  PetscCall(DeviceTake(queue, n * n, column, &s->column));
  PetscCall(DeviceTake(queue, n * n, inverse, &s->value));
  PetscCall(PetscFree2(inverse, column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_lowest(const DeviceQueue *queue, Mat A, PetscBool floating, DeviceSparse *s)
{
  PetscInt   n;
  PetscReal *a;
  Mat        dense;

  PetscFunctionBeginUser;
  PetscCall(MatGetSize(A, &n, NULL));
  PetscCall(PetscMalloc1(n * n, &a));
  PetscCall(MatConvert(A, MATDENSE, MAT_INITIAL_MATRIX, &dense));
  for (PetscInt e = 0; e < n * n; e++) PetscCall(MatGetValue(dense, e / n, e % n, &a[e]));
  PetscCall(MatDestroy(&dense));
  PetscCall(take_inverse(queue, n, a, floating, s));
  PetscCall(PetscFree(a));
  PetscFunctionReturn(PETSC_SUCCESS);
}

void DeviceLevelsFillNoise(PetscInt n, PetscReal x[])
{
  for (PetscInt i = 0; i < n; i++) x[i] = PetscSinReal(1 + 12.9898 * (PetscReal)i) + (i % 2 ? 0.5 : -0.5);
}

/* A bound of the eigenvalues of D^-1 A, d: its inverse diagonal */
static PetscErrorCode find_largest(Mat A, Vec d, PetscReal *largest)
{
  PetscReal *a, size;
  PetscInt   n;
  Vec        x, y;

  PetscFunctionBeginUser;
  PetscCall(VecDuplicate(d, &x));
  PetscCall(VecDuplicate(d, &y));
  PetscCall(VecGetLocalSize(x, &n));
  PetscCall(VecGetArrayWrite(x, &a));
  DeviceLevelsFillNoise(n, a);
  PetscCall(VecRestoreArrayWrite(x, &a));
  for (PetscInt k = 0; k < POWER; k++) {
    PetscCall(VecNorm(x, NORM_2, &size));
    PetscCall(VecScale(x, 1 / size));
    PetscCall(MatMult(A, x, y));
    PetscCall(VecPointwiseMult(x, d, y));
  }
  PetscCall(VecNorm(x, NORM_2, &size));
  *largest = LARGER * size;
  PetscCall(VecDestroy(&x));
  PetscCall(VecDestroy(&y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* A level that has one below it, to which P leads */
static PetscErrorCode take_level(const DeviceQueue *queue, Mat A, Mat P, DeviceLevel *l)
{
  const PetscReal *host;
  Vec              d;

  PetscFunctionBeginUser;
  PetscCall(take_sparse(queue, A, &l->A));
  PetscCall(take_sparse(queue, P, &l->P));
  PetscCall(MatCreateVecs(A, &d, NULL));
  PetscCall(MatGetDiagonal(A, d));
  PetscCall(VecReciprocal(d));
  PetscCall(find_largest(A, d, &l->largest));
  PetscCall(VecGetArrayRead(d, &host));
  PetscCall(DeviceTake(queue, l->A.n, host, &l->inverse));
  PetscCall(VecRestoreArrayRead(d, &host));
  PetscCall(VecDestroy(&d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode take_work(const DeviceQueue *queue, DeviceLevel *l)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceTake(queue, l->A.n, NULL, &l->x));
  PetscCall(DeviceTake(queue, l->A.n, NULL, &l->y));
  PetscCall(DeviceTake(queue, l->A.n, NULL, &l->b));
  PetscCall(DeviceTake(queue, l->A.n, NULL, &l->d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- where the levels come from ---- */

/* Matrices of n levels, finest first, and P [k] from level k + 1 to level k; references of the caller's */
typedef struct {
  PetscInt n;
  Mat      A[MAX_LEVELS], P[MAX_LEVELS];
} Hierarchy;

static PetscErrorCode clear(Hierarchy *h)
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < h->n; k++) PetscCall(MatDestroy(&h->A[k]));
  for (PetscInt k = 0; k < h->n; k++) PetscCall(MatDestroy(&h->P[k]));
  h->n = 0;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By lattices of twice the width; n = 0 where that does not lead to a small one */
static PetscErrorCode build_geometric(Mat matrix, const DeviceGrid *grid, Hierarchy *h)
{
  DeviceGrid g[2];
  PetscInt   n = grid->n;

  PetscFunctionBeginUser;
  PetscCall(MatConvert(matrix, MATSEQAIJ, MAT_INITIAL_MATRIX, &h->A[0]));
  for (h->n = 1; n > LOWEST && h->n < MAX_LEVELS; h->n++) {
    const PetscInt k = h->n - 1;

    PetscCall(DeviceGridCoarsen(k ? &g[0] : grid, &g[1], &h->P[k]));
    if (k) PetscCall(DeviceGridDestroy(&g[0]));
    g[0] = g[1];
    if (!h->P[k]) break;
    n = g[0].n;
    PetscCall(MatPtAP(h->A[k], h->P[k], MAT_INITIAL_MATRIX, PETSC_DEFAULT, &h->A[k + 1]));
  }
  if (h->n > 1) PetscCall(DeviceGridDestroy(&g[0]));
  if (n > HIGHEST) PetscCall(clear(h));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* By PETSc's aggregation */
static PetscErrorCode build_algebraic(Mat matrix, Hierarchy *h)
{
  PC  pc;
  KSP smoother;

  PetscFunctionBeginUser;
  PetscCall(PCCreate(PetscObjectComm((PetscObject)matrix), &pc));
  PetscCall(PCSetOptionsPrefix(pc, "device_levels_"));
  PetscCall(PCSetType(pc, PCGAMG));
  PetscCall(PCGAMGSetCoarseEqLim(pc, LOWEST));
  PetscCall(PCSetOperators(pc, matrix, matrix));
  PetscCall(PCSetUp(pc));
  PetscCall(PCMGGetLevels(pc, &h->n));
  PetscCheck(h->n <= MAX_LEVELS, PETSC_COMM_SELF, PETSC_ERR_PLIB, "%" PetscInt_FMT " levels", h->n);
  for (PetscInt k = 0; k < h->n; k++) {
    const PetscInt at = h->n - 1 - k; /* PETSc's finest is the last */

    PetscCall(PCMGGetSmoother(pc, at, &smoother));
    PetscCall(KSPGetOperators(smoother, &h->A[k], NULL));
    PetscCall(PetscObjectReference((PetscObject)h->A[k]));
    if (at == 0) continue;
    PetscCall(PCMGGetInterpolation(pc, at, &h->P[k]));
    PetscCall(PetscObjectReference((PetscObject)h->P[k]));
  }
  PetscCall(PCDestroy(&pc));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceLevelsCreate(const DeviceQueue *queue, Mat matrix, const DeviceGrid *grid, PetscBool floating,
                                  PetscInt *n, DeviceLevel *level[], DeviceSparse *lowest)
{
  Hierarchy h = {0};

  PetscFunctionBeginUser;
  *lowest = (DeviceSparse){0};
  if (grid && grid->at) PetscCall(build_geometric(matrix, grid, &h));
  if (h.n > 1) PetscCall(take_sparse(queue, h.A[h.n - 1], lowest));
  if (!h.n) PetscCall(build_algebraic(matrix, &h));
  *n = h.n;
  PetscCall(PetscCalloc1(h.n, level));
  for (PetscInt k = 0; k < h.n; k++) {
    DeviceLevel *l = *level + k;

    if (k == h.n - 1) PetscCall(take_lowest(queue, h.A[k], floating, &l->A));
    else PetscCall(take_level(queue, h.A[k], h.P[k], l));
    PetscCall(take_work(queue, l));
  }
  PetscCall(clear(&h));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- changes, there ---- */

static PetscErrorCode free_changes(CoarseChanges *c)
{
  PetscFunctionBeginUser;
  PetscCall(PetscFree(c->cell));
  PetscCall(PetscFree(c->change));
  PetscCall(PetscFree(c->row));
  PetscCall(PetscFree(c->column));
  PetscCall(PetscFree(c->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceLevelsChange(Flow flow, Coarse coarse, const DeviceTransfer *transfer, DeviceSparse *A)
{
  const DeviceQueue *q = FlowGetQueue(flow);
  CoarseChanges      c;
  const int         *cell, *row, *column;
  double            *change, *value;

  PetscFunctionBeginUser;
  PetscCall(CoarseTakeChanges(coarse, &c));
  PetscCall(DeviceTakeInts(q, c.n, c.cell, &cell));
  PetscCall(DeviceTake(q, c.n * 3, c.change, &change));
  PetscCall(FlowAddBoxesOnDevice(flow, transfer, c.n, cell, change, A));
  PetscCall(DeviceTakeInts(q, c.nentry, c.row, &row));
  PetscCall(DeviceTakeInts(q, c.nentry, c.column, &column));
  PetscCall(DeviceTake(q, c.nentry, c.value, &value));
  PetscCallDevice(q, (*q->run->vertices.add_entries)(q, (int)c.nentry, row, column, value, A));
  PetscCall(DeviceFree(q, &cell));
  PetscCall(DeviceFree(q, &change));
  PetscCall(DeviceFree(q, &row));
  PetscCall(DeviceFree(q, &column));
  PetscCall(DeviceFree(q, &value));
  PetscCall(free_changes(&c));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* As find_largest; work vectors of the level are lost */
static PetscErrorCode update_largest(const DeviceQueue *q, const double noise[], double sums[], DeviceLevel *l)
{
  const size_t n = (size_t)l->A.n;
  double      *x = l->x, *y = l->d, square, before = 0;

  PetscFunctionBeginUser;
  PetscCallDevice(q, (*q->run->combine)(q, n, 1, &noise, (double[]){1}, NULL, x));
  PetscCallDevice(q, (*q->run->zero)(q, n * sizeof(double), l->b));
  l->largest = 1;
  for (PetscInt k = 0; k < POWER; k++) { /* y = -D^-1 A x over what is the eigenvalue so far */
    const PetscReal       scale = 1 / l->largest;
    const DeviceChebyshev step  = {.c2 = scale, .b = l->b, .x = x, .d = y, .x_new = l->y};

    PetscCallDevice(q, (*q->run->smooth_sparse)(q, &l->A, l->inverse, &step));
    PetscCallDevice(q, (*q->run->dot)(q, n, y, y, NULL, NULL, sums, sums + DEVICE_PARTIAL));
    PetscCallDevice(q, (*q->run->download)(q, sizeof(square), sums + DEVICE_PARTIAL, &square));
    if (k > 0) l->largest = PetscSqrtReal(square / before) / scale;
    before = square;
    x      = y;
    y      = x == l->d ? l->x : l->d;
  }
  l->largest *= LARGER;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The lowest level's inverse is the host's: some dozens of unknowns */
static PetscErrorCode update_lowest(const DeviceQueue *q, const DeviceSparse *lowest, PetscBool floating,
                                    DeviceSparse *inverse)
{
  const PetscInt n = lowest->n, all = n * lowest->width;
  PetscReal     *a, *value;
  int           *column;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(n * n, &a));
  PetscCall(PetscMalloc2(all, &value, all, &column));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)all * sizeof(*value), lowest->value, value));
  PetscCallDevice(q, (*q->run->download)(q, (size_t)all * sizeof(*column), lowest->column, column));
  for (PetscInt e = 0; e < all; e++) a[e % n * n + column[e]] += value[e];
  PetscCall(DeviceSparseDestroy(q, inverse));
  PetscCall(take_inverse(q, n, a, floating, inverse));
  PetscCall(PetscFree(a));
  PetscCall(PetscFree2(value, column));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceLevelsUpdate(const DeviceQueue *q, PetscInt n, DeviceLevel level[], DeviceSparse *lowest,
                                  PetscBool floating, const double noise[], double sums[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < n - 1; k++) {
    DeviceLevel *l = level + k;

    PetscCallDevice(q, (*q->run->vertices.coarsen)(q, &l->A, &l->P, k == n - 2 ? lowest : &level[k + 1].A));
    PetscCallDevice(q, (*q->run->vertices.invert_sparse)(q, &l->A, (double *)l->inverse));
    PetscCall(update_largest(q, noise, sums, l));
  }
  PetscCall(update_lowest(q, lowest, floating, &level[n - 1].A));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceSparseDestroy(const DeviceQueue *queue, DeviceSparse *s)
{
  PetscFunctionBeginUser;
  PetscCall(DeviceFree(queue, &s->column));
  PetscCall(DeviceFree(queue, &s->value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode DeviceLevelsDestroy(const DeviceQueue *queue, PetscInt n, DeviceLevel *level[])
{
  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < n; k++) {
    DeviceLevel *l = *level + k;

    PetscCall(DeviceSparseDestroy(queue, &l->A));
    PetscCall(DeviceSparseDestroy(queue, &l->P));
    PetscCall(DeviceFree(queue, &l->inverse));
    PetscCall(DeviceFree(queue, &l->x));
    PetscCall(DeviceFree(queue, &l->y));
    PetscCall(DeviceFree(queue, &l->b));
    PetscCall(DeviceFree(queue, &l->d));
  }
  PetscCall(PetscFree(*level));
  PetscFunctionReturn(PETSC_SUCCESS);
}
