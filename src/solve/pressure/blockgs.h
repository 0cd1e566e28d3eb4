/* BlockGS: sparse matrix of small dense blocks, of which rows that are equal are stored once (rowpool.h), with
   processor-local Gauss-Seidel sweeps by blocks.

   A smoother is limited by the memory it reads: sweeps, and the product from which multigrid forms its residual, take
   the blocks and the inverses of those on the diagonal in single precision; vectors and sums are double, so that it is
   a linear operator, symmetric if the matrix is, close to it by the round-off of its entries. A part W W^T of low rank
   may be added to both, which would fill the matrix. BlockGSMultiplySparse is the product for a Krylov method: in
   double precision where the entries are kept so, without the part of low rank. */
#pragma once
#include "device/device.h"
#include <petscmat.h>
#include "../rigid/sharedreduction.h"

/* Pattern of the own rows: borrowed for the life of the matrix. */
typedef struct {
  PetscInt        nk, n;  /* size of a block: 3 or 4; own block rows */
  const PetscInt *start;  /* [n + 1] */
  const PetscInt *column; /* [start[n]] in row i first those < i, then i, then < n (own), then n + ghost */
  PetscInt        nghost; /* other ranks' block rows that columns name */
  const PetscInt *ghost;  /* [nghost] their global numbers */
} BlockPattern;

/* A matrix shell without values: set all rows. exact: keep them in double precision too. Collective. Errors: another
   size of blocks. */
PetscErrorCode BlockGSCreate(MPI_Comm, const BlockPattern *, PetscBool exact, Mat *shell);
/* Forget all rows: they are to be set anew. Not collective. */
PetscErrorCode BlockGSClear(Mat shell);
/* Block row i <- value [blocks of the row][nk][nk], each block column by column. many: most rows are being set. Not
   collective. */
PetscErrorCode BlockGSSetRow(Mat shell, PetscInt i, const PetscReal value[], PetscBool many);
/* y = A x without the part of low rank, in double precision if it is exact. Collective. */
PetscErrorCode BlockGSMultiplySparse(Mat shell, Vec x, Vec y);
/* d = the diagonal of A, likewise without the part of low rank. Not collective. */
PetscErrorCode BlockGSGetDiagonal(Mat shell, Vec d);
/* The n own rows that BlockGSMultiplySparse takes in double precision from now on; not called: all exact ones. Not
   collective. */
PetscErrorCode BlockGSSetFine(Mat shell, PetscInt n, const PetscInt row[]);
/* Sweeps (not products) add extra [own block rows][nk][nk], symmetric, to the blocks on the diagonal: what keeps a
   sweep there and back definite although ranks sweep at the same time. NULL: none. Borrowed, read by BlockGSSetRow. Not
   collective. */
PetscErrorCode BlockGSSetExtra(Mat shell, const PetscReal extra[]);
/* From now on the shell stands for A + W W^T, W given by n blocks value [n][nk][nr] at own block rows row [n]
   (ascending) and block columns column [n] < ncolumn, the entries of a SharedReduction, which says what columns of
   other ranks are the same (borrowed); nr is 3 for blocks of 3 and 6 for blocks of 4, as rigid motions have. Nothing is
   filled in: W^T x follows the sweep. A sweep takes the part of a column that p ranks share p times (W W^T is at most p
   times the ranks' own parts, so that the error cannot grow). Only where entries are exact. value is borrowed until the
   next call, the rest copied; after every change of rows. Collective. */
PetscErrorCode BlockGSSetLowRank(Mat shell, SharedReduction, PetscInt ncolumn, PetscInt n, const PetscInt row[],
                                 const PetscInt column[], const PetscReal w[]);

/* The two halves of a symmetric two-level cycle, with the residual for what a sweep costs less. Down: x = a forward
   sweep from zero, r = b - (A + W W^T) x, of n block rows; the values of x in other ranks' columns are known then
   (ghost [nghost][nk]), and who corrects x corrects them as well. Up: a backward sweep over x. Collective. */
PetscErrorCode BlockGSSweepDown(Mat shell, const PetscReal b[], PetscReal x[], PetscReal r[]);
PetscErrorCode BlockGSGetGhosts(Mat shell, PetscReal *ghost[]);
PetscErrorCode BlockGSSweepUp(Mat shell, const PetscReal b[], PetscReal x[]);

/* What a device takes of it (devicerows.h): the rows, and the inverses [own block rows][nk][nk] of their diagonal
   blocks as sweeps have them. Borrowed until rows change. Not collective. */
struct _p_RowsView {
  const PetscInt  *start, *column, *at; /* [n + 1]; in blocks */
  const PetscReal *exact;               /* [blocks][nk][nk], NULL: in single precision only */
  const float     *single, *inverse;
  PetscInt         n, nk, nblock, nghost;
};
PetscErrorCode BlockGSGetRows(Mat shell, struct _p_RowsView *);
/* From now on BlockGSMultiplySparse takes vectors in the queue's memory, by these rows; all: room for own blocks and
   those of other ranks, NULL on one rank. Borrowed. Not collective. */
PetscErrorCode BlockGSSetDevice(Mat shell, const DeviceQueue *, const DeviceRows *, PetscReal all[]);
/* Blocks [nghost][nk] of x, own ones, that other ranks have; in one memory. Collective. */
PetscErrorCode BlockGSFetchGhosts(Mat shell, const PetscReal x[], PetscReal ghost[]);
