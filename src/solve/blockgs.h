/* BlockGS: smoother of a sparse matrix of small dense blocks with its entries in single precision.

   A matrix shell over a BAIJ matrix with blocks of 3 or 4: product (so that multigrid forms its residual with it) and
   processor-local Gauss-Seidel sweeps by blocks. A smoother is limited by the memory it reads, and the blocks and the
   inverses of those on the diagonal are stored as floats; vectors and sums are double, so that it is a linear operator,
   symmetric if A is, close to A by the round-off of its entries. For preconditioners only. A part W W^T of low rank may
   be added, which would fill A. */
#pragma once
#include <petscmat.h>
#include "sharing.h"

/* The shell keeps a reference to A and starts without values: call BlockGSUpdate. Collective. Errors: another matrix
   type or block size. */
PetscErrorCode BlockGSCreate(Mat A, Mat *shell);
/* Copy anew what changed in A: n local block rows, or all with rows = NULL. Not collective. */
PetscErrorCode BlockGSUpdate(Mat shell, PetscInt n, const PetscInt rows[]);
/* y = A x in single precision, without the part of low rank. Collective. */
PetscErrorCode BlockGSMultiplySparse(Mat shell, Vec x, Vec y);
/* Sweeps (not products) add extra [own block rows][nk][nk], symmetric, to the blocks on the diagonal: what keeps a
   sweep there and back definite although ranks sweep at the same time. NULL: none. Borrowed, read by BlockGSUpdate. Not
   collective. */
PetscErrorCode BlockGSSetExtra(Mat shell, const PetscReal extra[]);
/* From now on the shell stands for A + W W^T, W given by n blocks value [n][nk][nr] at own block rows row [n]
   (ascending) and block columns column [n] < ncolumn, the entries of a Sharing, which says what columns of other ranks
   are the same (borrowed); nr is 3 for blocks of 3 and 6 for blocks of 4, as rigid motions have. Nothing is filled in:
   W^T x follows the sweep. A sweep takes the part of a column that p ranks share p times (W W^T is at most p times the
   ranks' own parts, so that the error cannot grow). Copied; after every BlockGSUpdate. Collective. */
PetscErrorCode BlockGSSetLowRank(Mat shell, Sharing, PetscInt ncolumn, PetscInt n, const PetscInt row[], const PetscInt column[],
                                 const PetscReal w[]);
