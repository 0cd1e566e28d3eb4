/* BlockGS: see blockgs.h. Rows are sums over their blocks, stored column by column: one column is one vector of four
   numbers, of which the fourth is read for nothing when blocks have three rows. */
#include "compat.h"
#include "blockgs.h"
#include "base/algebra.h"
#include "base/inline.h"
#include "base/rowtype.h"
#include "blockgsimpl.h"

#define MAX_NK   4
#define RANK(nk) ((nk) == 3 ? 3 : 6) /* columns of a block of the low-rank part: rigid motions in 2 and 3 dimensions */
#define SLACK    4                   /* numbers behind the end of an array that a vector may read */

typedef double wide __attribute__((vector_size(32)));
typedef double loose __attribute__((vector_size(32), aligned(8)));
typedef float  narrow __attribute__((vector_size(16), aligned(4)));

INLINE wide load_column(const float *v)
{
  return __builtin_convertvector(*(const narrow *)v, wide);
}

/* Sum of the blocks [begin, end) of row i times x, whose columns begin at `first`; one sum a column, so that additions
   do not wait for each other. exact: of the entries as they are. */
INLINE wide sum_row(const int nk, const PetscBool exact, const BlockGS *restrict g, PetscInt i, PetscInt begin,
                    PetscInt end, PetscInt first, const PetscReal *x)
{
  const PetscInt *column    = g->column + g->start[i];
  const size_t    at        = (size_t)(g->pool.at[i] * nk * nk);
  wide            s[MAX_NK] = {{0}};

  for (PetscInt q = begin; q < end; q++)
    for (int m = 0; m < nk; m++) {
      const size_t index = at + (size_t)((q * nk + m) * nk);

      s[m] += (exact ? (wide) * (const loose *)(g->pool.exact + index) : load_column(g->pool.value + index)) *
              x[(column[q] - first) * nk + m];
    }
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
INLINE void add_to_low_rank(const int nk, const BlockGS *restrict g, PetscInt e, PetscReal factor,
                            const PetscReal *restrict d)
{
  const int        nr = RANK(nk);
  PetscReal       *t  = g->t + g->w_column[e] * nr;
  const PetscReal *w  = g->w + e * nk * nr;

  for (int k = 0; k < nk; k++)
    for (int m = 0; m < nr; m++) t[m] += factor * w[k * nr + m] * d[k];
}

/* lower: only blocks before the diagonal, the rest of x is zero. Entries of W are met row by row; t follows x. */
INLINE void sweep(const int nk, const BlockGS *restrict g, PetscBool forward, PetscBool lower, const PetscReal *b,
                  PetscReal *x)
{
  const PetscInt step = forward ? 1 : -1;
  PetscInt       at   = forward ? 0 : g->nw - 1;

  for (PetscInt r = 0; r < g->n; r++) {
    const PetscInt i = forward ? r : g->n - 1 - r, first = at;
    PetscInt       end = g->own[i];
    PetscReal      residual[MAX_NK];
    wide           s, d = {0};

    if (lower) end = g->before[i];
    s = sum_row(nk, PETSC_FALSE, g, i, 0, end, 0, x);
    for (int k = 0; k < nk; k++) residual[k] = b[i * nk + k] - s[k];
    for (; at >= 0 && at < g->nw && g->w_row[at] == i; at += step) subtract_low_rank(nk, g, at, residual);
    for (int m = 0; m < nk; m++) d += load_column(g->inverse + (i * nk + m) * nk) * residual[m];
    for (int k = 0; k < nk; k++) residual[k] = d[k];
    for (int k = 0; k < nk; k++) x[i * nk + k] += residual[k];
    for (PetscInt e = first; e != at; e += step) add_to_low_rank(nk, g, e, g->factor[g->w_column[e]], residual);
  }
}

/* As sum_row, exactly where values are kept so and products take the row so (BlockGSSetFine) */
INLINE wide sum_fine(const int nk, const PetscBool exact, const BlockGS *restrict g, PetscInt i, PetscInt begin,
                     PetscInt end, PetscInt first, const PetscReal *restrict x)
{
  return exact && (!g->fine || g->fine[i]) ? sum_row(nk, PETSC_TRUE, g, i, begin, end, first, x)
                                           : sum_row(nk, PETSC_FALSE, g, i, begin, end, first, x);
}

INLINE void multiply(const int nk, const PetscBool exact, const BlockGS *restrict g, const PetscReal *restrict x,
                     PetscReal *restrict y)
{
  for (PetscInt i = 0; i < g->n; i++) {
    const wide s = sum_fine(nk, exact, g, i, 0, g->own[i], 0, x);

    for (int k = 0; k < nk; k++) y[i * nk + k] = s[k];
  }
}

/* y += scale times the part of other ranks' columns */
INLINE void add_ghosts(const int nk, const PetscBool exact, const BlockGS *restrict g, PetscReal scale,
                       PetscReal *restrict y)
{
  for (PetscInt e = 0; e < g->nborder; e++) {
    const PetscInt i = g->border[e];
    const wide     s = sum_fine(nk, exact, g, i, g->own[i], g->start[i + 1] - g->start[i], g->n, g->ghost);

    for (int k = 0; k < nk; k++) y[i * nk + k] += scale * s[k];
  }
}

/* t = W^T x over all ranks, the sum on its way: with the exchange of ghosts one point at which ranks wait.
   Collective. */
static PetscErrorCode begin_low_rank(BlockGS *g, const PetscReal x[])
{
  PetscFunctionBeginUser;
  if (!g->any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscArrayzero(g->t, g->nt));
  for (PetscInt e = 0; e < g->nw; e++) {
    if (g->nk == 3) add_to_low_rank(3, g, e, 1, x + g->w_row[e] * 3);
    else add_to_low_rank(4, g, e, 1, x + g->w_row[e] * 4);
  }
  PetscCall(SharedReductionSumBegin(g->shared_reduction, RANK(g->nk), g->t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode end_low_rank(BlockGS *g)
{
  PetscFunctionBeginUser;
  if (g->any) PetscCall(SharedReductionSumEnd(g->shared_reduction, RANK(g->nk), g->t));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode multiply_sparse(BlockGS *g, PetscBool exact, Vec x, Vec y)
{
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(VecGetArrayWrite(y, &ya));
  if (g->sf) PetscCall(PetscSFBcastBegin(g->sf, g->unit, xa, g->ghost, MPI_REPLACE));
  if (g->nk == 3 && exact) multiply(3, PETSC_TRUE, g, xa, ya);
  else if (g->nk == 3) multiply(3, PETSC_FALSE, g, xa, ya);
  else if (exact) multiply(4, PETSC_TRUE, g, xa, ya);
  else multiply(4, PETSC_FALSE, g, xa, ya);
  if (g->sf) {
    PetscCall(PetscSFBcastEnd(g->sf, g->unit, xa, g->ghost, MPI_REPLACE));
    if (g->nk == 3) add_ghosts(3, exact, g, 1, ya);
    else add_ghosts(4, exact, g, 1, ya);
  }
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(VecRestoreArrayWrite(y, &ya));
  PetscCall(PetscLogFlops(2.0 * g->nk * g->nk * g->start[g->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSMultiplySparse(Mat shell, Vec x, Vec y)
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  if (g->queue) PetscCall(BlockGSMultiplyOnDevice(g, x, y));
  else PetscCall(multiply_sparse(g, g->pool.keep, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode mult_blocks(Mat shell, Vec x, Vec y)
{
  BlockGS         *g;
  const PetscReal *xa;
  PetscReal       *ya;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(VecGetArrayRead(x, &xa));
  PetscCall(begin_low_rank(g, xa));
  PetscCall(VecRestoreArrayRead(x, &xa));
  PetscCall(multiply_sparse(g, PETSC_FALSE, x, y));
  if (!g->any) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(end_low_rank(g));
  PetscCall(VecGetArray(y, &ya));
  for (PetscInt i = 0; i < g->nt; i++) g->t[i] = -g->t[i];
  for (PetscInt e = 0; e < g->nw; e++) {
    if (g->nk == 3) subtract_low_rank(3, g, e, ya + g->w_row[e] * 3);
    else subtract_low_rank(4, g, e, ya + g->w_row[e] * 4);
  }
  PetscCall(VecRestoreArray(y, &ya));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Other ranks' unknowns, which are known here, stay as they are in a sweep: their part goes to the right-hand side */
static PetscErrorCode subtract_ghosts(BlockGS *g, const PetscReal *b[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscArraycpy(g->residual, *b, g->n * g->nk));
  if (g->nk == 3) add_ghosts(3, PETSC_FALSE, g, -1, g->residual);
  else add_ghosts(4, PETSC_FALSE, g, -1, g->residual);
  *b = g->residual;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* x of other ranks' columns. Collective. */
static PetscErrorCode fetch_ghosts(BlockGS *g, const PetscReal x[])
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFBcastBegin(g->sf, g->unit, x, g->ghost, MPI_REPLACE));
  PetscCall(PetscSFBcastEnd(g->sf, g->unit, x, g->ghost, MPI_REPLACE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* r = what a forward sweep from zero, which has met all that is before a row's diagonal, leaves of its right-hand side:
   columns of own rows behind the diagonal, with W T - t where t is what the sweep knew of T. */
INLINE void upper_residual(const int nk, const BlockGS *restrict g, const PetscReal *restrict x, PetscReal *restrict r)
{
  PetscInt at = 0;

  for (PetscInt i = 0; i < g->n; i++) {
    const PetscInt   first = at;
    const PetscReal *xi    = x + i * nk;
    PetscReal       *ri    = r + i * nk;
    const wide       s     = sum_row(nk, PETSC_FALSE, g, i, g->before[i] + 1, g->own[i], 0, x);

    for (int k = 0; k < nk; k++) ri[k] = -s[k];
    for (; at < g->nw && g->w_row[at] == i; at++) add_to_low_rank(nk, g, at, -g->factor[g->w_column[at]], xi);
    for (PetscInt e = first; e < at; e++) subtract_low_rank(nk, g, e, ri);
    for (int k = 0; k < nk && g->extra; k++)
      for (int m = 0; m < nk; m++) ri[k] += g->extra[(i * nk + k) * nk + m] * xi[m];
  }
}

PetscErrorCode BlockGSSweepDown(Mat shell, const PetscReal b[], PetscReal x[], PetscReal r[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(PetscArrayzero(x, g->n * g->nk));
  PetscCall(PetscArrayzero(g->t, g->nt));
  if (g->nk == 3) sweep(3, g, PETSC_TRUE, PETSC_TRUE, b, x);
  else sweep(4, g, PETSC_TRUE, PETSC_TRUE, b, x);
  if (g->sf) PetscCall(begin_low_rank(g, x)); /* else t has it */
  if (g->sf) PetscCall(fetch_ghosts(g, x));
  if (g->sf) PetscCall(end_low_rank(g));
  if (g->nk == 3) upper_residual(3, g, x, r);
  else upper_residual(4, g, x, r);
  if (g->nk == 3 && g->sf) add_ghosts(3, PETSC_FALSE, g, -1, r);
  if (g->nk == 4 && g->sf) add_ghosts(4, PETSC_FALSE, g, -1, r);
  PetscCall(PetscLogFlops(2.0 * g->nk * g->nk * g->start[g->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSGetGhosts(Mat shell, PetscReal *ghost[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  *ghost = g->ghost;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSSweepUp(Mat shell, const PetscReal b[], PetscReal x[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(begin_low_rank(g, x));
  if (g->sf) PetscCall(subtract_ghosts(g, &b));
  PetscCall(end_low_rank(g));
  if (g->nk == 3) sweep(3, g, PETSC_FALSE, PETSC_FALSE, b, x);
  else sweep(4, g, PETSC_FALSE, PETSC_FALSE, b, x);
  PetscCall(PetscLogFlops(2.0 * g->nk * g->nk * g->start[g->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sweep_blocks(Mat shell, Vec bv, PetscReal omega, MatSORType flag, PetscReal shift, PetscInt its,
                                   PetscInt lits, Vec xv)
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
    PetscCall(begin_low_rank(g, x));
    if (g->sf) PetscCall(fetch_ghosts(g, x));
    if (g->sf) PetscCall(subtract_ghosts(g, &rhs));
    PetscCall(end_low_rank(g));
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
  PetscCall(PetscLogFlops(2.0 * its * lits * g->nk * g->nk * g->start[g->n]));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSGetDiagonal(Mat shell, Vec d)
{
  BlockGS   *g;
  PetscReal *da;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(VecGetArrayWrite(d, &da));
  for (PetscInt i = 0; i < g->n; i++)
    for (PetscInt k = 0; k < g->nk; k++) {
      const PetscInt at = ((g->pool.at[i] + g->before[i]) * g->nk + k) * g->nk + k;

      da[i * g->nk + k] = g->pool.keep ? g->pool.exact[at] : (PetscReal)g->pool.value[at];
    }
  PetscCall(VecRestoreArrayWrite(d, &da));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* The inverse of the diagonal block of row i, given its blocks, with the entries [begin, end) of W in this row and the
   extra part */
static void invert_diagonal(BlockGS *g, PetscInt i, const PetscReal value[], PetscInt begin, PetscInt end)
{
  const PetscInt nk = g->nk, nn = nk * nk, nr = RANK(nk), q = g->before[i];
  PetscReal      block[MAX_NK * MAX_NK], inverse[MAX_NK * MAX_NK];

  for (PetscInt e = 0; e < nn; e++) block[e] = value[q * nn + e];
  for (PetscInt e = begin; e < end; e++)
    for (PetscInt k = 0; k < nn; k++)
      for (PetscInt m = 0; m < nr; m++)
        block[k] += g->factor[g->w_column[e]] * g->w[(e * nk + k / nk) * nr + m] * g->w[(e * nk + k % nk) * nr + m];
  for (PetscInt e = 0; e < nn && g->extra; e++) block[e] += g->extra[i * nn + e];
  DenseInvert(nk, block, inverse); /* the transpose of the inverse is the inverse of the transpose */
  for (PetscInt e = 0; e < nn; e++) g->inverse[i * nn + e] = (float)inverse[e];
}

PetscErrorCode BlockGSClear(Mat shell)
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  RowPoolClear(&g->pool);
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSSetRow(Mat shell, PetscInt i, const PetscReal value[], PetscBool many)
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(RowPoolSet(&g->pool, i, g->start[i + 1] - g->start[i], value, many));
  invert_diagonal(g, i, value, 0, 0);
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

PetscErrorCode BlockGSSetFine(Mat shell, PetscInt n, const PetscInt row[])
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  if (!g->fine) PetscCall(PetscMalloc1(g->n, &g->fine));
  PetscCall(PetscArrayzero(g->fine, g->n));
  for (PetscInt e = 0; e < n; e++) g->fine[row[e]] = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

static const PetscReal *exact_row(const BlockGS *g, PetscInt i)
{
  return g->pool.exact + g->pool.at[i] * g->pool.unit;
}

/* Give up W; rows that had a part of it get the inverses of their own blocks. */
static PetscErrorCode drop_low_rank(BlockGS *g)
{
  PetscFunctionBeginUser;
  for (PetscInt e = 0; e < g->nw; e++) invert_diagonal(g, g->w_row[e], exact_row(g, g->w_row[e]), 0, 0);
  PetscCall(PetscFree4(g->w_row, g->w_column, g->t, g->factor));
  g->nw = g->nt = 0;
  g->any        = PETSC_FALSE;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSSetLowRank(Mat shell, SharedReduction shared_reduction, PetscInt ncolumn, PetscInt n,
                                 const PetscInt row[], const PetscInt column[], const PetscReal w[])
{
  BlockGS *g;
  PetscInt nr;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCheck(n == 0 || g->pool.keep, PETSC_COMM_SELF, PETSC_ERR_ARG_WRONGSTATE,
             "A part of low rank needs exact entries");
  PetscCall(drop_low_rank(g));
  nr                  = RANK(g->nk);
  g->nt               = ncolumn * nr;
  g->nw               = n;
  g->any              = (PetscBool)(shared_reduction != NULL);
  g->w                = w;
  g->shared_reduction = shared_reduction;
  PetscCall(PetscMalloc4(n, &g->w_row, n, &g->w_column, g->nt, &g->t, ncolumn, &g->factor));
  PetscCall(PetscArraycpy(g->w_row, row, n));
  PetscCall(PetscArraycpy(g->w_column, column, n));
  PetscCall(PetscArrayzero(g->factor, ncolumn));
  for (PetscInt e = 0; e < n; e++) g->factor[column[e]] = 1;
  PetscCall(SharedReductionSum(shared_reduction, 1, g->factor));
  for (PetscInt begin = 0, end = 0; begin < n; begin = end) {
    while (end < n && row[end] == row[begin]) end++;
    invert_diagonal(g, row[begin], exact_row(g, row[begin]), begin, end);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode destroy_blocks(Mat shell)
{
  BlockGS *g;

  PetscFunctionBeginUser;
  PetscCall(MatShellGetContext(shell, &g));
  PetscCall(RowPoolDestroy(&g->pool));
  PetscCall(PetscFree4(g->own, g->before, g->inverse, g->border));
  PetscCall(PetscFree2(g->ghost, g->residual));
  PetscCall(PetscFree4(g->w_row, g->w_column, g->t, g->factor));
  PetscCall(PetscFree(g->fine));
  PetscCall(PetscSFDestroy(&g->sf));
  PetscCall(RowTypeDestroy(&g->unit));
  PetscCall(PetscFree(g));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode create_exchange(BlockGS *g, const PetscInt global[])
{
  PetscLayout rows;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc2(g->nghost * g->nk, &g->ghost, g->n * g->nk, &g->residual));
  PetscCall(PetscLayoutCreateFromSizes(g->comm, g->n, PETSC_DETERMINE, 1, &rows));
  PetscCall(PetscSFCreate(g->comm, &g->sf));
  PetscCall(PetscSFSetGraphLayout(g->sf, rows, g->nghost, NULL, PETSC_OWN_POINTER, global));
  PetscCall(PetscSFSetUp(g->sf));
  PetscCall(PetscLayoutDestroy(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Own columns of a row come before those of other ranks, with the diagonal behind those before it */
static PetscErrorCode split_rows(BlockGS *g)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < g->n; i++) {
    const PetscInt length = g->start[i + 1] - g->start[i];

    while (g->own[i] < length && g->column[g->start[i] + g->own[i]] < g->n) g->own[i]++;
    if (g->own[i] < length) g->border[g->nborder++] = i;
    while (g->before[i] < length && g->column[g->start[i] + g->before[i]] < i) g->before[i]++;
    PetscCheck(g->before[i] < length && g->column[g->start[i] + g->before[i]] == i, PETSC_COMM_SELF,
               PETSC_ERR_ARG_WRONG, "Row %" PetscInt_FMT ": the diagonal does not come behind the columns before it",
               i);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BlockGSCreate(MPI_Comm comm, const BlockPattern *pattern, PetscBool exact, Mat *shell)
{
  const PetscInt nk = pattern->nk, m = pattern->n * nk;
  PetscMPIInt    size;
  BlockGS       *g;

  PetscFunctionBeginUser;
  PetscCheck(nk == 3 || nk == 4, comm, PETSC_ERR_ARG_WRONG,
             "Block Gauss-Seidel needs blocks of 3 or 4, not of %" PetscInt_FMT, nk);
  PetscCall(PetscNew(&g));
  g->comm   = comm;
  g->nk     = nk;
  g->n      = pattern->n;
  g->nghost = pattern->nghost;
  g->start  = pattern->start;
  g->column = pattern->column;
  PetscCall(PetscCalloc4(g->n, &g->own, g->n, &g->before, g->n * nk * nk + SLACK, &g->inverse, g->n, &g->border));
  PetscCall(split_rows(g));
  PetscCall(RowPoolCreate(g->n, nk * nk, exact, &g->pool));
  PetscCall(RowTypeCreate(nk, &g->unit));
  PetscCallMPI(MPI_Comm_size(comm, &size));
  if (size > 1) PetscCall(create_exchange(g, pattern->ghost));
  PetscCall(MatCreateShell(comm, m, m, PETSC_DETERMINE, PETSC_DETERMINE, g, shell));
  PetscCall(MatShellSetOperation(*shell, MATOP_MULT, (void (*)(void))mult_blocks));
  PetscCall(MatShellSetOperation(*shell, MATOP_SOR, (void (*)(void))sweep_blocks));
  PetscCall(MatShellSetOperation(*shell, MATOP_DESTROY, (void (*)(void))destroy_blocks));
  PetscFunctionReturn(PETSC_SUCCESS);
}
