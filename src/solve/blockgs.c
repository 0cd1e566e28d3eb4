/* BlockGS: see blockgs.h. Rows are sums over their blocks, column by column as PETSc stores them: one column is one
   vector of four numbers, of which the fourth is read for nothing when blocks have three rows. */
#include "compat.h"
#include "blockgs.h"
#include "base/algebra.h"
#include "rowpool.h"

#define MAX_NK   4
#define RANK(nk) ((nk) == 3 ? 3 : 6) /* columns of a block of the low-rank part: rigid motions in 2 and 3 dimensions */
#define SLACK    4                   /* numbers behind the end of an array that a vector may read */

typedef double wide __attribute__((vector_size(32)));
typedef float  narrow __attribute__((vector_size(16), aligned(4)));

typedef struct {
  Mat              A, part[2]; /* whole matrix; own and other columns (NULL on one rank) */
  PetscInt         nk, n;      /* block size, own block rows */
  const PetscInt  *start[2], *column[2];
  RowPool          own;             /* values of own columns: blocks [nk][nk] column by column */
  float           *other, *inverse; /* of other columns, [blocks][nk][nk]; [n][nk][nk]; likewise */
  PetscInt         nghost;
  PetscReal       *ghost, *rest; /* [nghost][nk]; [n][nk] right-hand side less what other ranks' unknowns do */
  PetscSF          sf;
  MPI_Datatype     unit;  /* nk reals */
  const PetscReal *extra; /* [n][nk][nk] or NULL, see BlockGSSetExtra */
  /* W, see BlockGSSetLowRank */
  PetscInt   nt, nw, *w_row, *w_column;
  Sharing    sharing; /* of the block columns, borrowed */
  PetscBool  any;     /* a part of low rank has been set */
  PetscReal *w, *t;   /* [nw][nk][nr]; [nt] W^T x, nr numbers for every block column */
  PetscReal *factor;  /* [ncolumn] what a sweep multiplies the column's part by: ranks that sweep it at the same time */
} BlockGS;

#define INLINE static inline __attribute__((always_inline))

INLINE wide load_column(const float *v)
{
  return __builtin_convertvector(*(const narrow *)v, wide);
}

/* Sum of the first n own blocks of row i times x; one sum a column, so that additions do not wait for each other */
INLINE wide sum_row(const int nk, const BlockGS *restrict g, PetscInt i, PetscInt n, const PetscReal *x)
{
  const PetscInt *column    = g->column[0] + g->start[0][i];
  const float    *value     = g->own.value + g->own.at[i] * nk * nk;
  wide            s[MAX_NK] = {{0}};

  for (PetscInt q = 0; q < n; q++)
    for (int m = 0; m < nk; m++) s[m] += load_column(value + (q * nk + m) * nk) * x[column[q] * nk + m];
  return nk == 3 ? s[0] + s[1] + s[2] : s[0] + s[1] + (s[2] + s[3]);
}

/* r -= w t, what the low-rank part has in a row */
INLINE void subtract_low_rank(const int nk, const BlockGS *restrict g, PetscInt e, PetscReal *restrict r)
{
  const int        nr = RANK(nk);
  const PetscReal *t = g->t + g->w_column[e] * nr, *w = g->w + e * nk * nr;

  for (int k = 0; k < nk; k++)
    for (int m = 0; m < nr; m++) r[k] -= w[k * nr + m] * t[m];
}

/* t += factor w^T d */
INLINE void add_to_low_rank(const int nk, const BlockGS *restrict g, PetscInt e, PetscReal factor, const PetscReal *restrict d)
{
  const int        nr = RANK(nk);
  PetscReal       *t  = g->t + g->w_column[e] * nr;
  const PetscReal *w  = g->w + e * nk * nr;

  for (int k = 0; k < nk; k++)
    for (int m = 0; m < nr; m++) t[m] += factor * w[k * nr + m] * d[k];
}

