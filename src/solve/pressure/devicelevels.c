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

/* The inverse of A as a full matrix; of one that is singular with what it cannot see given a value */
static PetscErrorCode take_inverse(const DeviceQueue *queue, Mat A, PetscBool floating, DeviceSparse *s)
{
  PetscInt   n;
  PetscReal *a, *inverse, mean = 0;
  int       *column;
  Mat        dense;

  PetscFunctionBeginUser;
  PetscCall(MatGetSize(A, &n, NULL));
  PetscCall(PetscMalloc3(n * n, &a, n * n, &inverse, n * n, &column));
  PetscCall(MatConvert(A, MATDENSE, MAT_INITIAL_MATRIX, &dense));
  for (PetscInt e = 0; e < n * n; e++) {
    PetscCall(MatGetValue(dense, e / n, e % n, &a[e]));
    column[e] = (int)(e / n);
  }
  PetscCall(MatDestroy(&dense));
  for (PetscInt i = 0; i < n; i++) mean += a[i * (n + 1)] / (PetscReal)n;
  for (PetscInt e = 0; e < n * n && floating; e++)
    a[e] += mean / (PetscReal)n + (e % (n + 1) == 0 ? REGULARISE * mean : 0);
  invert(n, a, inverse);
  *s = (DeviceSparse){.n = (int)n, .width = (int)n};
  PetscCall(DeviceTake(queue, n * n, column, &s->column));
  PetscCall(DeviceTake(queue, n * n, inverse, &s->value));
  PetscCall(PetscFree3(a, inverse, column));
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
                                  PetscInt *n, DeviceLevel *level[])
{
  Hierarchy h = {0};

  PetscFunctionBeginUser;
  if (grid && grid->at) PetscCall(build_geometric(matrix, grid, &h));
  if (!h.n) PetscCall(build_algebraic(matrix, &h));
  *n = h.n;
  PetscCall(PetscCalloc1(h.n, level));
  for (PetscInt k = 0; k < h.n; k++) {
    DeviceLevel *l = *level + k;

    if (k == h.n - 1) PetscCall(take_inverse(queue, h.A[k], floating, &l->A));
    else PetscCall(take_level(queue, h.A[k], h.P[k], l));
    PetscCall(take_work(queue, l));
  }
  PetscCall(clear(&h));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode drop_sparse(const DeviceQueue *queue, DeviceSparse *s)
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

    PetscCall(drop_sparse(queue, &l->A));
    PetscCall(drop_sparse(queue, &l->P));
    PetscCall(DeviceFree(queue, &l->inverse));
    PetscCall(DeviceFree(queue, &l->x));
    PetscCall(DeviceFree(queue, &l->y));
    PetscCall(DeviceFree(queue, &l->b));
    PetscCall(DeviceFree(queue, &l->d));
  }
  PetscCall(PetscFree(*level));
  PetscFunctionReturn(PETSC_SUCCESS);
}