/* lower: only blocks before the diagonal, the rest of x is zero. Entries of W are met row by row; t follows x. */
INLINE void sweep(const int nk, const BlockGS *restrict g, PetscBool forward, PetscBool lower, const PetscReal *b, PetscReal *x)
{
  const PetscInt step = forward ? 1 : -1;
  PetscInt       at   = forward ? 0 : g->nw - 1;

  for (PetscInt r = 0; r < g->n; r++) {
    const PetscInt i = forward ? r : g->n - 1 - r, first = at;
    PetscInt       end = g->start[0][i + 1];
    PetscReal      rest[MAX_NK];
    wide           s, d = {0};

    if (lower)
      for (end = g->start[0][i]; g->column[0][end] < i;) end++;
    s = sum_row(nk, g, i, end - g->start[0][i], x);
    for (int k = 0; k < nk; k++) rest[k] = b[i * nk + k] - s[k];
    for (; at >= 0 && at < g->nw && g->w_row[at] == i; at += step) subtract_low_rank(nk, g, at, rest);
    for (int m = 0; m < nk; m++) d += load_column(g->inverse + (i * nk + m) * nk) * rest[m];
    for (int k = 0; k < nk; k++) rest[k] = d[k];
    for (int k = 0; k < nk; k++) x[i * nk + k] += rest[k];
    for (PetscInt e = first; e != at; e += step) add_to_low_rank(nk, g, e, g->factor[g->w_column[e]], rest);
  }
}

INLINE void multiply(const int nk, const BlockGS *restrict g, const PetscReal *restrict x, PetscReal *restrict y)
{
  for (PetscInt i = 0; i < g->n; i++) {
    const wide s = sum_row(nk, g, i, g->start[0][i + 1] - g->start[0][i], x);

    for (int k = 0; k < nk; k++) y[i * nk + k] = s[k];
  }
}

/* y += scale times the part of other ranks' columns */
static void add_ghosts(const BlockGS *g, PetscReal scale, PetscReal y[])
{
  const PetscInt nk = g->nk;

  for (PetscInt i = 0; i < g->n; i++)
    for (PetscInt q = g->start[1][i]; q < g->start[1][i + 1]; q++)
      for (PetscInt m = 0; m < nk; m++)
        for (PetscInt k = 0; k < nk; k++) y[i * nk + k] += scale * g->other[(q * nk + m) * nk + k] * g->ghost[g->column[1][q] * nk + m];
}

/* t = W^T x over all ranks. Collective. */
static PetscErrorCode gather_low_rank(BlockGS *g, const PetscReal x[])
{
  PetscFunctionBeginUser;
  if (!g->any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(g->t, g->nt));
  for (PetscInt e = 0; e < g->nw; e++) {
    if (g->nk == 3) add_to_low_rank(3, g, e, 1, x + g->w_row[e] * 3);
    else add_to_low_rank(4, g, e, 1, x + g->w_row[e] * 4);
  }
  PetscCall(SharingSum(g->sharing, RANK(g->nk), g->t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSMultiplySparse(Mat shell, Vec x, Vec y)
{
  BlockGS         *g;
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArrayWrite(y, &ya));
  if (g->sf) PetscCall(PetscSFBcastBegin(g->sf, g->unit, xa, g->ghost, MPI_REPLACE));
  if (g->nk == 3) multiply(3, g, xa, ya);
  else multiply(4, g, xa, ya);
  if (g->sf) {
    PetscCall(PetscSFBcastEnd(g->sf, g->unit, xa, g->ghost, MPI_REPLACE));
    add_ghosts(g, 1, ya);
  }
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecRestoreArrayWrite(y, &ya));
  PetscCall(PetscLogFlops(2.0 * g->nk * g->nk * g->start[0][g->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode mult_blocks(Mat shell, Vec x, Vec y)
{
  BlockGS         *g;
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(BlockGSMultiplySparse(shell, x, y));
  PetscCall(MatShellGetContext(shell, &g));
  if (g->nt == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArray(y, &ya));
  PetscCall(gather_low_rank(g, xa));
  for (PetscInt i = 0; i < g->nt; i++) g->t[i] = -g->t[i];
  for (PetscInt e = 0; e < g->nw; e++) {
    if (g->nk == 3) subtract_low_rank(3, g, e, ya + g->w_row[e] * 3);
    else subtract_low_rank(4, g, e, ya + g->w_row[e] * 4);
  }
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecRestoreArray(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Other ranks' unknowns stay as they are in a sweep: their part goes to the right-hand side. Collective. */
static PetscErrorCode subtract_ghosts(BlockGS *g, const PetscReal x[], const PetscReal *b[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(g->sf, g->unit, x, g->ghost, MPI_REPLACE));
  PetscCall(PetscArraycpy(g->rest, *b, g->n * g->nk));
  PetscCall(PetscSFBcastEnd(g->sf, g->unit, x, g->ghost, MPI_REPLACE));
  add_ghosts(g, -1, g->rest);
  *b = g->rest;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sweep_blocks(Mat shell, Vec bv, PetscReal omega, MatSORType flag, PetscReal shift, PetscInt its, PetscInt lits, Vec xv)
{
  BlockGS         *g;
  const PetscReal *b, *rhs;
  PetscReal       *x;
  PetscBool        zero         = (PetscBool)((flag & SOR_ZERO_INITIAL_GUESS) != 0);
  const PetscBool  direction[2] = {(PetscBool)((flag & (SOR_FORWARD_SWEEP | SOR_LOCAL_FORWARD_SWEEP)) != 0),
                                   (PetscBool)((flag & (SOR_BACKWARD_SWEEP | SOR_LOCAL_BACKWARD_SWEEP)) != 0)};

  PetscFunctionBeginUser;
  PetscCheck(omega == 1 && shift == 0, PetscObjectComm((PetscObject)shell), PETSC_ERR_SUP,
             "The pressure sweep knows no over-relaxation or shift (omega %g, shift %g): leave ..._pc_sor_omega at 1 or choose another smoother",
             (double)omega, (double)shift);
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(VecGetArrayRead(bv, &b));
  PetscCall(VecGetArray(xv, &x));
  rhs = b;
  PetscCheck(its == 1 || !g->sf, PetscObjectComm((PetscObject)shell), PETSC_ERR_SUP,
             "The pressure sweep is done once a call on several ranks: leave ..._pc_sor_its at 1");
  if (zero) {
    PetscCall(PetscArrayzero(x, g->n * g->nk));
    PetscCall(PetscArrayzero(g->t, g->nt));
  } else {
    if (g->sf) PetscCall(subtract_ghosts(g, x, &rhs));
    PetscCall(gather_low_rank(g, x));
  }
  for (PetscInt it = 0; it < its * lits; it++) {
    for (int back = 0; back < 2; back++) {
      if (!direction[back]) continue;
      if (g->nk == 3) sweep(3, g, (PetscBool)!back, (PetscBool)(zero && !back), rhs, x);
      else sweep(4, g, (PetscBool)!back, (PetscBool)(zero && !back), rhs, x);
      zero = PETSC_FALSE;
    }
  }
  PetscCall(VecRestoreArray(xv, &x));
  PetscCall(VecRestoreArrayRead(bv, &b));
  PetscCall(PetscLogFlops(2.0 * its * lits * g->nk * g->nk * g->start[0][g->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The inverse of the diagonal block of row i, with the entries [begin, end) of W in this row and the extra part */
static void invert_diagonal(BlockGS *g, PetscInt i, const PetscReal value[], PetscInt begin, PetscInt end)
{
  const PetscInt nk = g->nk, nn = nk * nk, nr = RANK(nk);
  PetscReal      block[MAX_NK * MAX_NK], inverse[MAX_NK * MAX_NK];
  PetscInt       q = g->start[0][i];

  while (g->column[0][q] != i) q++;
  for (PetscInt e = 0; e < nn; e++) block[e] = value[q * nn + e];
  for (PetscInt e = begin; e < end; e++)
    for (PetscInt k = 0; k < nn; k++)
      for (PetscInt m = 0; m < nr; m++) block[k] += g->factor[g->w_column[e]] * g->w[(e * nk + k / nk) * nr + m] * g->w[(e * nk + k % nk) * nr + m];
  for (PetscInt e = 0; e < nn && g->extra; e++) block[e] += g->extra[i * nn + e];
  DenseInvert(nk, block, inverse); /* the transpose of the inverse is the inverse of the transpose */
  for (PetscInt e = 0; e < nn; e++) g->inverse[i * nn + e] = (float)inverse[e];
}

/* One row of both parts, and the inverse of its diagonal block */
static PetscErrorCode copy_row(BlockGS *g, PetscInt i, PetscReal *const value[2], PetscBool many)
{
  const PetscInt nn = g->nk * g->nk, begin = g->start[0][i];

  PetscFunctionBeginUser;
  PetscCall(RowPoolSet(&g->own, i, g->start[0][i + 1] - begin, value[0] + begin * nn, many));
  if (g->part[1])
    for (PetscInt e = g->start[1][i] * nn; e < g->start[1][i + 1] * nn; e++) g->other[e] = (float)value[1][e];
  invert_diagonal(g, i, value[0], 0, 0);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSUpdate(Mat shell, PetscInt n, const PetscInt rows[])
{
  BlockGS   *g;
  PetscReal *value[2] = {NULL, NULL};

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  for (PetscInt s = 0; s < 2 && g->part[s]; s++) PetscCall(MatSeqBAIJGetArray(g->part[s], &value[s]));
  if (!rows) n = g->n;
  if (n == g->n) RowPoolClear(&g->own);
  for (PetscInt r = 0; r < n; r++) PetscCall(copy_row(g, rows ? rows[r] : r, value, (PetscBool)(2 * n > g->n)));
  for (PetscInt s = 0; s < 2 && g->part[s]; s++) PetscCall(MatSeqBAIJRestoreArray(g->part[s], &value[s]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSSetExtra(Mat shell, const PetscReal extra[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  g->extra = extra;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Give up W; rows that had a part of it get the inverses of their own blocks. */
static PetscErrorCode drop_low_rank(BlockGS *g)
{
  PetscReal *value;

  PetscFunctionBeginUser;
  PetscCall(MatSeqBAIJGetArray(g->part[0], &value));
  for (PetscInt e = 0; e < g->nw; e++) invert_diagonal(g, g->w_row[e], value, 0, 0);
  PetscCall(MatSeqBAIJRestoreArray(g->part[0], &value));
  PetscCall(PetscFree5(g->w_row, g->w_column, g->w, g->t, g->factor));
  g->nw = g->nt = 0;
  g->any        = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSSetLowRank(Mat shell, Sharing sharing, PetscInt ncolumn, PetscInt n, const PetscInt row[], const PetscInt column[],
                                 const PetscReal w[])
{
  BlockGS   *g;
  PetscReal *value;
  PetscInt   nr;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(drop_low_rank(g));
  nr         = RANK(g->nk);
  g->nt      = ncolumn * nr;
  g->nw      = n;
  g->any     = (PetscBool)(sharing != NULL);
  g->sharing = sharing;
  PetscCall(PetscMalloc5(n, &g->w_row, n, &g->w_column, n * g->nk * nr, &g->w, g->nt, &g->t, ncolumn, &g->factor));
  PetscCall(PetscArraycpy(g->w_row, row, n));
  PetscCall(PetscArraycpy(g->w_column, column, n));
  PetscCall(PetscArraycpy(g->w, w, n * g->nk * nr));
  PetscCall(PetscArrayzero(g->factor, ncolumn));
  for (PetscInt e = 0; e < n; e++) g->factor[column[e]] = 1;
  PetscCall(SharingSum(sharing, 1, g->factor));
  PetscCall(MatSeqBAIJGetArray(g->part[0], &value));
  for (PetscInt begin = 0, end = 0; begin < n; begin = end) {
    while (end < n && row[end] == row[begin]) end++;
    invert_diagonal(g, row[begin], value, begin, end);
  }
  PetscCall(MatSeqBAIJRestoreArray(g->part[0], &value));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_blocks(Mat shell)
{
  BlockGS  *g;
  PetscInt  n;
  PetscBool done;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  for (PetscInt s = 0; s < 2 && g->part[s]; s++)
    PetscCall(MatRestoreRowIJ(g->part[s], 0, PETSC_FALSE, PETSC_TRUE, &n, &g->start[s], &g->column[s], &done));
  PetscCall(RowPoolDestroy(&g->own));
  PetscCall(PetscFree(g->other));
  PetscCall(PetscFree(g->inverse));
  PetscCall(PetscFree2(g->ghost, g->rest));
  PetscCall(PetscFree5(g->w_row, g->w_column, g->w, g->t, g->factor));
  PetscCall(PetscSFDestroy(&g->sf));
  PetscCallMPI(MPI_Type_free(&g->unit));
  PetscCall(MatDestroy(&g->A));
  PetscCall(PetscFree(g));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_exchange(BlockGS *g, const PetscInt global[])
{
  PetscLayout rows;
  PetscInt    n;

  PetscFunctionBeginUser;
  PetscCall(MatGetSize(g->part[1], NULL, &n));
  g->nghost = n / g->nk;
  PetscCall(PetscMalloc2(n, &g->ghost, g->n * g->nk, &g->rest));
  PetscCall(PetscLayoutCreate(PetscObjectComm((PetscObject)g->A), &rows));
  PetscCall(PetscLayoutSetLocalSize(rows, g->n));
  PetscCall(PetscLayoutSetUp(rows));
  PetscCall(PetscSFCreate(PetscObjectComm((PetscObject)g->A), &g->sf));
  PetscCall(PetscSFSetGraphLayout(g->sf, rows, g->nghost, NULL, PETSC_OWN_POINTER, global));
  PetscCall(PetscSFSetUp(g->sf));
  PetscCall(PetscLayoutDestroy(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSCreate(Mat A, Mat *shell)
{
  BlockGS        *g;
  const PetscInt *global = NULL;
  PetscInt        m, n, nk;
  PetscBool       seq, mpi, done;

  PetscFunctionBeginUser;
  PetscCall(PetscObjectTypeCompare((PetscObject)A, MATSEQBAIJ, &seq));
  PetscCall(PetscObjectTypeCompare((PetscObject)A, MATMPIBAIJ, &mpi));
  PetscCall(MatGetBlockSize(A, &nk));
  PetscCheck((seq || mpi) && (nk == 3 || nk == 4), PetscObjectComm((PetscObject)A), PETSC_ERR_ARG_WRONG,
             "Block Gauss-Seidel needs a BAIJ matrix with blocks of 3 or 4, not of %" PetscInt_FMT, nk);
  PetscCall(PetscNew(&g));
  g->nk = nk;
  PetscCall(PetscObjectReference((PetscObject)A));
  g->A       = A;
  g->part[0] = A;
  if (mpi) PetscCall(MatMPIBAIJGetSeqBAIJ(A, &g->part[0], &g->part[1], &global));
  for (PetscInt s = 0; s < 2 && g->part[s]; s++) {
    PetscCall(MatGetRowIJ(g->part[s], 0, PETSC_FALSE, PETSC_TRUE, &g->n, &g->start[s], &g->column[s], &done));
    PetscCheck(done, PETSC_COMM_SELF, PETSC_ERR_SUP, "The rows of a block matrix are not accessible");
  }
  PetscCall(RowPoolCreate(g->n, nk * nk, &g->own));
  if (g->part[1]) PetscCall(PetscCalloc1(g->start[1][g->n] * nk * nk, &g->other));
  PetscCall(PetscCalloc1(g->n * g->nk * g->nk + SLACK, &g->inverse));
  PetscCallMPI(MPI_Type_contiguous((PetscMPIInt)g->nk, MPIU_REAL, &g->unit));
  PetscCallMPI(MPI_Type_commit(&g->unit));
  if (mpi) PetscCall(create_exchange(g, global));
  PetscCall(MatGetLocalSize(A, &m, &n));
  PetscCall(MatCreateShell(PetscObjectComm((PetscObject)A), m, n, PETSC_DETERMINE, PETSC_DETERMINE, g, shell));
  PetscCall(MatShellSetOperation(*shell, MATOP_MULT, (void (*)(void))mult_blocks));
  PetscCall(MatShellSetOperation(*shell, MATOP_SOR, (void (*)(void))sweep_blocks));
  PetscCall(MatShellSetOperation(*shell, MATOP_DESTROY, (void (*)(void))destroy_blocks));
  PetscFunctionReturn(PETSC_SUCCESS);
}
